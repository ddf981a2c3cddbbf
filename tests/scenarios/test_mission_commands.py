"""Missions with commands and laps, driven: over real bytes, with faults, killed and resumed, and replayed."""

from __future__ import annotations

from pathlib import Path

import pytest

from companion.mission.load import load_mission
from companion.mission.mission import Mission, with_laps
from companion.recording.reader import load_record
from companion.recording.recorder import NullRecorder
from companion.replay.replay import replay
from companion.settings import Settings
from sitl.lockstep import Drive
from sitl.scenario import scenario_from_mission
from sitl.simulator import Simulator
from tests.support.quick import first_of
from tests.support.records import recorded
from tests.support.rig import GATE, GUIDED, HOLD, RTL, Rig, yard
from tests.support.served import finished, mission_path, process, served
from tests.support.shared_data import SHARED, needs_shared

SERVO, RELAY, SPRAYER, CAMERA, GRIPPER = 183, 181, 216, 203, 211
WORKING = """
[[command]]
name = "DO_SPRAYER"
params = [1]
[[target]]
name = "corner"
field = [4, 4]
hold_s = 1.0
[[target.command]]
name = "DO_SET_SERVO"
params = [9, 1900]
[[target.command]]
name = "DO_DIGICAM_CONTROL"
params = [0, 0, 0, 0, 1]
after_s = 1.0
[[target.command]]
name = "DO_GRIPPER"
params = [1, 1]
within_m = 2.0
[[target]]
name = "door"
field = [4, 10]
[[target.command]]
name = "DO_SPRAYER"
params = [0]
"""


@pytest.mark.thorough
def test_a_mission_with_commands_under_faults_is_done_once_and_replayed_bit_for_bit(tmp_path: Path) -> None:
    mission = yard(tmp_path, WORKING)
    record = load_record(recorded(tmp_path / "record", mission, faults="commands"))
    result = replay(record)
    assert result.differences == [] and [status for _, status in result.targets] == ["reached", "reached"]
    assert result.companion is not None
    assert result.companion.command_lines() == [
        "DO_SPRAYER 1 at the start: accepted",
        "DO_SET_SERVO 9 1900 at corner: accepted",
        "DO_DIGICAM_CONTROL 0 0 at corner: refused (denied)",
        "DO_GRIPPER 1 1 at corner: refused (failed)",
        "DO_SPRAYER 0 at door: accepted",
    ]
    ended = "Mission ended: 2 of 2 targets reached; commands: 3 accepted, 2 refused"
    assert ended in result.companion.outcome.said


def test_where_and_when_commands_are_given(tmp_path: Path) -> None:
    rig = Rig(yard(tmp_path, WORKING))
    rig.finish()
    events = {(event.command, event.params[0]): event for event in rig.simulator.commands}
    corner = (rig.simulator.start.north_m - 3.0, rig.simulator.start.east_m + 2.0)
    for key in ((SERVO, 9.0), (CAMERA, 0.0)):
        event = events[key]
        assert abs(event.north_m - corner[0]) < 1.0 and abs(event.east_m - corner[1]) < 1.0
    assert 0.9 < events[CAMERA, 0.0].time_s - events[SERVO, 9.0].time_s < 1.5
    gripper, door = events[GRIPPER, 1.0], (rig.simulator.start.north_m + 3.0, corner[1])
    assert 1.0 < abs(gripper.north_m - door[0]) < 2.5, "on the way, two metres before the door"


@pytest.mark.thorough
def test_a_target_that_cannot_be_reached_gets_none_of_its_commands(tmp_path: Path) -> None:
    servo = '[[target.command]]\nname = "DO_SET_SERVO"\nparams = [9, 1900]\n'
    rig = Rig(yard(tmp_path, GATE + servo, sealed=True))
    rig.finish()
    assert rig.simulator.commands == ()
    assert "Not sent, the rover is not there: DO_SET_SERVO 9 1900" in rig.companion.outcome.said
    assert rig.companion.command_lines() == ["DO_SET_SERVO 9 1900 at gate: left out"]


def test_a_person_who_takes_over_is_not_disturbed_by_commands(tmp_path: Path) -> None:
    """What is open waits until the companion has the rover again."""
    rig = Rig(yard(tmp_path, WORKING))
    rig.until(lambda: any(event.command == SERVO for event in rig.simulator.commands), 120.0)
    rig.pilot_mode(HOLD)
    rig.run_for(5.0)
    assert not any(event.command == CAMERA for event in rig.simulator.commands)
    rig.pilot_mode(GUIDED)
    rig.finish()
    assert [event.command for event in rig.simulator.commands] == [SPRAYER, SERVO, CAMERA, GRIPPER, SPRAYER]


