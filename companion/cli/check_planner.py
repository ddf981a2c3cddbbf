"""``rover-companion check-planner``: is a planner of one's own one that the navigator can use?"""

from __future__ import annotations

from functools import partial
from typing import Annotated

import numpy as np
import typer

from companion.cli.inputs import EXIT_BAD_INPUT
from companion.cli.patience import Patience
from companion.planning.planner_contract import broken_by, random_problem
from companion.planning.problem import Budget, PlanningProblem
from companion.planning.registry import UnknownPlannerError, make_planner
from companion.settings import PlannerSettings

EXIT_BROKEN = 3
SLOW_S = 10.0
"""After so long without an answer to one problem it is told."""
BUDGET = Budget(min_epochs=2, max_epochs=15, control_points=(4, 6), population=18)
SIGNS = {True: "#", False: "."}


def check_planner(
    name: Annotated[str, typer.Argument(metavar="NAME", help="A planner: its name, or module:name.")],
    problems: Annotated[int, typer.Option(min=1, help="So many random problems.")] = 300,
    seed: Annotated[int, typer.Option(min=0, help="Of the first problem; the next ones are consecutive.")] = 0,
) -> None:
    """Hold a planner to the contract of all planners, on random problems.

    Exit code 0: it keeps the contract; 3: it breaks it, and the first problem is shown; 2: no such planner.
    """
    try:
        planner = make_planner(name, PlannerSettings())
    except UnknownPlannerError as error:
        typer.echo(str(error), err=True)
        raise typer.Exit(EXIT_BAD_INPUT) from error
    found = 0
    for number in range(seed, seed + problems):
        problem = random_problem(np.random.default_rng(number))
        patience = Patience(SLOW_S, partial(_tell, f"{name}: problem {number}: no answer for {SLOW_S:.0f} s yet"))
        patience.begin()
        try:
            wrong = broken_by(planner, problem, BUDGET, number)
            found += not wrong and planner.plan(problem, BUDGET, np.random.default_rng(number)).path is not None
        except Exception as error:
            wrong = " ".join(f"it raised {type(error).__name__}: {error}".split())
        finally:
            patience.end()
        if wrong:
            typer.echo(f"{name}: problem {number}: {wrong}", err=True)
            typer.echo(picture(problem), err=True)
            typer.echo(f"again: rover-companion check-planner {name} --problems 1 --seed {number}", err=True)
            raise typer.Exit(EXIT_BROKEN)
    typer.echo(f"{name}: keeps the contract on {problems} problems; it found a path in {found} of them")


def _tell(text: str) -> None:
    typer.echo(text, err=True)


def picture(problem: PlanningProblem) -> str:
    """North up; S start, T target, # obstacles. Ends outside the map are not drawn."""
    rows = [[SIGNS[bool(weight >= 1.0)] for weight in row] for row in problem.weights]
    for sign, (x, y) in (("S", problem.start), ("T", problem.target)):
        if 0 <= y < len(rows) and 0 <= x < len(rows[0]):
            rows[y][x] = sign
    corner = "corners may be cut" if problem.corner_cutting else "no corner may be cut"
    return "\n".join(["".join(row) for row in reversed(rows)] + [corner])
