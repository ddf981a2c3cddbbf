"""The GPS gate and the step of a position with its fix: whole runs in lock-step, over MAVLink bytes."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from companion.mapping.evidence_map import EvidenceMap
from companion.recording.reader import load_record
from companion.replay.replay import replay
from companion.safety.reasons import Doubt, RunPhase, WaitReason
from companion.settings import Settings, parse_settings
from companion.supervision.localization_monitor import CALM_S
from sitl.faults.plan import Fault, FixName, GpsFixChange, GpsFixUntold
from tests.support.quick import first_of
from tests.support.records import recorded
from tests.support.rig import ARM, GUIDED, HOLD, MANUAL, SET_MODE, Rig, without, yard

GATED = parse_settings({"safety": {"gps_fix": "rtk-fixed"}}, "gate")
LOST_S, SETTLE_S = GATED.safety.gps_lost_s, GATED.safety.gps_settle_s
FLOAT, FIXED = 5, 6
STEP_M = 0.8
ASIDE = math.radians(60.0)
NEAR_M = 0.25
"""A mapped cell so near to something is of that."""
WRONG = 0.05
"""This share of them may be of nothing: what was seen in the first tenths of a second of a step."""


def with_fix(fix_type: int, every: int = 1) -> Any:
    """The line says this fix in every so many messages of the receiver."""
    count = 0

    def change(message: Any) -> Any:
        nonlocal count
        if message.get_type() == "GPS_RAW_INT":
            count += 1
            message.fix_type = fix_type if count % every == 0 else message.fix_type
        return message

    return change


class Stale:
    """The line repeats the receiver's last message."""

    def __init__(self) -> None:
        self._first: Any = None

    def __call__(self, message: Any) -> Any:
        if message.get_type() == "GPS_RAW_INT":
            self._first = self._first or message
            message.time_usec, message.fix_type = self._first.time_usec, self._first.fix_type
        return message


def modes_asked_for(rig: Rig, since_s: float) -> list[float]:
    return [one.message.param2 for one in rig.sent_since(since_s) if one.command == SET_MODE]


@pytest.fixture
def rig(tmp_path: Path) -> Rig:
    """A rover at full speed that needs an RTK fix, and has it."""
    rig = Rig(yard(tmp_path), GATED)
    rig.until_driven(3.0)
    return rig


# The gate -------------------------------------------------------------------------------------------------------------


@first_of(
    1,
    ("bad", "doubt"),
    [(with_fix(FLOAT), Doubt.GPS_POOR), (without("GPS_RAW_INT"), Doubt.GPS_SILENT), (Stale(), Doubt.GPS_SILENT)],
    ids=["float", "silent", "stale"],
)
def test_below_the_gate_it_stands_and_goes_on_by_itself(rig: Rig, bad: Any, doubt: Doubt) -> None:
    rig.change, since_s = bad, rig.now_s()
    rig.run_for(LOST_S + 10.0)
    assert rig.gave(doubt) and rig.does(RunPhase.STOPPED) and rig.speed_m_s < 0.01
    stopped_s = next(one.time_s for one in rig.sent_since(since_s) if one.is_standstill)
    assert stopped_s - since_s <= LOST_S + 0.1
    driven_m = rig.simulator.driven_m
    rig.run_for(SETTLE_S)
    assert rig.simulator.driven_m == pytest.approx(driven_m, abs=0.02)
    rig.change, good_s = None, rig.now_s()
    rig.until(lambda: rig.does(RunPhase.DRIVING), 10.0)
    assert SETTLE_S <= rig.now_s() - good_s <= SETTLE_S + 0.4
    rig.finish()
    assert rig.companion.outcome.complete and rig.simulator.collisions == ()
    assert HOLD not in modes_asked_for(rig, since_s)[:-1], "only at the end of the mission"


def test_single_messages_with_a_worse_fix_stop_nothing(rig: Rig) -> None:
    rig.change = with_fix(FLOAT, every=3)
    rig.finish()
    assert rig.companion.outcome.complete and not rig.was_stopped


def test_without_a_gate_a_worse_fix_stops_nothing(tmp_path: Path) -> None:
    rig = Rig(yard(tmp_path), Settings())
    rig.change = with_fix(3)
    rig.finish()
    assert rig.companion.outcome.complete and not rig.was_stopped


