"""The compiled part of PRM (probabilistic roadmap) with Lazy A*: Achour & Chaalal 2011, section IV.

Nodes are fields, shape (n, 2), columns x and y; node 0 is the start, node 1 the target. A node or an edge is not
checked until the query needs it.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from companion.core.grid import OBSTACLE, Cell, Weights
from companion.planning.graph_search.heap import Queue, put, take_out
from companion.planning.papers.line_of_sight import DRAWS_A_SAMPLE, sees
from companion.planning.random_numbers import State, seeded, uniform, whole
from companion.planning.raster import CellArray

Ints = NDArray[np.int32]
Floats = NDArray[np.float64]


class Effort(NamedTuple):
    """How long to search, and how edges are measured; see ``PrmSettings``."""

    samples: int
    neighbours: int
    rounds: int
    reach: float
    difficult_share: float
    weight_x: float
    weight_y: float
    corner_cutting: bool


@njit(cache=True, nogil=True)
def distance(nodes: CellArray, a: int, b: int, effort: Effort) -> float:
    """The weighted L-infinity norm between two nodes."""
    return float(
        max(effort.weight_x * abs(nodes[a, 0] - nodes[b, 0]), effort.weight_y * abs(nodes[a, 1] - nodes[b, 1]))
    )


@njit(cache=True, nogil=True)
def link(nodes: CellArray, blocked: NDArray[np.bool_], effort: Effort) -> Ints:
    """The B nearest of every node, in sight or not, without nodes known to be blocked; -1 where there are no more."""
    most = effort.neighbours
    near = np.full((len(nodes), most), -1, np.int32)
    lengths = np.empty(most)
    for a in range(len(nodes)):
        count = 0
        if blocked[a]:
            continue
        for b in range(len(nodes)):
            length = distance(nodes, a, b, effort)
            if length == 0.0 or blocked[b] or (count == most and length >= lengths[count - 1]):
                continue
            at = min(count, most - 1)
            while at > 0 and lengths[at - 1] > length:
                lengths[at] = lengths[at - 1]
                near[a, at] = near[a, at - 1]
                at -= 1
            lengths[at] = length
            near[a, at] = b
            count = min(count + 1, most)
    return near


@njit(cache=True, nogil=True)
def edges_of(near: Ints) -> tuple[Ints, Ints, Ints]:
    """Every link once in both directions: (first edges, where each edge comes from, where it leads).

    The edges of node a are ``first[a]`` to ``first[a + 1]``.
    """
    count = len(near)
    degree = np.zeros(count + 1, np.int32)
    for a in range(count):
        for b in near[a]:
            if b >= 0 and not (a in near[b] and b < a):
                degree[a + 1] += 1
                degree[b + 1] += 1
    first = np.cumsum(degree).astype(np.int32)
    written = first[:-1].copy()
    come_from, lead_to = np.empty(first[-1], np.int32), np.empty(first[-1], np.int32)
    for a in range(count):
        for b in near[a]:
            if b >= 0 and not (a in near[b] and b < a):
                come_from[written[a]], lead_to[written[a]] = a, b
                written[a] += 1
                come_from[written[b]], lead_to[written[b]] = b, a
                written[b] += 1
    return first, come_from, lead_to


@njit(cache=True, nogil=True)
def query(
    weights: Weights,
    nodes: CellArray,
    near: Ints,
    blocked: NDArray[np.bool_],
    tried: NDArray[np.int64],
    effort: Effort,
) -> Ints:
    """Lazy A*: each node's predecessor on the best path from the start, -1 where none is known; the start is its own.

    An edge waits in the queue with the cost it would have, and is checked only when it is expanded: first the node it
    leads to, then the line. ``tried`` (columns: lines checked, lines blocked) is counted up for both ends of the line.
    """
    first, come_from, lead_to = edges_of(near)
    count = len(lead_to)
    queue = Queue(np.zeros(count + 1, np.int32), np.zeros(count, np.int32), np.empty((count, 2)))
    parent, cost = np.full(len(nodes), -1, np.int32), np.zeros(len(nodes))
    parent[0] = 0
    here = 0
    while here != 1:
        for edge in range(first[here], first[here + 1]):
            there = lead_to[edge]
            if parent[there] < 0:
                so_far = cost[here] + distance(nodes, here, there, effort)
                put(queue, edge, so_far + distance(nodes, there, 1, effort), -so_far)
        here = -1
        while queue.heap[0] > 0 and here < 0:
            edge = queue.heap[1]
            take_out(queue, edge)
            a, b = come_from[edge], lead_to[edge]
            blocked[b] = weights[nodes[b, 1], nodes[b, 0]] >= OBSTACLE
            if parent[b] >= 0 or blocked[b]:
                continue
            tried[a, 0] += 1
            tried[b, 0] += 1
            if sees(weights, nodes[a, 0], nodes[a, 1], nodes[b, 0], nodes[b, 1], effort.corner_cutting):
                parent[b], cost[b], here = a, -queue.keys[edge, 1], b
            else:
                tried[a, 1] += 1
                tried[b, 1] += 1
        if here < 0:
            break
    return parent


@njit(cache=True, nogil=True)
def sample_anywhere(shape: tuple[int, int], nodes: CellArray, state: State) -> None:
    """Fill all rows with fields of the map, free or not, uniformly at random."""
    for i in range(len(nodes)):
        nodes[i, 0], nodes[i, 1] = whole(state, 0, shape[1] - 1), whole(state, 0, shape[0] - 1)


@njit(cache=True, nogil=True)
def sample_difficult(
    weights: Weights,
    nodes: CellArray,
    tried: NDArray[np.int64],
    reach: float,
    share: float,
    new: CellArray,
    state: State,
) -> None:
    """Fill ``new`` with fields around the nodes whose lines were blocked, in proportion to the share of blocked ones.

    ``reach``: how far to each side. If no line was blocked there is no difficult region, and the fields are anywhere.
    """
    height, width = weights.shape
    shares = tried[:, 1] / np.maximum(tried[:, 0], 1)
    heaped = np.cumsum(shares)
    if heaped[-1] <= 0.0:
        sample_anywhere(weights.shape, new, state)
        return
    sample_anywhere(weights.shape, new, state)
    for i in range(int(share * len(new))):
        seed = min(np.searchsorted(heaped, uniform(state) * heaped[-1], side="right"), len(nodes) - 1)
        for _ in range(DRAWS_A_SAMPLE):
            for axis, size in ((0, width), (1, height)):
                middle, side = nodes[seed, axis], math.ceil(reach)
                new[i, axis] = whole(state, max(middle - side, 0), min(middle + side, size - 1))
            if weights[new[i, 1], new[i, 0]] < OBSTACLE:
                break


@njit(cache=True, nogil=True)
def search(weights: Weights, start: Cell, target: Cell, effort: Effort, seed: int) -> tuple[CellArray, int, int, int]:
    """One whole search between two different free fields.

    Returns the nodes of the path (no rows if none was found), the number of nodes of the roadmap, the rounds of extra
    samples and the lines checked.
    """
    state = seeded(seed)
    shape = weights.shape
    reach = effort.reach * math.sqrt(shape[0] * shape[1] / effort.samples)
    nodes = np.empty((2 + effort.samples * (1 + effort.rounds), 2), np.int64)
    blocked = np.zeros(len(nodes), np.bool_)
    nodes[0, 0], nodes[0, 1] = start
    nodes[1, 0], nodes[1, 1] = target
    sample_anywhere(shape, nodes[2 : 2 + effort.samples], state)
    checked = 0
    for done in range(effort.rounds + 1):
        used = 2 + effort.samples * (1 + done)
        tried = np.zeros((used, 2), np.int64)
        near = link(nodes[:used], blocked[:used], effort)
        parent = query(weights, nodes[:used], near, blocked, tried, effort)
        checked += tried[:, 0].sum() // 2
        if parent[1] >= 0:
            return _path_nodes(nodes, parent), used - 2, done, checked
        if done < effort.rounds:
            sample_difficult(
                weights, nodes[:used], tried, reach, effort.difficult_share, nodes[used : used + effort.samples], state
            )
    return np.empty((0, 2), np.int64), used - 2, effort.rounds, checked


@njit(cache=True, nogil=True)
def _path_nodes(nodes: CellArray, parent: Ints) -> CellArray:
    """The nodes of the path from the start to the target."""
    count, here = 1, 1
    while here != 0:
        here = parent[here]
        count += 1
    path = np.empty((count, 2), np.int64)
    here = 1
    for i in range(count - 1, -1, -1):
        path[i] = nodes[here]
        here = parent[here]
    return path
