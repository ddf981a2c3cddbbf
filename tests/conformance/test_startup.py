"""ArduRover's start-up: what is sent, refused and accepted when, against the recording of a boot."""

from typing import Any

import pytest

from tests.conformance.test_motion import timed
from tests.shared_data import SHARED, needs_shared
from tests.sitl_client import Client, open_ground
from tests.tlog import raw_packets

RECORDING = SHARED / "data" / "ardurover-4.7-transcripts" / "boot-to-armed.tlog"
PREARM_BIT = 1 << 28
LATENCY_S = 0.06


def first_s(client: Client, kind: str, test: Any = lambda message: True) -> float:
    """When the first message of a kind arrived that passes the test."""
    while True:
        for message in client.run_for(0.1):
            if message.get_type() == kind and message.get_srcComponent() == 1 and test(message):
                return client.simulator.time_s
        assert client.simulator.time_s < 60.0, kind


@pytest.mark.parametrize(
    ("kind", "test", "second"),
    [
        ("HEARTBEAT", lambda m: True, 0.1),
        ("ATTITUDE", lambda m: True, 3.0),
        ("GPS_RAW_INT", lambda m: m.fix_type >= 3, 10.0),
        ("HOME_POSITION", lambda m: True, 10.0),
        ("GLOBAL_POSITION_INT", lambda m: m.lat != 0, 10.0),
        ("LOCAL_POSITION_NED", lambda m: m.x == 0.0, 11.0),
        ("SYS_STATUS", lambda m: bool(m.onboard_control_sensors_health & PREARM_BIT), 24.0),
        ("STATUSTEXT", lambda m: "is using GPS" in m.text, 42.0),
        ("EKF_STATUS_REPORT", lambda m: bool(m.flags & 16 and not m.flags & 128), 42.0),
    ],
)
def test_timetable(kind: str, test: Any, second: float) -> None:
    assert first_s(Client(open_ground()), kind, test) == pytest.approx(second, abs=0.11)


def test_arming_in_guided_is_accepted_from_43_seconds() -> None:
    client = Client(open_ground())
    client.run_to(4.0)
    assert client.set_mode(15) == 0
    results = {}
    for second in (5, 15, 26, 35, 41, 42, 43.1):
        client.run_to(second)
        results[second] = client.arm()
    assert results == {5: 4, 15: 4, 26: 4, 35: 4, 41: 4, 42: 4, 43.1: 0}
    assert any(text.startswith("Arm: ") for text in client.texts())
    assert all(m.severity == 2 for m in client.of("STATUSTEXT") if m.text.startswith("Arm: "))


def test_manual_arms_before_there_is_a_position() -> None:
    client = Client(open_ground())
    client.run_to(20.0)
    assert client.arm() == 4
    client.run_to(24.5)
    assert client.arm() == 0


def test_return_needs_a_position() -> None:
    client = Client(open_ground())
    client.run_to(5.0)
    assert client.set_mode(11) == 4
    assert "Flight mode change failed" in client.texts()
    client.run_to(43.0)
    assert client.set_mode(11) == 0


def test_default_streams_come_at_1_hz() -> None:
    client = Client(open_ground())
    client.run_to(43.0)
    client.received.clear()
    client.run_for(10.0)
    counts = {m.get_type(): len(client.of(m.get_type())) for m in client.received}
    assert {"HEARTBEAT", "SYS_STATUS", "ATTITUDE", "GLOBAL_POSITION_INT", "LOCAL_POSITION_NED", "VFR_HUD"} <= set(
        counts
    )
    assert {"GPS_RAW_INT", "EKF_STATUS_REPORT", "BATTERY_STATUS", "SERVO_OUTPUT_RAW", "MISSION_CURRENT"} <= set(counts)
    assert {count for kind, count in counts.items() if kind != "STATUSTEXT"} == {10}
    assert "POSITION_TARGET_GLOBAL_INT" not in counts
    assert "NAV_CONTROLLER_OUTPUT" not in counts
    assert "DISTANCE_SENSOR" not in counts


@needs_shared
def test_the_recorded_boot() -> None:
    """The same commands at the same times get the same answers, and the EKF reports the same flags."""
    recorded = timed(list(raw_packets(RECORDING)))
    client = Client(open_ground())
    for time_s, message in recorded:
        if message.get_srcComponent() == 191:
            client.run_to(time_s + LATENCY_S)
            client.link.receive(bytes(message.get_msgbuf()))
    client.run_for(1.0)

    def answers(messages: list[Any]) -> list[tuple[int, int]]:
        return [(m.command, m.result) for m in messages if m.get_type() == "COMMAND_ACK"]

    def flags(messages: list[Any]) -> list[int]:
        found = [m.flags for m in messages if m.get_type() == "EKF_STATUS_REPORT"]
        return [flag for flag, before in zip(found, [None, *found], strict=False) if flag != before]

    def refusals(messages: list[Any]) -> list[str]:
        return [m.text for m in messages if m.get_type() == "STATUSTEXT" and m.text.startswith("Arm: ")]

    real = [message for _, message in recorded]
    assert answers(client.received) == answers(real)
    assert flags(client.received) == flags(real)
    assert refusals(client.received) == refusals(real)
