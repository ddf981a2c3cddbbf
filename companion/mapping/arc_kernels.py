"""Compiled loops over the evidence raster for a rover on arcs: clear length of an arc, pure pursuit along a line.

Lengths and places are in evidence cells, x east and y north; headings are clockwise from north; a curvature is per
cell, clockwise positive as seen in the direction of travel. The map comes as the tuple ``EvidenceArrays``.

Nouns: pure pursuit, curvature.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from companion.mapping.evidence_kernels import nearest

Points = NDArray[np.float64]

FREE, UNSEEN, BLOCKED = 0, 1, 2
"""A place for the middle of the rover's disc: seen free, not seen yet, not to be entered."""
REACHED, STOPPED, LOST = 0, 1, 2
"""How following a line ends: at its end, at an obstacle, or too far beside the line to follow it."""
STEP_CELLS = 1.0
"""Length of a step along an arc."""
TAIL_RAD = math.pi / 3.0
"""The rim of a rover that goes backwards must be on seen ground so far to either side of the direction of travel."""
LATE_RAD = 0.6 * math.pi
"""A place on the line that lies farther aside cannot be steered for: the rover would have to turn round first."""


class EvidenceArrays(NamedTuple):
    """An ``EvidenceMap`` for the compiled loops. The field (``own_x``, ``own_y``) of the rover is never blocked."""

    log_odds: NDArray[np.float32]
    base: NDArray[np.float64]
    penalty: NDArray[np.float32]
    subdivisions: int
    occupied_at: float
    own_x: int
    own_y: int


class Start(NamedTuple):
    """A place, the heading there and the curvature driven there."""

    x: float
    y: float
    heading: float
    curvature: float


class Following(NamedTuple):
    """How the rover follows a line; lengths in evidence cells.

    ``backwards``: tail first. ``sharpest``: greatest curvature. ``steering``: greatest change of curvature over one
    cell. ``lookahead``: how far ahead on the line the place lies that is steered for. ``room``: kept clear round
    the middle. ``flank``: how far beside the middle the ground must have been seen, from ``near`` on. ``tail``: see
    ``is_tail_unseen``; 0 for a rover that goes forwards. ``astray``: farther beside the line the rover is lost.
    """

    backwards: bool
    sharpest: float
    steering: float
    lookahead: float
    room: float
    flank: float
    near: float
    tail: float
    astray: float


@njit(cache=True, nogil=True)
def place(ground: Any, x: float, y: float, room: float) -> int:
    """FREE, UNSEEN (its middle) or BLOCKED."""
    height, width = ground.log_odds.shape
    cx, cy, s = int(math.floor(x)), int(math.floor(y)), ground.subdivisions
    if not (0 <= cx < width and 0 <= cy < height):
        return BLOCKED
    fx, fy = cx // s, cy // s
    if ground.base[fy, fx] + ground.penalty[fy, fx] >= 1.0 and (fx != ground.own_x or fy != ground.own_y):
        return BLOCKED
    if nearest(ground.log_odds, x, y, room, ground.occupied_at) < room:
        return BLOCKED
    return UNSEEN if ground.log_odds[cy, cx] == 0.0 else FREE


@njit(cache=True, nogil=True)
def is_unseen(ground: Any, x: float, y: float) -> bool:
    """Whether a place of the map has not been seen; beyond the map nothing needs to be seen."""
    height, width = ground.log_odds.shape
    cx, cy = int(math.floor(x)), int(math.floor(y))
    return bool(0 <= cx < width and 0 <= cy < height and ground.log_odds[cy, cx] == 0.0)


@njit(cache=True, nogil=True)
def is_tail_unseen(ground: Any, x: float, y: float, course: float, tail: float) -> bool:
    """Whether the rim of a rover that goes backwards, ``tail`` away from its middle, lies on unseen ground.

    ``course``: direction of travel. A single cell does not count: such holes are left between readings. With a ``tail``
    of 0 nothing does.
    """
    if tail <= 0.0:
        return False
    pieces = int(math.ceil(2.0 * TAIL_RAD * tail))
    for at in range(pieces + 1):
        towards = course + TAIL_RAD * (2.0 * at / pieces - 1.0)
        rim_x, rim_y = x + tail * math.sin(towards), y + tail * math.cos(towards)
        if is_unseen(ground, rim_x, rim_y) and (
            is_unseen(ground, rim_x - 1.0, rim_y)
            or is_unseen(ground, rim_x + 1.0, rim_y)
            or is_unseen(ground, rim_x, rim_y - 1.0)
            or is_unseen(ground, rim_x, rim_y + 1.0)
        ):
            return True
    return False


@njit(cache=True, nogil=True)
def kept_room(ground: Any, x: float, y: float, room: float, least: float) -> float:
    """The room to keep on an arc that begins here: an obstacle nearer than that already must not come nearer still."""
    gap = nearest(ground.log_odds, x, y, room + 1.0, ground.occupied_at)
    return float(min(room, max(gap - 0.2, least)))


