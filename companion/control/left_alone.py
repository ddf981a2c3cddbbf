"""Left alone: where a rover goes that is told one thing and then nothing more, and what its outline meets there.

This is the last look's own reckoning of ways and of what stands there: it asks each cell of the evidence map under the
outline, not a field of distances or a line, and follows the rover in steps of its own. So an error in that is not
repeated here. What is known of the rover (``Following``), how far it may turn off that (``turn_gains``) and what it was
told it has from where the controllers have it. It is a little milder, so that it speaks only where something is wrong.

Nouns: left alone.
"""

# mypy: disable-error-code="no-untyped-def"

from __future__ import annotations

import math
from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from companion.control.following import SOON_S, Following, turn_gains
from companion.control.local_view import LocalView
from companion.control.told import in_force
from companion.mapping.evidence_map import EvidenceMap
from companion.vehicle.commands import GuidedVelocity

STEP_S = 0.05
ANY_S = 0.1
"""The outline is looked at so often."""
MOST_STEPS = 1200
"""A rover that does not stand by then never does."""
STANDS_M_S, STANDS_RAD_S = 0.02, 0.02
NEARER_M, NEARER_UNSEEN_M = 0.05, 0.1
"""So deep the outline may lie over the middle of a cell, and the rover's middle in a closed field: steps in time and
cells make ways differ by as much."""
AWAY_M, AWAY = 0.02, 0.1
"""A rover whose outline lies deeper over something may get so much deeper, so that it gets away; but with each metre it
must get out of it by the second."""
UNDER_M, BESIDE = 0.1, 1.5
"""No sensor sees the ground on which the rover can turn and so much round it, nor what lies that many times its half
width, and so much, beside it: a lidar of 90 degrees sees little of that where a rover begins."""

CORNER = 0.75
"""A rover at the border of its field may cut the corner of a closed one within this share of a field's side."""
PIECE_M = 0.05
"""A way of the middle is looked at so often."""
TURN_RAD = 0.1
"""So often the outline is looked at while the rover turns on the spot."""

Places = NDArray[np.float64]
"""Shape (n, 4): metres north and east of the map's corner, heading, forward speed."""


class Met(IntEnum):
    """What comes first on a way."""

    NOTHING = 0
    OBSTACLE = 1
    UNSEEN = 2
    CLOSED = 3
    ENDLESS = 4


class Rover(NamedTuple):
    """The worst that may be: it gains speed fast and brakes badly."""

    gains_m_s2: float
    brakes_m_s2: float
    turns_rad_s2: float


class Outline(NamedTuple):
    """How far it reaches ahead, back and to either side; a circle reaches as far everywhere."""

    front_m: float
    rear_m: float
    half_width_m: float
    is_circle: bool


class Rasters(NamedTuple):
    """The map's rasters."""

    log_odds: Any
    stamps: Any
    base: Any
    penalty: Any
    cell_m: float
    occupied_at: float


def ways_left_alone(setpoint: GuidedVelocity, view: LocalView) -> list[Places] | None:
    """The ways on which it may end, as it turns as told, less or more, and obeys late or soon; None if it would never
    stand."""
    follows, lasts_s = view.following, view.settings.guidance.velocity_lasts_s
    start = np.array((*_from_corner(view), view.pose.heading_rad, view.shoots_m_s, view.yaw_rate_rad_s))
    ways = []
    for obeys_s in _obeys_s(view):
        tells = _tells(setpoint, view, obeys_s)
        for gain in turn_gains(follows, lasts_s):
            places, stands = way_of(start, tells, obeys_s + lasts_s, follows.turn_gain * gain, _worst(follows))
            if not stands:
                return None
            ways.append(places)
    return ways


def once_turned_back(places: Places, setpoint: GuidedVelocity, view: LocalView) -> Places:
    """The way from where it rolls as told; until then a rover that rolled the other way brakes."""
    if setpoint.forward_m_s * view.forward_m_s >= 0.0:
        return places
    turned = np.flatnonzero(places[:, 3] * setpoint.forward_m_s > 0.0)
    return places[min(turned[0] if len(turned) else len(places), len(places) - 2) :]


