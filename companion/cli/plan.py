"""``rover-companion plan``: one path over a known map, without a rover."""

from __future__ import annotations

import json
import math
import shlex
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from companion.cli.images import save_plan
from companion.cli.inputs import EXIT_BAD_INPUT, OutputError, apart, picture, usable_settings
from companion.core.clock import stopwatch_s
from companion.core.grid import Cell, Grid, inflated
from companion.core.own_parts import OwnKind, OwnPartError, blamed
from companion.mapping.map_files import MapError, load_map
from companion.navigation.search_budget import budget_of
from companion.planning.line_to_drive import AHEAD_DEG, bearing_of, line_of, tightest_radius, too_tight
from companion.planning.problem import KinematicConstraints, PlanningProblem, PlanResult, PlanStatus
from companion.planning.problem import Path as GridPath
from companion.planning.raster import FAULTS, PathFault, cells_cost, first_fault, plain
from companion.planning.registry import PLANNERS, UnknownPlannerError, make_planner, warm_up
from companion.settings import Settings, SettingsError
from companion.settings.versions import made_with

EFFORT = {
    "sedighi": ("generations", "chromosomes"),
    "sedighi-local": ("generations", "chromosomes"),
    "hermanu": ("generations", "chromosomes"),
    "geisler": ("generations", "chromosomes"),
    "vertex": ("generations", "chromosomes"),
    "vertex++": ("generations", "chromosomes"),
    "achour": ("iterations", "segments weighed"),
    "prm": ("queries of the roadmap", "lines looked at"),
}
"""What a planner's epochs and evaluations count, if not those of the paper's genetic algorithm."""

STATUS_WORDS = {
    PlanStatus.FOUND: "found",
    PlanStatus.NO_PATH: "no path: proved that there is none",
    PlanStatus.BUDGET_SPENT: "budget spent: none found, which proves nothing",
}


@dataclass(frozen=True, slots=True)
class Answer:
    """The result of a search, and its input. ``kinematics``: how the rover turns.

    The cost of its path is computed here; ``told_cost`` is what the planner said, None where that is the same.
    """

    result: PlanResult
    seconds: float
    seed: int
    top_left: bool
    grid: Grid
    kinematics: KinematicConstraints
    settings: Settings
    told_cost: float | None = None

    @property
    def tight(self) -> NDArray[np.float64]:
        """Places in fields, shape (n, 2), where the line to drive bends more sharply than the rover turns."""
        path = self.result.path
        return np.empty((0, 2)) if path is None else too_tight(line_of(path), self.kinematics.turning_radius_fields)

    def place(self, cell: Cell) -> tuple[int, int]:
        """A field in the coordinates that the user chose."""
        return flipped(cell, self.grid.height, self.top_left)


def flipped(cell: Cell, height: int, top_left: bool) -> tuple[int, int]:
    """A field in the user's coordinates, or back."""
    return (cell.x, height - 1 - cell.y) if top_left else (cell.x, cell.y)


def length_of(line: NDArray[np.float64]) -> float:
    """The length of a line, in its own unit."""
    return float(np.hypot(*np.diff(line, axis=0).T).sum())


def as_text(answer: Answer) -> str:
    """The answer as one JSON object; the path is a list of [x, y] in the user's coordinates."""
    result, path = answer.result, answer.result.path
    curve = path.curve if path else None
    return json.dumps(
        {
            "status": result.status.value,
            "planner": result.planner,
            "cost": path.cost if path else None,
            "wrong_cost_of_planner": answer.told_cost,
            "length_fields": path.length_fields if path else None,
            "length_m": path.length_fields * answer.grid.resolution_m if path else None,
            "curve_length_fields": None if curve is None else length_of(curve),
            "curve_length_m": None if curve is None else length_of(curve) * answer.grid.resolution_m,
            "sharpest_bend_m": _bend_m(answer, path) if path else None,
            "too_tight_bends": len(answer.tight),
            "time_s": answer.seconds,
            "epochs": result.epochs,
            "evaluations": result.evaluations,
            "control_points": result.control_points,
            "seed": answer.seed,
            "path": [answer.place(cell) for cell in path.cells] if path else None,
            **made_with(answer.settings),
        }
    )


