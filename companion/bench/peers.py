"""Search libraries that people use today, each asked in its own way. Those that are not installed are left out.

Obstacles are blocked and all other ground costs the same: what not all of them can weigh is left out of the comparison.
"""

from __future__ import annotations

import importlib.util
import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from companion.bench.contestants import Contestant, Found
from companion.core.grid import OBSTACLE, Cell, Weights
from companion.planning.raster import polyline

SLOW_FIELDS = 100_000
"""Pure Python stops here: larger maps take minutes a search."""
LIMIT_S = 5.0
"""A sampling planner gives up then."""


def installed_peers() -> tuple[list[Contestant], list[str]]:
    """The peers that can take part, and the modules that are missing (extra ``peers``)."""
    found, missing = [], []
    for module, make in PEERS.items():
        if importlib.util.find_spec(module) is None:
            missing.append(module)
        else:
            found += make()
    return found, missing


def _blocked(weights: Weights) -> NDArray[np.bool_]:
    blocked: NDArray[np.bool_] = weights >= OBSTACLE
    return blocked


def _xy(rows_columns: Any) -> Callable[[], NDArray[np.int64]]:
    """Fields from a path of rows and columns."""
    return lambda: np.asarray(rows_columns, dtype=np.int64)[:, ::-1]


def _neighbour_pairs(free: NDArray[np.bool_]) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]:
    """Every step on the grid once (8 neighbours, no corner cut): from, to, length."""
    height, width = free.shape
    number = np.arange(height * width).reshape(height, width)
    heads, tails, lengths = [], [], []
    for step_y, step_x in ((0, 1), (1, 0), (1, 1), (1, -1)):
        here = (slice(0, height - step_y), slice(max(0, -step_x), width - max(0, step_x)))
        there = (slice(step_y, height), slice(max(0, step_x), width + min(0, step_x)))
        allowed = free[here] & free[there]
        if step_y and step_x:
            allowed &= free[here[0], there[1]] & free[there[0], here[1]]
        heads.append(number[here][allowed])
        tails.append(number[there][allowed])
        lengths.append(np.full(len(heads[-1]), math.hypot(step_x, step_y)))
    return np.concatenate(heads), np.concatenate(tails), np.concatenate(lengths)