def turned_on_the_spot(bearing_rad: float, view: LocalView) -> Places:
    """The rover turned the shorter way to a bearing, where it is."""
    heading_rad = view.pose.heading_rad
    turn_rad = math.remainder(bearing_rad - heading_rad, 2.0 * math.pi)
    headings_rad = heading_rad + np.linspace(0.0, turn_rad, 2 + math.ceil(abs(turn_rad) / TURN_RAD))
    places = np.zeros((len(headings_rad), 4))
    places[:, :2], places[:, 2] = _from_corner(view), headings_rad
    return places


def along(
    way: NDArray[np.float64], radius_m: float, evidence: EvidenceMap, deep_m: float, away: float = AWAY
) -> tuple[int, int]:
    """How many places of a way a disc of this radius passes before it lies over something that stands there, over a
    closed field or off the map; and how many before its middle is on unseen ground.

    ``way``: shape (n, 2), metres north and east in the local frame. ``away``: with each metre the disc must get out of
    what it lies over at first by so much. ``deep_m``: so deep it may lie over anything. A thing may fill the whole of
    its cell.
    """
    corner, reach_m = evidence.base.south_west, radius_m + 0.5 * evidence.evidence_m
    disc = Outline(reach_m, reach_m, reach_m, True)
    clear, seen = passes(way - np.array((corner.north_m, corner.east_m)), disc, away, deep_m, _rasters(evidence))
    return int(clear), int(seen)


def first_met(places: Places, view: LocalView) -> Met:
    """What the outline meets first on a way, of all that is known; unseen ground does not count round the rover."""
    footprint = view.footprint
    outline = Outline(footprint.front_m, footprint.rear_m, footprint.half_width_m, footprint.is_circle)
    under_m = max(footprint.radius_m, BESIDE * footprint.half_width_m) + UNDER_M
    here = _from_corner(view)
    return Met(meets(places, outline, here, under_m, _rasters(view.evidence)))


def _from_corner(view: LocalView) -> tuple[float, float]:
    """The rover's place, metres north and east of the map's corner."""
    corner, pose = view.evidence.base.south_west, view.pose
    return pose.north_m - corner.north_m, pose.east_m - corner.east_m


def _rasters(evidence: EvidenceMap) -> Rasters:
    return Rasters(
        evidence.log_odds,
        evidence.stamps,
        evidence.base.weights,
        evidence.penalty,
        evidence.evidence_m,
        evidence.settings.occupied_at,
    )


def _worst(follows: Following) -> Rover:
    brakes_m_s2 = follows.deceleration_m_s2 * (1.0 - follows.off_model)
    return Rover(follows.gains_most_m_s2, brakes_m_s2, follows.turn_acceleration_rad_s2)


def _obeys_s(view: LocalView) -> tuple[float, ...]:
    """When a command has its effect, in whole steps: at the latest, and over a late link, or if it lasts, also at the
    soonest. It lasts on from there, so later leads farther; but a turn that is under way may end sooner.
    """
    follows = view.following
    latest_s = math.ceil(follows.dead_s * (1.0 + follows.off_model) / STEP_S - 1e-6) * STEP_S
    if view.soonest_s >= follows.dead_s and view.settings.guidance.velocity_lasts_s <= SOON_S:
        return (latest_s,)
    soonest_s = min(view.soonest_s, follows.dead_s) * (1.0 - follows.off_model)
    return latest_s, math.floor(soonest_s / STEP_S + 1e-6) * STEP_S


def _tells(setpoint: GuidedVelocity, view: LocalView, obeys_s: float) -> NDArray[np.float64]:
    """From when on which speed and turn rate have their effect, one a row; the last one is the setpoint's.

    Where no velocity was told, the rover goes on as it does; a position tells it to drive on, as fast as was told for
    that; as fast as the mission says where that is not known.
    """
    now_s, on_m_s = view.pose.time_s, view.forward_m_s
    if view.by_position(now_s - obeys_s):
        on_m_s = view.placed_m_s if math.isfinite(view.placed_m_s) else view.rover.cruise_speed_m_s
    first = in_force(view.lately, now_s - obeys_s)
    rows = [(-math.inf, on_m_s, view.yaw_rate_rad_s) if first is None else (-math.inf, *first[1:])]
    later = (one for one in view.lately if one.time_s > now_s - obeys_s)
    rows += [(one.time_s - now_s + obeys_s, one.speed_m_s, one.turn_rad_s) for one in later]
    return np.array([*rows, (obeys_s, setpoint.forward_m_s, setpoint.yaw_rate_rad_s)])


