"""Stuck recovery: when a rover counts as stuck, how it backs out, and what it remembers of the place."""

import math
from dataclasses import replace

import pytest

from companion.control.controller import STANDSTILL, ControlCommand, Purpose, stop_for
from companion.control.local_view import LocalView
from companion.control.stuck_recovery import (
    CIRCLES_M,
    ELSEWHERE_M,
    FRESH_PENALTY,
    LINGERS_PER_M,
    MOVED_M,
    PATIENT,
    SAME_PLACE_M,
    TRIES_AT_ONE_PLACE,
    TURNED_RAD,
    StuckRecovery,
)
from companion.core.frames import NedPoint, Pose
from companion.core.grid import empty_grid
from companion.core.rover_limits import RoverLimits
from companion.mapping.evidence_map import EvidenceMap, new_map
from companion.settings import Settings
from companion.settings.settings_file import parse_settings
from companion.vehicle.commands import GuidedPosition, GuidedVelocity

SETTINGS = Settings()
LIMIT_S = SETTINGS.guidance.stuck_after_s
DRIVE = ControlCommand(Purpose.DRIVE, GuidedPosition(NedPoint(14.0, 10.5)), 1.0)
BLOCKED = stop_for(Purpose.BLOCKED)
AHEAD = NedPoint(11.5, 10.5)


def seen_map() -> EvidenceMap:
    evidence = new_map(empty_grid(20, 20), 0.35, SETTINGS.mapping)
    evidence.log_odds.fill(-1.0)
    return evidence


def view(time_s: float, evidence: EvidenceMap | None = None, north_m: float = 10.5, turned: float = 0.0) -> LocalView:
    pose = Pose(north_m, 10.5, turned, time_s)
    return LocalView(pose, 0.0, seen_map() if evidence is None else evidence, RoverLimits(0.35, 2.0, 8.0), SETTINGS)


def watching() -> StuckRecovery:
    recovery = StuckRecovery()
    recovery.begin(view(0.0).pose)
    return recovery


@pytest.mark.parametrize(("command", "limit_s"), [(DRIVE, LIMIT_S), (BLOCKED, LIMIT_S / 3.0)])
def test_a_rover_that_stays_where_it_is_is_stuck_and_sooner_where_it_is_blocked(
    command: ControlCommand, limit_s: float
) -> None:
    assert not watching().is_stuck(view(limit_s - 0.01), command)
    assert watching().is_stuck(view(limit_s), command)


@pytest.mark.parametrize(
    ("controller", "lasts_s", "patient"), [("motion-ga", 3.0, PATIENT), ("motion-ga", 0.3, 1.0), ("points", 3.0, 1.0)]
)
def test_motions_without_a_guard_have_longer_as_little_speed_may_be_told_in_a_gap(
    controller: str, lasts_s: float, patient: float
) -> None:
    settings = parse_settings({"guidance": {"controller": controller, "velocity_lasts_s": lasts_s}}, "test")
    before, then = (
        replace(view(time_s), settings=settings) for time_s in (patient * LIMIT_S - 0.01, patient * LIMIT_S)
    )
    assert not watching().is_stuck(before, DRIVE) and watching().is_stuck(then, DRIVE)


def test_moving_on_counts_from_anew_and_turning_counts_for_a_while() -> None:
    recovery = watching()
    assert not recovery.is_stuck(view(LIMIT_S, north_m=10.5 + MOVED_M), DRIVE)
    assert not recovery.is_stuck(view(2.0 * LIMIT_S - 0.1, north_m=10.5 + MOVED_M), DRIVE)
    assert recovery.is_stuck(view(2.0 * LIMIT_S, north_m=10.5 + MOVED_M), DRIVE)
    turning, ticks = watching(), [i * 0.5 * LIMIT_S for i in range(1, 7)]
    stuck = [turning.is_stuck(view(time_s, turned=i % 2 * TURNED_RAD), DRIVE) for i, time_s in enumerate(ticks, 1)]
    assert stuck == [False] * 5 + [True], "turning to and fro is no progress in the end"


@pytest.mark.parametrize("radius_m", CIRCLES_M)
def test_a_rover_that_goes_to_and_fro_is_stuck_when_it_does_not_leave_a_circle_in_time(radius_m: float) -> None:
    def stuck_after_s(reach_m: float, until_s: float) -> float:
        recovery, evidence = watching(), seen_map()
        for tick in range(1, int(until_s)):
            north_m = 10.5 + reach_m * abs((tick / 10.0) % 2.0 - 1.0)
            if recovery.is_stuck(view(float(tick), evidence, north_m), DRIVE):
                return float(tick)
        return math.inf

    allowed_s = LINGERS_PER_M * LIMIT_S * radius_m
    assert allowed_s <= stuck_after_s(0.95 * radius_m, 2.0 * allowed_s) <= allowed_s + 2.0
    assert stuck_after_s(2.0 * max(CIRCLES_M) + 0.1, 10.0 * allowed_s) == math.inf, "far to and fro is on its way"


