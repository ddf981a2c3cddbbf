"""Our planners as contestants of a benchmark."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from numpy.random import Generator

from companion.core.grid import Cell, Weights
from companion.planning.planner import Planner
from companion.planning.problem import Budget, PlanningProblem
from companion.planning.raster import CellArray
from companion.planning.registry import make_planner
from companion.settings import PlannerSettings

Found = Callable[[], CellArray] | None
"""Returns the fields of the path found, outside the measured time; None: no path was found."""


@dataclass(frozen=True, slots=True)
class Contestant:
    """One way to search.

    ``solve(weights, start, target, rng)`` is timed, with all preparations for a new map (but not for the generator,
    which a vehicle has already).

    ``random``: the seed matters. ``most_fields``: larger maps are not tried, as they would take hours or all memory.
    ``note``: what a reader needs for a fair comparison.
    """

    name: str
    solve: Callable[[Weights, Cell, Cell, Generator], Found]
    random: bool = False
    ours: bool = False
    most_fields: int = 100_000_000
    note: str = ""


def our_planner(name: str, settings: PlannerSettings, budget: Budget) -> Contestant:
    """A registered planner, made anew for every search (some have a memory). Raises UnknownPlannerError."""
    capabilities = make_planner(name, settings).capabilities

    def solve(weights: Weights, start: Cell, target: Cell, rng: Generator) -> Found:
        planner: Planner = make_planner(name, settings)
        path = planner.plan(PlanningProblem(weights, start, target), budget, rng).path
        return None if path is None else lambda: path.cell_array

    notes = []
    if capabilities.smooth_curve:
        notes.append("smooth curve")
    if capabilities.any_angle:
        notes.append("any angle")
    if capabilities.optimal:
        notes.append("optimal")
    elif capabilities.proves_no_path:
        notes.append("complete")
    return Contestant(name, solve, capabilities.random, ours=True, note=", ".join(notes))
