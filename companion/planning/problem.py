"""What a planner is asked and what it answers."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from enum import StrEnum
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from companion.core.grid import Cell, Weights, as_array, as_cells

MIN_WEIGHT = 0.01
"""The least that a field costs: on ground of weight 0 a detour must still cost something."""


@dataclass(frozen=True, eq=False, slots=True)
class Mover:
    """A moving obstacle: a disc whose centre goes along straight segments.

    ``track`` has shape (n, 3): columns time in seconds from the moment of planning, rising, then x and y in fields (field
    centres at whole numbers). Between the rows it moves evenly; before the first and after the last it stands there.
    ``radius_fields`` has the rover's own radius in it, as the map has.
    """

    radius_fields: float
    track: NDArray[np.float64]


@dataclass(frozen=True, eq=False, slots=True)
class Motion:
    """How the vehicle moves, for planners that ask.

    ``heading_rad``: at the start, 0 along +x, growing towards +y; None: any. ``turning_radius_fields``: the tightest arc it can
    drive; 0: it turns on the spot. ``speeds_fields_s``: the slowest and the fastest it may be told to go.
    """

    heading_rad: float | None = None
    turning_radius_fields: float = 0.0
    speeds_fields_s: tuple[float, float] = (0.2, 2.0)


@dataclass(frozen=True, eq=False, slots=True)
class PlanningProblem:
    """Find a path over ``weights`` (shape (height, width), 1 = obstacle) from ``start`` to ``target``.

    ``corner_cutting`` allows a diagonal step past the corner of an obstacle, as the papers do; off, both orthogonal
    neighbours of a diagonal step must be free. Planners never write to ``weights``. ``movers`` and ``motion`` count only
    for planners whose capabilities say so.
    """

    weights: Weights
    start: Cell
    target: Cell
    corner_cutting: bool = False
    movers: tuple[Mover, ...] = ()
    motion: Motion = Motion()


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


@dataclass(frozen=True, eq=False, slots=True, init=False)
class Path:
    """The fields from start to target, each 8-adjacent to the one before.

    ``cell_array`` has their places, shape (n, 2), columns x and y; ``cells`` are the same as tuples. ``cost``: see
    ``path_cost``. ``curve``, if the planner has one, is the smooth line the fields came from: shape (n, 2),
    columns x and y in fields, field centres at whole numbers. ``speeds_fields_s``, if the planner chooses them, has
    shape (n - 1,): the speed from each point of the curve to the next. Nobody writes to these arrays.
    """

    cell_array: NDArray[np.int64]
    cost: float
    curve: NDArray[np.float64] | None
    speeds_fields_s: NDArray[np.float64] | None
    _cells: tuple[Cell, ...] | None = field(init=False, repr=False)

    def __init__(
        self,
        cell_array: NDArray[np.int64] | Iterable[Cell],
        cost: float,
        curve: NDArray[np.float64] | None = None,
        speeds_fields_s: NDArray[np.float64] | None = None,
    ) -> None:
        put = object.__setattr__
        put(self, "cell_array", cell_array if isinstance(cell_array, np.ndarray) else as_array(cell_array))
        put(self, "cost", cost)
        put(self, "curve", curve)
        put(self, "speeds_fields_s", speeds_fields_s)
        put(self, "_cells", None)

    @property
    def cells(self) -> tuple[Cell, ...]:
        """The fields one by one. Made when first asked for: on a large map that takes as long as finding the path."""
        if self._cells is None:
            object.__setattr__(self, "_cells", as_cells(self.cell_array))
        assert self._cells is not None
        return self._cells

    @property
    def length_fields(self) -> float:
        """Length in fields; a diagonal step is sqrt 2."""
        return float(np.hypot(*np.diff(self.cell_array, axis=0).T).sum())


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