def as_table(answer: Answer) -> Table:
    """The answer as a table."""
    result, path = answer.result, answer.result.path
    table = Table(show_header=False)
    table.add_row("status", STATUS_WORDS[result.status])
    table.add_row("planner", result.planner)
    if path is not None:
        for name, text in _lengths(answer, path).items():
            table.add_row(name, text)
    table.add_row("time", f"{answer.seconds * 1000.0:.3f} ms")
    if result.epochs:
        rounds, tries = EFFORT.get(result.planner, ("epochs", "chromosomes"))
        table.add_row("search", f"{result.epochs} {rounds}, {result.evaluations} {tries}")
    return table


def _lengths(answer: Answer, path: GridPath) -> dict[str, str]:
    """Cost and length of the path, from field to field and along the line to drive."""
    resolution_m = answer.grid.resolution_m

    def both(fields: float) -> str:
        return f"{fields:.2f} fields, {fields * resolution_m:.2f} m"

    line = line_of(path)
    rows = {"cost": f"{path.cost:.3f}"}
    if answer.told_cost is not None:
        rows["planner's cost"] = f"{answer.told_cost:.3f}, wrong: check-planner tells more"
    rows["from field to field"] = both(path.length_fields)
    rows["line to drive"] = both(length_of(line)) if path.curve is not None else "the same: through the fields' middles"
    bend_m = _bend_m(answer, path)
    radius_m = answer.kinematics.turning_radius_fields * resolution_m
    if radius_m > 0.0:
        rows["sharpest bend"] = "none" if bend_m is None else f"{bend_m:.2f} m radius"
        rows["too tight"] = _too_tight(len(answer.tight))
    if sets_out := _sets_out(answer):
        rows["sets out"] = sets_out
    return rows


def _sets_out(answer: Answer) -> str:
    """How far off the rover's heading the path begins; empty without heading or path."""
    heading_rad, path = answer.kinematics.heading_rad, answer.result.path
    line = None if path is None else line_of(path)
    if heading_rad is None or line is None or len(line) < 2:
        return ""
    off_deg = math.degrees(abs(math.remainder(bearing_of(line) - heading_rad, 2.0 * math.pi)))
    return "ahead" if off_deg <= AHEAD_DEG else f"{off_deg:.0f} deg off its heading: the rover would manoeuvre first"


def _heading(answer: Answer) -> tuple[float, str] | None:
    """The heading at the start, and what the picture says of it; None where any will do."""
    heading_rad, sets_out = answer.kinematics.heading_rad, _sets_out(answer)
    told = f"heading at the start; it sets out {sets_out}" if sets_out else "heading at the start"
    return None if heading_rad is None else (heading_rad, told)


def _too_tight(bends: int) -> str:
    if not bends:
        return "no bend: the rover can follow the line"
    return f"{bends} bend{'s' * (bends != 1)}: the rover would manoeuvre there"


def _bend_m(answer: Answer, path: GridPath) -> float | None:
    """The radius of the sharpest bend of the line to drive; None for a straight line."""
    radius = tightest_radius(line_of(path))
    return radius * answer.grid.resolution_m if math.isfinite(radius) else None


EXIT_FOUND, EXIT_NO_PATH = 0, 3


class PlaceError(ValueError):
    """A start or target that cannot be used; the text is one line."""


class TurningError(ValueError):
    """A turning radius or heading that would have no effect; the text is one line."""


