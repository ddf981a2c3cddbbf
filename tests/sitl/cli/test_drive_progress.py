"""The speed of simulated time."""

import pytest

from sitl.cli.drive_progress import Pace
from tests.support.notices import HandClock


def test_a_pace_counts_from_its_first_moment_and_catches_up() -> None:
    clock = HandClock(100.0)
    pace, free = Pace(10.0, clock), Pace(None, clock)
    pace.wait(5.0)
    free.wait(50.0)
    assert clock.time_s == 100.0
    pace.wait(25.0)
    assert clock.time_s == pytest.approx(102.0)
    clock.time_s = 110.0
    pace.wait(30.0)
    assert clock.time_s == 110.0
