"""Object tracker: which of the things that the range sensors see are moving, and where to.

Ground on which something stands was never seen free. So readings count that end on ground that had been seen free all
round. So do those of a narrow thing that stands alone, with nothing near on either side; but what stands seems to move,
too, when it is seen from another side, so such a thing must be faster. So must a piece, on free ground, of something
larger that mostly is not: a wall, a piece of which was taken for free ground because the position was not exact.
Where the edge of the view cuts one off, its other side is followed. Readings that lie together are one thing, and a
thing whose place changes evenly from scan to scan moves. The map does not use this: there a moving thing is evidence
like any other, and is freed behind it.

Nouns: object tracker.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numba import njit
from numpy.typing import NDArray

from companion.core.frames import NedPoint, Pose
from companion.core.scan import RangeScan
from companion.mapping.evidence_map import EvidenceMap
from companion.mapping.lazy_zeros import lazy_zeros
from companion.perception.moving_obstacles import Moving
from companion.settings import TrafficSettings

Points = NDArray[np.float64]

FREE_AT = -0.5
"""Log-odds from which ground counts as seen free."""
ROUND_M, FINE_ROUND_M = 0.35, 0.5
"""Ground must have been free this far round a reading, and half a beam's width more: neither is exact.

With more, what moves among posts is seen late; with less, walls seem to move. Fine beams free ground close beside legs
and posts, too.
"""
TOGETHER_M = 0.8
"""Readings nearer to each other than this are of one thing; it is found again this near to where it is expected."""
GOES_ON_M = 0.5
"""A thing goes on with the next reading if that lies this near, and half a beam's width more."""
WIDEST_SINGLE_M = 0.3
"""A single reading of a beam that is wider there may be of a wall that is seen at a flat angle, if it does not stand
alone."""
WIDEST_M = 3.0
"""Anything wider is not a thing that moves but ground with an error of position."""
WINDOW_S = 1.0
LEAST_S, LEAST_SIGHTINGS = 0.28, 4
"""Four scans at 10 Hz, which do not come exactly 0.1 s apart."""
CUT_SIGHTINGS = 5
"""Of what the edge of the view cuts off, where the ground was never seen free: a trunk, seen by a rover that turns."""
LOST_S = 1.0
LEAST_RADIUS_M = 0.4
STRAY_M = 0.15
"""Sightings of a thing that moves evenly lie this near to a line, on average, and half a beam's width more."""
SURE = 2.5
"""A velocity counts from this many times its own standard error on."""
DOUBT_M = 0.25
"""Added to the radius of a thing that is only seen: neither its place nor its size is exact."""
LEAST_BEAMS = 8
"""A few thin beams cannot tell what moves from what the rover passes."""
ALONE_M, ALONE_NARROWEST_M, ALONE_WIDEST_M = 0.8, 0.25, 1.2
"""A thing stands alone if the readings beside it lie this far behind it, and it is so wide: no post, no wall."""
ALONE_DEPTH_M, ALONE_TOGETHER_M = 0.3, 0.3
"""Its readings differ from one to the next by no more, and it is found again this near to where it is expected."""
IN_RANGE_M = 0.3
"""... and so far inside the sensor's range: of a wall that comes into range more is seen with each scan."""
FINE_RAD = math.radians(2.0)
"""With wider beams what stands alone seems to jump. There this share of its readings must be on free ground."""
PART_FREE = 0.3
ALONE_M_S = 0.6
"""Below this speed a thing that stands alone is not believed to move."""
FINE_MAX_YAW_RATE_RAD_S = math.radians(45.0)
"""Of a rover that turns faster, readings of fine beams are too far from where they seem to be."""


