"""Moving obstacles: discs on timed routes of straight segments, and the distance to them along rays and from places.

Times are the simulator's, in seconds since it was created. Movers react to nothing: they pass through walls, each
other and the rover.

Nouns: Mover.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


class Announcement(Enum):
    """How a moving obstacle announces itself over MAVLink; the values are those of mission and world files."""

    VEHICLE = "vehicle"
    ADSB = "adsb"
    AIS = "ais"


@dataclass(frozen=True, eq=False, slots=True)
class Mover:
    """A disc that moves; world frame.

    ``track`` has shape (n, 3): columns time in seconds (rising), north and east in metres. Before the first row and
    after the last the disc stands still; with ``repeats`` it starts over at the first row instead.
    """

    name: str
    radius_m: float
    track: Floats
    repeats: bool = False
    announce: Announcement | None = None
    """How it announces itself over MAVLink; None: not at all."""


class Fleet(NamedTuple):
    """All movers, for compiled code: tracks one after the other, where each begins, radii, periods (0: no repeat)."""

    rows: Floats
    begins: Ints
    radii_m: Floats
    periods_s: Floats


def timed_track(places_m: list[tuple[float, float]], speed_m_s: float, start_s: float, *, repeats: bool) -> Floats:
    """The track of a disc that passes the places at a constant speed; one that repeats returns straight to the first.

    Places (north, east) that equal the one before are left out. Raises ValueError when all are equal.
    """
    closed = [*places_m, places_m[0]] if repeats else places_m
    path = [place for i, place in enumerate(closed) if i == 0 or place != closed[i - 1]]
    if len(path) < 2:
        raise ValueError("a route needs at least two different places")
    points = np.array(path, dtype=np.float64)
    lengths_m = np.hypot(*np.diff(points, axis=0).T)
    times_s = start_s + np.concatenate(([0.0], np.cumsum(lengths_m))) / speed_m_s
    return np.column_stack((times_s, points))


def fleet_of(movers: tuple[Mover, ...]) -> Fleet:
    """The movers in the form that compiled code takes."""
    begins = np.cumsum([0, *(len(mover.track) for mover in movers)]).astype(np.int64)
    rows = np.concatenate([mover.track for mover in movers]) if movers else np.empty((0, 3))
    periods_s = [float(mover.track[-1, 0] - mover.track[0, 0]) if mover.repeats else 0.0 for mover in movers]
    radii_m = np.array([mover.radius_m for mover in movers], dtype=np.float64)
    return Fleet(np.ascontiguousarray(rows), begins, radii_m, np.array(periods_s, dtype=np.float64))


@njit(cache=True, nogil=True)
def motion_of(fleet: Fleet, mover: int, time_s: float) -> tuple[float, float, float, float]:
    """Where a mover is, north and east in metres, and its velocity north and east in m/s."""
    rows, begins, _, periods_s = fleet
    low, high = begins[mover], begins[mover + 1] - 1
    if periods_s[mover] > 0.0 and time_s > rows[low, 0]:
        time_s = rows[low, 0] + (time_s - rows[low, 0]) % periods_s[mover]
    if time_s < rows[low, 0]:
        return rows[low, 1], rows[low, 2], 0.0, 0.0
    if time_s >= rows[high, 0]:
        return rows[high, 1], rows[high, 2], 0.0, 0.0
    while high - low > 1:
        middle = (low + high) // 2
        if rows[middle, 0] <= time_s:
            low = middle
        else:
            high = middle
    span_s = rows[high, 0] - rows[low, 0]
    north_m_s = (rows[high, 1] - rows[low, 1]) / span_s
    east_m_s = (rows[high, 2] - rows[low, 2]) / span_s
    since_s = time_s - rows[low, 0]
    return rows[low, 1] + north_m_s * since_s, rows[low, 2] + east_m_s * since_s, north_m_s, east_m_s


@njit(cache=True, nogil=True)
def shorten_rays(
    fleet: Fleet, time_s: float, north_m: float, east_m: float, bearings_rad: Floats, lengths_m: Floats
) -> None:
    """Shorten ``lengths_m`` to the nearest mover met by a ray of each row of bearings (sectors x rays).

    From inside a disc every ray is 0.
    """
    for mover in range(fleet.radii_m.size):
        mover_n, mover_e, _, _ = motion_of(fleet, mover, time_s)
        to_n, to_e, radius_m = mover_n - north_m, mover_e - east_m, fleet.radii_m[mover]
        gap2 = to_n * to_n + to_e * to_e - radius_m * radius_m
        for sector in range(bearings_rad.shape[0]):
            for ray in range(bearings_rad.shape[1]):
                bearing_rad = bearings_rad[sector, ray]
                along = to_n * math.cos(bearing_rad) + to_e * math.sin(bearing_rad)
                root = along * along - gap2
                if gap2 <= 0.0:
                    lengths_m[sector] = 0.0
                elif along > 0.0 and root >= 0.0:
                    lengths_m[sector] = min(lengths_m[sector], along - math.sqrt(root))
