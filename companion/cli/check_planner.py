"""``rover-companion check-planner``: is a planner of one's own one that the navigator can use?"""

from __future__ import annotations

import math
from functools import partial
from typing import Annotated, NoReturn

import numpy as np
import typer

from companion.cli.inputs import EXIT_BAD_INPUT
from companion.cli.patience import Patience
from companion.core.interrupts import is_interrupt
from companion.core.own_parts import OwnKind, raised
from companion.planning.contract_problems import BUDGET, large_problem, tasks_for
from companion.planning.planner import Planner
from companion.planning.planner_contract import broken_by, reachable
from companion.planning.problem import Budget, Path, PlanningProblem
from companion.planning.registry import UnknownPlannerError, make_planner
from companion.settings import PlannerSettings

EXIT_BROKEN = 3
SLOW_S = 10.0
"""After so long without an answer to one problem it is told."""
MOST_MISSED = 5
"""A planner that finds none of so many paths finds none at all. Of those that come with the program none has missed
two on end in 71 problems with a way."""
ASKED_AGAIN = 30
"""So many of the problems are given twice, far apart."""
Task = tuple[int, PlanningProblem, Budget]
"""With the number that is its seed, and the planner's."""
SIGNS = {True: "#", False: "."}


def check_planner(
    name: Annotated[str, typer.Argument(metavar="NAME", help="A planner: its name, or module:name.")],
    problems: Annotated[
        int, typer.Option(min=1, help="So many random ones; as many again for each promise that needs its own.")
    ] = 300,
    seed: Annotated[int, typer.Option(min=0, help="Of the first problem; the next ones are consecutive.")] = 0,
) -> None:
    """Hold a planner to the contract of all planners and to what its capabilities promise, on random problems.

    Exit code 0: it keeps both; 3: it breaks one, or never finds a path, and the first problem is shown; 2: no such
    planner.
    """
    planner = _made(name)
    tasks = [(one, *task) for one in range(seed, seed + problems) for task in tasks_for(planner.capabilities, one)]
    tasks.append((seed, large_problem(np.random.default_rng(seed)), BUDGET))
    paths = [_kept(name, planner, task) for task in tasks]
    with_way = [task for task in tasks if reachable(task[1])]
    found = sum(path is not None for path in paths)
    if not found and len(with_way) >= MOST_MISSED:
        text = (
            f"it found no path in any of {len(with_way)} problems that have one; the first, problem {with_way[0][0]}:"
        )
        _end_broken(f"{name}: {text}", with_way[0][1])
    _ask_again(name, planner, tasks[:ASKED_AGAIN], paths)
    among = f"it found a path in {found} of {len(with_way)} that have one"
    typer.echo(f"{name}: keeps the contract on {len(tasks)} problems; {among}")


def _kept(name: str, planner: Planner, task: Task) -> Path | None:
    """The path that it finds; a planner that does something wrong ends the program."""
    number, problem, _ = task
    wrong, path = _judged(name, planner, task)
    if wrong:
        again = f"again: rover-companion check-planner {name} --problems 1 --seed {number}"
        _end_broken(f"{name}: problem {number}: {wrong}", problem, again)
    return path


def _ask_again(name: str, planner: Planner, tasks: list[Task], paths: list[Path | None]) -> None:
    """The first problems once more, after all others, and of a planner made anew: both must answer as at first."""
    for whose, asked in (("asked again after the other problems", planner), ("made anew", _made(name))):
        for task, path in zip(tasks, paths, strict=False):
            _, later = _judged(name, asked, task)
            if (None if path is None else path.cells) != (None if later is None else later.cells):
                text = f"problem {task[0]}: {whose} it gave another path for the same seed"
                _end_broken(f"{name}: {text}", task[1], "again: the same command; a single problem does not show it")


def _end_broken(text: str, problem: PlanningProblem, again: str = "") -> NoReturn:
    for line in (text, picture(problem), *([again] if again else [])):
        typer.echo(line, err=True)
    raise typer.Exit(EXIT_BROKEN)


def _made(name: str) -> Planner:
    """The planner; one that cannot be made ends the program with one line."""
    try:
        return make_planner(name, PlannerSettings())
    except UnknownPlannerError as error:
        typer.echo(str(error), err=True)
        raise typer.Exit(EXIT_BAD_INPUT) from error


def _judged(name: str, planner: Planner, task: Task) -> tuple[str, Path | None]:
    """What it does wrong on a problem, and the path that it finds."""
    number, problem, budget = task
    patience = Patience(SLOW_S, partial(_tell, f"{name}: problem {number}: no answer for {SLOW_S:.0f} s yet"))
    patience.begin()
    try:
        wrong = broken_by(planner, problem, budget, number)
        return wrong, None if wrong else planner.plan(problem, budget, np.random.default_rng(number)).path
    except (Exception, SystemExit) as error:  # a planner that ends the program would end a drive
        if is_interrupt(error):
            raise
        return f"it raised {raised(OwnKind.PLANNER, name, error)}", None
    finally:
        patience.end()


def _tell(text: str) -> None:
    typer.echo(text, err=True)


def picture(problem: PlanningProblem) -> str:
    """North up; S start, T target, # obstacles. Ends outside the map are not drawn."""
    rows = [[SIGNS[bool(weight >= 1.0)] for weight in row] for row in problem.weights]
    for sign, (x, y) in (("S", problem.start), ("T", problem.target)):
        if 0 <= y < len(rows) and 0 <= x < len(rows[0]):
            rows[y][x] = sign
    told = ["corners may be cut" if problem.corner_cutting else "no corner may be cut"]
    for mover in problem.moving_obstacles:
        places = ", ".join(f"at {x:.1f}, {y:.1f} after {time_s:.1f} s" for time_s, x, y in mover.track)
        told.append(f"a disc of radius {mover.radius_fields:g} fields moves: {places}")
    heading_rad, radius = problem.kinematics.heading_rad, problem.kinematics.turning_radius_fields
    if heading_rad is not None and radius > 0.0:
        told.append(f"turning radius {radius:.3g} fields, heading {math.degrees(heading_rad):.0f} deg from right to up")
    return "\n".join(["".join(row) for row in reversed(rows)] + told)
