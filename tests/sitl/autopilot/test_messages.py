"""Messages that ground stations send besides the measured ones: home, arming checks, joysticks."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.autopilot import telemetry
from sitl.world import geodesy
from tests.support.mission_client import ORIGIN
from tests.support.sitl_client import READY_S, Client, open_ground, ready

SET_HOME, GET_HOME, CHECK_ARMING = 179, 410, 401
ACCEPTED, TRY_LATER, DENIED, FAILED = 0, 1, 2, 4
MANUAL, RTL = 0, 11
THERE = geodesy.moved(ORIGIN, 20.0, 5.0)
LETS_GO = 32767


def station() -> Client:
    client = Client(open_ground(), system=255, component=190)
    client.run_to(READY_S)
    return client


def set_home(client: Client, frame: int, param1: float, x: int, y: int) -> int:
    client.send(mavlink.MAVLink_command_int_message(1, 1, frame, SET_HOME, 0, 0, param1, 0, 0, 0, x, y, 120.0))
    return client.result_of(SET_HOME)


def home(client: Client) -> tuple[int, int]:
    told = client.of("HOME_POSITION")[-1]
    return told.latitude, told.longitude


def test_home_is_moved_by_a_command_and_told() -> None:
    client = station()
    assert set_home(client, 0, 0.0, *THERE) == ACCEPTED
    assert home(client) == THERE
    assert client.ask(SET_HOME, 1) == ACCEPTED
    assert home(client) == pytest.approx(ORIGIN, abs=2)
    assert client.ask(SET_HOME, 0, 0, 0, 0, THERE[0] * 1e-7, THERE[1] * 1e-7, 120.0) == ACCEPTED
    assert home(client) == pytest.approx(THERE, abs=100), "degrees in single precision"


def test_rtl_goes_to_the_home_that_was_set() -> None:
    client = ready(open_ground())
    assert set_home(client, 3, 0.0, *THERE) == ACCEPTED
    assert client.set_mode(RTL) == ACCEPTED
    client.run_for(30.0)
    truth = client.simulator.truth
    assert math.dist((truth.north_m, truth.east_m), (20.0, 5.0)) < 1.0


def test_a_home_that_cannot_be_is_refused() -> None:
    client = station()
    assert set_home(client, 1, 0.0, *THERE) == DENIED
    assert set_home(client, 0, 2.0, *THERE) == FAILED
    assert set_home(client, 0, 0.0, 910_000_000, 0) == FAILED
    assert client.ask(SET_HOME, 0, 0, 0, 0, math.inf, 0, 0) == DENIED
    early = Client(open_ground())
    early.run_to(5.0)
    assert early.ask(SET_HOME, 1) == FAILED
    assert early.ask(GET_HOME) == FAILED
    assert client.ask(GET_HOME) == ACCEPTED
    assert home(client) == ORIGIN
    assert client.of("GPS_GLOBAL_ORIGIN")


def test_arming_checks_on_request() -> None:
    client = Client(open_ground())
    client.run_to(5.0)
    assert client.ask(CHECK_ARMING) == ACCEPTED
    assert "PreArm: Accels inconsistent" in client.texts()
    armed = ready(open_ground())
    assert armed.ask(CHECK_ARMING) == TRY_LATER


def joystick(client: Client, steering: int, throttle: int, target: int = 1) -> None:
    client.send(mavlink.MAVLink_manual_control_message(target, 0, steering, throttle, 0, 0))
    client.run_for(2.0)


def test_a_joystick_drives_in_manual() -> None:
    client = ready(open_ground(), system=255, component=190)
    assert client.set_mode(MANUAL) == ACCEPTED
    joystick(client, 0, 500)
    assert client.simulator.truth.speed_m_s == pytest.approx(2.0, abs=0.1)
    joystick(client, LETS_GO, LETS_GO)
    assert client.simulator.truth.speed_m_s == pytest.approx(0.0, abs=0.01)
    joystick(client, 0, -500)
    assert client.simulator.truth.speed_m_s < -1.0
    joystick(client, 0, 500, target=9)
    client.run_for(3.0)
    assert client.simulator.truth.speed_m_s == pytest.approx(0.0, abs=0.01), (
        "meant for somebody else, and the old one is stale"
    )


def test_a_joystick_is_a_sign_of_life() -> None:
    """FS_GCS_ENABLE watches for the ground station; sticks count as well as heartbeats."""
    client = ready(open_ground(parameters={"FS_GCS_ENABLE": 1.0}), system=255, component=190)
    client.send(mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3))
    for _ in range(5):
        joystick(client, 0, 0)
    assert "Radio Failsafe" not in client.texts()
    client.run_for(8.0)
    assert "Radio Failsafe" in client.texts()


def test_after_71_minutes_the_time_of_servo_outputs_begins_anew() -> None:
    """Its field has 32 bits and counts microseconds."""
    vehicle: Any = SimpleNamespace(time_us=2**32 + 7, control=[{"servo_1": 0.0, "servo_3": 0.5}])
    (message,) = telemetry._servos(vehicle)
    assert mavlink.MAVLink(None).parse_buffer(message.pack(mavlink.MAVLink(None)))[0].time_usec == 7
