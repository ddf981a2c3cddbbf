"""Obstacles under a straight line from field to field, and detours along their corners. Compiled.

Lines are those of ``raster.line_into``. Fields are numbered row after row: number = y * width + x.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from companion.planning.raster import HALF, ONE, SHIFT, fine_steps

Ints = NDArray[np.int64]


class Ground(NamedTuple):
    """``polygons.Polygons`` with corners as field numbers (-1: outside the map), rule for corners, a cache of lines.

    ``corner_fields`` is in the order of the rings. ``known_lines`` and ``known_counts`` are the cache: a line's place
    in it follows from its ends, and a newer line replaces an older one.
    """

    owner: NDArray[np.int32]
    corner_fields: Ints
    rings: Ints
    obstacle_rings: Ints
    corner_cutting: bool
    known_lines: Ints
    known_counts: NDArray[np.int32]


@njit(cache=True, nogil=True)
def crossings(ground: Ground, start: int, end: int, found: Ints) -> int:
    """How often a line between two free fields enters an obstacle; a cut corner counts too.

    The first of these obstacles are written to ``found``: columns obstacle, last field before it, first field behind
    it.
    """
    owner = ground.owner
    width = owner.shape[1]
    x, y = start % width, start // width
    steps, step_x, step_y = fine_steps(end % width - x, end // width - y)
    fine_x, fine_y = x * ONE + HALF, y * ONE + HALF
    count, inside = 0, 0
    for _ in range(steps):
        from_x, from_y = x, y
        fine_x += step_x
        fine_y += step_y
        x, y = fine_x >> SHIFT, fine_y >> SHIFT
        here = owner[y, x]
        met = here if inside == 0 else 0
        if met == 0 and inside == 0 and not ground.corner_cutting and x != from_x and y != from_y:
            met = max(owner[from_y, x], owner[y, from_x])
        if met > 0:
            if count < len(found):
                found[count, 0], found[count, 1] = met, from_y * width + from_x
                found[count, 2] = y * width + x
            count += 1
        elif inside > 0 and here == 0 and count <= len(found):
            found[count - 1, 2] = y * width + x
        inside = here
    return count


@njit(cache=True, nogil=True)
def crossing_count(ground: Ground, start: int, end: int, nothing: Ints) -> int:
    """``crossings`` without the details, from the cache if the line is in it. ``nothing`` has no rows."""
    line = start * ground.owner.size + end
    mask = len(ground.known_lines) - 1
    place = ((line * 0x9E3779B1) >> 15) & mask
    if ground.known_lines[place] != line:
        ground.known_counts[place] = crossings(ground, start, end, nothing)
        ground.known_lines[place] = line
    return int(ground.known_counts[place])


@njit(cache=True, nogil=True)
def nearest_corner(ground: Ground, obstacle: int, ring: int, field: int) -> int:
    """The corner of an obstacle (of one ring of it, unless that is -1) nearest to a field; -1 if none is on the map."""
    width = ground.owner.shape[1]
    nearest, best = -1, np.inf
    for r in range(ground.obstacle_rings[obstacle - 1], ground.obstacle_rings[obstacle]):
        if ring >= 0 and r != ring:
            continue
        for i in range(ground.rings[r, 0], ground.rings[r, 1]):
            corner = ground.corner_fields[i]
            if corner < 0:
                continue
            dx, dy = corner % width - field % width, corner // width - field // width
            if dx * dx + dy * dy < best:
                nearest, best = i, float(dx * dx + dy * dy)
    return nearest


@njit(cache=True, nogil=True)
def ring_of(ground: Ground, corner: int) -> int:
    """The ring that a corner belongs to."""
    return int(np.searchsorted(ground.rings[:, 1], corner, side="right"))


@njit(cache=True, nogil=True)
def walk(ground: Ground, ring: int, begin: int, end: int, step: int, chain: Ints, used: int) -> int:
    """Add the fields of the corners from ``begin`` to ``end``, either way round the ring, to ``chain[:used]``.

    Returns how many are used then, or -1 if a corner is outside the map or there are too many.
    """
    first, past = ground.rings[ring, 0], ground.rings[ring, 1]
    at = begin
    while True:
        if ground.corner_fields[at] < 0 or used >= len(chain):
            return -1
        chain[used] = ground.corner_fields[at]
        used += 1
        if at == end:
            return used
        at += step
        if at == past:
            at = first
        elif at < first:
            at = past - 1


@njit(cache=True, nogil=True)
def chain_length(width: int, chain: Ints, begin: int, end: int) -> float:
    """Length of the straight lines through ``chain[begin:end]``."""
    total = 0.0
    for i in range(begin + 1, end):
        total += np.hypot(chain[i] % width - chain[i - 1] % width, chain[i] // width - chain[i - 1] // width)
    return total


@njit(cache=True, nogil=True)
def pulled(ground: Ground, chain: Ints, used: int, reach: int, nothing: Ints) -> int:
    """Drop the points of a chain that a free line can skip, at most ``reach`` at a time. Returns how many are left."""
    kept, at = 1, 0
    while at < used - 1:
        ahead = min(at + reach, used - 1)
        while ahead > at + 1 and crossing_count(ground, chain[at], chain[ahead], nothing) > 0:
            ahead -= 1
        chain[kept] = chain[ahead]
        kept += 1
        at = ahead
    return kept