def test_a_person_who_takes_it_below_the_gate_has_it_until_guided_is_set(rig: Rig) -> None:
    rig.change = with_fix(FLOAT)
    rig.until(lambda: rig.gave(Doubt.GPS_POOR), 5.0)
    rig.pilot_mode(MANUAL)
    rig.until(lambda: rig.mode == MANUAL, 2.0)
    rig.change, since_s = None, rig.now_s()
    rig.run_for(SETTLE_S + 2.0)
    assert rig.awaits_guided and not [one for one in rig.sent_since(since_s) if one.moves_or_changes]
    rig.pilot_mode(GUIDED)
    rig.finish()
    assert rig.companion.outcome.complete


def test_it_does_not_even_arm_before_the_fix_is_good_enough(tmp_path: Path) -> None:
    rig = Rig(yard(tmp_path), GATED)
    rig.change = with_fix(FLOAT)
    rig.run_for(6.0)
    assert rig.awaits(WaitReason.GOOD_DATA) and rig.sent and not [one for one in rig.sent if one.moves_or_changes]
    assert str(rig.activity) == "waiting for good data (GPS fix RTK float, RTK fixed needed)"
    rig.change = None
    rig.finish()
    assert rig.companion.outcome.complete and [one for one in rig.sent if one.command == ARM]


@pytest.mark.thorough
def test_a_companion_that_is_killed_below_the_gate_stands_again_and_goes_on_by_itself(tmp_path: Path) -> None:
    mission = yard(tmp_path)
    rig = Rig(mission, GATED, state=tmp_path / "state")
    rig.until_driven(5.0)
    rig.change = with_fix(FLOAT)
    rig.until(lambda: rig.gave(Doubt.GPS_POOR), 5.0)
    rig.run_for(1.0)
    rig.restart_companion(mission, resume=True)
    since_s = rig.now_s()
    rig.run_for(15.0)
    assert rig.does(RunPhase.STOPPED) and rig.speed_m_s < 0.01 and modes_asked_for(rig, since_s) == []
    rig.change = None
    rig.finish()
    assert rig.companion.outcome.complete and rig.simulator.collisions == ()


# The step -------------------------------------------------------------------------------------------------------------


def fix_fault(metres: float = STEP_M, *, start_s: float = 2.0, duration_s: float = 6.0) -> GpsFixChange:
    """From a fixed position to a float one that is wrong, and back."""
    return GpsFixChange(
        start_s, start_s + duration_s, "driving", fix=FixName.RTK_FLOAT, metres=metres, bearing_deg=math.degrees(ASIDE)
    )


def misplaced(rig: Rig) -> float:
    """The share of mapped obstacle cells with nothing that really stands there, as the position is off now."""
    evidence: EvidenceMap | None = rig.companion.evidence
    assert evidence is not None
    off_n, off_e = rig.simulator.vehicle.ekf.offset_m
    start = rig.simulator.start
    rows, columns = np.nonzero(evidence.log_odds >= evidence.settings.occupied_at)
    corner, side_m = evidence.base.south_west, evidence.evidence_m
    world, wrong = rig.simulator.world, 0
    for row, column in zip(rows, columns, strict=True):
        north_m = corner.north_m + (row + 0.5) * side_m - off_n + start.north_m
        east_m = corner.east_m + (column + 0.5) * side_m - off_e + start.east_m
        wrong += world.clearance_m(north_m, east_m, 1.0) > NEAR_M
    assert len(rows) > 20
    return wrong / len(rows)


def stepped(folder: Path, *faults: Fault, settings: Settings | None = None, state: Path | None = None) -> Rig:
    rig = Rig(yard(folder), settings, faults=faults or (fix_fault(),), state=state)
    rig.until(lambda: rig.gave(Doubt.FIX_CHANGED), 90.0)
    return rig


def moves(rig: Rig) -> list[str]:
    return [text for text in rig.texts() if "the map is moved" in text]


