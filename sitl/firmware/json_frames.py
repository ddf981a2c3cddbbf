"""Frames of ArduPilot's JSON interface: servo outputs arrive in a binary frame, the rover's state is returned as text.

Source: ArduPilot, libraries/SITL/SIM_JSON and its description.

Nouns: JSON interface.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

RANGES_MOST = 6
"""``rng_1`` to ``rng_6``."""
COUNTS = 1 << 32
"""Frame numbers wrap around at this value."""

_FORMS = {18458: struct.Struct("<HHI16H"), 29569: struct.Struct("<HHI32H")}
_MAGIC = struct.Struct("<H")


@dataclass(frozen=True, slots=True)
class ServoFrame:
    """A frame of the firmware: steps per second that it wants, the frame's number, pulses in microseconds."""

    rate_hz: int
    count: int
    pwm_us: tuple[int, ...]


class BodyState(NamedTuple):
    """State for the firmware: metres from the start, m/s, radians, m/s^2; world NED, body forward and right."""

    time_s: float
    north_m: float
    east_m: float
    vel_north_m_s: float
    vel_east_m_s: float
    heading_rad: float
    yaw_rate_rad_s: float
    accel_ahead_m_s2: float
    accel_right_m_s2: float


def decode(datagram: bytes) -> ServoFrame | None:
    """The frame in a datagram, with 16 or 32 channels; None if it is not a frame."""
    if len(datagram) < _MAGIC.size:
        return None
    form = _FORMS.get(_MAGIC.unpack_from(datagram)[0])
    if form is None or len(datagram) != form.size:
        return None
    _, rate_hz, count, *pwm_us = form.unpack(datagram)
    return ServoFrame(rate_hz, count, tuple(pwm_us)) if rate_hz else None


def encode(state: BodyState, down_m_s2: float, ranges_m: Sequence[float]) -> bytes:
    """The answer to a frame; ``down_m_s2``: reading of the accelerometer downwards; a range of NaN means no reading.

    The firmware searches for the keys as plain text and expects the value two characters later, so there are no
    spaces. The heading is given twice, because some versions accept ``rng_1`` only with ``attitude`` and ``rng_2``
    only with ``quaternion``.
    """
    time_s, north_m, east_m, vel_n, vel_e, heading_rad, yaw_rate, ahead, right = state
    ranges = "".join(
        f',"rng_{number}":{range_m:.3f}' if math.isfinite(range_m) else f',"rng_{number}":NaN'
        for number, range_m in enumerate(ranges_m, 1)
    )
    half_rad = 0.5 * heading_rad
    return (
        f'\n{{"timestamp":{time_s:.9f},"imu":{{"gyro":[0.0,0.0,{yaw_rate:.9f}],'
        f'"accel_body":[{ahead:.9f},{right:.9f},{down_m_s2}]}},'
        f'"position":[{north_m:.9f},{east_m:.9f},0.0],"attitude":[0.0,0.0,{heading_rad:.9f}],'
        f'"quaternion":[{math.cos(half_rad):.9f},0.0,0.0,{math.sin(half_rad):.9f}],'
        f'"velocity":[{vel_n:.9f},{vel_e:.9f},0.0]{ranges}}}\n'
    ).encode("ascii")
