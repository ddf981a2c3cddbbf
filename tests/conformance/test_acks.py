"""The simulator answers as ArduRover 4.7 did: the recording of commands and their answers, and the measured tables."""

import math
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from tests.conformance.test_motion import timed
from tests.shared_data import SHARED, needs_shared
from tests.sitl_client import Client, open_ground, ready
from tests.tlog import raw_packets

RECORDING = SHARED / "data" / "ardurover-4.7-transcripts" / "commands-and-acks.tlog"
LATENCY_S = 0.06
ACCEPTED, DENIED, UNSUPPORTED, FAILED = 0, 2, 3, 4
MISSION_TRANSFER = {"MISSION_COUNT", "MISSION_REQUEST_LIST", "MISSION_REQUEST_INT", "MISSION_ACK"}
HERE = (-353632075, 1491652300)


@pytest.fixture(scope="module")
def replay() -> tuple[list[Any], Client]:
    """What was recorded, and a client that sent the same to the simulator (mission transfers apart)."""
    recorded = timed(list(raw_packets(RECORDING)))
    client = Client(open_ground(), system=255, component=190)
    for time_s, message in recorded:
        kind = message.get_type()
        transfer = kind in MISSION_TRANSFER or (kind == "MISSION_ITEM_INT" and message.current != 2)
        if message.get_srcSystem() == 255 and not transfer:
            client.run_to(time_s + LATENCY_S)
            client.link.receive(bytes(message.get_msgbuf()))
    client.run_for(1.0)
    return [message for _, message in recorded], client


@needs_shared
def test_every_command_is_answered_as_recorded(replay: tuple[list[Any], Client]) -> None:
    recorded, client = replay

    def answers(messages: list[Any]) -> list[tuple[int, int]]:
        return [(m.command, m.result) for m in messages if m.get_type() == "COMMAND_ACK"]

    assert len(answers(recorded)) == 48
    assert answers(client.received) == answers(recorded)


@needs_shared
def test_guided_mission_items_are_answered_as_recorded(replay: tuple[list[Any], Client]) -> None:
    recorded, client = replay
    real = [m.type for m in recorded if m.get_type() == "MISSION_ACK" and m.get_srcComponent() == 1]
    ours = [m.type for m in client.received if m.get_type() == "MISSION_ACK"]
    assert ours == real[:2] == [1, 0]


@needs_shared
def test_the_same_complaints_are_said(replay: tuple[list[Any], Client]) -> None:
    recorded, client = replay

    def complaints(messages: list[Any]) -> list[tuple[int, str]]:
        """Everything said about what was asked, in the order it was said."""
        about = ("No ", "Flight mode", "Dock", "Arm:", "Throttle", "Requested", "e SCHED")
        return [(m.severity, m.text) for m in messages if m.get_type() == "STATUSTEXT" and m.text.startswith(about)]

    assert len(complaints(recorded)) > 10
    # The recording ends before it tells of the last disarming.
    assert complaints(client.received) == [*complaints(recorded), (6, "Throttle disarmed")]


@needs_shared
def test_heartbeats_show_the_same_modes(replay: tuple[list[Any], Client]) -> None:
    recorded, client = replay

    def modes(messages: list[Any]) -> set[tuple[int, int, int]]:
        return {
            (m.base_mode, m.custom_mode, m.system_status)
            for m in messages
            if m.get_type() == "HEARTBEAT" and m.get_srcComponent() == 1 and m.get_srcSystem() == 1
        }

    assert modes(client.received) == modes(recorded)


@needs_shared
def test_parameters_are_read_and_set_as_recorded(replay: tuple[list[Any], Client]) -> None:
    recorded, client = replay

    def speeds(messages: list[Any]) -> list[tuple[float, int, int]]:
        found = [m for m in messages if m.get_type() == "PARAM_VALUE" and m.param_id == "WP_SPEED"]
        return [(m.param_value, m.param_type, m.param_index) for m in found]

    assert speeds(client.received) == speeds(recorded) == [(3.0, 9, 65535), (2.5, 9, 65535)]


@pytest.mark.parametrize("mode", [0, 1, 3, 4, 5, 7, 9, 15])
def test_modes_that_arm(mode: int) -> None:
    client = Client(open_ground())
    client.run_to(43.2)
    assert client.set_mode(mode) == ACCEPTED
    assert client.arm() == ACCEPTED
    assert client.arm() == ACCEPTED
    assert client.ask(400, 0) == ACCEPTED
    assert client.ask(400, 0) == ACCEPTED


@pytest.mark.parametrize("mode", [11, 12])
def test_modes_that_do_not_arm(mode: int) -> None:
    client = Client(open_ground())
    client.run_to(43.2)
    assert client.set_mode(mode) == ACCEPTED
    assert client.arm() == FAILED
    assert "Arm: Mode not armable" in client.texts()


