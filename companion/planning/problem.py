"""A planning problem (grid, start, target, vehicle, moving obstacles), a budget, and a planner's result.

Nouns: planning problem, budget, path, problem.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from enum import StrEnum
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from companion.core.grid import OBSTACLE, Cell, Weights, as_array, as_cells

MIN_WEIGHT = 0.01
"""The least that a field costs: even on ground of weight 0 a longer path must cost more."""


@dataclass(frozen=True, eq=False, slots=True)
class ObstacleTrajectory:
    """Where a moving obstacle is expected to be: a disc whose centre moves along straight segments.

    ``track`` has shape (n, 3), one row for each end of a segment: time in seconds from the moment of planning (rising),
    then x and y in fields (field centres at whole numbers). Between two rows the speed is constant; before the first
    row and after the last the obstacle stands still. ``radius_fields`` includes the rover's own radius, as the map
    does.
    """

    radius_fields: float
    track: NDArray[np.float64]


@dataclass(frozen=True, eq=False, slots=True)
class KinematicConstraints:
    """How the vehicle can move, for planners that consider it.

    ``heading_rad``: at the start, 0 along +x, growing towards +y; None: any. ``turning_radius_fields``: the tightest
    arc it can drive; 0: it turns on the spot. ``speeds_fields_s``: the lowest and the highest speed it may be
    commanded.
    """

    heading_rad: float | None = None
    turning_radius_fields: float = 0.0
    speeds_fields_s: tuple[float, float] = (0.2, 2.0)


@dataclass(frozen=True, eq=False, slots=True)
class PlanningProblem:
    """Find a path over ``weights`` (shape (height, width), 1 = obstacle) from ``start`` to ``target``.

    ``corner_cutting`` allows a diagonal step past the corner of an obstacle, as the papers do. Without it both straight
    neighbours of a diagonal step must be free. Planners never write to ``weights``. Only planners whose capabilities
    say so consider ``moving_obstacles`` and ``kinematics``.
    """

    weights: Weights
    start: Cell
    target: Cell
    corner_cutting: bool = False
    moving_obstacles: tuple[ObstacleTrajectory, ...] = ()
    kinematics: KinematicConstraints = KinematicConstraints()

    @property
    def ends_are_free(self) -> bool:
        """Whether start and target are inside the map and free. If not, there is no path."""
        height, width = self.weights.shape
        for x, y in (self.start, self.target):
            if not (0 <= x < width and 0 <= y < height and self.weights[y, x] < OBSTACLE):
                return False
        return True


@dataclass(frozen=True, slots=True)
class Budget:
    """How long to search, in epochs (never seconds). Complete planners ignore it.

    Each number of ``control_points`` is tried in turn, for ``max_epochs``, until one gives a path.
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

    ``cell_array``: their coordinates, shape (n, 2), columns x and y; ``cells``: the same as tuples. ``cost``: see
    ``path_cost``. ``curve``: the smooth line that the fields were made from, if the planner has one, shape (n, 2),
    columns x and y in fields, field centres at whole numbers. ``speeds_fields_s``: the speed from each point of the
    curve to the next, if the planner chooses speeds, shape (n - 1,). The arrays must not be written to.
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
        """The fields as tuples, made at the first use: on a large map that takes as long as finding the path."""
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
    """A planner's result. ``path`` is not None exactly when the status is FOUND."""

    status: PlanStatus
    path: Path | None
    planner: str
    evaluations: int = 0
    epochs: int = 0
    control_points: int = 0


def path_cost(weights: Weights, cells: tuple[Cell, ...]) -> float:
    """Sum over the steps of length (1 or sqrt 2) times the weight of the field entered (at least MIN_WEIGHT)."""
    return sum(math.hypot(b.x - a.x, b.y - a.y) * max(float(weights[b.y, b.x]), MIN_WEIGHT) for a, b in pairwise(cells))
