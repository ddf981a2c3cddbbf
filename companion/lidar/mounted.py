"""From a turn of the lidar to a scan of the rover: mounting, masks, limits."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from companion.core.scan import WIRED, RangeScan
from companion.lidar.points import Floats
from companion.lidar.spec import Mounting
from companion.lidar.turns import Turn

AHEAD_DEG = 45.0
"""A turn ends when the lidar has swept so far past straight ahead."""
LEAST_WIDTH_DEG, MOST_WIDTH_DEG = 0.1, 5.0
ECHO_SHARE = 0.01
"""A lidar that gets fewer echoes is taken to be blind: its laser is dead, or it is covered or dazzled."""


def cut_deg(mounting: Mounting) -> float:
    """The sensor's own angle at which its turns are to end."""
    aside_deg = mounting.yaw_deg if mounting.flipped else -mounting.yaw_deg
    return (AHEAD_DEG + aside_deg) % 360.0


def scan_of(turn: Turn, mounting: Mounting, source: str) -> RangeScan:
    """The turn as the rover sees it, in the order in which its readings were taken."""
    points = turn.points
    bearing_deg = _bearings_deg(turn, mounting)
    range_m = _ranges(turn, mounting, _masked(bearing_deg, mounting))
    bearing_rad = np.radians((bearing_deg + 180.0) % 360.0 - 180.0)
    width_rad = math.radians(_width_deg(points.angle_deg))
    origin_m = mounting.forward_m, mounting.right_m
    if origin_m != (0.0, 0.0):
        bearing_rad, range_m = _from_middle(bearing_rad, range_m, origin_m)
    return RangeScan(
        turn.time_s,
        bearing_rad,
        range_m,
        mounting.min_m,
        mounting.max_m,
        width_rad,
        source,
        WIRED,
        turn.age_s,
        mounting.empty_m,
        origin_m,
    )


def believed(mounting: Mounting, turn: Turn) -> Mounting:
    """The mounting to read this turn with: of a blind lidar no reading says that nothing is there.

    Echoes count that are not masked, too near or too weak. A person who told ``empty`` is believed.
    """
    if mounting.empty_told:
        return mounting
    counts = ~_masked(_bearings_deg(turn, mounting), mounting)
    range_m, quality = turn.points.range_m, turn.points.quality
    echo = counts & (range_m > 0.0) & (range_m >= mounting.min_m) & (quality >= mounting.least_quality)
    blind = echo.sum() < max(ECHO_SHARE * counts.sum(), 1.0)
    return replace(mounting, empty_m=0.0) if blind else mounting


def _bearings_deg(turn: Turn, mounting: Mounting) -> Floats:
    angle_deg = turn.points.angle_deg
    return mounting.yaw_deg + (-angle_deg if mounting.flipped else angle_deg)


def _masked(bearing_deg: Floats, mounting: Mounting) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
    hidden = np.zeros(len(bearing_deg), np.bool_)
    for begin_deg, end_deg in mounting.masked_deg:
        hidden |= (bearing_deg - begin_deg) % 360.0 <= (end_deg - begin_deg) % 360.0
    return hidden


def _ranges(turn: Turn, mounting: Mounting, hidden: np.ndarray[tuple[int, ...], np.dtype[np.bool_]]) -> Floats:
    """Ranges from the lidar: inf where nothing is up to the maximum, nan where nothing is known."""
    measured_m = turn.points.range_m
    echo = measured_m > 0.0
    range_m = np.where(echo & (measured_m < mounting.max_m), measured_m, np.inf if mounting.empty_m > 0.0 else np.nan)
    weak = echo & ((measured_m < mounting.min_m) | (turn.points.quality < mounting.least_quality))
    range_m[weak | hidden] = np.nan
    return np.asarray(range_m)


def _width_deg(angle_deg: Floats) -> float:
    """How far apart the readings lie: each speaks for this width."""
    steps_deg = np.diff(angle_deg) % 360.0
    usual_deg = float(np.median(steps_deg)) if len(steps_deg) else MOST_WIDTH_DEG
    return min(max(usual_deg, LEAST_WIDTH_DEG), MOST_WIDTH_DEG)


def _from_middle(bearing_rad: Floats, range_m: Floats, origin_m: tuple[float, float]) -> tuple[Floats, Floats]:
    """What was hit, as the middle of the rover would see it; where nothing was, the direction stays."""
    hit = np.isfinite(range_m)
    seen_m = np.where(hit, range_m, 0.0)
    forward_m = seen_m * np.cos(bearing_rad) + origin_m[0]
    right_m = seen_m * np.sin(bearing_rad) + origin_m[1]
    return (
        np.where(hit, np.arctan2(right_m, forward_m), bearing_rad),
        np.where(hit, np.hypot(forward_m, right_m), range_m),
    )
