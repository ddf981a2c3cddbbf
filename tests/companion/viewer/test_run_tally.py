"""What is counted of a run."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import pytest

from companion.core.frames import GeoPoint, LocalFrame, NedPoint, Pose
from companion.executive.mission_progress import TargetStatus
from companion.safety.reasons import Activity, LatchReason, Reason, RunPhase, WaitReason
from companion.viewer.run_tally import RunTally

DRIVING = Activity(RunPhase.DRIVING)
NO_SEARCH = SimpleNamespace(seconds=[])


def moment(time_s: float, heard_s: float, activity: Activity = DRIVING) -> Any:
    """The companion at a time, in its own clock 100 s later; its newest position, 2 m/s, of ``heard_s``."""
    position = SimpleNamespace(time_s=100.0 + heard_s)
    vehicle = SimpleNamespace(speed_m_s=2.0, forward_m_s=2.0, battery=None, position=position)
    run = SimpleNamespace(activity=activity, stop=None, is_driving=False, places=None, taken_over=False)
    status = SimpleNamespace(
        time_s=100.0 + time_s, pose=None, activity=activity, target="gate", decision=None, doing=str(activity)
    )
    return cast(
        Any,
        SimpleNamespace(
            vehicle=vehicle,
            mission_run=run,
            status=lambda: status,
            statuses=lambda: [("gate", "")],
            driver=None,
            executor=None,
            outcome=SimpleNamespace(broken_off=None),
        ),
    )


def test_a_speed_that_was_heard_long_ago_is_no_distance() -> None:
    tally = RunTally()
    for tick in range(1, 601):
        time_s = 0.05 * tick
        tally.ticked(moment(time_s, min(time_s, 10.0)), time_s)
    assert tally.driven_m == pytest.approx(2.0 * 11.0, abs=0.3) and tally.moving_s == pytest.approx(11.0, abs=0.1)


def test_a_rover_that_is_led_and_does_not_get_on_has_a_row_in_the_table() -> None:
    tally = RunTally()
    for tick in range(1, 201):
        now = moment(0.1 * tick, 0.1 * tick)
        now.driver = SimpleNamespace(decision=None, makes_way=True, tally=SimpleNamespace(stuck=0), searcher=NO_SEARCH)
        now.status().pose = Pose(0.0, 0.0, 0.0, 100.0 + 0.1 * tick)
        tally.ticked(now, 0.1 * tick)
    spell = tally.stood["making way for something that moves"]
    assert spell.times == 1 and spell.seconds == pytest.approx(17.0, abs=0.3) and tally.stops == 0


def test_data_that_is_missing_is_told_as_the_large_line_has_it_whoever_has_the_rover() -> None:
    """The mode has been changed, and good data is awaited, too."""
    awaited = Reason(WaitReason.GOOD_DATA_AND, ("position silent", Reason(WaitReason.PERSON_SETS_GUIDED_AGAIN)))
    activity = Activity(RunPhase.STOPPED_AND_WAITING, Reason(LatchReason.OTHER_MODE, ("GUIDED",)), awaited)
    tally = RunTally()
    for tick in range(1, 101):
        now = moment(0.1 * tick, 0.1 * tick, activity)
        now.vehicle.forward_m_s = 2.0 if tick < 20 else 0.0  # it still rolls
        tally.ticked(now, 0.1 * tick)
    assert list(tally.stood) == ["stopped: position silent"] and tally.stops == 1
    assert tally.stood["stopped: position silent"].seconds == pytest.approx(10.0, abs=0.2)
    assert tally.watchdogs["position silent"].seconds == pytest.approx(10.0, abs=0.2)


def test_the_track_counts_from_the_first_origin_also_after_the_autopilot_has_got_another_one() -> None:
    tally, first = RunTally(), GeoPoint(53.0, 23.0)
    there = LocalFrame(first).to_geo(NedPoint(24.0, 0.0))
    for tick, origin, north_m in ((1, first, 24.0), (2, there, 0.0), (3, there, 1.0)):
        now = moment(tick, tick)
        now.mission_run.places = SimpleNamespace(origin=origin)
        now.status().pose = Pose(north_m, 0.0, 0.0, 100.0 + tick)
        tally.ticked(now, float(tick))
    assert [north_m for _, north_m, _ in tally.track] == pytest.approx([24.0, 24.0, 25.0], abs=0.02)


def led(tally: RunTally, ticks: range, *statuses: TargetStatus) -> None:
    """The rover drives north at 2 m/s while its targets are in this state."""
    for tick in ticks:
        now = moment(0.1 * tick, 0.1 * tick)
        now.mission_run.is_driving = True
        now.mission_run.places = SimpleNamespace(origin=GeoPoint(53.0, 23.0))
        now.status().pose = Pose(0.2 * tick, 0.0, 0.0, 100.0 + 0.1 * tick)
        now.statuses = lambda: [(f"target {number}", status) for number, status in enumerate(statuses)]
        tally.ticked(now, 0.1 * tick)


def test_a_leg_begins_where_the_last_target_ended_whatever_became_of_it() -> None:
    tally, pending, reached = RunTally(), TargetStatus.PENDING, TargetStatus.REACHED
    led(tally, range(1, 101), pending, pending)
    led(tally, range(101, 151), TargetStatus.UNREACHABLE, pending)
    led(tally, range(151, 161), TargetStatus.UNREACHABLE, reached)
    first, second = tally.legs
    assert first.ended_s == pytest.approx(10.1) and first.driven_m == pytest.approx(20.0, abs=0.3)
    assert first.straight_m is None and second.ended_s == pytest.approx(15.1)
    assert second.driven_m == pytest.approx(10.0, abs=0.3) and second.straight_m == pytest.approx(10.0, abs=0.3)


def test_targets_of_a_patrol_have_the_figures_of_the_lap_begun_last() -> None:
    tally, pending, reached = RunTally(), TargetStatus.PENDING, TargetStatus.REACHED
    led(tally, range(1, 51), pending, pending)
    led(tally, range(51, 101), reached, pending)
    led(tally, range(101, 102), reached, reached)
    led(tally, range(102, 151), pending, pending)
    led(tally, range(151, 161), reached, pending)
    first, second = tally.legs
    assert first.ended_s == pytest.approx(15.1) and first.driven_m == pytest.approx(10.0, abs=0.3)
    assert second.status is pending and second.ended_s is None and second.driven_m is None
