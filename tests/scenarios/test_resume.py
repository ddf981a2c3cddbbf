"""A companion is killed at any moment, and another one resumes its run: in lock-step, over MAVLink bytes."""

from __future__ import annotations

import math
import shutil
from pathlib import Path

import numpy as np
import pytest

from companion.checkpoint.resume import PreviousRun
from companion.checkpoint.state_format import SavedState, decode_state
from companion.control.model_estimate import ModelEstimate
from companion.core.grid import Cell
from companion.executive.mission_progress import MissionPhase, TargetStatus
from companion.mission.mission import Mission, OnBlocked
from companion.mission.resolve import ResolvedTarget
from companion.navigation.field_step import Action
from companion.safety.mode_latch import Control
from companion.safety.reasons import Doubt, WaitReason
from companion.settings import parse_settings
from companion.supervision.arming import LEFT_S
from tests.scenarios.test_safety_pilot import hold_sticks
from tests.support.quick import first_of
from tests.support.rig import ARM, GATE, GUIDED, HOLD, MANUAL, SET_MODE, Rig, Sent, without, yard

TWO = GATE + 'hold_s = 1.0\n[[target]]\nname = "corner"\nfield = [4, 3]\n'
UP_S = 45.0
RESUMED_S = 2.0


def rig_of(folder: Path, targets: str = TWO, *, seed: int = 0, sealed: bool = False) -> tuple[Rig, Mission]:
    mission = yard(folder, targets, sealed=sealed)
    return Rig(mission, seed=seed, late_s=UP_S, state=folder / "state"), mission


def state_in(folder: Path) -> SavedState:
    return decode_state((folder / "state" / "mission.state").read_bytes())[0]


def kill_and_resume(rig: Rig, mission: Mission) -> None:
    """The companion is gone between two ticks: its last packets still arrive, its unfinished file is lost."""
    beside = Path(str(rig.state_file) + ".new")
    beside.write_bytes(b"half a sta")
    rig.restart_companion(mission, resume=True)


def assert_setpoints_only_when_ours(sent: list[Sent]) -> None:
    setpoints = [one for one in sent if one.is_setpoint]
    assert setpoints
    assert all(one.mode == GUIDED and one.armed for one in setpoints)


def goes_on_after_s(rig: Rig, since_s: float) -> float:
    """So long after a moment the companion has led the rover somewhere again."""

    def led() -> list[float]:
        return [one.time_s for one in rig.sent_since(since_s) if one.is_setpoint and not one.is_standstill]

    rig.until(lambda: bool(led()), 20.0)
    return led()[0] - since_s


@first_of(1, "seed", range(5))
def test_killed_at_random_times_it_drives_the_mission_to_its_end(tmp_path: Path, seed: int) -> None:
    rig, mission = rig_of(tmp_path, seed=seed)
    rng = np.random.default_rng(seed)
    for _ in range(3):
        rig.run_for(float(rng.uniform(0.1, 14.0)))
        if rig.companion.done:
            break
        begun = rig.companion.driver is not None
        kill_and_resume(rig, mission)
        if begun and rig.mode == GUIDED:
            assert goes_on_after_s(rig, rig.now_s()) <= RESUMED_S
    rig.finish()
    assert rig.companion.outcome.complete, rig.texts()
    reached = [target for target, action in rig.log.decided if action is Action.REACHED]
    assert reached == ["gate", "corner"], "what was reached is not driven to again"
    assert rig.simulator.collisions == ()
    assert_setpoints_only_when_ours(rig.sent)
    assert state_in(tmp_path).ended and state_in(tmp_path).reached == 2


@pytest.mark.thorough
def test_the_same_kill_gives_the_same_run(tmp_path: Path) -> None:
    commands = []
    for name in ("one", "two"):
        (tmp_path / name).mkdir()
        rig, mission = rig_of(tmp_path / name)
        rig.until_driven(9.0)
        kill_and_resume(rig, mission)
        rig.finish()
        commands.append([(one.time_s, one.message.to_dict()) for one in rig.sent if one.moves_or_changes])
    assert len(commands[0]) >= 40 and commands[0] == commands[1]


