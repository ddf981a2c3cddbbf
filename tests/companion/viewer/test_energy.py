"""Energy drawn from a battery, added up from its current."""

from __future__ import annotations

import pytest

from companion.vehicle.events import BatterySeen
from companion.viewer.energy import EnergyMeter


def metered(*readings: tuple[float, float | None, float | None]) -> EnergyMeter:
    """Of readings: time, volts, amperes."""
    meter = EnergyMeter()
    for time_s, volts, amperes in readings:
        for _ in range(2):  # the same one is given again
            meter.take(BatterySeen(time_s, 0, volts, None, 0, amperes))
    return meter


def test_current_times_time_is_charge_and_with_the_voltage_energy() -> None:
    meter = metered((0.0, 12.0, 6.0), (5.0, 11.0, 3.0), (10.0, 11.0, 0.0))
    assert meter.charge_ah == pytest.approx((6.0 * 5.0 + 3.0 * 5.0) / 3600.0)
    assert meter.energy_wh == pytest.approx((72.0 * 5.0 + 33.0 * 5.0) / 3600.0)


def test_what_nobody_told_is_not_known() -> None:
    assert (metered().charge_ah, metered().energy_wh) == (None, None)
    silent = metered((0.0, 12.0, None), (5.0, 12.0, None))
    assert (silent.charge_ah, silent.energy_wh) == (None, None)
    no_volts = metered((0.0, None, 1.0), (3.6, None, 1.0))
    assert no_volts.charge_ah == pytest.approx(0.001) and no_volts.energy_wh is None


def test_a_reading_does_not_stand_for_a_long_silence() -> None:
    assert metered((0.0, 12.0, 3.6), (3600.0, 12.0, 3.6)).charge_ah == pytest.approx(0.01)
