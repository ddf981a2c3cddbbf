"""Motion at up to 2 m/s, recorded from the firmware's own simulated skid rover: the same packets give the same motion.

Speed and turn rate are compared at every recorded moment. Packets are placed in vehicle time to a few hundredths of a
second only, so the moments of a step differ by that much.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.conformance.recordings import FAST, Heard, Recording, Replay, replay
from tests.support.quick import first_of
from tests.support.shared_data import needs_shared

pytestmark = needs_shared
READY_S = 46.0


def rows(heard: tuple[Heard, ...], kind: str, *fields: str) -> NDArray[np.float64]:
    """Time and these fields of a kind of message."""
    told: list[Any] = [one.message for one in heard if one.message.get_type() == kind]
    return np.array([(m.time_boot_ms / 1000, *(getattr(m, field) for field in fields)) for m in told])


def both(one: Replay, kind: str, *fields: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The firmware's and our values at the firmware's times."""
    real, ours = rows(one.real, kind, *fields), rows(one.ours, kind, *fields)
    real = real[(real[:, 0] > READY_S) & (real[:, 0] < ours[-1, 0])]
    assert len(real) > 1000
    return real, np.column_stack([np.interp(real[:, 0], ours[:, 0], column) for column in ours.T])


@dataclass(frozen=True)
class Bounds:
    """How far ours may be from the firmware's: speed (root mean square, most), turn rate, places."""

    speed_rms_m_s: float
    speed_m_s: float
    rate_rms_deg_s: float
    place_m: float


BOUNDS = {
    "velocity-and-turn-rate": Bounds(0.04, 0.12, 3.2, math.inf),
    "turns-at-speed-jerk-0": Bounds(0.04, 0.12, 1.3, 0.3),
    "turns-at-speed-jerk-3": Bounds(0.04, 0.15, 1.6, 0.3),
}
"""Turn rates with the gyro unfiltered: 3.7, 1.55, 1.61 degrees a second. Where velocities are told, small differences
of the heading add up, so places are not compared."""


@first_of(2, "recording", FAST, ids=lambda recording: recording.name)
def test_the_motion_is_the_firmwares(recording: Recording) -> None:
    """One test for each recording: each is replayed once."""
    one, bounds = replay(recording), BOUNDS[recording.name]
    real, ours = both(one, "LOCAL_POSITION_NED", "x", "y", "vx", "vy")
    off_m_s = np.abs(np.hypot(*real[:, 3:].T) - np.hypot(*ours[:, 3:].T))
    assert math.sqrt(np.mean(off_m_s**2)) < bounds.speed_rms_m_s and off_m_s.max() < bounds.speed_m_s
    assert np.hypot(*(real[:, 1:3] - ours[:, 1:3]).T).max() < bounds.place_m
    real_turn, our_turn = both(one, "ATTITUDE", "yawspeed")
    off_deg_s = np.degrees(real_turn[:, 1] - our_turn[:, 1])
    assert math.sqrt(np.mean(off_deg_s**2)) < bounds.rate_rms_deg_s
    if recording.name == "velocity-and-turn-rate":
        # Told 2 rad/s, 114.6 degrees a second: the gyro's filter makes the rate overshoot a little.
        fastest_deg_s = np.degrees([np.abs(real_turn[:, 1]).max(), np.abs(our_turn[:, 1]).max()])
        assert fastest_deg_s == pytest.approx([117.0, 117.0], abs=1.0)
    if recording.name.startswith("turns-at-speed"):
        # It stands 1.3 m (jerk 0) and 1.03 m beyond a position, more than WP_RADIUS; then one 4 m ahead is overshot by
        # 0.57 m, not by 0.2 m.
        when = (real[:, 0] > 134.5) & (real[:, 0] < 144.5)
        for track in (real[when], ours[when]):
            assert np.hypot(*(track[-1, 1:3] - track[0, 1:3])) == pytest.approx(4.57, abs=0.06)
