"""Motion at up to 2 m/s, recorded from the firmware's own simulated skid rover: the same packets give the same motion.

Speed and turn rate are compared at every recorded moment. Packets are placed in vehicle time to a few hundredths of a
second only, so the moments of a step differ by that much.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.conformance.recordings import FAST, Heard, Replay, replay
from tests.support.shared_data import needs_shared

pytestmark = needs_shared
READY_S = 46.0


@pytest.fixture(scope="module")
def replays() -> dict[str, Replay]:
    """Every recording with its replay."""
    return {recording.name: replay(recording) for recording in FAST}


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


@pytest.mark.parametrize(
    ("name", "rms_m_s", "most_m_s"),
    [
        ("velocity-and-turn-rate", 0.04, 0.12),
        ("turns-at-speed-jerk-0", 0.04, 0.12),
        ("turns-at-speed-jerk-3", 0.08, 0.4),
    ],
)
def test_the_speed_is_the_firmwares(replays: dict[str, Replay], name: str, rms_m_s: float, most_m_s: float) -> None:
    real, ours = both(replays[name], "LOCAL_POSITION_NED", "vx", "vy")
    off_m_s = np.abs(np.hypot(*real[:, 1:].T) - np.hypot(*ours[:, 1:].T))
    assert math.sqrt(np.mean(off_m_s**2)) < rms_m_s and off_m_s.max() < most_m_s


@pytest.mark.parametrize(
    ("name", "rms_deg_s"),
    [("velocity-and-turn-rate", 3.2), ("turns-at-speed-jerk-0", 1.3), ("turns-at-speed-jerk-3", 1.6)],
)
def test_the_turn_rate_is_the_firmwares(replays: dict[str, Replay], name: str, rms_deg_s: float) -> None:
    """With the gyro unfiltered: 3.7, 1.55 and 1.61."""
    real, ours = both(replays[name], "ATTITUDE", "yawspeed")
    off_deg_s = np.degrees(real[:, 1] - ours[:, 1])
    assert math.sqrt(np.mean(off_deg_s**2)) < rms_deg_s


def test_told_two_radians_a_second_it_turns_so_and_no_faster(replays: dict[str, Replay]) -> None:
    """The gyro's filter makes the rate overshoot a little; without it nothing would."""
    real, ours = both(replays["velocity-and-turn-rate"], "ATTITUDE", "yawspeed")
    fastest_deg_s = np.degrees([np.abs(real[:, 1]).max(), np.abs(ours[:, 1]).max()])
    assert fastest_deg_s == pytest.approx([117.0, 117.0], abs=1.0)


@pytest.mark.parametrize(("name", "most_m"), [("turns-at-speed-jerk-0", 0.3), ("turns-at-speed-jerk-3", 0.5)])
def test_turning_aside_at_speed_it_comes_by_the_same_places(
    replays: dict[str, Replay], name: str, most_m: float
) -> None:
    """Straight at 2 m/s, then one position 30 to 160 degrees aside; at the end positions 2, 4, 8 and 20 m ahead."""
    real, ours = both(replays[name], "LOCAL_POSITION_NED", "x", "y")
    assert np.hypot(*(real[:, 1:] - ours[:, 1:]).T).max() < most_m


def test_after_an_overrun_the_next_position_is_overshot(replays: dict[str, Replay]) -> None:
    """It stands 1.3 m beyond a position, more than WP_RADIUS; then one 4 m ahead is overshot by 0.57 m, not 0.2 m."""
    real, ours = both(replays["turns-at-speed-jerk-0"], "LOCAL_POSITION_NED", "x", "y")
    when = (real[:, 0] > 134.5) & (real[:, 0] < 144.5)
    for track in (real, ours):
        assert np.hypot(*(track[when, 1:][-1] - track[when, 1:][0])) == pytest.approx(4.57, abs=0.06)
