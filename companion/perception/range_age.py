"""Range age: how much older than positions ranges over MAVLink are, found from how they turn with the rover.

A lidar needs a turn to measure and the autopilot a while to pass it on. What the rover sees while it turns lies aside
by its turn rate times that age. So a scan is laid over one taken just before, when the rover turned at another rate,
with each of some ages in turn: with the right one both lie on the same walls.

Nouns: range age.
"""

# mypy: disable-error-code="no-untyped-def"

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np
from numba import njit
from numpy.typing import NDArray

from companion.core.frames import Pose
from companion.core.scan import WIRED, RangeScan
from companion.perception.past_headings import PastHeadings
from companion.perception.scan_filter import Sensor, sensor_of
from companion.vehicle.state import VehicleState

Floats = NDArray[np.float64]

STEP_S = 0.025
AGES_S: Floats = np.linspace(-0.05, 0.6, 27)
"""Those that are tried. Below 0 there are some so that an age of 0 has others on both sides."""
NOW = 2
"""The number of age 0."""
LEAST_S = 0.05
"""A younger scan lies where it was taken by a few centimetres."""
OTHER_RAD_S = 0.25
"""So much the turn rates of two scans differ at least, or their age does not show."""
LASTS_S, NEAR_M = 3.0, 2.5
"""A scan is compared with one of so long before at most, from so near: both see the same."""
KEPT = 30
"""Scans to compare with, of each sensor."""
APART_S, ROUNDING_S = 0.1, 0.001
"""Between scans that are looked at: a comparison takes some tenths of a millisecond."""
SIGHT_M, FEW, ENOUGH = 6.0, 12, 72
"""Readings up to there count; so many there must be, and of more than so many some are left out."""
FAR_M = 0.4
"""What lies farther from anything seen before is something else."""
COUNT, MOST = 10, 200
"""So many comparisons tell something; of more than so many the older ones count less and less."""
TURNS_RAD_S = 5.0
"""The differences of the turn rates that were compared must come to so much together."""
BETTER_M, BETTER = 0.015, 0.13
"""By so much, and by this share, scans must lie nearer to each other than with no age at all, on average."""
STAYS = 0.6
"""An age that was found stays down to this share of these and of ``LEAST_S``, so that it does not come and go."""


@dataclass(frozen=True, eq=False, slots=True)
class _Look:
    """Readings that hit something, and how the rover stood and moved when they came."""

    pose: Pose
    forward_m_s: float
    yaw_rate_rad_s: float
    turned_rad: Floats
    """How far it had turned then since each of ``AGES_S`` before."""
    bearing_rad: Floats
    range_m: Floats


@dataclass(eq=False, slots=True)
class _Voice:
    """What is known of one sensor."""

    before: deque[_Look] = field(default_factory=lambda: deque(maxlen=KEPT))
    noted_s: float = -math.inf
    gaps_m: Floats = field(default_factory=lambda: np.zeros(len(AGES_S)))
    count: float = 0.0
    turns_rad_s: float = 0.0
    age_s: float = 0.0


class RangeAges:
    """Finds the age of the ranges of each sensor that sends views over MAVLink, and no ages of its own."""

    def __init__(self) -> None:
        self._voices: dict[Sensor, _Voice] = {}
        self._headings = PastHeadings()

    @property
    def found(self) -> tuple[tuple[Sensor, float], ...]:
        """The ages that were found, s."""
        return tuple((sensor, voice.age_s) for sensor, voice in self._voices.items() if voice.age_s > 0.0)

    def go_on(self, found: Iterable[tuple[Sensor, float]]) -> None:
        """Count on what an earlier run had found, until it is found anew."""
        for sensor, age_s in found:
            self._voices.setdefault(sensor, _Voice()).age_s = age_s

    def begin_anew(self) -> None:
        """The rover's place has jumped: scans from before lie elsewhere. What was found of ages stays."""
        for voice in self._voices.values():
            voice.before.clear()

    def hear(self, vehicle: VehicleState) -> None:
        """The vehicle after each event: its last attitude counts."""
        if vehicle.attitude is not None:
            self._headings.note(vehicle.attitude, vehicle.came_s(vehicle.attitude))

    def age_s(self, scan: RangeScan) -> float:
        """How old the scan was when it came; 0 as long as nothing else is known."""
        voice = self._voices.get(sensor_of(scan))
        return 0.0 if voice is None else voice.age_s

    def note(self, scan: RangeScan, pose: Pose, forward_m_s: float, yaw_rate_rad_s: float) -> None:
        """One more scan, as it came. ``pose``, ``forward_m_s``, ``yaw_rate_rad_s``: of the rover when it came."""
        hit = np.flatnonzero(np.isfinite(scan.range_m) & (scan.range_m < SIGHT_M))
        if scan.sender == WIRED or scan.age_s is not None or len(hit) < FEW:
            return
        voice = self._voices.setdefault(sensor_of(scan), _Voice())
        known_s = self._headings.known_s(pose.time_s)
        if known_s < AGES_S[-1] or abs(pose.time_s - voice.noted_s) < APART_S - ROUNDING_S:
            return
        voice.noted_s = pose.time_s
        hit = hit[:: math.ceil(len(hit) / ENOUGH)]
        turned_rad = self._headings.turned_rad(pose.time_s, AGES_S)
        look = _Look(pose, forward_m_s, yaw_rate_rad_s, turned_rad, scan.bearing_rad[hit], scan.range_m[hit])
        if (other := _other(voice, look)) is not None:
            _compare(voice, look, other)
        voice.before.append(look)

    def before(self, pose: Pose, age_s: float, forward_m_s: float) -> Pose:
        """Where the rover was so long before it was at ``pose``, with the speed that it has there."""
        turned_rad = float(self._headings.turned_rad(pose.time_s, np.array([age_s]))[0])
        place = pose.point.moved(pose.heading_rad - 0.5 * turned_rad, -forward_m_s * age_s)
        return Pose(place.north_m, place.east_m, pose.heading_rad - turned_rad, pose.time_s - age_s)


