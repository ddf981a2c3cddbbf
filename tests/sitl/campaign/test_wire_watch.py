"""The watch on the line: quiet on drives as they should be, and it finds a companion that does what it must not."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.recording.recorder import NullRecorder
from companion.settings import Settings
from sitl.campaign.wire_watch import WireWatch
from sitl.campaign.worded import faults_of
from sitl.lockstep import Drive
from sitl.scenario import scenario_from_mission, with_faults
from tests.support.quick import first_of
from tests.support.rig import yard

PILOT = "pilot start_s=3 since=driving mode=HOLD"
SILENT = "sensor_silent start_s=2 since=driving duration_s=6"


def watched(folder: Path, faults: str, limit_s: float = 62.0) -> tuple[Drive, WireWatch]:
    mission = yard(folder)
    scenario = with_faults(scenario_from_mission(mission), faults_of(faults, folder))
    run = Drive(mission, scenario, Settings(), 0, NullRecorder(), limit_s)
    return run, WireWatch(run)


@first_of(1, "faults", [PILOT, SILENT])
def test_a_companion_as_it_is_breaks_nothing(tmp_path: Path, faults: str) -> None:
    run, watch = watched(tmp_path, faults)
    run.run()
    assert run.simulator.driven_m > 1.0
    assert (watch.against_pilot, watch.blind_s) == (0, 0.0)


def test_setpoints_against_a_pilot_are_counted(tmp_path: Path) -> None:
    """One that says a setpoint in every tick."""
    run, watch = watched(tmp_path, PILOT)
    setpoint = mavlink.MAVLink_set_position_target_local_ned_message(
        0, 1, 1, mavlink.MAV_FRAME_LOCAL_NED, 1511, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0
    ).pack(mavlink.MAVLink(None, 1, 191))
    said = run.clock.overhear
    assert said is not None

    def stubborn(time_s: float, data: bytes) -> None:
        said(time_s, data + setpoint)

    run.clock.overhear = stubborn
    run.run()
    assert watch.against_pilot > 50, "before it was armed, and after the pilot had taken it"


def heard_by(watch: WireWatch, time_s: float, *messages: mavlink.MAVLink_message) -> None:
    sender = mavlink.MAVLink(None, 1, 1)
    assert watch._run.clock.delivered is not None
    watch._run.clock.delivered(time_s, b"".join(message.pack(sender) for message in messages))


@pytest.mark.parametrize(
    ("speed_m_s", "mode", "beats", "blind_s"),
    [(1.0, 15, True, 4.0), (0.0, 15, True, 0.0), (1.0, 0, True, 0.0), (1.0, 15, False, 0.0)],
    ids=["it moves", "it stands", "a pilot drives", "the line is cut"],
)
def test_a_rover_that_moves_without_range_data_is_seen(
    speed_m_s: float, mode: int, beats: bool, blind_s: float
) -> None:
    """Range data ends after 1 s; it is stale 1 s later, and 4 s are enough to stand."""
    run = SimpleNamespace(
        clock=SimpleNamespace(overhear=None, delivered=None),
        settings=Settings(),
        simulator=SimpleNamespace(truth=SimpleNamespace(speed_m_s=speed_m_s)),
    )
    watch = WireWatch(run)  # type: ignore[arg-type]
    beat = mavlink.MAVLink_heartbeat_message(10, 3, 129, mode, 4, 3)
    ranges = mavlink.MAVLink_distance_sensor_message(0, 20, 600, 300, 0, 1, 0, 0)
    for tick in range(201):
        time_s = 0.05 * tick
        messages = [beat] if beats or time_s <= 2.0 else []
        heard_by(watch, time_s, *messages, *([ranges] if 0.0 < time_s <= 1.0 else []))
    assert watch.blind_s == pytest.approx(blind_s, abs=0.06)


@pytest.mark.parametrize(
    ("message", "counts"),
    [
        (mavlink.MAVLink_set_position_target_global_int_message(0, 1, 1, 6, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0), 1),
        (mavlink.MAVLink_mission_item_int_message(1, 1, 0, 6, 16, 2, 1, 0, 0, 0, 0, 0, 0, 0), 1),
        (mavlink.MAVLink_command_int_message(1, 1, 6, 192, 0, 0, 0, 0, 0, 0, 0, 0, 0), 1),
        (mavlink.MAVLink_command_int_message(1, 1, 6, 195, 0, 0, 0, 0, 0, 0, 0, 0, 0), 0),
        (mavlink.MAVLink_heartbeat_message(18, 8, 0, 0, 4, 3), 0),
    ],
    ids=["global", "mission item", "reposition", "another command", "heartbeat"],
)
def test_every_form_of_setpoint_counts(message: mavlink.MAVLink_message, counts: int) -> None:
    run = SimpleNamespace(clock=SimpleNamespace(overhear=None, delivered=None), settings=Settings(), simulator=None)
    watch = WireWatch(run)  # type: ignore[arg-type]
    heard_by(watch, 1.0, mavlink.MAVLink_heartbeat_message(10, 3, 129, 0, 4, 3))
    assert run.clock.overhear is not None
    run.clock.overhear(1.05, message.pack(mavlink.MAVLink(None, 1, 191)))
    assert watch.against_pilot == counts