def _scipy() -> list[Contestant]:
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import dijkstra

    def solve(weights: Weights, start: Cell, target: Cell, rng: Generator) -> Found:
        height, width = weights.shape
        a, b, length = _neighbour_pairs(~_blocked(weights))
        graph = coo_array((length, (a, b)), shape=(height * width, height * width)).tocsr()
        begin, end = start.y * width + start.x, target.y * width + target.x
        distances, before = dijkstra(graph, directed=False, indices=begin, return_predecessors=True)
        if not np.isfinite(distances[end]):
            return None

        def cells() -> NDArray[np.int64]:
            numbers = [end]
            while numbers[-1] != begin:
                numbers.append(int(before[numbers[-1]]))
            return np.array([(at % width, at // width) for at in reversed(numbers)], np.int64)

        return cells

    return [Contestant("scipy dijkstra", solve, note="graph built for each search")]


def _skimage() -> list[Contestant]:
    from skimage.graph import route_through_array

    def solve(weights: Weights, start: Cell, target: Cell, rng: Generator) -> Found:
        costs = np.where(_blocked(weights), -1.0, 1.0)
        try:
            path, _ = route_through_array(costs, (start.y, start.x), (target.y, target.x), geometric=True)
        except ValueError:
            return None
        return _xy(path)

    return [Contestant("scikit-image", solve)]


def _tcod() -> list[Contestant]:
    from tcod.path import AStar

    def solve(weights: Weights, start: Cell, target: Cell, rng: Generator) -> Found:
        free = (~_blocked(weights)).astype(np.int8)
        path = AStar(free, diagonal=math.sqrt(2.0)).get_path(start.y, start.x, target.y, target.x)
        return _xy([(start.y, start.x), *path]) if path else None

    return [Contestant("tcod", solve)]


def _nano_astar() -> list[Contestant]:
    from nano_astar import astar

    def solve(weights: Weights, start: Cell, target: Cell, rng: Generator) -> Found:
        answer = astar(_blocked(weights).view(np.uint8), (start.y, start.x), (target.y, target.x))
        return None if answer is None else _xy(answer[0])

    return [Contestant("nano-astar", solve)]


def _pyastar2d() -> list[Contestant]:
    from pyastar2d import astar_path

    def solve(weights: Weights, start: Cell, target: Cell, rng: Generator) -> Found:
        costs = np.where(_blocked(weights), np.float32(np.inf), np.float32(1.0))
        path = astar_path(costs, (start.y, start.x), (target.y, target.x), allow_diagonal=True)
        return None if path is None else _xy(path)

    return [Contestant("pyastar2d", solve, note="diagonal steps are charged 1, not sqrt 2")]


def _pathfinding() -> list[Contestant]:
    from pathfinding.core.diagonal_movement import DiagonalMovement
    from pathfinding.core.grid import Grid
    from pathfinding.finder.a_star import AStarFinder

    def solve(weights: Weights, start: Cell, target: Cell, rng: Generator) -> Found:
        grid = Grid(matrix=(~_blocked(weights)).astype(int).tolist())
        finder = AStarFinder(diagonal_movement=DiagonalMovement.only_when_no_obstacle)
        nodes, _ = finder.find_path(grid.node(*start), grid.node(*target), grid)
        return (lambda: np.array([(node.x, node.y) for node in nodes], np.int64)) if nodes else None

    return [Contestant("pathfinding", solve, most_fields=SLOW_FIELDS, note="pure Python")]


def _networkx() -> list[Contestant]:
    import networkx

    def solve(weights: Weights, start: Cell, target: Cell, rng: Generator) -> Found:
        width = weights.shape[1]
        a, b, length = _neighbour_pairs(~_blocked(weights))
        graph: Any = networkx.Graph()
        graph.add_weighted_edges_from(zip(a.tolist(), b.tolist(), length.tolist(), strict=True))

        def octile(one: int, other: int) -> float:
            x, y = abs(one % width - other % width), abs(one // width - other // width)
            return float(max(x, y) + (math.sqrt(2.0) - 1.0) * min(x, y))

        begin, end = start.y * width + start.x, target.y * width + target.x
        try:
            path = networkx.astar_path(graph, begin, end, octile)
        except (networkx.NetworkXNoPath, networkx.NodeNotFound):
            return None
        return lambda: np.array([(at % width, at // width) for at in path], np.int64)

    return [Contestant("networkx A*", solve, most_fields=SLOW_FIELDS, note="pure Python, graph built for each search")]


def _pathplanning() -> list[Contestant]:
    from pathplanning import plan_discrete
    from pathplanning.core.contracts import DiscreteProblem
    from pathplanning.spaces import Grid2DSearchSpace

    def solve(weights: Weights, start: Cell, target: Cell, rng: Generator) -> Found:
        height, width = weights.shape
        graph = Grid2DSearchSpace(width, height, occupancy=_blocked(weights)).to_native_graph()
        result = plan_discrete(DiscreteProblem(graph, tuple(start), tuple(target)), planner="astar")
        path = result.path
        return None if path is None or len(path) == 0 else lambda: np.asarray(path, np.int64)

    return [Contestant("pathplanning A*", solve, most_fields=1_500_000, note="graph built for each search")]


def _ompl() -> list[Contestant]:
    from ompl import base, geometric, util

    util.noOutputHandler()

    def ompl_planner(name: str) -> Contestant:
        def solve(weights: Weights, start: Cell, target: Cell, rng: Generator) -> Found:
            height, width = weights.shape
            free = ~_blocked(weights)
            space = base.RealVectorStateSpace(2)
            bounds = base.RealVectorBounds(2)
            for axis, size in enumerate((width, height)):
                bounds.setLow(axis, -0.5)
                bounds.setHigh(axis, size - 0.5)
            space.setBounds(bounds)
            setup = geometric.SimpleSetup(space)
            setup.setStateValidityChecker(lambda state: bool(free[round(state[1]), round(state[0])]))
            setup.getSpaceInformation().setStateValidityCheckingResolution(0.5 / math.hypot(width, height))
            ends = [space.allocState(), space.allocState()]
            for end, place in zip(ends, (start, target), strict=True):
                end[0], end[1] = float(place.x), float(place.y)
            setup.setStartAndGoalStates(*ends)
            setup.setPlanner(getattr(geometric, name)(setup.getSpaceInformation()))
            objective = base.PathLengthOptimizationObjective(setup.getSpaceInformation())
            objective.setCostThreshold(base.Cost(math.inf))  # any path will do: without this BIT* goes on for LIMIT_S
            setup.setOptimizationObjective(objective)
            if not setup.solve(LIMIT_S) or not setup.haveExactSolutionPath():
                return None
            states = setup.getSolutionPath().getStates()
            corners = np.array([(round(state[0]), round(state[1])) for state in states], np.int64)
            return lambda: polyline(corners)

        note = "first solution, any angle; collision checks call back into Python; cannot be seeded for each search"
        return Contestant(f"OMPL {name}", solve, random=True, most_fields=SLOW_FIELDS, note=note)

    return [ompl_planner("RRTConnect"), ompl_planner("BITstar")]


PEERS: dict[str, Callable[[], list[Contestant]]] = {
    "scipy": _scipy,
    "skimage": _skimage,
    "tcod": _tcod,
    "nano_astar": _nano_astar,
    "pyastar2d": _pyastar2d,
    "pathfinding": _pathfinding,
    "pathplanning": _pathplanning,
    "networkx": _networkx,
    "ompl": _ompl,
}
"""How to make the peers of each module, once it is known to be installed."""
