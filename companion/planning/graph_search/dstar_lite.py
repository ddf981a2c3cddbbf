"""D* Lite: the cheapest path, found again with little work where a map has changed a little.

Koenig & Likhachev 2002. The planner remembers its last search. While target, map size and rules stay the same, only what has changed of the map
since then, and the way the start has gone, is worked into it; else it searches anew. What it costs does not depend on what was asked
before; of equally cheap paths, which one may.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from companion.core.grid import Weights
from companion.planning.ends import ends_free
from companion.planning.graph_search.dstar_kernel import changes, note_changes, queue, settle, way_on
from companion.planning.graph_search.steps import least_cost, octile
from companion.planning.planner import Capabilities
from companion.planning.problem import Budget, Path, PlanningProblem, PlanResult, PlanStatus
from companion.planning.raster import CellArray, cells_cost, plain
from companion.settings import PlannerSettings

Floats = NDArray[np.float64]
Fields = NDArray[np.int32]

ANEW_SHARE = 0.1
"""When more of the map than this has changed, a new search is less work than the repair."""
SLACK = 1e-6
"""Costs nearer than this may have been taken in the wrong order by rounding."""


@dataclass(frozen=True, eq=False, slots=True)
class Memory:
    """A search as it was left. ``passed`` (the paper's k_m): how far the start has come since it began, by the heuristic."""

    weights: Floats
    shape: tuple[int, ...]
    corner_cutting: bool
    start: int
    target: int
    least: float
    passed: float
    g: Floats
    rhs: Floats
    heap: Fields
    place: Fields
    keys: Floats
    size: int


class DstarLite:
    """The cheapest path, or the proof that there is none. One object belongs to one drive: it remembers, and is not for two threads."""

    name = "dstar-lite"
    capabilities = Capabilities(proves_no_path=True, optimal=True)

    def __init__(self, settings: PlannerSettings) -> None:
        del settings  # nothing to set
        self._memory: Memory | None = None

    def plan(self, problem: PlanningProblem, budget: Budget, rng: Generator) -> PlanResult:
        """See ``Planner.plan``. FOUND or NO_PATH; budget and generator are left alone."""
        del budget, rng
        if not ends_free(problem):
            return PlanResult(PlanStatus.NO_PATH, None, self.name)
        weights = plain(problem.weights)
        memory = _brought_up_to_date(self._memory, weights, problem) or _begun(weights, problem)
        self._memory = None  # if this is interrupted, half a search must not be remembered
        self._memory, cells = _settled(memory)
        if len(cells) == 0:
            return PlanResult(PlanStatus.NO_PATH, None, self.name)
        return PlanResult(PlanStatus.FOUND, Path(cells, float(cells_cost(weights, cells))), self.name)


def _begun(weights: Weights, problem: PlanningProblem) -> Memory:
    """A search of which nothing is known but the target."""
    fields, width = weights.size, weights.shape[1]
    start, target = (cell.y * width + cell.x for cell in (problem.start, problem.target))
    flat = weights.ravel().copy()
    g, rhs, keys = np.full(fields, np.inf), np.full(fields, np.inf), np.zeros((fields, 2))
    heap, place = np.zeros(fields, np.int32), np.zeros(fields, np.int32)
    rhs[target] = 0.0
    least = float(least_cost(flat, flat[target]))
    size = queue(width, g, rhs, heap, place, keys, 0, target, start, least, 0.0)
    return Memory(
        flat, weights.shape, problem.corner_cutting, start, target, least, 0.0, g, rhs, heap, place, keys, size
    )


def _brought_up_to_date(memory: Memory | None, weights: Weights, problem: PlanningProblem) -> Memory | None:
    """The remembered search with what has changed since; None if it is of no use any more."""
    width = weights.shape[1]
    start, target = (cell.y * width + cell.x for cell in (problem.start, problem.target))
    if memory is None or (memory.shape, memory.target, memory.corner_cutting) != (
        weights.shape,
        target,
        problem.corner_cutting,
    ):
        return None
    changed = np.empty(int(ANEW_SHARE * weights.size) + 1, np.int64)
    count = changes(memory.weights, weights.ravel(), changed)
    # Cheaper ground than any before would make the remembered heuristic promise too much.
    if count > len(changed) or (count and memory.weights[changed[:count]].min() < memory.least):
        return None
    moved = memory.least * octile(start % width - memory.start % width, start // width - memory.start // width)
    passed = memory.passed + moved
    size = note_changes(
        memory.weights,
        width,
        memory.g,
        memory.rhs,
        memory.heap,
        memory.place,
        memory.keys,
        memory.size,
        changed[:count],
        start,
        target,
        memory.least,
        passed,
        problem.corner_cutting,
    )
    return replace(memory, start=start, passed=passed, size=size)


def _settled(memory: Memory) -> tuple[Memory, CellArray]:
    """The search carried on until the start's cost is known, and the fields of the path; none if there is no path."""
    width, start, target = memory.shape[1], memory.start, memory.target
    size = memory.size
    for slack in (0.0, SLACK):
        size = settle(
            memory.weights,
            width,
            memory.g,
            memory.rhs,
            memory.heap,
            memory.place,
            memory.keys,
            size,
            start,
            target,
            memory.least,
            memory.passed,
            memory.corner_cutting,
            slack,
        )
        cells = np.empty((0, 2), np.int64)
        if memory.g[start] == np.inf:
            break
        cells = way_on(memory.weights, width, memory.g, memory.rhs, start, target, memory.corner_cutting)
        if len(cells) > 0:
            break
    return replace(memory, size=size), cells
