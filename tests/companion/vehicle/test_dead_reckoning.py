"""Positions that jump, freeze or drift, compared with their velocity."""

from __future__ import annotations

import math

import pytest

from companion.vehicle.dead_reckoning import (
    DRIFT_S,
    MAX_DRIFT_M,
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
