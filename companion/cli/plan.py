"""``rover-companion plan``: one path over a known map, without a rover."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.console import Console
from rich.table import Table

from companion.cli.inputs import OutputError, picture
from companion.cli.plan_image import save_image
from companion.clock import stopwatch_s
from companion.grid import Cell, Grid
from companion.mapfiles import MapError, load_map
from companion.planning.problem import PlanningProblem, PlanResult, PlanStatus
from companion.planning.registry import PLANNERS, UnknownPlannerError, make_planner, warm_up
from companion.provenance import made_with
from companion.searching import budget_of
from companion.settings import Settings, SettingsError, load_settings

EXIT_FOUND, EXIT_BAD_INPUT, EXIT_NO_PATH = 0, 2, 3


class PlaceError(ValueError):
    """A start or target that cannot be one; the text is one line."""


@dataclass(frozen=True, slots=True)
class Answer:
    """What a search came to, and what was asked."""

    result: PlanResult
    seconds: float
    seed: int
    top_left: bool
    grid: Grid
    settings: Settings

    def place(self, cell: Cell) -> tuple[int, int]:
        """A field in the coordinates that the user chose."""
        return flipped(cell, self.grid.height, self.top_left)


def plan(
    map_file: Annotated[Path, typer.Argument(metavar="MAP", help="ROS yaml, MovingAI .map, or an image.")],
    start: Annotated[str, typer.Option(metavar="X,Y", help="Field: X right, Y up from the bottom row.")],
    target: Annotated[str, typer.Option(metavar="X,Y", help="Field.")],
    planner: Annotated[str | None, typer.Option(help=f"One of: {', '.join(PLANNERS)}.")] = None,
    seed: Annotated[int, typer.Option(min=0, help="Of planners that draw random numbers.")] = 0,
    image: Annotated[Path | None, typer.Option(help="Write a picture of map and path, north up.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON instead of a table.")] = False,
    top_left: Annotated[bool, typer.Option("--top-left", help="Y counts down from the top row (MovingAI).")] = False,
    settings_file: Annotated[Path | None, typer.Option("--settings", help="TOML file.")] = None,
) -> None:
    """Find a path over MAP. Exit code 0: found; 3: no path, or none within the budget; 2: bad input."""
    try:
        settings = load_settings(settings_file)
        grid = load_map(map_file)
        problem = PlanningProblem(
            grid.weights,
            place_of("--start", start, grid, top_left),
            place_of("--target", target, grid, top_left),
        )
        picture(image)
        answer = search(grid, problem, planner or settings.navigator.planner, settings, seed, top_left)
        if image is not None:
            save_image(image, grid, problem.start, problem.target, answer.result.path)
    except (SettingsError, MapError, PlaceError, UnknownPlannerError, OutputError) as error:
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
    return Answer(result, stopwatch_s() - began_s, seed, top_left, grid, settings)


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


def flipped(cell: Cell, height: int, top_left: bool) -> tuple[int, int]:
    """From a field's place in the grid to the user's coordinates, and the same way back."""
    return (cell.x, height - 1 - cell.y) if top_left else (cell.x, cell.y)


def as_text(answer: Answer) -> str:
    """The answer as one JSON object; the path is a list of [x, y] in the user's coordinates."""
    result, path = answer.result, answer.result.path
    return json.dumps(
        {
            "status": result.status.value,
            "planner": result.planner,
            "cost": path.cost if path else None,
            "length_fields": path.length_fields if path else None,
            "length_m": path.length_fields * answer.grid.resolution_m if path else None,
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
    """The answer for people."""
    result, path = answer.result, answer.result.path
    table = Table(show_header=False)
    table.add_row("status", result.status.value)
    table.add_row("planner", result.planner)
    if path is not None:
        length_m = path.length_fields * answer.grid.resolution_m
        table.add_row("cost", f"{path.cost:.3f}")
        table.add_row("length", f"{path.length_fields:.2f} fields, {length_m:.2f} m")
    table.add_row("time", f"{answer.seconds * 1000.0:.3f} ms")
    if result.epochs:
        table.add_row("search", f"{result.epochs} epochs, {result.evaluations} chromosomes")
    return table
