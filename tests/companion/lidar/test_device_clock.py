"""How late the bytes of a lidar come, by its own clock."""

from __future__ import annotations

import pytest

from companion.lidar.device_clock import DeviceClock


def late_s(delays_s: list[float], drift: float = 0.0) -> list[float]:
    """Of packets every 0.1 s, which come so late."""
    clock = DeviceClock()
    return [
        clock.late_s(round(100.0 * i * (1.0 + drift)) % 30_000, 0.1 * i + delay_s) for i, delay_s in enumerate(delays_s)
    ]


def test_a_delay_that_begins_is_told_as_long_as_it_lasts_also_when_the_clock_wraps() -> None:
    found = late_s([0.02] * 250 + [0.5] * 250 + [0.02] * 50)
    assert max(found[:250]) < 0.01 and max(found[501:]) < 0.01
    assert min(found[251:500]) > 0.4


@pytest.mark.parametrize("drift", [-5e-4, 5e-4])
def test_clocks_that_drift_apart_for_half_an_hour_are_no_delay(drift: float) -> None:
    assert max(late_s([0.02] * 18_000, drift)) < 0.05


def test_jitter_counts_from_the_best_moment() -> None:
    found = late_s([0.02, 0.04, 0.01, 0.03] * 20)
    assert max(found) < 0.04 and found[-1] == pytest.approx(0.02, abs=0.005)


def test_a_lidar_without_a_clock_or_with_one_that_stands_is_never_late() -> None:
    for told in (None, 7):
        clock = DeviceClock()
        assert all(clock.late_s(told, float(time_s)) == 0.0 for time_s in range(20))


def test_a_clock_that_begins_anew_is_not_late_for_long() -> None:
    clock = DeviceClock()
    told_ms = [*range(0, 20_000, 100), *range(0, 20_000, 100)]
    found = [clock.late_s(told, 0.1 * i) for i, told in enumerate(told_ms)]
    assert max(found) < 0.3