@njit(cache=True, nogil=True)
def free_all_round(free: NDArray[np.bool_], places: Points, reaches: Points) -> NDArray[np.bool_]:
    """Which places (rows of x and y, in cells) have only free cells round them: in eight directions, and on the way."""
    height, width = free.shape
    result = np.ones(len(places), np.bool_)
    for i in range(len(places)):
        for k in range(25):
            reach = reaches[i] * ((k + 7) // 8) / 3.0
            angle = k * 0.25 * math.pi
            row = math.floor(places[i, 1] + reach * math.cos(angle))
            column = math.floor(places[i, 0] + reach * math.sin(angle))
            if not (0 <= row < height and 0 <= column < width and free[row, column]):
                result[i] = False
                break
    return result


@dataclass(frozen=True, slots=True)
class Sighting:
    """A thing in one scan."""

    time_s: float
    north_m: float
    east_m: float
    radius_m: float
    blur_m: float
    seen_m: float
    """How wide what is seen of it is."""
    on_free_ground: bool
    """Else it only stands alone."""
    cut: bool = False
    """Whether a part of it is out of sight: its middle is then found otherwise, and may seem to lie elsewhere."""

    @property
    def found_again_m(self) -> float:
        """So near to where a thing is expected it is that one; of things that may stand the next is often not far."""
        return TOGETHER_M if self.on_free_ground else ALONE_TOGETHER_M


@dataclass(frozen=True)
class Track:
    """A thing over the last second."""

    number: int
    sightings: tuple[Sighting, ...]

    @cached_property
    def estimate(self) -> tuple[Moving, bool] | None:
        """Its place and velocity by least squares, and whether they are significant; None if seen too briefly."""
        kind = self.sightings[-1].cut
        return self._of_kind(kind) or self._of_kind(not kind)

    def _of_kind(self, cut: bool) -> tuple[Moving, bool] | None:
        """Of the sightings of one kind alone: else a thing that is only found otherwise seems to move."""
        sightings = [one for one in self.sightings if one.cut == cut]
        on_free_ground = 2 * sum(one.on_free_ground for one in sightings) >= len(sightings)
        least = CUT_SIGHTINGS if cut and not on_free_ground else LEAST_SIGHTINGS
        time_s = np.array([one.time_s for one in sightings])
        if len(time_s) < least or time_s[-1] - time_s[0] < LEAST_S:
            return None
        places = np.array([(one.north_m, one.east_m) for one in sightings])
        since = time_s - time_s.mean()
        velocity = since @ places / (since @ since)
        fitted = places.mean(axis=0) + since[:, None] * velocity
        stray_m = float(np.sqrt(((places - fitted) ** 2).sum(axis=1).mean()))
        newest = NedPoint(float(fitted[-1, 0]), float(fitted[-1, 1]))
        radius_m = max(one.radius_m for one in sightings) + DOUBT_M
        blur_m = sum(one.blur_m for one in sightings) / len(sightings)
        error_m_s = max(stray_m, 0.03) / math.sqrt(float(since @ since))
        north_m_s, east_m_s = (float(part) for part in velocity)
        moving = Moving(f"seen {self.number}", float(time_s[-1]), newest, north_m_s, east_m_s, radius_m)
        least_m_s = max(SURE * error_m_s, 0.0 if on_free_ground else ALONE_M_S)
        return moving, stray_m <= STRAY_M + blur_m and moving.speed_m_s >= least_m_s


class ObjectTracker:
    """Remembers which ground has been seen free, and follows what enters it."""

    def __init__(self, evidence: EvidenceMap) -> None:
        self._evidence = evidence
        self._free = lazy_zeros(evidence.log_odds.shape, np.bool_)
        self._tracks: tuple[Track, ...] = ()
        self._numbers = 0

    def take(self, pose: Pose, yaw_rate_rad_s: float, scan: RangeScan) -> None:
        """Look through a scan that has not been added to the map yet."""
        fine = scan.beam_width_rad <= FINE_RAD
        if len(scan.bearing_rad) < LEAST_BEAMS or (fine and abs(yaw_rate_rad_s) > FINE_MAX_YAW_RATE_RAD_S):
            return
        ends, range_m = _ends(pose, scan)
        round_m = FINE_ROUND_M if fine else ROUND_M
        free = self._on_free_ground(ends, round_m + 0.5 * scan.beam_width_rad * range_m)
        things: list[Sighting] = []
        if free.any() or fine:  # without either nothing of it may move
            things = _seen_things(ends, free, _alone(scan), pose, scan.beam_width_rad)
        if things or self._tracks:
            self._follow(pose.time_s, things)

    def remember(self, pose: Pose, reach_m: float) -> None:
        """Note what a scan just added to the map has shown to be free."""
        rows, columns = self._window(pose, reach_m)
        self._free[rows, columns] |= self._evidence.log_odds[rows, columns] <= FREE_AT

    def moving(self, now_s: float, settings: TrafficSettings) -> tuple[Moving, ...]:
        """What moves now."""
        found = []
        for track in self._tracks:
            estimate = track.estimate
            if estimate is not None and now_s - estimate[0].time_s <= LOST_S:
                moving, believed = estimate
                if believed and moving.speed_m_s >= settings.moving_m_s:
                    found.append(moving)
        return tuple(found)

    def _window(self, pose: Pose, reach_m: float) -> tuple[slice, slice]:
        frame = self._evidence.frame
        x, y = frame.xy(pose.point)
        row, column, reach = math.floor(y), math.floor(x), math.ceil(frame.cells(reach_m)) + 1
        return slice(max(row - reach, 0), max(row + reach, 0)), slice(max(column - reach, 0), max(column + reach, 0))

    def _on_free_ground(self, points: Points, round_m: Points) -> NDArray[np.bool_]:
        """Which have ground round them that had all been seen free."""
        frame = self._evidence.frame
        return free_all_round(self._free, frame.xys(points), round_m * frame.cells(1.0))

    def _follow(self, time_s: float, things: list[Sighting]) -> None:
        """Give each thing to the track that expects it nearest; a thing that no track expects begins a new one."""
        tracks = []
        for track in self._tracks:
            expected = _expected(track, time_s)
            nearest = min(things, key=lambda one: math.dist((one.north_m, one.east_m), expected), default=None)
            if nearest is None or math.dist((nearest.north_m, nearest.east_m), expected) > nearest.found_again_m:
                if time_s - track.sightings[-1].time_s <= LOST_S:
                    tracks.append(track)
                continue
            things.remove(nearest)
            kept = tuple(one for one in track.sightings if time_s - one.time_s <= WINDOW_S)
            tracks.append(Track(track.number, (*kept, nearest)))
        for one in things:
            self._numbers += 1
            tracks.append(Track(self._numbers, (one,)))
        self._tracks = tuple(tracks)


def _expected(track: Track, time_s: float) -> tuple[float, float]:
    """Where the next sighting should be."""
    estimate = track.estimate
    last = track.sightings[-1]
    if estimate is None:
        return last.north_m, last.east_m
    there = estimate[0].at(time_s)
    return there.north_m, there.east_m


def _ends(pose: Pose, scan: RangeScan) -> tuple[Points, Points]:
    """Where the readings that hit something ended, shape (n, 2): north and east; and their ranges."""
    hit = np.isfinite(scan.range_m)
    bearing_rad, range_m = pose.heading_rad + scan.bearing_rad[hit], scan.range_m[hit]
    north_m, east_m = pose.north_m + range_m * np.cos(bearing_rad), pose.east_m + range_m * np.sin(bearing_rad)
    return np.column_stack((north_m, east_m)), range_m


@njit(cache=True, nogil=True)
def alone_in(beam_rad: float, range_m: Points, farthest_m: float, is_fan: bool) -> NDArray[np.int64]:
    """For each reading the number of the narrow thing, with nothing near beside it, to which it belongs; -1: none.

    ``range_m``: one for each beam, in their order, ``beam_rad`` apart; inf: free, nan: nothing is known. What reaches
    the edge of a fan may go on beyond; there its other side counts. The number is that of its first beam.
    """
    count = len(range_m)
    result = np.full(count, -1)
    first = 0 if is_fan else 1
    while first < count - 1:
        last = first
        while last + 1 < count and abs(range_m[last + 1] - range_m[last]) <= ALONE_DEPTH_M:
            last += 1
        whole = first > 0 and last < count - 1
        if math.isfinite(range_m[first]) and (whole or (is_fan and last - first < count - 1)):
            own = range_m[first : last + 1]
            before = first == 0 or range_m[first - 1] > range_m[first] + ALONE_M
            behind = last == count - 1 or range_m[last + 1] > range_m[last] + ALONE_M
            wide_m = own.min() * (last - first) * beam_rad
            if before and behind and wide_m <= ALONE_WIDEST_M and own.max() <= farthest_m:
                result[first : last + 1] = first
        first = last + 1
    return result


def _alone(scan: RangeScan) -> tuple[NDArray[np.int64], dict[int, int]]:
    """For each reading that hit something the number of the thing that stands alone to which it belongs; -1: none.

    And on which side the edge of a fan cuts one off, by its number: 1 to the right, -1 to the left.
    """
    bearings = np.mod(scan.bearing_rad + math.pi, 2.0 * math.pi)
    order = np.argsort(bearings, kind="stable")
    ordered_rad = bearings[order]
    before_rad = np.concatenate((ordered_rad[-1:] - 2.0 * math.pi, ordered_rad[:-1]))
    gaps = ordered_rad - before_rad
    widest = int(gaps.argmax())
    is_fan = bool(gaps[widest] > 1.5 * scan.beam_width_rad)
    if is_fan:
        order = np.concatenate((order[widest:], order[:widest]))  # it begins and ends at its edges
    ordered = alone_in(scan.beam_width_rad, scan.range_m[order], scan.max_range_m - IN_RANGE_M, is_fan)
    thing = np.empty(len(order), np.int64)
    thing[order] = ordered
    sides = {int(ordered[-1]): 1, int(ordered[0]): -1}
    cut = {number: side for number, side in sides.items() if number >= 0 and is_fan}
    return thing[np.isfinite(scan.range_m)], cut


def _seen_things(
    ends: Points, free: NDArray[np.bool_], alone: tuple[NDArray[np.int64], dict[int, int]], pose: Pose, beam_rad: float
) -> list[Sighting]:
    """What may move: readings on free ground (``free``), things of which a part is, and with fine beams what is alone.

    ``alone``: see ``_alone``.
    """
    (thing, cut), fine = alone, beam_rad <= FINE_RAD
    known, found = free.copy(), []
    for number in sorted(set(thing[thing >= 0].tolist())):
        own = thing == number
        on_free = bool(free[own].mean() >= PART_FREE)
        if fine and number in cut:
            known[own] = False
            found.append(_cut_sighting(ends[own], cut[number], pose, on_free_ground=on_free))
        elif on_free:
            known[own] = True
        elif fine and not free[own].any():
            found.append(_sighting(ends[own], pose, beam_rad, on_free_ground=False))
    wholes = _wholes(ends, pose, beam_rad)
    for rows, on_free in _groups(ends, known, free):
        if len(rows) == 1 and thing[rows[0]] < 0 and _is_wide(ends[rows[0]], pose, beam_rad):
            continue
        stands = on_free and _is_part_of_what_stands(rows, wholes, free)
        found.append(_sighting(ends[rows], pose, beam_rad, on_free_ground=on_free and not stands))
    return [one for one in found if _may_move(one)]


def _may_move(thing: Sighting) -> bool:
    """Whether it is as wide as things that move: what only stands alone, or of which a part is out of sight, may be the
    end of a wall.
    """
    if thing.on_free_ground and not thing.cut:
        return thing.seen_m <= WIDEST_M
    least_m = 0.0 if thing.on_free_ground else ALONE_NARROWEST_M
    return least_m <= thing.seen_m <= ALONE_WIDEST_M


def _groups(ends: Points, known: NDArray[np.bool_], free: NDArray[np.bool_]) -> list[tuple[NDArray[np.int64], bool]]:
    """Of the known readings those that lie together, by their rows, and whether most of them are on free ground."""
    groups: list[list[int]] = []
    for row in np.flatnonzero(known).tolist():
        for group in groups:
            if min(math.dist(ends[group[-1]], ends[row]), math.dist(ends[group[0]], ends[row])) <= TOGETHER_M:
                group.append(row)
                break
        else:
            groups.append([row])
    return [(np.array(rows), 2 * int(free[rows].sum()) >= len(rows)) for rows in groups]


def _wholes(ends: Points, pose: Pose, beam_rad: float) -> NDArray[np.int64]:
    """For each reading the number of the thing to which it belongs: from one reading to the next beside it it goes on
    where they lie near each other.
    """
    away = ends - (pose.north_m, pose.east_m)
    order = np.argsort(np.arctan2(away[:, 1], away[:, 0]), kind="stable")
    ordered, range_m = ends[order], np.hypot(*away[order].T)
    apart_m = np.hypot(*(ordered - np.roll(ordered, 1, axis=0)).T)
    goes_on_m = GOES_ON_M + 0.5 * beam_rad * np.minimum(range_m, np.roll(range_m, 1))
    begins = apart_m > goes_on_m
    number = np.cumsum(begins)
    wholes = np.empty(len(ends), np.int64)
    wholes[order] = np.where(number == 0, number[-1:], number)  # the last goes on with the first
    return wholes


def _is_part_of_what_stands(rows: NDArray[np.int64], wholes: NDArray[np.int64], free: NDArray[np.bool_]) -> bool:
    """Whether readings on free ground belong to something larger, most of which is not on it."""
    whole = np.isin(wholes, wholes[rows])
    return 2 * int(free[whole].sum()) < int(whole.sum())


def _is_wide(end: Points, pose: Pose, beam_rad: float) -> bool:
    """Whether a beam is wide where it ended."""
    return beam_rad * math.dist(end, (pose.north_m, pose.east_m)) > WIDEST_SINGLE_M


def _sighting(seen: Points, pose: Pose, beam_width_rad: float, *, on_free_ground: bool) -> Sighting:
    """Readings of one thing as a disc: its middle lies behind what is seen of it."""
    middle = np.mean(seen, axis=0)
    seen_m = 2.0 * float(max(math.dist(point, middle) for point in seen))
    radius_m = max(seen_m / 2.0, LEAST_RADIUS_M)
    away_rad = math.atan2(middle[1] - pose.east_m, middle[0] - pose.north_m)
    behind_m = 0.7 * radius_m
    north_m = float(middle[0]) + behind_m * math.cos(away_rad)
    east_m = float(middle[1]) + behind_m * math.sin(away_rad)
    blur_m = 0.5 * beam_width_rad * math.dist(middle, (pose.north_m, pose.east_m))
    return Sighting(pose.time_s, north_m, east_m, radius_m, blur_m, seen_m, on_free_ground)


def _cut_sighting(seen: Points, side: int, pose: Pose, *, on_free_ground: bool) -> Sighting:
    """Readings of a thing of which a part is out of sight on this side: of its middle only the other side tells."""
    away = seen - (pose.north_m, pose.east_m)
    bearings_rad = np.arctan2(away[:, 1], away[:, 0])
    beside_rad = np.mod(bearings_rad - pose.heading_rad + math.pi, 2.0 * math.pi) - math.pi
    edge = int(np.argmin(side * beside_rad))
    across_rad = float(bearings_rad[edge]) + side * 0.5 * math.pi
    seen_m = float(np.hypot(*(seen - seen[edge]).T).max())
    radius_m = max(seen_m / 2.0, LEAST_RADIUS_M)
    # Always as far: what is seen of it, and with it the radius, changes while it gets into sight.
    north_m = float(seen[edge, 0]) + LEAST_RADIUS_M * math.cos(across_rad)
    east_m = float(seen[edge, 1]) + LEAST_RADIUS_M * math.sin(across_rad)
    return Sighting(pose.time_s, north_m, east_m, radius_m, 0.0, seen_m, on_free_ground, cut=True)