def plan(
    map_file: Annotated[Path, typer.Argument(metavar="MAP", help="ROS yaml, MovingAI .map, or an image.")],
    start: Annotated[
        str, typer.Option(metavar="X,Y", help="The field to start from: X right, Y up from the bottom row.")
    ],
    target: Annotated[str, typer.Option(metavar="X,Y", help="The field to reach, counted in the same way.")],
    planner: Annotated[
        str | None, typer.Option(help=f"One of: {', '.join(PLANNERS)}; default: the settings', hybrid.")
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Of planners that draw random numbers.")] = 0,
    resolution_m: Annotated[
        float | None, typer.Option(min=0.01, max=1000.0, help="Field size of MAP, if it has none; default 1.")
    ] = None,
    radius_m: Annotated[
        float, typer.Option(min=0.0, max=20.0, help="The rover's: its middle keeps so far from obstacles.")
    ] = 0.0,
    turning_radius_m: Annotated[
        float, typer.Option(min=0.0, help="The tightest turn; 0: it turns on the spot. For bspline-ga, hybrid.")
    ] = 0.0,
    heading_deg: Annotated[
        float | None, typer.Option(help="Where it points at the start, clockwise from north (up); default: anywhere.")
    ] = None,
    image: Annotated[Path | None, typer.Option(help="Write a picture (.png, .jpg) of map and path, north up.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON instead of a table.")] = False,
    top_left: Annotated[bool, typer.Option("--top-left", help="Y counts down from the top row (MovingAI).")] = False,
    settings_file: Annotated[Path | None, typer.Option("--settings", help="TOML file, see docs/settings.md.")] = None,
) -> None:
    """Find a path over MAP. Exit code 0: found; 3: no path, or none within the budget; 2: bad input."""
    try:
        settings = usable_settings(settings_file)
        name = settings.navigator.planner if planner is None else planner
        grid = _ground(map_file, resolution_m, radius_m)
        problem = PlanningProblem(
            grid.weights,
            place_of("--start", start, grid, top_left),
            place_of("--target", target, grid, top_left),
            kinematics=wanted_kinematics(name, settings, turning_radius_m, heading_deg, grid),
        )
        apart((image,), (map_file, settings_file))
        picture(image)
        answer = search(grid, problem, name, settings, seed, top_left)
        if image is not None:
            title = f"{map_file.name}, planned by {answer.result.planner}: {STATUS_WORDS[answer.result.status]}"
            ends = (problem.start, problem.target)
            save_plan(image, grid, ends, answer.result.path, answer.tight, title, _heading(answer))
    except (SettingsError, MapError, PlaceError, TurningError, UnknownPlannerError, OwnPartError, OutputError) as error:
        typer.echo(str(error), err=True)
        raise typer.Exit(EXIT_BAD_INPUT) from error
    typer.echo(as_text(answer)) if as_json else Console().print(as_table(answer))
    if image is not None:
        typer.echo(f"picture: {image}", err=as_json)
    raise typer.Exit(EXIT_FOUND if answer.result.status is PlanStatus.FOUND else EXIT_NO_PATH)


def _ground(map_file: Path, resolution_m: float | None, radius_m: float) -> Grid:
    """The map for a rover of this radius. Raises MapError."""
    if resolution_m is not None and map_file.suffix.lower() in (".yaml", ".yml"):
        raise MapError(f"{map_file}: --resolution-m: a ROS map says this itself: resolution")
    grid = load_map(map_file, resolution_m)
    return grid.with_weights(inflated(grid.weights, grid.fields(radius_m)))


def search(grid: Grid, problem: PlanningProblem, name: str, settings: Settings, seed: int, top_left: bool) -> Answer:
    """Plan with the budget of a thorough search; the time excludes compiling.

    Raises UnknownPlannerError, and OwnPartError for a planner of one's own that fails or gives a path that is none.
    """
    chosen = make_planner(name, settings.planner)
    with Console(stderr=True).status("compiling (once a machine) ..."):
        warm_up((name,), settings.planner)
    began_s = stopwatch_s()
    with blamed(OwnKind.PLANNER, name):
        result = chosen.plan(problem, budget_of(settings.navigator.thorough), np.random.default_rng(seed))
    seconds, told = stopwatch_s() - began_s, None
    if (path := result.path) is not None:
        cost = _true_cost(path, problem, name)
        told = None if math.isclose(path.cost, cost, rel_tol=1e-9, abs_tol=1e-12) else path.cost
        result = replace(result, path=GridPath(path.cell_array, cost, path.curve, path.speeds_fields_s))
    return Answer(result, seconds, seed, top_left, grid, problem.kinematics, settings, told)


def _true_cost(path: GridPath, problem: PlanningProblem, name: str) -> float:
    """By the project's own rule. Raises OwnPartError for fields that are no path from start to target."""
    weights, cells = plain(problem.weights), path.cell_array
    number, index = first_fault(weights, cells, problem.corner_cutting)
    fault = f"{FAULTS[number]}, at its field {index}" if FAULTS[number] is not PathFault.NONE else ""
    if len(cells) == 0 or tuple(cells[0]) != problem.start or tuple(cells[-1]) != problem.target:
        fault = PathFault.WRONG_ENDS
    if fault:
        more = f"rover-companion check-planner {name} tells more"
        raise OwnPartError(f"planner {name!r:.80}: its path is none: {fault}; {more}")
    return float(cells_cost(weights, cells))


def wanted_kinematics(
    name: str, settings: Settings, radius_m: float, heading_deg: float | None, grid: Grid
) -> KinematicConstraints:
    """How the rover turns. Raises TurningError for a planner that ignores it, and UnknownPlannerError."""
    if radius_m == 0.0:
        if heading_deg is not None:
            raise TurningError(f"--heading-deg {heading_deg:g}: counts only with --turning-radius-m")
        return KinematicConstraints()
    if not (math.isfinite(radius_m) and math.isfinite(heading_deg or 0.0)):
        raise TurningError("--turning-radius-m, --heading-deg: finite numbers are needed")
    if not make_planner(name, settings.planner).capabilities.turning_radius:
        able = (each for each in PLANNERS if make_planner(each, settings.planner).capabilities.turning_radius)
        raise TurningError(f"--turning-radius-m: {name} does not heed it; {' and '.join(able)} do")
    heading_rad = None if heading_deg is None else math.remainder(math.radians(90.0 - heading_deg), 2.0 * math.pi)
    return KinematicConstraints(heading_rad, grid.fields(radius_m))


def plan_command(problem: PlanningProblem, resolution_m: float, settings: Settings, stem: Path) -> str:
    """What plans this problem; its map is ``stem``.yaml. Obstacles that move are left out.

    Raises UnknownPlannerError.
    """
    planner = settings.navigator.planner
    (x, y), (to_x, to_y), how = problem.start, problem.target, problem.kinematics
    turning = ""
    if how.turning_radius_fields > 0.0 and make_planner(planner, settings.planner).capabilities.turning_radius:
        turning = f" --turning-radius-m {how.turning_radius_fields * resolution_m:g}"
        heading_rad = how.heading_rad
        turning += "" if heading_rad is None else f" --heading-deg {90.0 - math.degrees(heading_rad):g}"
    ends = f"--start {x},{y} --target {to_x},{to_y}"
    return f"rover-companion plan {shlex.quote(f'{stem}.yaml')} {ends} --planner {shlex.quote(planner)}{turning}"


def place_of(option: str, text: str, grid: Grid, top_left: bool) -> Cell:
    """The field of ``X,Y``. Raises PlaceError if it is none, outside the map or on an obstacle."""
    try:
        x, y = (int(word) for word in text.split(","))
    except ValueError:
        raise PlaceError(f"{option} {text}: two whole numbers are needed, as in {option} 3,24") from None
    cell = Cell(*flipped(Cell(x, y), grid.height, top_left))
    if not grid.contains(cell):
        raise PlaceError(
            f"{option} {text}: outside the map, which has fields 0,0 to {grid.width - 1},{grid.height - 1}"
        )
    if grid.is_obstacle(cell):
        raise PlaceError(f"{option} {text}: on an obstacle, choose a free field")
    return cell