def _other(voice: _Voice, look: _Look) -> _Look | None:
    """The scan that has seen the same a moment before, while the rover turned at the most different rate."""
    here, rate_rad_s = look.pose, look.yaw_rate_rad_s
    turned_otherwise = (one for one in voice.before if abs(one.yaw_rate_rad_s - rate_rad_s) >= OTHER_RAD_S)
    alike = (
        one
        for one in turned_otherwise
        if here.time_s - one.pose.time_s < LASTS_S and here.point.distance_m(one.pose.point) < NEAR_M
    )
    return max(alike, key=lambda one: abs(one.yaw_rate_rad_s - rate_rad_s), default=None)


def _compare(voice: _Voice, look: _Look, other: _Look) -> None:
    if voice.count >= MOST:
        voice.count, voice.gaps_m = 0.5 * voice.count, 0.5 * voice.gaps_m
    voice.count += 1.0
    voice.turns_rad_s += abs(look.yaw_rate_rad_s - other.yaw_rate_rad_s)
    voice.gaps_m += mean_gaps_m(*_figures(look), *_figures(other), AGES_S)
    if voice.count >= COUNT and voice.turns_rad_s >= TURNS_RAD_S:
        voice.age_s = _best_s(voice.gaps_m / voice.count, STAYS if voice.age_s > 0.0 else 1.0)


def _figures(look: _Look) -> tuple[tuple[float, float, float], float, Floats, Floats, Floats]:
    pose = look.pose
    place = (pose.north_m, pose.east_m, pose.heading_rad)
    return place, look.forward_m_s, look.turned_rad, look.bearing_rad, look.range_m


def _best_s(gaps_m: Floats, share: float) -> float:
    """The age with the least gap, between those that were tried; 0 where it is hardly better than none.

    ``share``: of ``LEAST_S``, ``BETTER_M`` and ``BETTER`` that it must have.
    """
    at, now_m = int(gaps_m.argmin()), gaps_m[NOW]
    if not 0 < at < len(gaps_m) - 1 or now_m - gaps_m[at] < share * max(BETTER_M, BETTER * now_m):
        return 0.0
    before, least, after = gaps_m[at - 1 : at + 2]
    bend = before - 2.0 * least + after
    age_s = float(AGES_S[at] + (0.5 * (before - after) / bend * STEP_S if bend > 0.0 else 0.0))
    return age_s if age_s >= share * LEAST_S else 0.0


@njit(cache=True, nogil=True)
def mean_gaps_m(
    pose, forward_m_s, turned_rad, bearing_rad, range_m,
    other_pose, other_forward_m_s, other_turned_rad, other_bearing_rad, other_range_m, ages_s,
):  # fmt: skip
    """How far, on average, readings end from the nearest one of another scan, ``FAR_M`` at most, for each age."""
    gaps = np.empty(ages_s.size)
    ends, others = np.empty((range_m.size, 2)), np.empty((other_range_m.size, 2))
    for nth in range(ages_s.size):
        _lay(pose, forward_m_s * ages_s[nth], turned_rad[nth], bearing_rad, range_m, ends)
        _lay(
            other_pose, other_forward_m_s * ages_s[nth], other_turned_rad[nth], other_bearing_rad, other_range_m, others
        )
        total = 0.0
        for i in range(ends.shape[0]):
            least = FAR_M * FAR_M
            for j in range(others.shape[0]):
                north, east = ends[i, 0] - others[j, 0], ends[i, 1] - others[j, 1]
                least = min(least, north * north + east * east)
            total += math.sqrt(least)
        gaps[nth] = total / ends.shape[0]
    return gaps


@njit(cache=True, nogil=True)
def _lay(pose, gone_m, turned_rad, bearing_rad, range_m, ends):
    """Where readings end, metres north and east, that were taken before the rover came and turned by so much."""
    middle_rad, heading_rad = pose[2] - 0.5 * turned_rad, pose[2] - turned_rad
    north, east = pose[0] - gone_m * math.cos(middle_rad), pose[1] - gone_m * math.sin(middle_rad)
    for i in range(range_m.size):
        ends[i, 0] = north + range_m[i] * math.cos(heading_rad + bearing_rad[i])
        ends[i, 1] = east + range_m[i] * math.sin(heading_rad + bearing_rad[i])