@pytest.mark.parametrize("metres", [0.5, 12.0])
def test_map_and_past_path_are_there_again(tmp_path: Path, metres: float) -> None:
    rig, mission = rig_of(tmp_path)
    rig.until_driven(metres)
    rig.run_for(0.5)
    assert rig.companion.evidence is not None
    before = rig.companion.evidence.log_odds.copy()
    kill_and_resume(rig, mission)
    assert goes_on_after_s(rig, rig.now_s()) <= RESUMED_S
    evidence, driver = rig.companion.evidence, rig.companion.driver
    assert evidence is not None and driver is not None
    seen_before, seen_now = before != 0.0, evidence.log_odds != 0.0
    assert (seen_before & seen_now).sum() > 0.8 * seen_before.sum(), "what had been seen, but for the last seconds"
    state = driver.nav_state
    assert state is not None and state.past[0] == Cell(2, 7), "the way back on this leg"
    trail = rig.executor.trail.back()
    assert trail[-1] == Cell(2, 7), "the way back to the start"
    assert metres < 3.0 or len(trail) > 5
    assert rig.companion.progress is not None and rig.companion.progress.home.cell == Cell(2, 7)
    assert any(text.startswith("Resumed with its map, 0 targets reached") for text in rig.texts())


@pytest.mark.thorough
def test_a_requested_goal_is_run_to_its_end_and_then_the_mission(tmp_path: Path) -> None:
    rig, mission = rig_of(tmp_path)
    rig.until_driven(3.0)
    centre = rig.executor.evidence.base.centre_of(Cell(5, 12))
    rig.executor.request(ResolvedTarget("requested goal 1", centre, Cell(5, 12), 0.0, OnBlocked.SKIP, 1.5))
    rig.run_for(0.5)
    kill_and_resume(rig, mission)
    goes_on_after_s(rig, rig.now_s())
    progress = rig.companion.progress
    assert progress is not None and progress.requested is not None and progress.requested.cell == Cell(5, 12)
    rig.until(lambda: rig.companion.progress is not None and rig.companion.progress.requested is None)
    truth = rig.simulator.truth
    assert math.hypot(truth.north_m - 12.5, truth.east_m - 5.5) < 1.5
    rig.finish()
    assert rig.companion.outcome.complete


@pytest.mark.thorough
def test_a_rover_on_its_way_back_goes_on_back(tmp_path: Path) -> None:
    targets = GATE + 'on_blocked = "return"\n'
    rig, mission = rig_of(tmp_path, targets, sealed=True)
    rig.until(lambda: rig.companion.progress is not None and rig.companion.progress.phase is MissionPhase.HOME, 200.0)
    kill_and_resume(rig, mission)
    rig.finish()
    assert [status for _, status in rig.companion.statuses()] == [TargetStatus.UNREACHABLE]
    truth = rig.simulator.truth
    assert math.hypot(truth.north_m - 7.5, truth.east_m - 2.5) < 1.5
    assert rig.times_decided(Action.UNREACHABLE, "gate") == 1, "it had been found out before"
    assert rig.simulator.collisions == ()


@pytest.mark.thorough
def test_the_link_comes_up_and_within_two_seconds_it_drives(tmp_path: Path) -> None:
    rig, mission = rig_of(tmp_path)
    rig.until_driven(5.0)
    rig.cut = True
    kill_and_resume(rig, mission)
    rig.run_for(8.0)
    rig.cut = False
    assert goes_on_after_s(rig, rig.now_s()) <= RESUMED_S
    rig.finish()
    assert rig.companion.outcome.complete and rig.simulator.collisions == ()


@pytest.mark.thorough
def test_a_rover_that_cannot_be_driven_again_stands_and_is_left_to_a_person_in_hold(tmp_path: Path) -> None:
    rig, mission = rig_of(tmp_path)
    rig.until_driven(5.0)
    rig.change = lambda message: None if message.get_type() == "EKF_STATUS_REPORT" else message
    kill_and_resume(rig, mission)
    since_s = rig.now_s()
    rig.until(lambda: rig.mode == HOLD, 20.0)
    assert LEFT_S <= rig.now_s() - since_s <= LEFT_S + 4.0
    assert all(one.is_standstill for one in rig.sent_since(since_s) if one.is_setpoint)
    assert rig.texts()[-1] == "HOLD: waited too long for good data (no EKF status)"
    rig.change = None
    rig.run_for(10.0)
    assert rig.mode == HOLD and rig.speed_m_s < 0.05, "good data alone do not bring it back"
    rig.pilot_mode(GUIDED)
    rig.finish()
    assert rig.companion.outcome.complete


