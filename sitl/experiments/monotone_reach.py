"""Which paths the genotypes of Sedighi et al. 2004 can represent: exactly, by an exhaustive search over vertices."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from companion.core.grid import OBSTACLE
from companion.planning.problem import PlanningProblem

ROWS, COLUMNS = 0, 1
Places = dict[tuple[int, int, int], int]
"""(x, y, kind of movement that leads on) -> fewest switches."""


def fewest_switches(problem: PlanningProblem, kinds: Iterable[int] = (ROWS, COLUMNS)) -> int | None:
    """The fewest switches for a path from corner to corner of a square map that begins with one kind; None: no path.

    As many as it takes are counted, though a chromosome has room for two. Switches lie between vertices, one at a time.
    """
    free = problem.weights < OBSTACLE
    side = len(free)
    ends = {tuple(problem.start), tuple(problem.target)}
    if free.shape != (side, side) or ends != {(0, side - 1), (side - 1, 0)}:
        raise ValueError("only for square maps, from the upper left corner to the lower right one")
    places: Places = {(*problem.start, kind): 0 for kind in kinds}
    for gene in range(1, side):
        following: Places = {}
        for (x, y, kind), switches in places.items():
            for to_kind, spent in ((kind, switches), (1 - kind, switches + 1)):
                for to_x, to_y in _vertices(gene, to_kind, side) if gene < side - 1 else (problem.target,):
                    here = (to_x, to_y, to_kind)
                    if spent < following.get(here, side) and _joined(free, (x, y), (to_x, to_y)):
                        following[here] = spent
        places = following
    return min(places.values(), default=None)


def _vertices(gene: int, kind: int, side: int) -> Sequence[tuple[int, int]]:
    """Where a gene's vertex can be; genes count rows from the top and columns from the left."""
    if kind == ROWS:
        return [(x, side - 1 - gene) for x in range(side)]
    return [(gene, y) for y in range(side)]


def _joined(free: NDArray[np.bool_], here: tuple[int, int], there: tuple[int, int]) -> bool:
    """Whether one of the two ways of a horizontal and a vertical line is free."""
    (x, y), (to_x, to_y) = here, there
    columns, rows = slice(min(x, to_x), max(x, to_x) + 1), slice(min(y, to_y), max(y, to_y) + 1)
    return bool(
        (free[y, columns].all() and free[rows, to_x].all()) or (free[rows, x].all() and free[to_y, columns].all())
    )