@njit(cache=True, nogil=True)
def way_of(start, tells, ends_s, turn_gain, rover):
    """The way of a rover that does what ``tells`` and then brakes, and whether it comes to stand.

    ``start``: north, east, heading, forward speed, turn rate.
    """
    north, east, heading, speed, turn = start
    every = int(round(ANY_S / STEP_S))
    places = np.empty((MOST_STEPS // every + 2, 4))
    places[0] = north, east, heading, speed
    at, count = 0, 1
    for step in range(MOST_STEPS):
        middle_s = (step + 0.5) * STEP_S
        while at + 1 < tells.shape[0] and tells[at + 1, 0] <= middle_s:
            at += 1
        goes_m_s, turns_rad_s = 0.0, 0.0
        if middle_s < ends_s:
            goes_m_s, turns_rad_s = tells[at, 1], turn_gain * tells[at, 2]
        slows = speed * (goes_m_s - speed) < 0.0
        most = (rover.brakes_m_s2 if slows else rover.gains_m_s2) * STEP_S
        most_turn = rover.turns_rad_s2 * STEP_S
        speed = min(max(goes_m_s, speed - most), speed + most)
        turned = min(max(turns_rad_s, turn - most_turn), turn + most_turn)
        turns, turn = 0.5 * (turn + turned) * STEP_S, turned
        heading += 0.5 * turns
        north += speed * STEP_S * math.cos(heading)
        east += speed * STEP_S * math.sin(heading)
        heading += 0.5 * turns
        stands = middle_s >= ends_s and abs(speed) < STANDS_M_S and abs(turn) < STANDS_RAD_S
        if stands or (step + 1) % every == 0:
            places[count] = north, east, heading, speed
            count += 1
        if stands:
            return places[:count], True
    return places[:count], False


@njit(cache=True, nogil=True)
def _inside_m(outline, forward_m, right_m):
    """How deep a place lies in the outline; below 0 outside."""
    if outline.is_circle:
        return outline.front_m - math.hypot(forward_m, right_m)
    return min(outline.front_m - forward_m, outline.rear_m + forward_m, outline.half_width_m - abs(right_m))


@njit(cache=True, nogil=True)
def _deepest(place, outline, under, under_m, evidence):
    """How deep the outline lies over obstacles, and over ground that is unseen or off the map; below 0: not at all."""
    height, width = evidence.log_odds.shape
    cell_m, north, east = evidence.cell_m, place[0], place[1]
    sine, cosine = math.sin(place[2]), math.cos(place[2])
    reach_m = math.hypot(max(outline.front_m, outline.rear_m), outline.half_width_m)
    obstacle_m = unseen_m = -1.0
    for y in range(int(math.floor((north - reach_m) / cell_m)), int(math.ceil((north + reach_m) / cell_m))):
        for x in range(int(math.floor((east - reach_m) / cell_m)), int(math.ceil((east + reach_m) / cell_m))):
            found = 0.0
            if 0 <= y < height and 0 <= x < width:
                found = evidence.log_odds[y, x]
            if found != 0.0 and found < evidence.occupied_at:
                continue
            to_north, to_east = (y + 0.5) * cell_m - north, (x + 0.5) * cell_m - east
            deep_m = _inside_m(outline, to_north * cosine + to_east * sine, to_east * cosine - to_north * sine)
            if found != 0.0:
                obstacle_m = max(obstacle_m, deep_m)
            elif math.hypot((y + 0.5) * cell_m - under[0], (x + 0.5) * cell_m - under[1]) > under_m or _was_seen(
                y, x, evidence
            ):
                unseen_m = max(unseen_m, deep_m)
    return obstacle_m, unseen_m


@njit(cache=True, nogil=True)
def _was_seen(y, x, evidence):
    """Whether an unknown cell was an obstacle once, and forgotten."""
    return 0 <= y < evidence.stamps.shape[0] and 0 <= x < evidence.stamps.shape[1] and evidence.stamps[y, x] > 0


@njit(cache=True, nogil=True)
def _is_closed(north, east, evidence, by_experience):
    """Whether a place is in a field that mission or fence closes, or experience, if that is asked for."""
    rows, columns = evidence.base.shape
    field_m = evidence.cell_m * (evidence.log_odds.shape[0] // rows)
    y, x = int(math.floor(north / field_m)), int(math.floor(east / field_m))
    if not (0 <= y < rows and 0 <= x < columns):
        return False
    return evidence.base[y, x] >= 1.0 or (by_experience and evidence.base[y, x] + evidence.penalty[y, x] >= 1.0)


@njit(cache=True, nogil=True)
def _is_deep_in_closed(place, evidence, by_experience):
    """Whether the rover's middle lies so deep in closed fields: it may cut a corner of one."""
    north, east = place[0], place[1]
    return (
        _is_closed(north - NEARER_M, east, evidence, by_experience)
        and _is_closed(north + NEARER_M, east, evidence, by_experience)
        and _is_closed(north, east - NEARER_M, evidence, by_experience)
        and _is_closed(north, east + NEARER_M, evidence, by_experience)
    )


@njit(cache=True, nogil=True)
def meets(places, outline, under, under_m, evidence):
    """The number of a ``Met``. Ground counts as seen within ``under_m`` of the place ``under``.

    Fields that experience has closed do not keep the rover there: they count only farther away than it reaches.
    """
    begins_m, _ = _deepest(places[0], outline, under, under_m, evidence)
    reach_m = math.hypot(max(outline.front_m, outline.rear_m), outline.half_width_m)
    was_closed = _is_deep_in_closed(places[0], evidence, True)
    for at in range(1, places.shape[0]):
        obstacle_m, unseen_m = _deepest(places[at], outline, under, under_m, evidence)
        gone_m = math.hypot(places[at, 0] - places[0, 0], places[at, 1] - places[0, 1])
        if obstacle_m > max(begins_m + AWAY_M - AWAY * gone_m, NEARER_M):
            return 1
        if unseen_m > NEARER_UNSEEN_M:
            return 2
        closed = _is_deep_in_closed(places[at], evidence, gone_m > reach_m)
        if closed and not was_closed:
            return 3
        was_closed = closed
    return 0


@njit(cache=True, nogil=True)
def passes(way, disc, away, deep_m, evidence):
    """See ``along``; places count from the map's corner. What the disc lies over at first may be left, not entered.
    Experience may have closed the field that it begins in."""
    place = np.array((way[0, 0], way[0, 1], 0.0))
    begins_m, _ = _deepest(place, disc, way[0], math.inf, evidence)
    height, width = evidence.log_odds.shape
    cell_m, count = evidence.cell_m, way.shape[0]
    field_m = cell_m * (height // evidence.base.shape[0])
    own_y, own_x = math.floor(way[0, 0] / field_m), math.floor(way[0, 1] / field_m)
    seen, unseen_m = count, -PIECE_M
    for at in range(1, count):
        place[0], place[1] = way[at, 0], way[at, 1]
        y, x = int(math.floor(place[0] / cell_m)), int(math.floor(place[1] / cell_m))
        gone_m = math.hypot(way[at, 0] - way[0, 0], way[at, 1] - way[0, 1])
        if not (0 <= y < height and 0 <= x < width):
            return at, min(seen, at)
        unseen_m = unseen_m + PIECE_M if evidence.log_odds[y, x] == 0.0 else -PIECE_M
        if unseen_m > 0.5 * cell_m and seen == count:
            seen = at - int(round(unseen_m / PIECE_M))  # a corner of a cell alone does not count
        lies_m, _ = _deepest(place, disc, way[0], math.inf, evidence)
        if lies_m > max(begins_m + AWAY_M - away * gone_m, deep_m):
            return at, seen
        is_own = math.floor(place[0] / field_m) == own_y and math.floor(place[1] / field_m) == own_x
        if gone_m > CORNER * field_m and _is_deep_in_closed(place, evidence, not is_own):
            return at, seen
    return count, seen
