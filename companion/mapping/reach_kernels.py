"""Compiled search for the farthest place where the rover may be left alone with a target; lengths in evidence cells.

``control/safe_reach`` says what is asked for and why. Places are (x, y): x east, y north.
"""

# mypy: disable-error-code="no-untyped-def"

import math
from typing import NamedTuple

from numba import njit

from companion.mapping.evidence_kernels import first_unseen, look_at_line, look_beside


class Stopping(NamedTuple):
    """How the rover comes to a target and stands.

    ``radius``: of the rover. ``map_radius``: of the rover that the map was made for. ``room``: kept beside it on
    the way. ``overshoot``: at most so far beyond the target it stands, and at most a tenth of the distance, or
    ``rolling``, which counts on the speed that it has.
    ``held``: so much farther, whatever the distance, because the ground holds it. ``unsure``: an obstacle may
    stand, and ground that was seen may end, so much nearer than on the map. ``flank``: so far beside the middle the
    ground must have been seen, from ``near`` on. ``slack``: lengths that differ by less are equal. ``edge``: left
    between a place and the edge of the map.
    """

    radius: float
    map_radius: float
    room: float
    overshoot: float
    rolling: float
    held: float
    unsure: float
    flank: float
    near: float
    slack: float
    edge: float


@njit(cache=True, nogil=True)
def may_stop_at(ground, start, target, stopping):
    """Whether the rover, sent straight from start to target, stands on ground seen free, with nothing beside its way.

    Its front must come to lie on seen ground, too, and so must its flanks all the way.
    """
    east, north = target[0] - start[0], target[1] - start[1]
    distance = math.hypot(east, north)
    if distance == 0.0:
        return True
    ahead = (east / distance, north / distance)
    room, enough = stopping.radius + stopping.room, distance - stopping.slack
    length, seen = _at_line(ground, start, target)
    if seen < enough or _beside(ground, start, target, length, room, stopping) < enough:
        return False
    overshoot = min(stopping.overshoot, max(0.1 * distance, stopping.rolling)) + stopping.held
    stands = moved_within_map(ground, target, ahead, overshoot, stopping.edge)
    length = math.hypot(stands[0] - start[0], stands[1] - start[1])
    # The flanks first: with thin beams they fail most often.
    if first_unseen(ground.log_odds, start, stands, stopping.flank, stopping.near)[0] < length - 1e-6:
        return False
    if _at_line(ground, start, stands)[1] < length - stopping.slack:
        return False
    unsure = min(stopping.unsure, 0.05 * distance)
    # A cell counts by its middle, and what it stands for may begin half a cell before.
    beyond = moved_within_map(ground, target, ahead, overshoot + unsure + 0.5, stopping.edge)
    length = math.hypot(beyond[0] - start[0], beyond[1] - start[1])
    open_for = _at_line(ground, start, beyond)[0]
    if _beside(ground, start, beyond, open_for, stopping.radius, stopping) < length - 1e-6:
        return False
    front = moved_within_map(ground, stands, ahead, stopping.radius + unsure, stopping.edge)
    return _at_line(ground, stands, front)[1] >= math.hypot(front[0] - stands[0], front[1] - stands[1]) - stopping.slack


@njit(cache=True, nogil=True)
def first_to_stop_at(ground, start, targets, limit, stopping):
    """The index of the first target, shape (n, 2), that is near enough and may be stopped at; -1 if there is none."""
    for index in range(len(targets)):
        target = (targets[index, 0], targets[index, 1])
        distance = math.hypot(target[0] - start[0], target[1] - start[1])
        if stopping.slack <= distance <= limit and may_stop_at(ground, start, target, stopping):
            return index
    return -1


@njit(cache=True, nogil=True)
def stops_in_a_row(ground, start, targets, stopping):
    """How many targets, shape (n, 2), from the first one on may be stopped at."""
    for index in range(len(targets)):
        if not may_stop_at(ground, start, (targets[index, 0], targets[index, 1]), stopping):
            return index
    return len(targets)


@njit(cache=True, nogil=True)
def _at_line(ground, start, end):
    return look_at_line(ground.log_odds, ground.base, ground.penalty, start, end)


@njit(cache=True, nogil=True)
def _beside(ground, start, end, length, half_width, stopping):
    return look_beside(ground.log_odds, start, end, length, half_width, stopping.map_radius, ground.occupied_at)


@njit(cache=True, nogil=True)
def moved_within_map(ground, place, ahead, distance, edge):
    """The place so far ahead, or as far as the map reaches."""
    height, width = ground.log_odds.shape
    for size, at, step in ((width, place[0], ahead[0]), (height, place[1], ahead[1])):
        room = size - at if step > 0.0 else at
        if abs(step) * distance > room - edge:
            distance = max(room - edge, 0.0) / abs(step)
    return place[0] + distance * ahead[0], place[1] + distance * ahead[1]