@njit(cache=True, nogil=True)
def is_beside_gap(ground: Any, x: float, y: float, room: float, gap: float) -> bool:
    """Whether ground within ``room`` has not been seen and has an obstacle nearer than ``gap``: a wall may go on there.

    With a ``gap`` of 0 nothing does.
    """
    if gap <= 0.0:
        return False
    for cy in range(int(math.floor(y - room)), int(math.floor(y + room)) + 1):
        for cx in range(int(math.floor(x - room)), int(math.floor(x + room)) + 1):
            middle_x, middle_y = cx + 0.5, cy + 0.5
            if math.hypot(middle_x - x, middle_y - y) > room or not is_unseen(ground, middle_x, middle_y):
                continue
            if nearest(ground.log_odds, middle_x, middle_y, gap, ground.occupied_at) < gap:
                return True
    return False


@njit(cache=True, nogil=True)
def arc_clear(
    ground: Any,
    x: float,
    y: float,
    course: float,
    curvature: float,
    room: float,
    length: float,
    stop_at: int,
    gap: float,
    tail: float,
) -> float:
    """How far the rover can go on an arc before it stands on a place of kind ``stop_at`` (UNSEEN or BLOCKED) or worse.

    At most ``length``. ``course``: direction of travel. ``gap``: see ``is_beside_gap``; it does not stand there either.
    ``tail``: see ``is_tail_unseen``; it does not come there.
    """
    gone = 0.0
    while gone < length:
        step = min(STEP_CELLS, length - gone)
        middle = course + 0.5 * curvature * step
        x, y, course = x + step * math.sin(middle), y + step * math.cos(middle), course + curvature * step
        if place(ground, x, y, room) >= stop_at or is_beside_gap(ground, x, y, room, gap):
            return gone
        if is_tail_unseen(ground, x, y, course, tail):
            return gone
        gone += step
    return gone


@njit(cache=True, nogil=True)
def pursue(line: Points, at: int, x: float, y: float, course: float, lookahead: float) -> tuple[int, float, float]:
    """Pure pursuit (Coulter 1992): the arc to the place on the line that lies ``lookahead`` ahead.

    Returns where on the line the rover is (never before ``at``), the arc's curvature, and how far aside the place lies.
    """
    last = len(line) - 1
    while at < last and math.hypot(line[at + 1, 0] - x, line[at + 1, 1] - y) <= math.hypot(
        line[at, 0] - x, line[at, 1] - y
    ):
        at += 1
    aim = at
    while aim < last and math.hypot(line[aim, 0] - x, line[aim, 1] - y) < lookahead:
        aim += 1
    to_x, to_y = line[aim, 0] - x, line[aim, 1] - y
    if aim == last and last > 0:
        # Near its end the line is extended straight on, so that the rover does not swerve for the last bit.
        size = max(math.hypot(line[last, 0] - line[last - 1, 0], line[last, 1] - line[last - 1, 1]), 1e-9)
        more = max(lookahead - math.hypot(to_x, to_y), 0.0)
        to_x += more * (line[last, 0] - line[last - 1, 0]) / size
        to_y += more * (line[last, 1] - line[last - 1, 1]) / size
    distance = max(math.hypot(to_x, to_y), 1e-6)
    aside = (math.atan2(to_x, to_y) - course + math.pi) % (2.0 * math.pi) - math.pi
    return at, 2.0 * math.sin(aside) / distance, aside


@njit(cache=True, nogil=True)
def follow(ground: Any, following: Any, line: Points, start: Any, length: float) -> tuple[int, float, float, float]:
    """Play through how the rover follows a line, from its pose and the curvature it drives now, for at most ``length``.

    Returns how that ends, how far the rover gets before it meets an obstacle or is lost, how far its middle,
    flanks and tail have been seen (both inf if that never ends), and the curvature to steer now.
    """
    at, x, y, curvature = 0, start.x, start.y, start.curvature
    course = start.heading + math.pi if following.backwards else start.heading
    gone, seen = 0.0, math.inf
    wanted_now = math.nan
    last = len(line) - 1
    end, clear = REACHED, math.inf
    while gone < length:
        at, wanted, aside = pursue(line, at, x, y, course, following.lookahead)
        wanted = min(max(wanted, -following.sharpest), following.sharpest)
        if math.isnan(wanted_now):
            wanted_now = wanted
        off = math.hypot(line[at, 0] - x, line[at, 1] - y)
        if at == last and (off < STEP_CELLS or abs(aside) > 0.5 * math.pi):
            break
        if abs(aside) > LATE_RAD or off > following.astray:
            end, clear = LOST, gone
            break
        curvature += min(max(wanted - curvature, -following.steering * STEP_CELLS), following.steering * STEP_CELLS)
        middle = course + 0.5 * curvature * STEP_CELLS
        x, y = x + STEP_CELLS * math.sin(middle), y + STEP_CELLS * math.cos(middle)
        course += curvature * STEP_CELLS
        state = place(ground, x, y, following.room)
        if state == BLOCKED:
            end, clear = STOPPED, gone
            break
        if gone < seen and (
            state == UNSEEN
            or (gone > following.near and _flank_unseen(ground, x, y, course, following.flank))
            or is_tail_unseen(ground, x, y, course, following.tail)
        ):
            seen = gone
        gone += STEP_CELLS
    if math.isnan(wanted_now):
        wanted_now = 0.0
    return end, clear, seen, wanted_now


@njit(cache=True, nogil=True)
def _flank_unseen(ground: Any, x: float, y: float, course: float, offset: float) -> bool:
    side_x, side_y = offset * math.cos(course), -offset * math.sin(course)
    return is_unseen(ground, x + side_x, y + side_y) or is_unseen(ground, x - side_x, y - side_y)
