"""A stand-in for the firmware's side of the JSON interface: the frames it sends, and how it reads what comes back.

It follows ArduPilot's libraries/SITL/SIM_JSON: keys are found as bare text, a value begins two characters after its
key, an answer counts only between two newlines, and the frame number rises only when an answer was understood. ``OLD``
and ``NEW`` are the orders of its table of keys before and after latitude, longitude and altitude were added. Both read
the ranges from places 7 to 12 of that table, which in the new one belong to other keys.
"""

from __future__ import annotations

import math
import re
import struct
from collections.abc import Callable
from dataclasses import dataclass, field


def _table(text: str) -> list[str]:
    return text.split()


OLD = _table(
    "timestamp imu/gyro imu/accel_body position attitude quaternion velocity "
    "rng_1 rng_2 rng_3 rng_4 rng_5 rng_6 windvane/direction windvane/speed airspeed no_time_sync"
)
NEW = _table(
    "timestamp latitude longitude altitude imu/gyro imu/accel_body position attitude quaternion velocity "
    "rng_1 rng_2 rng_3 rng_4 rng_5 rng_6 velocity_wind windvane/direction windvane/speed airspeed no_time_sync "
    "no_lockstep rc/rc_1 rc/rc_2 rc/rc_3 rc/rc_4 battery/voltage battery/current"
)
REQUIRED = {"timestamp", "imu/gyro", "imu/accel_body", "position", "velocity"}
SIZES = {"imu/gyro": 3, "imu/accel_body": 3, "position": 3, "attitude": 3, "velocity": 3, "quaternion": 4}
NUMBER = re.compile(r"nan|[+-]?\d+\.?\d*(e[+-]?\d+)?", re.IGNORECASE)
FIRST_RANGE_PLACE, RANGES = 7, 6
Exchange = Callable[[bytes], bytes]


def frame(count: int, servo_1: int = 1500, servo_3: int = 1500, rate_hz: int = 400, channels: int = 16) -> bytes:
    """A frame as the firmware sends it."""
    pwm_us = [0] * channels
    pwm_us[0], pwm_us[2] = servo_1, servo_3
    magic = {16: 18458, 32: 29569}[channels]
    return struct.pack(f"<HHI{channels}H", magic, rate_hz, count, *pwm_us)


@dataclass
class Firmware:
    """``exchange`` sends a datagram and gives what comes back, empty if nothing does in time."""

    exchange: Exchange
    keys: list[str] = field(default_factory=lambda: NEW)
    rate_hz: int = 400
    channels: int = 16
    count: int = 0
    clock_s: float = 0.0
    stamp_s: float = 0.0
    state: dict[str, list[float]] = field(default_factory=dict)
    ranges_m: list[float] = field(default_factory=lambda: [math.nan] * RANGES)
    complaints: list[str] = field(default_factory=list)
    _buffer: bytes = b""

    def update(self, servo_1: int = 1500, servo_3: int = 1500) -> bool:
        """One frame, and its answer; whether that was understood."""
        return self.take_in(self.exchange(frame(self.count, servo_1, servo_3, self.rate_hz, self.channels)))

    def drive(self, seconds: float, servo_1: int = 1500, servo_3: int = 1500) -> None:
        """Hold these outputs for some time of the firmware's clock."""
        end_s = self.clock_s + seconds - 1e-9
        while self.clock_s < end_s:
            assert self.update(servo_1, servo_3), self.complaints

    def take_in(self, answer: bytes) -> bool:
        """Bytes from the physics."""
        self._buffer += answer.replace(b"\n", b"\0")
        last = self._buffer.rfind(b"\0")
        first = self._buffer.rfind(b"\0", 0, max(last, 0))
        if last <= 0 or first < 0:
            return False
        text = self._buffer[first + 1 : last].decode("ascii")
        found = self._found(text)
        if found is None:
            return False
        self._buffer = self._buffer[last:]
        self.state |= found
        for place in range(FIRST_RANGE_PLACE, FIRST_RANGE_PLACE + RANGES):
            if self.keys[place] in found:
                number = place - FIRST_RANGE_PLACE
                self.ranges_m[number] = self.state.get(f"rng_{number + 1}", [0.0])[0]
        passed_s = found["timestamp"][0] - self.stamp_s
        if passed_s < 0.0:
            self.complaints.append("physics reset")
        elif passed_s > 0.0:
            assert passed_s < 0.1, "the firmware takes no such step"
        self.clock_s += max(passed_s, 0.0)
        self.stamp_s = found["timestamp"][0]
        self.count = (self.count + 1) % (1 << 32)
        return True

    def _found(self, text: str) -> dict[str, list[float]] | None:
        found: dict[str, list[float]] = {}
        for name in self.keys:
            section, _, key = name.rpartition("/")
            at = text.find(section)
            at = text.find(key, at + len(section) + 1) if at >= 0 else -1
            if at < 0:
                if name in REQUIRED:
                    self.complaints.append(f"failed to find {name}")
                    return None
                continue
            values = _numbers(text[at + len(key) + 2 :], SIZES.get(name, 1))
            if values is None:
                self.complaints.append(f"failed to parse {name}")
                return None
            found[name] = values
        if "attitude" not in found and "quaternion" not in found:
            self.complaints.append("no attitude")
            return None
        return found

    @property
    def heading_rad(self) -> float:
        """From the quaternion, which the firmware prefers."""
        w, x, y, z = self.state["quaternion"]
        return math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


def _numbers(text: str, count: int) -> list[float] | None:
    if count > 1:
        end = text.find("]")
        if not text.startswith("[") or end < 0:
            return None
        parts = text[1:end].split(",")
    else:
        parts = [text]
    matches = [NUMBER.match(part) for part in parts]
    if len(matches) != count or not all(matches):
        return None
    return [float(match[0]) for match in matches if match]