@first_of(1, "resumed", [False, True])
def test_nothing_is_switched_on_where_a_pilot_has_brought_the_rover(tmp_path: Path, resumed: bool) -> None:
    mission = yard(tmp_path, WORKING.replace("after_s = 1.0", "after_s = 4.0"))
    rig = Rig(mission, state=tmp_path / "state")
    rig.until(lambda: any(event.command == SERVO for event in rig.simulator.commands), 120.0)
    rig.pilot_mode(RTL)
    rig.run_for(12.0)
    if resumed:
        rig.restart_companion(mission, resume=True)
    rig.pilot_mode(GUIDED)
    rig.finish()
    assert CAMERA not in [event.command for event in rig.simulator.commands]
    assert "Not sent, the rover is not at corner any more: DO_DIGICAM_CONTROL 0 0" in rig.companion.outcome.said
    assert "DO_DIGICAM_CONTROL 0 0 at corner: left out" in rig.companion.command_lines()


def with_a_relay(simulator: Simulator) -> None:
    simulator.vehicle.parameters.set("RELAY1_FUNCTION", 1.0)
    simulator.vehicle.parameters.set("RELAY1_PIN", 5.0)


@first_of(1, "ticks", range(5))
def test_killed_round_a_command_it_is_done_once(tmp_path: Path, ticks: int) -> None:
    """The death comes so many ticks after the rover has reached the place."""
    relay = '[[target.command]]\nname = "DO_SET_RELAY"\nparams = [0, 2]\n'
    mission = yard(tmp_path, WORKING.replace("[[target.command]]", relay + "[[target.command]]", 1))
    rig = Rig(mission, state=tmp_path / "state", prepare=with_a_relay)
    rig.until(lambda: "Reached corner" in rig.companion.outcome.said, 120.0)
    for _ in range(ticks):
        rig.companion.tick()
    rig.restart_companion(mission, resume=True)
    rig.finish()
    given = [event.command for event in rig.simulator.commands]
    told = [text for text in rig.companion.outcome.said if "may have been sent before" in text]
    assert given.count(RELAY) <= 1, "it switches over: twice is not once"
    assert given.count(RELAY) == 1 or any("its result is not known" in text for text in told)
    assert 1 <= given.count(SERVO) <= 2 and (given.count(SERVO) == 1 or any("sent again" in text for text in told))
    assert rig.companion.outcome.complete


def drive(mission: Mission) -> Drive:
    one = Drive(mission, scenario_from_mission(mission), Settings(), 0, NullRecorder())
    one.run()
    return one


@pytest.mark.thorough
@needs_shared
def test_a_real_patrol_goes_round_and_counts(tmp_path: Path) -> None:
    mission = with_laps(load_mission(SHARED / "data" / "missions" / "ros_gz_rover" / "playpen.txt"), 2)
    one = drive(mission)
    laps = one.companion.laps
    assert [lap.number for lap in laps] == [1, 2] and all(lap.missed == () for lap in laps)
    assert one.report.exit_code == 0 and sum(lap.driven_m for lap in laps) == pytest.approx(
        one.report.distance_m, abs=5
    )
    assert sum(text.startswith("Lap ") for text in one.report.said) == 2


@pytest.mark.thorough
def test_a_patrol_goes_on_until_it_is_ended_and_says_what_was_missed(tmp_path: Path) -> None:
    patrol = '\n[[target]]\nname = "corner"\nfield = [4, 3]\n[patrol]\n'
    rig = Rig(yard(tmp_path, GATE + patrol, sealed=True))
    rig.until(lambda: len(rig.companion.laps) == 2, 400.0)
    assert [lap.missed for lap in rig.companion.laps] == [("gate",), ("gate",)] and not rig.companion.done
    rig.companion.stop()
    rig.finish()
    assert not rig.companion.complete


def test_a_loop_that_leads_nowhere_does_not_spin(tmp_path: Path) -> None:
    rig = Rig(yard(tmp_path, '[[target]]\nname = "here"\nfield = [2, 7]\n[patrol]\n'))
    rig.until(lambda: len(rig.companion.laps) == 1, 120.0)
    rig.run_for(8.0)
    assert len(rig.companion.laps) <= 3


NEAR = """
[[target]]
name = "near"
field = [4, 7]
[[target.command]]
name = "DO_SET_SERVO"
params = [9, 1900]
[[target]]
name = "back"
field = [2, 7]
[[target.command]]
name = "DO_GRIPPER"
params = [1, 1]
"""


def test_two_programs_with_a_socket_between_them_and_a_state_on_the_disk(tmp_path: Path) -> None:
    """The thread that saves the state lets each command go; the replay knows when that was."""
    mission, record = yard(tmp_path, NEAR), tmp_path / "record"
    with (
        served(mission) as world,
        process(
            "companion", "run", mission_path(mission), "--connect", world.url, "--arm",
            "--record", record, "--state", tmp_path / "state",
        ) as run,
    ):  # fmt: skip
        code, out, err = finished(run)
        events = [(event.command, event.result_name) for event in world.simulator.commands]
    assert code == 0, err
    assert set(events) == {(SERVO, "accepted"), (GRIPPER, "failed")}
    assert "DO_SET_SERVO 9 1900 at near: accepted" in out and "DO_GRIPPER 1 1 at back: refused (failed)" in out
    assert replay(load_record(record)).differences == []
