"""Commands for servos, relays and so on are answered as ArduRover answers them."""

from __future__ import annotations

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.core.frames import GeoPoint
from sitl.autopilot.payload import command_of_name, run_payload
from sitl.faults.plan import CommandFault, FaultPlan
from sitl.simulator import Simulator
from sitl.world.truth import SimStart
from sitl.world.world import World

ACCEPTED, DENIED, UNSUPPORTED, FAILED = 0, 2, 3, 4
START = SimStart(10.0, 10.0, 0.0, GeoPoint(53.1, 23.1))
RELAY = {"RELAY1_FUNCTION": 1.0, "RELAY1_PIN": 5.0}


def simulator(parameters: dict[str, float] | None = None, *faults: CommandFault) -> Simulator:
    return Simulator(World.open(20.0, 20.0), START, "none", parameters=parameters, faults=FaultPlan(faults))


def answers(one: Simulator, *commands: tuple[int, ...]) -> list[int]:
    """The results of COMMAND_LONGs, real bytes both ways; -1 where none came."""
    link, mav = one.connect(), mavlink.MAVLink(None, 255, 190)
    found = []
    for number, *params in commands:
        message = mavlink.MAVLink_command_long_message(1, 1, number, 0, *params, *[0.0] * (7 - len(params)))
        link.receive(message.pack(mav))
        one.advance_to_s(one.time_s + 0.1)
        heard = mavlink.MAVLink(None).parse_buffer(link.take()) or []
        acks = [ack.result for ack in heard if ack.get_type() == "COMMAND_ACK" and ack.command == number]
        found.append(acks[0] if acks else -1)
    return found


@pytest.mark.parametrize(
    ("command", "params", "bare", "parameters", "fitted"),
    [
        (183, (9, 1900), ACCEPTED, {"SERVO9_FUNCTION": 73.0}, FAILED),
        (183, (3, 1900), FAILED, {"SERVO3_FUNCTION": 0.0}, ACCEPTED),
        (184, (33, 1900, 2, 1), FAILED, {}, FAILED),
        (181, (0, 1), FAILED, RELAY, ACCEPTED),
        (182, (1, 2, 1), FAILED, RELAY, FAILED),
        (211, (0, 1), FAILED, {"GRIP_ENABLE": 1.0}, ACCEPTED),
        (216, (1,), ACCEPTED, {}, ACCEPTED),
        (203, (0, 0, 0, 0, 1), ACCEPTED, {}, ACCEPTED),
        (2000, (0, 0, 1), FAILED, {"CAM1_TYPE": 1.0}, ACCEPTED),
        (2500, (0, 0, 1), FAILED, {"CAM1_TYPE": 1.0}, FAILED),
        (2500, (0, 0, 1), FAILED, {"CAM1_TYPE": 4.0}, ACCEPTED),
        (531, (1, 1), UNSUPPORTED, {"CAM1_TYPE": 5.0}, ACCEPTED),
        (205, (0, 0, 0), FAILED, {"MNT1_TYPE": 1.0}, ACCEPTED),
        (201, (0, 0, 0, 0, 53.2, 23.2, 0), ACCEPTED, {}, ACCEPTED),
        (201, (0, 0, 0, 0, 95.0, 23.2, 0), FAILED, {}, FAILED),
        (218, (300, 2), ACCEPTED, {}, ACCEPTED),
        (218, (300, 3), DENIED, {}, DENIED),
    ],
)
def test_answers(command: int, params: tuple[float, ...], bare: int, parameters: dict[str, float], fitted: int) -> None:
    full = (*params, *[0.0] * (7 - len(params)))
    assert run_payload(simulator().vehicle, command, full) == bare
    assert run_payload(simulator(parameters).vehicle, command, full) == fitted


def test_over_the_link_they_are_answered_and_logged() -> None:
    one = simulator()
    assert answers(one, (183, 9, 1900), (183, 3, 1500), (223, 1)) == [ACCEPTED, FAILED, UNSUPPORTED]
    assert [(event.name, event.result_name) for event in one.commands] == [
        ("DO_SET_SERVO 9 1900", "accepted"),
        ("DO_SET_SERVO 3 1500", "failed"),
    ]
    assert (one.commands[0].north_m, one.commands[0].as_json()["command"]) == (10.0, 183)


def test_faults_lose_refuse_and_keep_answers_to_themselves() -> None:
    lost = CommandFault(effect="lost", commands=(183,), times=1)
    silent = CommandFault(effect="unanswered", commands=(216,))
    refused = CommandFault(effect="refused", commands=(203,), result=DENIED)
    one = simulator(None, lost, silent, refused)
    assert answers(one, (183, 9, 1900), (183, 9, 1900), (216, 1), (203,)) == [-1, ACCEPTED, -1, DENIED]
    assert [(event.command, event.result) for event in one.commands] == [(183, 0), (216, 0), (203, 2)]


def test_names_of_commands() -> None:
    assert command_of_name("MAV_CMD_DO_GRIPPER") == command_of_name("do_gripper") == 211
    with pytest.raises(ValueError, match="is none that a mission gives; those are DO_AUX_FUNCTION"):
        command_of_name("NAV_LAND")