def test_the_step_of_a_fix_moves_the_map_and_not_the_rover(tmp_path: Path) -> None:
    rig = stepped(tmp_path)
    speed_m_s, driven_m, goal = rig.speed_m_s, rig.simulator.driven_m, rig.executor.progress.goal
    start = rig.executor.layout.start.point
    rig.until(lambda: bool(moves(rig)), 10.0)
    assert rig.simulator.driven_m - driven_m <= speed_m_s**2 / 2.0 + 0.5 * speed_m_s + 0.2, "it has only braked"
    assert rig.executor.progress.goal == goal, "a target has its place on earth"
    moved = rig.executor.layout.start.point
    led_m = moved.north_m - start.north_m, moved.east_m - start.east_m
    assert led_m == pytest.approx((STEP_M * math.cos(ASIDE), STEP_M * math.sin(ASIDE)), abs=0.08)
    assert rig.executor.progress.home == rig.executor.layout.start
    assert misplaced(rig) < WRONG
    rig.finish()
    assert len(moves(rig)) == 2, "there and back"
    assert misplaced(rig) < WRONG
    assert rig.companion.outcome.complete and rig.simulator.collisions == ()
    assert not rig.gave(Doubt.POSITION_WANDERED) and not rig.gave(Doubt.POSITION_JUMPED)


def test_a_map_that_stays_would_be_wrong(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What the test above looks at shows an error if there is one."""
    rig = stepped(tmp_path)
    monkeypatch.setattr(rig.executor, "move_map", lambda north_m, east_m, now_s: None)
    rig.until(lambda: bool(moves(rig)), 10.0)
    assert misplaced(rig) > 4.0 * WRONG


def test_with_the_gate_it_stands_while_the_fix_is_poor_and_the_map_follows_both_ways(tmp_path: Path) -> None:
    rig = stepped(tmp_path, settings=GATED)
    rig.finish()
    assert rig.gave(Doubt.GPS_POOR) and len(moves(rig)) == 2 and misplaced(rig) < WRONG
    assert rig.companion.outcome.complete and rig.simulator.collisions == ()


@first_of(1, "settings", [GATED, None])
def test_a_fix_that_comes_and_goes_is_waited_out(tmp_path: Path, settings: Settings | None) -> None:
    """It stands for a while after the third step, and goes on without a person."""
    faults = (fix_fault(0.5, start_s=1.0, duration_s=3.0), fix_fault(0.5, start_s=8.0, duration_s=3.0))
    rig = stepped(tmp_path, *faults, settings=settings)
    since_s = rig.now_s()
    rig.finish()
    assert len(moves(rig)) >= 3 and rig.now_s() - since_s > CALM_S
    assert rig.companion.outcome.complete and rig.simulator.collisions == ()
    assert HOLD not in modes_asked_for(rig, since_s)[:-1], "only at the end"
    assert not rig.gave(Doubt.POSITION_WANDERS)


@pytest.mark.thorough
def test_a_step_that_is_too_far_makes_the_map_begin_anew(tmp_path: Path) -> None:
    rig = stepped(tmp_path, fix_fault(2.5))
    rig.until(lambda: rig.gave(Doubt.POSITION_WANDERED) or rig.gave(Doubt.POSITION_JUMPED), 10.0)
    assert not moves(rig)
    rig.finish()
    assert rig.companion.outcome.complete and rig.simulator.collisions == ()


@pytest.mark.thorough
def test_a_fix_that_is_not_told_is_a_gate_that_shuts(tmp_path: Path) -> None:
    rig = Rig(yard(tmp_path), GATED, faults=(GpsFixUntold(2.0, 8.0, "driving"),))
    rig.finish()
    assert rig.gave(Doubt.GPS_SILENT) and rig.companion.outcome.complete


@first_of(1, "after_s", [0.5, 5.0], ids=["while it steps", "afterwards"])
def test_a_companion_that_is_killed_round_a_step_goes_on(tmp_path: Path, after_s: float) -> None:
    rig = stepped(tmp_path, fix_fault(duration_s=100.0), state=tmp_path / "state")
    rig.run_for(after_s)
    mission = rig.companion.mission_run.mission
    rig.restart_companion(mission, resume=True)
    rig.run_for(3.0)
    assert misplaced(rig) < WRONG
    rig.finish()
    assert rig.companion.outcome.complete and rig.simulator.collisions == ()


@pytest.mark.thorough
def test_a_run_with_steps_is_replayed_without_a_difference(tmp_path: Path) -> None:
    path = recorded(tmp_path / "record", yard(tmp_path), "rtk", settings=GATED)
    result = replay(load_record(path))
    assert result.differences == [] and result.heard > 100 and result.said > 10
    texts = (path / "link.tlog").read_bytes()
    assert texts.count(b"the map is moved by") >= 2 and b"Stopping: GPS fix" in texts
