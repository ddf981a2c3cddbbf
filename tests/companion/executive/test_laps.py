"""The odometer and the summary of a lap."""

from __future__ import annotations

import pytest

from companion.core.frames import NedPoint
from companion.executive.laps import LapStart, Odometer, lap_summary


def test_metres_are_counted_without_noise_and_jumps() -> None:
    odometer = Odometer()
    for north_m in (0.0, 0.1, -0.1, 1.0, 1.05, 2.0, 50.0, 51.0):
        odometer.at(NedPoint(north_m, 0.0))
    assert odometer.driven_m == pytest.approx(3.0)
    odometer.forget_place()
    odometer.at(NedPoint(0.0, 0.0))
    assert odometer.driven_m == pytest.approx(3.0)


def test_a_lap_in_words() -> None:
    assert str(lap_summary(3, LapStart(10.0, 100.0, 1), 70.4, 180.2, (), 1)) == "Lap 3: 60 s, 80 m, no target missed"
    assert str(lap_summary(4, LapStart(0.0), 5.0, 6.0, ("a", "b"), 2)) == (
        "Lap 4: 5 s, 6 m, missed a, b, 2 commands refused or unanswered"
    )
