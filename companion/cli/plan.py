"""``rover-companion plan``: one path over a known map, without a rover."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.console import Console

from companion.cli.inputs import OutputError, picture, usable_settings
from companion.cli.plan_answer import Answer, as_table, as_text, flipped
from companion.cli.plan_image import save_image
from companion.core.clock import stopwatch_s
from companion.core.grid import Cell, Grid
from companion.mapping.map_files import MapError, load_map
from companion.navigation.search_budget import budget_of
from companion.planning.problem import PlanningProblem, PlanStatus, VehicleMotion
from companion.planning.registry import PLANNERS, UnknownPlannerError, make_planner, warm_up
from companion.settings import Settings, SettingsError

EXIT_FOUND, EXIT_BAD_INPUT, EXIT_NO_PATH = 0, 2, 3


class PlaceError(ValueError):
    """A start or target that cannot be one; the text is one line."""


class TurningError(ValueError):
    """A turning radius or a heading that would not count; the text is one line."""


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
        grid = load_map(map_file)
        problem = PlanningProblem(
            grid.weights,
            place_of("--start", start, grid, top_left),
            place_of("--target", target, grid, top_left),
            motion=motion_of(name, settings, turning_radius_m, heading_deg, grid),
        )
        picture(image)
        answer = search(grid, problem, name, settings, seed, top_left)
        if image is not None:
            save_image(image, grid, problem.start, problem.target, answer.result.path)
    except (SettingsError, MapError, PlaceError, TurningError, UnknownPlannerError, OutputError) as error:
        typer.echo(str(error), err=True)
        raise typer.Exit(EXIT_BAD_INPUT) from error
    typer.echo(as_text(answer)) if as_json else Console().print(as_table(answer))
    raise typer.Exit(EXIT_FOUND if answer.result.status is PlanStatus.FOUND else EXIT_NO_PATH)


def search(grid: Grid, problem: PlanningProblem, name: str, settings: Settings, seed: int, top_left: bool) -> Answer:
    """Plan with the budget of a thorough search. The time is without compiling. Raises UnknownPlannerError."""
    chosen = make_planner(name, settings.planner)
    with Console(stderr=True).status("compiling (once a machine) ..."):
        warm_up((name,), settings.planner)
    began_s = stopwatch_s()
    result = chosen.plan(problem, budget_of(settings.navigator.thorough), np.random.default_rng(seed))
    return Answer(result, stopwatch_s() - began_s, seed, top_left, grid, problem.motion, settings)


def motion_of(name: str, settings: Settings, radius_m: float, heading_deg: float | None, grid: Grid) -> VehicleMotion:
    """How the rover turns, for a planner that heeds it. Raises TurningError for one that does not, and UnknownPlannerError."""
    if radius_m == 0.0:
        if heading_deg is not None:
            raise TurningError(f"--heading-deg {heading_deg:g}: counts only with --turning-radius-m")
        return VehicleMotion()
    if not (math.isfinite(radius_m) and math.isfinite(heading_deg or 0.0)):
        raise TurningError("--turning-radius-m, --heading-deg: finite numbers are needed")
    if not make_planner(name, settings.planner).capabilities.turning_radius:
        able = (each for each in PLANNERS if make_planner(each, settings.planner).capabilities.turning_radius)
        raise TurningError(f"--turning-radius-m: {name} does not heed it; {' and '.join(able)} do")
    heading_rad = None if heading_deg is None else math.remainder(math.radians(90.0 - heading_deg), 2.0 * math.pi)
    return VehicleMotion(heading_rad, radius_m / grid.resolution_m)


def place_of(option: str, text: str, grid: Grid, top_left: bool) -> Cell:
    """The field meant by ``X,Y``. Raises PlaceError if it is none, outside the map or on an obstacle."""
    try:
        x, y = (int(part) for part in text.split(","))
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
