"""Positions that jump, freeze or drift, compared with their velocity."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from companion.vehicle.dead_reckoning import (
    DRIFT_S,
    MAX_DRIFT_M,
    MAX_QUICK_M,
    QUICK_S,
    Drift,
    Reckoning,
    drift_after,
    jump_m,
    reckoning_after,
)
from companion.vehicle.events import LocalPositionSeen

STEP_S = 0.1


def report(time_s: float, north_m: float, speed_m_s: float, boot_s: float | None = None) -> LocalPositionSeen:
    return LocalPositionSeen(time_s, time_s if boot_s is None else boot_s, north_m, 0.0, speed_m_s, 0.0)


def reports(seconds: float, speed_m_s: float, moved_m_s: float) -> list[LocalPositionSeen]:
    """Northwards; the position moves by ``moved_m_s``, the velocity says ``speed_m_s``."""
    return [report(STEP_S * i, moved_m_s * STEP_S * i, speed_m_s) for i in range(round(seconds / STEP_S) + 1)]


@pytest.mark.parametrize(
    ("speed_m_s", "moved_m_s", "frozen"), [(1.0, 1.0, False), (1.0, 0.0, True), (1.0, 0.3, False), (0.1, 0.0, False)]
)
def test_a_position_is_frozen_if_only_the_velocity_moves(speed_m_s: float, moved_m_s: float, frozen: bool) -> None:
    reckoning: Reckoning | None = None
    before: LocalPositionSeen | None = None
    noticed = False
    for now in reports(12.0, speed_m_s, moved_m_s):
        reckoning, found = reckoning_after(reckoning, before, now)
        noticed, before = noticed or found, now
    assert noticed == frozen


@pytest.mark.parametrize(("off_m_s", "noticed"), [(0.0, False), (0.15, False), (0.3, True)])
def test_a_position_that_leaves_its_velocity_drifts(off_m_s: float, noticed: bool) -> None:
    drift, before, found = Drift(), None, False
    for now in reports(3.0 * DRIFT_S, 1.0, 1.0 + off_m_s):
        drift, before = drift_after(drift, before, now), now
        found = found or drift.noticed
    assert found == noticed == (off_m_s * DRIFT_S > MAX_DRIFT_M)


@pytest.mark.parametrize(("off_m", "noticed"), [(0.4, False), (0.7, True)])
def test_a_position_that_steps_aside_is_noticed_and_has_settled_once_it_follows_its_velocity(
    off_m: float, noticed: bool
) -> None:
    """As an EKF that a wrong GPS has led astray: within half a second, and it stays there."""
    drift, before, found, settled_s = Drift(), None, False, []
    for led in reports(6.0, 1.0, 1.0):
        astray_m = off_m * min(max(led.time_s - 2.0, 0.0) / 0.5, 1.0)
        now = replace(led, north_m=led.north_m + astray_m)
        drift, before = drift_after(drift, before, now), now
        found = found or drift.noticed
        settled_s += [now.time_s] if drift.settled else []
    assert found == noticed == (off_m > MAX_QUICK_M)
    unsettled = [t for t in np.arange(0.0, 6.0, STEP_S) if not any(abs(t - s) < STEP_S / 2 for s in settled_s)]
    assert max(unsettled) == pytest.approx(2.5 + QUICK_S, abs=0.4) and min(settled_s) == pytest.approx(1.0, abs=0.15)


def test_a_pause_in_the_reports_starts_the_comparison_again() -> None:
    drift = Drift(0.9, 0.0, ((0.0, 0.0, 0.0),), 0.9)
    assert drift_after(drift, report(1.0, 0.0, 0.0), report(3.0, 0.0, 0.0)) == Drift()


def test_a_jump_is_measured_from_where_the_velocity_led() -> None:
    assert jump_m(None, report(1.0, 5.0, 0.0)) == 0.0
    assert jump_m(report(1.0, 0.0, 2.0), report(1.5, 1.0, 2.0)) == pytest.approx(0.0)
    assert jump_m(report(1.0, 0.0, 2.0), report(1.5, 4.0, 2.0)) == pytest.approx(3.0)


def test_when_the_autopilots_clock_has_jumped_the_clock_that_fits_counts() -> None:
    before, now = report(1.0, 0.0, 1.0), report(1.5, 0.5, 1.0, boot_s=100.0)
    assert jump_m(before, now, clock_jumped=True) == pytest.approx(0.0)
    assert jump_m(before, now) > 50.0
    assert math.isfinite(jump_m(before, now))