@pytest.mark.thorough
@pytest.mark.parametrize("data", ["good", "missing"])
def test_sticks_that_were_taken_hold_of_while_the_companion_was_dead_take_the_rover(tmp_path: Path, data: str) -> None:
    rig, mission = rig_of(tmp_path)
    rig.until_driven(8.0)
    rig.run_for(5.0)  # long enough for a state with sticks
    kill_and_resume(rig, mission)
    rig.change = without("OBSTACLE_DISTANCE") if data == "missing" else None
    since_s = rig.now_s()
    hold_sticks(rig, 1700, 1300, 4.0)
    assert rig.mode == HOLD, rig.texts()
    assert data == "missing" or rig.gave(Doubt.STICKS_MOVED)
    held_s = next(one.time_s for one in rig.sent_since(since_s) if one.command == SET_MODE)
    assert held_s - since_s <= 1.5
    assert all(one.is_standstill for one in rig.sent_since(since_s) if one.is_setpoint and data == "missing")
    assert not [one for one in rig.sent_since(held_s + 0.01) if one.is_setpoint]
    rig.change = None
    rig.run_for(10.0)
    assert rig.mode == HOLD


def lose_power(rig: Rig, mission: Mission) -> None:
    """Of the whole rover, autopilot and companion; it is back at once."""
    rig.simulator._reboot()
    rig.restart_companion(mission, resume=True)


def test_after_a_loss_of_power_it_arms_and_goes_on_where_it_was(tmp_path: Path) -> None:
    rig, mission = rig_of(tmp_path)
    rig.until(lambda: rig.goals[-1:] == ["corner"])
    rig.run_for(2.0)
    lose_power(rig, mission)
    rig.until(lambda: rig.companion.vehicle.ekf_ok and rig.companion.vehicle.position is not None, 60.0)
    assert goes_on_after_s(rig, rig.now_s()) <= RESUMED_S
    rig.finish()
    assert rig.companion.outcome.complete, rig.texts()
    assert rig.times_decided(Action.REACHED, "gate") == 1, "what was reached is not driven to again"
    assert any("Resumed with the obstacles of its map" in text for text in rig.texts())
    assert rig.simulator.collisions == ()
    assert_setpoints_only_when_ours(rig.sent)
    truth = rig.simulator.truth
    assert math.hypot(truth.north_m - 3.5, truth.east_m - 4.5) < 1.5, (
        "home is where the mission began, not where it was switched on"
    )


@first_of(1, "alive", [True, False], ids=["before", "while it is dead"])
@first_of(1, "mode", [MANUAL, pytest.param(HOLD, marks=pytest.mark.thorough)])
def test_a_rover_that_a_person_has_taken_stays_with_that_person(tmp_path: Path, mode: int, alive: bool) -> None:
    rig, mission = rig_of(tmp_path)
    rig.until_driven(4.0)
    if alive:
        rig.pilot_mode(mode)
        rig.until(lambda: rig.mode == mode, 2.0)
        rig.run_for(0.2)
        assert state_in(tmp_path).control is Control.PERSON
    else:
        rig.cut = True
        rig.pilot_mode(mode)
        rig.run_for(0.1)
        rig.cut = False
    kill_and_resume(rig, mission)
    since_s = rig.now_s()
    rig.run_for(8.0)
    assert rig.mode == mode
    assert [one for one in rig.sent_since(since_s + 0.1) if one.moves_or_changes] == []
    assert rig.awaits_guided
    rig.pilot_mode(GUIDED)
    rig.finish()
    assert rig.companion.outcome.complete and rig.simulator.collisions == ()


@pytest.mark.thorough
def test_a_rover_disarmed_by_a_person_is_not_armed_after_a_restart(tmp_path: Path) -> None:
    rig, mission = rig_of(tmp_path)
    rig.until_driven(4.0)
    rig.pilot(ARM, 0)
    rig.until(lambda: not rig.armed, 2.0)
    kill_and_resume(rig, mission)
    since_s = rig.now_s()
    rig.run_for(10.0)
    assert [one for one in rig.sent_since(since_s) if one.moves_or_changes] == []
    assert rig.awaits(WaitReason.PERSON_ARMS)
    rig.pilot(ARM, 1)
    rig.finish()
    assert rig.companion.outcome.complete


