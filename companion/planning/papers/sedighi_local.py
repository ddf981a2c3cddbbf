"""Sedighi et al. 2004 as the paper means it (section II.A, figure 1): straight on, and a search only round an obstacle.

The way goes along the straight line to the target, in horizontal and vertical steps, until it meets an obstacle.
There the genetic algorithm searches, in a square round that obstacle, for a way from the last free field of the line to
the first one behind the obstacle. Then it goes straight on to the target. The paper does not say how large the square
is: here it holds the obstacle with a field of free ground round it. Where it holds no way, it is grown to twice its
side, up to the whole map (ours).

Nouns: Sedighi local.
"""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from companion.core.grid import OBSTACLE, Cell, Weights
from companion.planning.papers.sedighi_evolution import SWITCHING, Tuning
from companion.planning.papers.sedighi_ga import search
from companion.planning.planner import Capabilities, Outcome, RandomPlanner, from_settings
from companion.planning.problem import Budget, Path, PlanningProblem
from companion.planning.raster import cells_cost, without_loops
from companion.settings import PlannerSettings

Fields = list[tuple[int, int]]
"""x and y of each."""


class SedighiLocal(RandomPlanner):
    """The genetic algorithm of ``sedighi`` in squares round the obstacles on the straight line."""

    name = "sedighi-local"
    capabilities = Capabilities(random=True)

    def __init__(self, settings: PlannerSettings) -> None:
        self._tuning: Tuning = from_settings(Tuning, settings.sedighi, freedom=SWITCHING)

    def _search(self, problem: PlanningProblem, weights: Weights, budget: Budget, seed: int) -> Outcome:
        here, target, way, generations = problem.start, problem.target, [tuple(problem.start)], 0
        while here != target:
            ahead = straight(here, target)
            blocked = next((n for n, (x, y) in enumerate(ahead) if weights[y, x] >= OBSTACLE), len(ahead))
            way += ahead[1:blocked]
            if blocked == len(ahead):
                break
            begin, end = Cell(*ahead[blocked - 1]), _behind(ahead, blocked, weights)
            found, tried = self._round(begin, end, ahead[blocked], weights, seed + generations)
            generations += tried
            if not found:
                return None, generations * self._tuning.population, generations, 0
            way += found[1:]
            here = end
        cells = without_loops(np.array(way, np.int64).reshape(-1, 2))
        path = Path(cells, cells_cost(weights, cells))
        return path, generations * self._tuning.population, generations, 0

    def _round(self, begin: Cell, end: Cell, hit: tuple[int, int], weights: Weights, seed: int) -> tuple[Fields, int]:
        """A way round the obstacle that was hit, and generations; no fields if there is none in any square."""
        square, generations = _square(begin, end, hit, weights), 0
        while True:
            part = np.ascontiguousarray(weights[square.top : square.bottom, square.left : square.right])
            start, goal = (Cell(cell.x - square.left, cell.y - square.top) for cell in (begin, end))
            found, cells, _, tried = search(part, start, goal, self._tuning, seed + generations)
            generations += tried
            if found:
                return [(int(x) + square.left, int(y) + square.top) for x, y in cells], generations
            if part.shape == weights.shape:
                return [], generations
            square = square.grown(weights.shape)


class Square(NamedTuple):
    """Columns and rows of a part of the map; ``right`` and ``bottom`` are the first ones outside."""

    left: int
    top: int
    right: int
    bottom: int

    def grown(self, shape: tuple[int, ...]) -> Square:
        """Twice as large, as far as the map reaches."""
        wide, high = self.right - self.left, self.bottom - self.top
        return Square(
            max(self.left - (wide + 1) // 2, 0),
            max(self.top - (high + 1) // 2, 0),
            min(self.right + (wide + 1) // 2, shape[1]),
            min(self.bottom + (high + 1) // 2, shape[0]),
        )


def straight(begin: Cell, end: Cell) -> Fields:
    """The fields nearest to the straight line, from neighbour to neighbour, never diagonally; both ends are in it."""
    (x, y), dx, dy = begin, end.x - begin.x, end.y - begin.y
    fields = [(x, y)]
    for _ in range(abs(dx) + abs(dy)):
        # Of the two steps the one that stays nearer to the line.
        along_x = abs((x + np.sign(dx) - begin.x) * dy - (y - begin.y) * dx)
        along_y = abs((x - begin.x) * dy - (y + np.sign(dy) - begin.y) * dx)
        if x != end.x and (y == end.y or along_x <= along_y):
            x += int(np.sign(dx))
        else:
            y += int(np.sign(dy))
        fields.append((x, y))
    return fields


def _behind(ahead: Fields, blocked: int, weights: Weights) -> Cell:
    """The first free field of the line behind the obstacle; the line's end is free."""
    return Cell(*next((x, y) for x, y in ahead[blocked:] if weights[y, x] < OBSTACLE))


def _square(begin: Cell, end: Cell, hit: tuple[int, int], weights: Weights) -> Square:
    """The least square round the obstacle and both ends, with a field of ground round the obstacle, within the map."""
    height, width = weights.shape
    places = np.array([*_obstacle_at(hit, weights >= OBSTACLE), begin, end])
    left, top = np.maximum(places.min(axis=0) - 1, 0)
    right, bottom = np.minimum(places.max(axis=0) + 2, (width, height))
    side = max(right - left, bottom - top)
    left, right = _widened(int(left), int(right), int(side), width)
    top, bottom = _widened(int(top), int(bottom), int(side), height)
    return Square(left, top, right, bottom)


def _widened(low: int, high: int, side: int, size: int) -> tuple[int, int]:
    """An interval of this length round the other one, as far as there is room."""
    low = max(min(low - (side - (high - low)) // 2, size - side), 0)
    return low, min(low + side, size)


def _obstacle_at(hit: tuple[int, int], solid: NDArray[np.bool_]) -> Fields:
    """All fields of the obstacle that a field belongs to: those connected with it, diagonally too."""
    height, width = solid.shape
    seen, waiting = {hit}, deque([hit])
    while waiting:
        x, y = waiting.popleft()
        near = ((x + dx, y + dy) for dx in (-1, 0, 1) for dy in (-1, 0, 1))
        for other in near:
            inside = 0 <= other[0] < width and 0 <= other[1] < height
            if inside and other not in seen and solid[other[1], other[0]]:
                seen.add(other)
                waiting.append(other)
    return list(seen)
