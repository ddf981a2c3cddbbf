"""What a planner is asked and what it answers."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from companion.grid import Cell, Weights

MIN_WEIGHT = 0.01
"""The least that a field costs: on ground of weight 0 a detour must still cost something."""


@dataclass(frozen=True, eq=False, slots=True)
class PlanningProblem:
    """Find a path over ``weights`` (shape (height, width), 1 = obstacle) from ``start`` to ``target``.

    ``corner_cutting`` allows a diagonal step past the corner of an obstacle, as the papers do; off, both orthogonal
    neighbours of a diagonal step must be free. Planners never write to ``weights``.
    """

    weights: Weights
    start: Cell
    target: Cell
    corner_cutting: bool = False


@dataclass(frozen=True, slots=True)
class Budget:
    """How hard to try, in epochs (never seconds); planners that are complete ignore it.

    ``control_points`` are tried one after the other, ``max_epochs`` each, until one gives a path.
    """

    min_epochs: int = 1
    max_epochs: int = 500
    control_points: tuple[int, ...] = (4,)
    population: int = 30


class PlanStatus(StrEnum):
    """How a search ended."""

    FOUND = "found"
    BUDGET_SPENT = "budget-spent"
    NO_PATH = "no-path"


@dataclass(frozen=True, eq=False, slots=True)
class Path:
    """The fields from start to target, each 8-adjacent to the one before.

    ``cost``: see ``path_cost``. ``curve``, if the planner has one, is the smooth line the fields came from: shape (n, 2),
    columns x and y in fields, field centres at whole numbers.
    """

    cells: tuple[Cell, ...]
    cost: float
    curve: NDArray[np.float64] | None = None

    @property
    def length_fields(self) -> float:
        """Length in fields; a diagonal step is sqrt 2."""
        return sum(math.hypot(b.x - a.x, b.y - a.y) for a, b in pairwise(self.cells))


@dataclass(frozen=True, eq=False, slots=True)
class PlanResult:
    """A planner's answer. ``path`` is there exactly when the status is FOUND."""

    status: PlanStatus
    path: Path | None
    planner: str
    evaluations: int = 0
    epochs: int = 0
    control_points: int = 0


def path_cost(weights: Weights, cells: tuple[Cell, ...]) -> float:
    """Sum over the steps of length (1 or sqrt 2) times the weight of the field entered (at least MIN_WEIGHT)."""
    return sum(math.hypot(b.x - a.x, b.y - a.y) * max(float(weights[b.y, b.x]), MIN_WEIGHT) for a, b in pairwise(cells))