def test_a_pause_does_not_count() -> None:
    recovery = watching()
    recovery.pause()
    assert not recovery.is_stuck(view(10.0 * LIMIT_S), DRIVE)
    assert recovery.is_stuck(view(11.0 * LIMIT_S), DRIVE), "it counts again from then on"


def test_it_backs_out_as_far_as_the_settings_say() -> None:
    recovery, evidence = watching(), seen_map()
    assert recovery.backing(view(1.0, evidence)) is None
    recovery.back_out(view(1.0, evidence), AHEAD)
    guidance = SETTINGS.guidance
    ends_s = 1.0 + guidance.back_out_m / guidance.back_out_speed_m_s
    command = recovery.backing(view(1.0, evidence))
    assert command is not None and command.purpose is Purpose.LOOK
    assert command.setpoint == GuidedVelocity(-guidance.back_out_speed_m_s, 0.0)
    assert recovery.backing(view(ends_s - 0.01, evidence)) is not None
    assert recovery.backing(view(ends_s, evidence)) is None


def test_it_counts_how_often_it_was_stuck_at_one_place() -> None:
    recovery, evidence = watching(), seen_map()
    counts = []
    for north_m in (10.5, 10.9, 10.1, 10.5 + ELSEWHERE_M, 10.6 + ELSEWHERE_M, 10.5):
        recovery.back_out(view(1.0, evidence, north_m), AHEAD)
        counts.append(recovery.times_here)
    assert counts == [1, 2, 3, 1, 2, 1]


def test_one_that_still_turns_stands_first_as_it_would_not_go_straight() -> None:
    recovery, evidence = watching(), seen_map()
    recovery.back_out(view(1.0, evidence), AHEAD)
    assert recovery.backing(replace(view(1.0, evidence), yaw_rate_rad_s=-1.0)) == STANDSTILL
    command = recovery.backing(replace(view(1.5, evidence), yaw_rate_rad_s=-0.2))
    assert command is not None and command.speed_m_s > 0.0


def test_one_that_still_rolls_ahead_stands_first() -> None:
    recovery, evidence = watching(), seen_map()
    recovery.back_out(view(1.0, evidence), AHEAD)
    assert recovery.backing(replace(view(1.0, evidence), speed_m_s=0.3)) == STANDSTILL
    back = recovery.backing(replace(view(1.5, evidence), speed_m_s=0.3, rolls_back=True))
    assert back is not None and back.speed_m_s > 0.0


def test_without_room_behind_it_stands_and_that_is_all() -> None:
    recovery, evidence = watching(), seen_map()
    evidence.log_odds[:78] = 2.0
    recovery.back_out(view(1.0, evidence), AHEAD)
    assert recovery.backing(view(1.0, evidence)) == STANDSTILL
    assert recovery.backing(view(1.05, evidence)) is None


def test_the_settings_of_the_moment_hold() -> None:
    patient = SETTINGS.model_copy(
        update={"guidance": SETTINGS.guidance.model_copy(update={"stuck_after_s": 100.0 * LIMIT_S})}
    )
    assert not watching().is_stuck(replace(view(2.0 * LIMIT_S), settings=patient), DRIVE)


def test_a_place_grows_costly_and_in_the_end_closed() -> None:
    recovery, evidence = watching(), seen_map()
    field = evidence.base.cell_at(AHEAD)
    for tries in range(1, TRIES_AT_ONE_PLACE):
        recovery.back_out(view(float(tries), evidence), AHEAD)
        assert evidence.penalty[field.y, field.x] == pytest.approx(tries * FRESH_PENALTY)
        assert not evidence.grid.is_obstacle(field)
    recovery.back_out(view(9.0, evidence), AHEAD)
    assert evidence.grid.is_obstacle(field)
    assert math.isclose(float(evidence.penalty.sum()), float(evidence.penalty[field.y, field.x])), "it alone"


def test_where_fields_are_small_a_gap_beside_is_another_place() -> None:
    recovery, evidence = watching(), new_map(empty_grid(80, 80, 0.2), 0.35, SETTINGS.mapping)
    for number in range(TRIES_AT_ONE_PLACE):
        recovery.back_out(view(9.0, evidence), NedPoint(8.0, 8.0 + 0.25 * number))
    assert evidence.penalty.max() == pytest.approx(FRESH_PENALTY)


def test_places_near_one_another_count_as_one() -> None:
    recovery, evidence = watching(), seen_map()
    for tries in range(TRIES_AT_ONE_PLACE):
        recovery.back_out(view(float(tries), evidence), NedPoint(11.95 + tries * 0.1, 10.5))
    assert evidence.grid.is_obstacle(evidence.base.cell_at(NedPoint(12.1, 10.5))), "the last one is closed"
    assert not evidence.grid.is_obstacle(evidence.base.cell_at(NedPoint(11.95, 10.5)))
    recovery.back_out(view(9.0, evidence), NedPoint(12.15 + SAME_PLACE_M + 0.1, 10.5))
    assert not evidence.grid.is_obstacle(evidence.base.cell_at(NedPoint(12.8, 9.4))), "another place"
