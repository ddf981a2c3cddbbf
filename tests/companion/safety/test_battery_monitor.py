"""Thresholds of the battery: which reading counts, for how long it must last, and that a level never goes back."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.safety.battery_monitor import BatteryLevel, BatteryMonitor, BatteryState, judged, with_battery
from companion.safety.reasons import PowerReason, Reason, WaitReason
from companion.settings import PowerSettings
from companion.vehicle.events import BatterySeen, EkfStatusSeen
from companion.vehicle.state import VehicleState

SETTINGS = PowerSettings(return_percent=20.0, hold_percent=10.0, return_volts=11.0, hold_volts=10.5, after_s=5.0)


def fed(readings: list[tuple[float, int | None, float | None]], settings: PowerSettings = SETTINGS) -> BatteryState:
    """Time, per cent, volts of one battery; judged at each."""
    state = BatteryState()
    for time_s, percent, volts in readings:
        state = judged(with_battery(state, BatterySeen(time_s, 0, volts, percent)), time_s, settings)
    return state


def steady(
    percent: int | None, volts: float | None, seconds: float = 6.0
) -> list[tuple[float, int | None, float | None]]:
    return [(0.5 * i, percent, volts) for i in range(int(2.0 * seconds) + 1)]


@pytest.mark.parametrize(
    ("percent", "volts", "level", "reason"),
    [
        (20, 11.0, BatteryLevel.FINE, None),
        (19, 12.0, BatteryLevel.RETURN, PowerReason.CHARGE),
        (50, 10.9, BatteryLevel.RETURN, PowerReason.VOLTAGE),
        (10, 12.0, BatteryLevel.RETURN, PowerReason.CHARGE),
        (9, 12.0, BatteryLevel.HOLD, PowerReason.CHARGE),
        (None, 10.5, BatteryLevel.RETURN, PowerReason.VOLTAGE),
        (None, 10.4, BatteryLevel.HOLD, PowerReason.VOLTAGE),
        (0, 12.0, BatteryLevel.HOLD, PowerReason.CHARGE),
        (None, None, BatteryLevel.FINE, None),
    ],
)
def test_levels(percent: int | None, volts: float | None, level: BatteryLevel, reason: PowerReason | None) -> None:
    state = fed(steady(percent, volts))
    assert (state.level, None if state.reason is None else state.reason.kind) == (level, reason)


def test_it_takes_a_while_without_a_break() -> None:
    assert fed(steady(15, 12.0, 4.5)).level is BatteryLevel.FINE
    assert fed(steady(15, 12.0, 5.0)).level is BatteryLevel.RETURN
    broken = [(t, 15 if t != 3.0 else 25, v) for t, _, v in steady(15, 12.0, 7.0)]
    assert fed(broken).level is BatteryLevel.FINE


def test_a_level_never_goes_back_but_a_rover_that_has_not_begun_may() -> None:
    power = BatteryMonitor(SETTINGS)
    for i in range(12):
        power.take(BatterySeen(0.5 * i, 0, 12.0, 15), VehicleState())
        power.level(0.5 * i)
    assert power.awaited(6.0) == Reason(WaitReason.CHARGED_BATTERY, (power.reason,))
    power.take(BatterySeen(7.0, 0, 12.6, 100), VehicleState())
    assert power.level(7.0) is BatteryLevel.RETURN and power.reason == Reason(PowerReason.CHARGE, ("battery", 15))
    assert power.awaited(7.0) is None


def test_the_reason_is_the_reading_that_led_to_the_level() -> None:
    state = fed([*steady(15, 12.0, 5.0), (5.5, 14, 12.0)])
    assert state.reason == Reason(PowerReason.CHARGE, ("battery", 15))
    assert fed(steady(None, 10.94)).reason == Reason(PowerReason.VOLTAGE, ("battery", 10.9))


def test_a_rover_without_a_battery_report_may_drive() -> None:
    power = BatteryMonitor(SETTINGS)
    power.take(EkfStatusSeen(0.0, 0), VehicleState())
    assert power.level(10.0) is BatteryLevel.FINE and power.reason is None and power.awaited(10.0) is None


@pytest.mark.parametrize(("age_s", "level"), [(10.0, BatteryLevel.RETURN), (10.1, BatteryLevel.FINE)])
def test_a_reading_that_has_grown_old_says_nothing(age_s: float, level: BatteryLevel) -> None:
    state = fed(steady(15, 12.0, 4.0))
    assert judged(state, 4.0 + age_s, SETTINGS).level is level


def test_the_short_form_counts_only_where_there_is_no_other() -> None:
    state = with_battery(BatteryState(), BatterySeen(0.0, -1, 12.0, 5))
    for time_s in (0.0, 5.0):
        alone = judged(state if time_s == 0.0 else judged(state, 0.0, SETTINGS), time_s, SETTINGS)
    assert alone.level is BatteryLevel.HOLD
    both = with_battery(state, BatterySeen(0.0, 0, 12.0, 80))
    assert judged(judged(both, 0.0, SETTINGS), 6.0, SETTINGS).level is BatteryLevel.FINE


def test_any_of_several_batteries_counts_and_is_named() -> None:
    state = with_battery(with_battery(BatteryState(), BatterySeen(0.0, 0, 12.0, 80)), BatterySeen(0.0, 1, 12.0, 12))
    state = judged(judged(state, 0.0, SETTINGS), 5.0, SETTINGS)
    assert (state.level, state.reason) == (BatteryLevel.RETURN, Reason(PowerReason.CHARGE, ("battery 2", 12)))


@pytest.mark.parametrize(
    ("charge_state", "level", "kind"),
    [
        (0, BatteryLevel.FINE, None),
        (1, BatteryLevel.FINE, None),
        (2, BatteryLevel.RETURN, PowerReason.LOW),
        (3, BatteryLevel.HOLD, PowerReason.CRITICAL),
        (5, BatteryLevel.HOLD, PowerReason.CRITICAL),
        (6, BatteryLevel.FINE, None),
    ],
)
def test_the_autopilots_own_failsafe_counts_unless_switched_off(
    charge_state: int, level: BatteryLevel, kind: PowerReason | None
) -> None:
    for heed in (True, False):
        power = BatteryMonitor(SETTINGS.model_copy(update={"heed_autopilot": heed}))
        power.take(BatterySeen(0.0, 0, 12.0, 80, charge_state), VehicleState())
        reason = None if kind is None or not heed else Reason(kind, ("battery",))
        assert power.awaited(0.0) == (None if reason is None else Reason(WaitReason.CHARGED_BATTERY, (reason,)))
        assert power.level(0.0) is BatteryLevel.FINE
        assert (power.level(5.0), power.reason) == (level if heed else BatteryLevel.FINE, reason)


def test_zero_switches_a_threshold_off() -> None:
    off = PowerSettings(return_percent=0.0, hold_percent=0.0)
    assert fed(steady(0, 0.5), off).level is BatteryLevel.FINE


@given(st.lists(st.tuples(st.none() | st.integers(0, 100), st.none() | st.floats(0.1, 60.0)), max_size=60))
def test_whatever_comes_the_level_only_rises_and_has_a_reason(readings: list[tuple[int | None, float | None]]) -> None:
    state = BatteryState()
    for i, (percent, volts) in enumerate(readings):
        before = state.level
        state = judged(with_battery(state, BatterySeen(float(i), 0, volts, percent)), float(i), SETTINGS)
        assert state.level >= before
        assert (state.reason is not None) == (state.level > BatteryLevel.FINE)