def test_set_mode_message_is_acted_on_and_not_acknowledged() -> None:
    client = Client(open_ground())
    client.run_to(43.2)
    client.received.clear()
    client.send(mavlink.MAVLink_set_mode_message(1, 1, 15))
    client.run_for(1.1)
    assert not client.of("COMMAND_ACK")
    assert client.of("HEARTBEAT")[-1].custom_mode == 15


def test_setpoints_outside_guided_vanish() -> None:
    client = Client(open_ground())
    client.run_to(43.2)
    assert client.set_mode(4) == ACCEPTED
    assert client.arm() == ACCEPTED
    client.received.clear()
    client.drive_to(10.0, 0.0)
    client.drive_at(1.0)
    client.send(mavlink.MAVLink_set_position_target_global_int_message(0, 1, 1, 6, 3580, *HERE, *[0.0] * 9))
    client.run_for(3.0)
    assert not client.of("COMMAND_ACK")
    assert not client.texts()
    assert client.set_mode(15) == ACCEPTED
    client.run_for(3.0)
    assert client.simulator.truth.north_m == 0.0
    assert not client.of("POSITION_TARGET_GLOBAL_INT")


@pytest.mark.parametrize(
    ("frame", "driven"), [(0, True), (3, True), (5, True), (6, True), (10, True), (11, True), (1, False)]
)
def test_frames_of_global_targets(frame: int, driven: bool) -> None:
    client = ready(open_ground())
    client.send(mavlink.MAVLink_set_position_target_global_int_message(0, 1, 1, frame, 3580, *HERE, *[0.0] * 9))
    client.run_for(10.0)
    assert (client.simulator.truth.north_m > 5.0) == driven


@pytest.mark.parametrize("mask", [0, 3580 & ~(7 << 6), 3559 & ~(7 << 6)])
def test_targets_with_acceleration_are_refused_with_a_text(mask: int) -> None:
    client = ready(open_ground())
    client.received.clear()
    client.drive_to(5.0, 5.0, mask=mask)
    client.run_for(2.0)
    assert [m.text for m in client.of("STATUSTEXT")] == [
        "Ignoring SET_POSITION_TARGET_LOCAL_NED; set ACC_IG",
        "NORE in mask",
    ]
    assert client.simulator.truth.north_m == 0.0


def test_do_reposition() -> None:
    def ask(client: Client, frame: int, place: tuple[int, int], flags: float = 0.0, speed: float = -1.0) -> int:
        client.send(mavlink.MAVLink_command_int_message(1, 1, frame, 192, 0, 0, speed, flags, 0, 0, *place, 0))
        return client.result_of(192)

    client = Client(open_ground())
    client.run_to(43.2)
    assert client.set_mode(4) == ACCEPTED
    assert ask(client, 3, HERE) == DENIED
    assert ask(client, 3, (0, 0), 1) == DENIED
    assert ask(client, 3, (910000000, 0), 1) == DENIED
    assert ask(client, 1, HERE, 1) == DENIED
    assert client.ask(192, -1, 1, 0, 0, -35.3, 149.1) == UNSUPPORTED
    assert ask(client, 3, HERE, 1, speed=1.5) == FAILED
    client.run_for(1.0)
    assert client.of("HEARTBEAT")[-1].custom_mode == 15
    assert ask(client, 3, HERE, 0) == ACCEPTED
    assert ask(client, 3, HERE, 0, speed=1.5) == ACCEPTED


def test_guided_mission_items() -> None:
    def ask(client: Client, frame: int, x: int, y: int) -> int:
        client.received.clear()
        client.send(mavlink.MAVLink_mission_item_int_message(1, 1, 0, frame, 16, 2, 0, 0, 0, 0, 0, x, y, 0))
        client.run_for(0.1)
        return int(client.of("MISSION_ACK")[0].type)

    client = Client(open_ground())
    client.run_to(43.2)
    assert ask(client, 3, *HERE) == 1
    assert client.set_mode(15) == ACCEPTED
    assert ask(client, 3, *HERE) == 0
    assert ask(client, 3, 0, 0) == 0
    assert ask(client, 1, 10, 10) == 2
    client.received.clear()
    client.send(mavlink.MAVLink_mission_item_message(1, 1, 0, 3, 16, 2, 0, 0, 0, 0, 0, -35.3632, 149.16523, 0))
    client.run_for(2.1)
    assert client.of("MISSION_ACK")[0].type == 0
    assert client.of("POSITION_TARGET_GLOBAL_INT")[-1].lat_int == pytest.approx(-353632000, abs=40)


def test_change_speed_needs_a_position_target() -> None:
    client = ready(open_ground())
    assert client.ask(178, 1, 2.0) == FAILED
    client.drive_to(20.0, 0.0)
    assert client.ask(178, 1, 2.0) == ACCEPTED
    assert client.ask(178, 1, 0.05) == ACCEPTED
    for refused in (0.0, -1.0, 0.01, math.nan):
        assert client.ask(178, 1, refused) == FAILED
    client.drive_at(1.0)
    assert client.ask(178, 1, 2.0) == FAILED


