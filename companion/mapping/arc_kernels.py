"""Compiled: what lies on the way of a rover that drives arcs. It knows nothing of MAVLink, missions or planners.

Ways are in evidence cells, x east and y north; headings clockwise from north; curvature per cell, clockwise positive as seen in the
direction of travel. The map comes as the tuple ``Ground``.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

Points = NDArray[np.float64]

FREE, UNSEEN, BLOCKED = 0, 1, 2
"""What a place is for the rover's disc: seen free, not all of it looked at, not to be entered."""
REACHED, STOPPED, LOST = 0, 1, 2
"""How a way ends: at the end of the line, at something in the way, or too far beside the line to follow it."""
STEP_CELLS = 1.0
"""Length of a step along a way."""
LATE_RAD = 0.6 * math.pi
"""A place on the line that lies farther aside cannot be steered for: the rover would have to come round."""


class Ground(NamedTuple):
    """The map as the compiled loops take it: see ``EvidenceMap``. ``home_x``, ``home_y``: the field the rover stands in is never blocked."""

    log_odds: NDArray[np.float32]
    base: NDArray[np.float64]
    penalty: NDArray[np.float32]
    subdivisions: int
    occupied_at: float
    home_x: int
    home_y: int


class Drive(NamedTuple):
    """How the rover drives: all in evidence cells.

    ``backwards``: tail first. ``sharpest``: greatest curvature. ``steering``: change of curvature a cell. ``ahead``: how far ahead on
    the line the place lies that is steered for. ``room``: kept clear round the middle. ``flank``: where the sides must have been seen.
    ``near``: nearer than this they need not. ``astray``: farther beside the line it is lost.
    """

    backwards: bool
    sharpest: float
    steering: float
    ahead: float
    room: float
    flank: float
    near: float
    astray: float


@njit(cache=True, nogil=True)
def gap(ground: Any, x: float, y: float, reach: float) -> float:
    """Distance from a place to the nearest evidence of an obstacle, at most ``reach``."""
    height, width = ground.log_odds.shape
    best = reach
    r = int(math.ceil(reach + 0.5))
    for cy in range(max(0, int(y) - r), min(height, int(y) + r + 1)):
        for cx in range(max(0, int(x) - r), min(width, int(x) + r + 1)):
            if ground.log_odds[cy, cx] >= ground.occupied_at:
                best = min(best, max(math.hypot(cx + 0.5 - x, cy + 0.5 - y) - 0.5, 0.0))
    return best


@njit(cache=True, nogil=True)
def place(ground: Any, x: float, y: float, room: float) -> int:
    """FREE, UNSEEN (its middle) or BLOCKED."""
    height, width = ground.log_odds.shape
    cx, cy, s = int(math.floor(x)), int(math.floor(y)), ground.subdivisions
    if not (0 <= cx < width and 0 <= cy < height):
        return BLOCKED
    fx, fy = cx // s, cy // s
    if ground.base[fy, fx] + ground.penalty[fy, fx] >= 1.0 and (fx != ground.home_x or fy != ground.home_y):
        return BLOCKED
    if gap(ground, x, y, room) < room:
        return BLOCKED
    return UNSEEN if ground.log_odds[cy, cx] == 0.0 else FREE


@njit(cache=True, nogil=True)
def is_unseen(ground: Any, x: float, y: float) -> bool:
    """Whether nobody has looked at a place; beyond the map nobody needs to."""
    height, width = ground.log_odds.shape
    cx, cy = int(math.floor(x)), int(math.floor(y))
    return bool(0 <= cx < width and 0 <= cy < height and ground.log_odds[cy, cx] == 0.0)


@njit(cache=True, nogil=True)
def kept_room(ground: Any, x: float, y: float, room: float, least: float) -> float:
    """The room to keep on a way that begins here: what is nearer than wanted already must not come nearer still."""
    return min(room, max(gap(ground, x, y, room + 1.0) - 0.2, least))


