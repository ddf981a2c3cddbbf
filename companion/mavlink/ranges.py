"""Range messages as RangeScan, without the autopilot's echoes.

Those are DISTANCE_SENSOR, OBSTACLE_DISTANCE, RANGEFINDER, and through ``points`` OBSTACLE_DISTANCE_3D.

Rules (ArduRover's behaviour and the MAVLink definitions; where these are ambiguous, the safe interpretation):

- A reading at or beyond the sensor's maximum means "nothing up to the maximum" (``inf``), never an obstacle. - A
reading between zero and the minimum is an obstacle at that distance: in doubt the rover stops. - Zero, 65535 and signal
quality 1 are "unknown" (``nan``). MAVLink defines zero in OBSTACLE_DISTANCE as "touching", but drivers fill unused
sectors with it and ArduPilot ignores it. Unknown is safe: unseen ground is not driven on, and an obstacle that comes
near was on the map before. - A message with unknown readings only is no scan: range data becomes stale and the rover
stops. - A wide beam has an obstacle somewhere in its width: it becomes several narrow beams of the same range. -
Orientations count clockwise (1 is right-front), as in ArduPilot; the text of common.xml says the reverse. -
OBSTACLE_DISTANCE is relative to the rover whatever its frame field says, as in ArduPilot: most drivers leave the field
at 0, which would mean north.

An autopilot repeats much of what it receives or measures in a coarser form (an echo); ``RangeDecoder`` leaves that out.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.core.arrival_jitter import ArrivalJitter
from companion.core.scan import RangeScan
from companion.mavlink import points
from companion.mavlink.framing import AUTOPILOT
from companion.mavlink.points import Band, PointJoiner
from companion.perception.scan_filter import MOST_SCANS, Sensor, sensor_of

MESSAGES = (mavlink.MAVLINK_MSG_ID_DISTANCE_SENSOR, mavlink.MAVLINK_MSG_ID_OBSTACLE_DISTANCE, points.MESSAGE)
FORGOTTEN_S = 5.0
"""At most MOST_SCANS sensors are used, first come, first served; one that is silent for this long loses its place."""
ECHO_S = 2.0
"""For this long after a message, coarser messages that repeat its readings are left out."""
UNKNOWN_CM = 65535
INVALID_QUALITY = 1
HORIZONTAL = range(8)
CUSTOM_ORIENTATION = 100
MAX_TILT_RAD = math.radians(15.0)
SECTOR_IDS = range(10, 18)
SECTOR_RAD = math.radians(45.0)
OWN_BEAM_RAD = math.radians(4.0)
"""Width of a rangefinder that does not report its own (small laser rangefinders have 2 to 4 degrees)."""
NARROW_RAD = math.radians(6.0)
"""Wider beams become several."""
RANGEFINDER_MIN_M, RANGEFINDER_TRUST_M = 0.2, 5.0
"""RANGEFINDER has no limits of its own: a reading beyond the second figure means nothing seen."""


class RangeDecoder:
    """Decodes range messages and leaves out echoes; remembers when each source was heard last."""

    def __init__(self, band: Band) -> None:
        """``band``: the heights of points that count."""
        self._points = PointJoiner(band)
        self._first_s: float | None = None
        self._lidar_s = -math.inf
        self._other_range_s = -math.inf
        self._beam_s: dict[int, float] = {}
        self._seen_s: dict[int, float] = {}
        """When data finer than sectors last showed an obstacle, by octants of the circle."""
        self._heard_s: dict[Sensor, float] = {}
        """When each sensor was heard last."""
        self._jitter: dict[Sensor, ArrivalJitter] = {}

    def vehicle_heard(self, time_s: float) -> None:
        """Call when the vehicle is heard; the first time counts."""
        if self._first_s is None:
            self._first_s = time_s

    def scan(self, message: Any, time_s: float, sender: int) -> RangeScan | None:
        """The scan of one of ``MESSAGES``; None when it is an echo, useless, or from one sensor too many.

        Of points it is the scan of the look before; ``complete`` gives those that no other point has ended.
        """
        number = message.get_msgId()
        if number == points.MESSAGE:
            return self._with_place(self._points.add(message, time_s, sender), finer=True)
        if number == mavlink.MAVLINK_MSG_ID_OBSTACLE_DISTANCE:
            seen = obstacle_distance(message, time_s, sender)
            return self._with_place(seen, finer=True)
        sector = sender == AUTOPILOT and is_sector(message)
        scan = distance_sensor(message, time_s, sender, sector=sector)
        if scan is None or (sector and self._is_echo(message.orientation, scan)):
            return None
        scan = self._with_place(scan, coarse=sector)
        if scan is not None and not sector:
            self._beam_s[message.orientation] = time_s
        return scan

    def complete(self, time_s: float) -> list[RangeScan]:
        """The scans of points whose look is complete at the first bytes of a later time."""
        whole = [self._with_place(scan, finer=True) for scan in self._points.complete(time_s)]
        return [scan for scan in whole if scan is not None]

    def _with_place(self, scan: RangeScan | None, *, finer: bool = False, coarse: bool = False) -> RangeScan | None:
        """The scan, if there is a place for its sensor, and how late it came; notes what it tells about echoes.

        ``finer``: it is as fine as a lidar's; ``coarse``: it is a sector.
        """
        if scan is None or not self._has_place(sensor_of(scan), scan.time_s):
            return None
        self._other_range_s = scan.time_s
        if finer:
            self._lidar_s = scan.time_s
        if not coarse:
            self._seen_s.update((octant, scan.time_s) for octant in _octants(scan))
        return self._timed(scan)

    def _timed(self, scan: RangeScan) -> RangeScan:
        """The scan with how late it came, by the time in its message."""
        if scan.told_s is None:
            return scan
        jitter = self._jitter.get(sensor_of(scan), ArrivalJitter()).after(scan.time_s, scan.told_s)
        self._jitter[sensor_of(scan)] = jitter
        return replace(scan, late_s=jitter.late_s(scan.time_s, scan.told_s))

    def _is_echo(self, orientation: int, sector: RangeScan) -> bool:
        """Whether a proximity sector only repeats finer data, of a lidar or a rangefinder that faces the same way.

        An obstacle that the finer data has not shown comes from a sensor of the autopilot's own.
        """
        near = [self._seen_s.get((orientation + aside) % 8, -math.inf) for aside in (-1, 0, 1)]
        finer_s = max(self._lidar_s, self._beam_s.get(orientation, -math.inf))
        if np.isfinite(sector.range_m).any():
            finer_s = min(finer_s, max(near))
        return sector.time_s - finer_s < ECHO_S

    def _has_place(self, sensor: Sensor, time_s: float) -> bool:
        """Whether there is a place for this sensor; if so, it takes it."""
        if sensor not in self._heard_s and len(self._heard_s) >= MOST_SCANS:
            self._heard_s = {one: heard_s for one, heard_s in self._heard_s.items() if time_s - heard_s < FORGOTTEN_S}
            self._jitter = {one: jitter for one, jitter in self._jitter.items() if one in self._heard_s}
            if len(self._heard_s) >= MOST_SCANS:
                return False
        self._heard_s[sensor] = time_s
        return True

    def rangefinder(self, message: Any, time_s: float) -> RangeScan | None:
        """The scan of a RANGEFINDER, only if no better range data has been heard for a while."""
        assert self._first_s is not None
        if time_s - max(self._other_range_s, self._first_s) < ECHO_S:
            return None
        return rangefinder(message, time_s)


def distance_sensor(message: Any, time_s: float, sender: int = AUTOPILOT, *, sector: bool) -> RangeScan | None:
    """DISTANCE_SENSOR: one beam, or a 45-degree proximity sector; None if not horizontal or unknown."""
    bearing_rad = _bearing_rad(message)
    if bearing_rad is None or message.max_distance <= message.min_distance:
        return None
    distance = message.current_distance
    if message.signal_quality == INVALID_QUALITY or distance in (0, UNKNOWN_CM):
        return None
    width_rad = message.horizontal_fov if 0.0 < message.horizontal_fov <= math.pi else OWN_BEAM_RAD
    return _scan(
        time_s,
        np.array([bearing_rad]),
        np.array([math.inf if distance >= message.max_distance else distance / 100.0]),
        message.min_distance / 100.0,
        message.max_distance / 100.0,
        SECTOR_RAD if sector else width_rad,
        f"{'sector' if sector else 'distance sensor'} {message.id}",
        sender,
        message.time_boot_ms * 1e-3,
    )


def obstacle_distance(message: Any, time_s: float, sender: int = AUTOPILOT) -> RangeScan | None:
    """OBSTACLE_DISTANCE: up to 72 sectors; None if all are unknown or the message is invalid."""
    step_deg = message.increment_f if message.increment_f else float(message.increment)
    # A sector becomes as many beams as its width needs: more than a full turn is invalid.
    if not (0.0 < abs(step_deg) <= 360.0 and abs(message.angle_offset) <= 360.0):
        return None
    # Sectors beyond a full turn would cover the same directions twice.
    cells = min(len(message.distances), max(1, round(360.0 / abs(step_deg))))
    distance = np.asarray(message.distances[:cells], np.float64)
    unknown = (distance == 0.0) | (distance == UNKNOWN_CM)
    if message.max_distance == 0 or message.max_distance <= message.min_distance or unknown.all():
        return None
    range_m = np.where(unknown, np.nan, np.where(distance >= message.max_distance, np.inf, distance / 100.0))
    bearing_rad = np.radians(message.angle_offset + step_deg * np.arange(cells))
    return _scan(
        time_s,
        bearing_rad,
        range_m,
        message.min_distance / 100.0,
        message.max_distance / 100.0,
        math.radians(abs(step_deg)),
        "obstacle distance",
        sender,
        message.time_usec * 1e-6,
    )


def rangefinder(message: Any, time_s: float) -> RangeScan | None:
    """RANGEFINDER, the last resort: the nearest reading of all sensors, in any direction, as one narrow beam ahead.

    So an obstacle at the side stops the rover too, and only the ground straight ahead counts as free.
    """
    distance_m = message.distance
    if not math.isfinite(distance_m) or distance_m <= 0.0:
        return None
    range_m = math.inf if distance_m >= RANGEFINDER_TRUST_M else distance_m
    beam = np.array([0.0])
    return _scan(time_s, beam, np.array([range_m]), RANGEFINDER_MIN_M, RANGEFINDER_TRUST_M, OWN_BEAM_RAD, "rangefinder")


def is_sector(message: Any) -> bool:
    """Whether a DISTANCE_SENSOR of the autopilot is a proximity sector rather than a real sensor."""
    return message.id in SECTOR_IDS and message.orientation in HORIZONTAL


def _bearing_rad(message: Any) -> float | None:
    """Bearing clockwise from ahead; None for a sensor that does not face along the ground."""
    if message.orientation in HORIZONTAL:
        return float(message.orientation) * math.radians(45.0)
    if message.orientation != CUSTOM_ORIENTATION:
        return None
    w, x, y, z = message.quaternion
    norm = w * w + x * x + y * y + z * z
    if not math.isfinite(norm) or not 0.5 < norm < 1.5:
        return None
    # The direction of the sensor's x-axis in the rover's frame (forward, right, down).
    forward, right, down = w * w + x * x - y * y - z * z, 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)
    if abs(math.asin(max(-1.0, min(1.0, down / norm)))) > MAX_TILT_RAD:
        return None
    return math.atan2(right, forward)


def _scan(
    time_s: float,
    bearing_rad: np.ndarray[Any, np.dtype[np.float64]],
    range_m: np.ndarray[Any, np.dtype[np.float64]],
    min_range_m: float,
    max_range_m: float,
    width_rad: float,
    source: str,
    sender: int = AUTOPILOT,
    told_s: float | None = None,
) -> RangeScan:
    beams = max(1, math.ceil(width_rad / NARROW_RAD - 1e-9))
    if beams > 1:
        offsets = ((np.arange(beams) + 0.5) / beams - 0.5) * width_rad
        bearing_rad = (bearing_rad[:, None] + offsets).ravel()
        range_m = np.repeat(range_m, beams)
    width_rad /= beams
    return RangeScan(time_s, bearing_rad, range_m, min_range_m, max_range_m, width_rad, source, sender, told_s=told_s)


def _octants(scan: RangeScan) -> set[int]:
    """The octants of the circle, clockwise from ahead, in which the scan shows something."""
    seen = np.degrees(scan.bearing_rad[np.isfinite(scan.range_m)])
    return set((np.rint(seen / 45.0).astype(int) % 8).tolist())