@pytest.mark.parametrize("command", [115, 213, 193, 22, 31000])
def test_unsupported_commands(command: int) -> None:
    assert ready(open_ground()).ask(command, 90, 10) == UNSUPPORTED


def test_message_intervals_and_what_really_arrives() -> None:
    client = ready(open_ground(sensors="beams"))
    assert client.ask(511, 30, 50_000) == ACCEPTED
    assert client.ask(511, 32, 100_000) == ACCEPTED
    assert client.ask(511, 132, 100_000) == ACCEPTED
    assert client.ask(511, 33, -1) == ACCEPTED
    assert client.ask(511, 30, 20_000) == DENIED
    assert client.ask(511, 9999, 100_000) == DENIED
    assert client.ask(511, 330, 100_000) == DENIED
    assert client.ask(511, 331, 100_000) == DENIED
    client.run_for(1.0)
    client.received.clear()
    client.run_for(10.0)
    assert len(client.of("ATTITUDE")) == pytest.approx(200, abs=2)
    assert len(client.of("LOCAL_POSITION_NED")) == pytest.approx(100, abs=1)
    assert len(client.of("DISTANCE_SENSOR")) == pytest.approx(300, abs=3)
    assert not client.of("GLOBAL_POSITION_INT")
    assert len(client.of("VFR_HUD")) == 10
    assert client.ask(511, 33, 0) == ACCEPTED
    client.run_for(3.0)
    assert len(client.of("GLOBAL_POSITION_INT")) == 3


def test_intervals_belong_to_one_link() -> None:
    simulator = open_ground()
    client, other = ready(simulator), Client(simulator, system=255, component=190)
    assert client.ask(511, 30, 50_000) == ACCEPTED
    other.run_for(5.0)
    assert len(other.of("ATTITUDE")) <= 6


def test_requested_messages() -> None:
    client = ready(open_ground())
    for number, kind in (
        (242, "HOME_POSITION"),
        (49, "GPS_GLOBAL_ORIGIN"),
        (148, "AUTOPILOT_VERSION"),
        (33, "GLOBAL_POSITION_INT"),
    ):
        client.received.clear()
        assert client.ask(512, number) == ACCEPTED
        assert len(client.of(kind)) == 1
    assert client.ask(512, 132) == ACCEPTED
    assert client.ask(512, 330) == FAILED
    assert client.ask(512, 9999) == FAILED


def test_data_stream_requests_set_whole_groups() -> None:
    client = ready(open_ground())
    client.send(mavlink.MAVLink_request_data_stream_message(1, 1, 6, 5, 1))
    client.send(mavlink.MAVLink_request_data_stream_message(1, 1, 11, 0, 0))
    client.run_for(1.0)
    client.received.clear()
    client.run_for(10.0)
    assert len(client.of("GLOBAL_POSITION_INT")) == pytest.approx(50, abs=1)
    assert len(client.of("LOCAL_POSITION_NED")) == pytest.approx(50, abs=1)
    assert not client.of("VFR_HUD")


def test_reboot() -> None:
    client = ready(open_ground())
    assert client.ask(246, 1) == FAILED
    assert client.ask(400, 0) == ACCEPTED
    client.send(mavlink.MAVLink_param_set_message(1, 1, b"WP_SPEED", 1.5, 9))
    client.command(246, 1)
    client.run_for(0.1)
    assert client.link.dropped
    again = Client(client.simulator)
    again.run_for(30.0)
    assert again.of("EKF_STATUS_REPORT")[-1].flags == 167
    assert again.arm() == ACCEPTED
    assert again.of("ATTITUDE")[0].time_boot_ms == 3000
    again.send(mavlink.MAVLink_param_request_read_message(1, 1, b"WP_SPEED", -1))
    again.run_for(0.1)
    assert again.of("PARAM_VALUE")[-1].param_value == 1.5


def test_ground_station_failsafe() -> None:
    simulator = open_ground(parameters={"FS_GCS_ENABLE": 1})
    client, station = ready(simulator), Client(simulator, system=255, component=190)
    heartbeat = mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3)
    for _ in range(5):
        station.send(heartbeat)
        client.send(heartbeat)
        client.run_for(1.0)
    silent_s = simulator.time_s - 1.0
    client.received.clear()
    while "Radio Failsafe" not in client.texts() and simulator.time_s < silent_s + 10.0:
        client.send(heartbeat)
        client.run_for(0.1)
    assert simulator.time_s - silent_s == pytest.approx(5.7, abs=1.1)
    client.run_for(1.1)
    assert client.of("HEARTBEAT")[-1].custom_mode == 4