@njit(cache=True, nogil=True)
def arc_clear(
    ground: Any, x: float, y: float, course: float, curvature: float, room: float, length: float, stop_at: int
) -> float:
    """How far the rover can go on an arc (``course``: direction of travel) until it would stand where it is BLOCKED, or where it is
    UNSEEN if ``stop_at`` says so; at most ``length``.
    """
    gone = 0.0
    while gone < length:
        step = min(STEP_CELLS, length - gone)
        middle = course + 0.5 * curvature * step
        x, y, course = x + step * math.sin(middle), y + step * math.cos(middle), course + curvature * step
        if place(ground, x, y, room) >= stop_at:
            return gone
        gone += step
    return gone


@njit(cache=True, nogil=True)
def steered(line: Points, at: int, x: float, y: float, course: float, ahead: float) -> tuple[int, float, float]:
    """Pure pursuit (Coulter 1992): the arc to the place on the line that lies so far ahead.

    Returns where on the line the rover is (never before ``at``), the arc's curvature, and how far aside the place lies.
    """
    last = len(line) - 1
    while at < last and math.hypot(line[at + 1, 0] - x, line[at + 1, 1] - y) <= math.hypot(
        line[at, 0] - x, line[at, 1] - y
    ):
        at += 1
    aim = at
    while aim < last and math.hypot(line[aim, 0] - x, line[aim, 1] - y) < ahead:
        aim += 1
    to_x, to_y = line[aim, 0] - x, line[aim, 1] - y
    if aim == last and last > 0:
        # Near its end the line is thought to go on straight, lest the rover swerve for the last bit.
        size = max(math.hypot(line[last, 0] - line[last - 1, 0], line[last, 1] - line[last - 1, 1]), 1e-9)
        more = max(ahead - math.hypot(to_x, to_y), 0.0)
        to_x += more * (line[last, 0] - line[last - 1, 0]) / size
        to_y += more * (line[last, 1] - line[last - 1, 1]) / size
    distance = max(math.hypot(to_x, to_y), 1e-6)
    aside = (math.atan2(to_x, to_y) - course + math.pi) % (2.0 * math.pi) - math.pi
    return at, 2.0 * math.sin(aside) / distance, aside


@njit(cache=True, nogil=True)
def follow(
    ground: Any, drive: Any, line: Points, at: int, x: float, y: float, heading: float, curvature: float, length: float
) -> tuple[int, float, float, float]:
    """Play through how the rover follows a line, from its pose and the curvature it drives now, for at most ``length``.

    Returns how that ends, how far it gets before something is in the way or it is lost, how far its middle and flanks have been seen
    (both inf if that is never so), and the curvature to steer now.
    """
    course = heading + math.pi if drive.backwards else heading
    gone, seen = 0.0, math.inf
    wanted_now = math.nan
    last = len(line) - 1
    end, clear = REACHED, math.inf
    while gone < length:
        at, wanted, aside = steered(line, at, x, y, course, drive.ahead)
        wanted = min(max(wanted, -drive.sharpest), drive.sharpest)
        if math.isnan(wanted_now):
            wanted_now = wanted
        off = math.hypot(line[at, 0] - x, line[at, 1] - y)
        if at == last and (off < STEP_CELLS or abs(aside) > 0.5 * math.pi):
            break
        if abs(aside) > LATE_RAD or off > drive.astray:
            end, clear = LOST, gone
            break
        curvature += min(max(wanted - curvature, -drive.steering * STEP_CELLS), drive.steering * STEP_CELLS)
        middle = course + 0.5 * curvature * STEP_CELLS
        x, y = x + STEP_CELLS * math.sin(middle), y + STEP_CELLS * math.cos(middle)
        course += curvature * STEP_CELLS
        state = place(ground, x, y, drive.room)
        if state == BLOCKED:
            end, clear = STOPPED, gone
            break
        if gone < seen and (
            state == UNSEEN or (gone > drive.near and _flank_unseen(ground, x, y, course, drive.flank))
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
