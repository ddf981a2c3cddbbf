"""A position that steps because the GPS fix has changed, told from a rover that moves."""

from __future__ import annotations

import math

import numpy as np
import pytest

from companion.safety.fix_jump import BEFORE_S, CALM_S, SEEN_M, WATCHED_S, FixJump, JumpPhase
from companion.vehicle.events import GpsSeen, LocalPositionSeen
from companion.vehicle.gps_fix import GpsFix

STEP_S, GPS_S = 0.1, 0.2
FLOAT, FIXED = GpsFix.RTK_FLOAT, GpsFix.RTK_FIXED


class Reports:
    """A rover that drives north at ``speed_m_s``; its position is off by what a test says, and so is its velocity."""

    def __init__(self, speed_m_s: float = 1.0, noise_m: float = 0.0, seed: int = 0) -> None:
        self.jump, self.noise_m, self.rng = FixJump(), noise_m, np.random.default_rng(seed)
        self.speed_m_s = speed_m_s
        self.ticks = 0
        self.true_m = 0.0
        self.off_m = (0.0, 0.0)

    @property
    def now_s(self) -> float:
        return round(self.ticks * STEP_S, 6)

    def go(self, seconds: float, fix: GpsFix = FIXED, to_m: tuple[float, float] | None = None, lag_s: float = 1.0):
        """The phases, with this fix; the position's error goes to ``to_m`` as an EKF that follows."""
        phases = []
        for _ in range(round(seconds / STEP_S)):
            self.ticks += 1
            self.true_m += self.speed_m_s * STEP_S
            if to_m is not None:
                share = 1.0 - math.exp(-STEP_S / lag_s)
                self.off_m = tuple(off + share * (to - off) for off, to in zip(self.off_m, to_m, strict=True))
            if self.ticks % 2 == 0:
                self.jump.take_fix(GpsSeen(self.now_s, fix, 10))
            north_m, east_m = self.noise_m * self.rng.standard_normal(2)
            position = self.true_m + self.off_m[0] + north_m, self.off_m[1] + east_m
            self.jump.take_report(LocalPositionSeen(self.now_s, self.now_s, *position, self.speed_m_s, 0.0))
            phases.append(self.jump.phase)
            if self.jump.phase is JumpPhase.SETTLED:
                break
        return phases


@pytest.mark.parametrize("speed_m_s", [0.0, 2.0])
@pytest.mark.parametrize("to_m", [(0.3, 0.0), (-0.6, 0.5), (0.0, -1.2)])
@pytest.mark.parametrize("lag_s", [0.01, 1.0])
def test_a_step_with_the_fix_is_measured_however_the_rover_moves(
    speed_m_s: float, to_m: tuple[float, float], lag_s: float
) -> None:
    reports = Reports(speed_m_s)
    assert set(reports.go(5.0, FLOAT)) == {JumpPhase.NONE}
    phases = reports.go(WATCHED_S, FIXED, to_m, lag_s)
    assert JumpPhase.STEPPING in phases and phases[-1] is JumpPhase.SETTLED
    assert len(phases) * STEP_S <= 5.0
    assert (reports.jump.before, reports.jump.after) == (FLOAT, FIXED)
    assert math.dist((reports.jump.north_m, reports.jump.east_m), to_m) < 0.06
    assert set(reports.go(2.0 * WATCHED_S, FIXED, to_m)) == {JumpPhase.NONE}, "it is told once"
    assert not reports.jump.watching and reports.jump.off_m == 0.0


def test_without_a_change_of_fix_nothing_is_a_step_of_it() -> None:
    reports = Reports()
    reports.go(5.0)
    assert set(reports.go(10.0, FIXED, (0.8, 0.0))) == {JumpPhase.NONE}


def test_a_change_of_fix_without_a_step_stops_nothing() -> None:
    reports = Reports()
    reports.go(5.0, FLOAT)
    assert set(reports.go(5.0, FIXED, (0.9 * SEEN_M, 0.0))) == {JumpPhase.NONE}
    assert set(reports.go(WATCHED_S, FIXED)) == {JumpPhase.NONE}
    assert not reports.jump.watching


def test_a_step_that_began_before_the_message_of_the_fix_counts_whole() -> None:
    reports = Reports()
    reports.go(5.0, FLOAT)
    reports.go(0.6 * BEFORE_S, FLOAT, (0.0, 0.8))
    assert reports.go(8.0, FIXED, (0.0, 0.8))[-1] is JumpPhase.SETTLED
    assert reports.jump.east_m == pytest.approx(0.8, abs=0.06)


def test_a_receiver_that_was_lost_meanwhile_tells_no_change() -> None:
    reports = Reports()
    reports.go(5.0, FLOAT)
    reports.go(5.0, GpsFix.NO_FIX)
    assert set(reports.go(5.0, FIXED, (0.8, 0.0))) == {JumpPhase.NONE}


def test_a_position_that_does_not_come_to_rest_is_lost() -> None:
    reports = Reports()
    reports.go(5.0, FLOAT)
    phases = []
    for number in range(120):
        phases += reports.go(0.1, FIXED, (0.04 * number, 0.0), 0.01)
    assert JumpPhase.SETTLED not in phases and phases.count(JumpPhase.LOST) == 1
    assert not reports.jump.watching


def test_a_gap_in_the_reports_ends_the_comparison() -> None:
    reports = Reports()
    reports.go(5.0, FLOAT)
    reports.go(0.3, FIXED, (0.5, 0.0))
    assert reports.jump.watching
    reports.ticks += 20
    reports.go(0.1)
    assert not reports.jump.watching and reports.jump.phase is JumpPhase.NONE


def test_a_step_must_have_been_over_for_a_while() -> None:
    reports = Reports()
    reports.go(5.0, FLOAT)
    phases = reports.go(8.0, FIXED, (0.0, 0.5), 0.01)
    assert phases.index(JumpPhase.SETTLED) - phases.index(JumpPhase.STEPPING) >= round(CALM_S / STEP_S) - 2


@pytest.mark.parametrize("step_m", [0.1, 0.15, 0.2, 0.5])
def test_what_is_told_of_a_step_that_can_hardly_be_seen_is_never_more_than_the_step(step_m: float) -> None:
    """Reports are off by 3 cm: whatever is told in all, the place of the map is no worse for it than before."""
    for seed in range(20):
        reports, told_m = Reports(0.0, 0.03, seed), [0.0, 0.0]
        reports.go(5.0, FLOAT)
        for _ in range(40):
            if reports.go(1.0, FIXED, (step_m, 0.0), 0.01)[-1] is JumpPhase.SETTLED:
                told_m = [told_m[0] + reports.jump.north_m, told_m[1] + reports.jump.east_m]
        assert math.dist(told_m, (step_m, 0.0)) <= max(SEEN_M, 0.08) + 0.06, (seed, told_m)


def test_a_fix_that_changes_again_and_again_does_not_keep_a_step_going() -> None:
    reports = Reports()
    reports.go(5.0, FLOAT)
    phases = []
    for number in range(150):
        phases += reports.go(0.2, FLOAT if number % 10 < 5 else FIXED, (0.05 * number, 0.0), 0.01)
    assert JumpPhase.LOST in phases[: round((WATCHED_S + 3.0) / STEP_S)]