@pytest.mark.thorough
def test_after_an_orderly_stop_it_goes_on_by_itself(tmp_path: Path) -> None:
    rig, mission = rig_of(tmp_path)
    rig.until_driven(4.0)
    rig.companion.stop()
    rig.finish()
    state = state_in(tmp_path)
    assert state.released and not state.ended
    rig.run_for(1.0)
    rig.restart_companion(mission, resume=True)
    rig.finish()
    assert rig.companion.outcome.complete and rig.simulator.collisions == ()


@pytest.mark.thorough
def test_after_an_orderly_stop_a_rover_that_a_person_has_put_away_is_not_armed(tmp_path: Path) -> None:
    rig, mission = rig_of(tmp_path)
    rig.until_driven(4.0)
    rig.companion.stop()
    rig.finish()
    for command, value in ((SET_MODE, MANUAL), (ARM, 0)):
        rig.pilot(command, *((1, value) if command == SET_MODE else (value,)))
        rig.sleep_until_s(rig.now_s() + 2.0)
    assert rig.mode == MANUAL and not rig.armed
    rig.restart_companion(mission, resume=True)
    since_s = rig.now_s()
    rig.run_for(10.0)
    assert [one for one in rig.sent_since(since_s) if one.moves_or_changes] == []
    assert rig.awaits(WaitReason.PERSON_SETS_GUIDED_AGAIN)
    rig.pilot_mode(GUIDED)
    rig.pilot(ARM, 1)
    rig.finish()
    assert rig.companion.outcome.complete


def test_an_error_in_the_program_leaves_a_state_to_go_on_from(tmp_path: Path) -> None:
    rig, mission = rig_of(tmp_path)
    rig.until_driven(4.0)
    rig.companion.close()
    state = state_in(tmp_path)
    assert state.released and not state.ended
    rig.restart_companion(mission, resume=True)
    rig.finish()
    assert rig.companion.outcome.complete


def test_a_jump_of_the_position_is_not_survived_by_the_map(tmp_path: Path) -> None:
    """A crash right after it must not bring back a map that lies elsewhere now."""
    rig, mission = rig_of(tmp_path)
    rig.until_driven(6.0)
    rig.run_for(1.0)

    def moved(message: object) -> object:
        if message.get_type() == "LOCAL_POSITION_NED":  # type: ignore[attr-defined]
            message.x -= 3.0  # type: ignore[attr-defined]
        return message

    rig.change = moved
    rig.until(lambda: rig.gave(Doubt.POSITION_JUMPED), 3.0)
    kept = PreviousRun(*decode_state((tmp_path / "state" / "mission.state").read_bytes()))
    assert not kept.rasters["log_odds"].any()
    kill_and_resume(rig, mission)
    rig.until(lambda: rig.companion.evidence is not None, 3.0)
    evidence = rig.companion.evidence
    assert evidence is not None and not (evidence.log_odds[56:80, 64:72] >= 0.6).any(), "the wall where it was before"


@pytest.mark.thorough
def test_a_disk_that_fails_is_told_once_and_the_mission_goes_on(tmp_path: Path) -> None:
    rig, _ = rig_of(tmp_path)
    rig.until_driven(2.0)
    shutil.rmtree(tmp_path / "state")
    rig.finish()
    assert rig.companion.outcome.complete
    assert sum("The state cannot be saved" in text for text in rig.texts()) == 1


def test_how_the_rover_follows_is_not_forgotten(tmp_path: Path) -> None:
    """From the first moment the companion that resumes knows what the one before had found."""
    mission = yard(tmp_path, TWO)
    motions = parse_settings({"guidance": {"controller": "motion-ga"}}, "here")
    rig = Rig(mission, motions, late_s=UP_S, state=tmp_path / "state")
    rig.until_driven(1.0)
    before = rig.companion.mission_run.executor
    assert before is not None
    began = before.estimator.estimate.began
    found = ModelEstimate(began, began._replace(dead_s=0.4, turn_gain=1.2), 2.5, 2.5, 2.5)
    before.estimator.estimate = found
    old = ((196, "obstacle distance", 0), 0.15)
    before.range_ages.go_on([old])
    saved = state_in(tmp_path)
    rig.until(lambda: state_in(tmp_path) != saved, 20.0)
    kill_and_resume(rig, mission)
    rig.until(lambda: rig.companion.mission_run.executor is not None, 20.0)
    after = rig.companion.mission_run.executor
    assert after is not None and after.estimator.estimate.known == found.known
    assert after.range_ages.found == (old,)
    assert after.estimator.estimate.figures.turn_gain > 1.1 and after.estimator.estimate.figures.dead_s > 0.35
