"""MAVLink 1 and 2 on the vehicle's links."""

from __future__ import annotations

import pytest
from pymavlink.dialects.v10 import ardupilotmega as mavlink_1
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.simulator import Simulator
from tests.support.party import AUTOPILOT_VERSION, HOLD, REBOOT, REQUEST_MESSAGE, SET_MODE, Party, booted, split


@pytest.fixture
def simulator() -> Simulator:
    return booted()


def test_each_sender_counts_its_packets(simulator: Simulator) -> None:
    ground = Party(simulator, 255, 190)
    numbers = [m.get_seq() for m in ground.heard(5.0)]
    assert len(numbers) > 50
    assert numbers == [number % 256 for number in range(numbers[0], numbers[0] + len(numbers))]


def test_a_port_set_to_mavlink_1_speaks_it_from_the_next_boot_on(simulator: Simulator) -> None:
    old, new = Party(simulator, 255, 190, 1), Party(simulator, 1, 191, 0)
    old.version_1 = True
    old.send(mavlink.MAVLink_param_set_message(1, 1, b"SERIAL1_PROTOCOL", 1, 2))
    assert {packet[0] for packet in split(old.raw(1.0))} == {0xFD}
    old.command(REBOOT, 1)
    old.raw()
    old.reconnect()
    new.reconnect()
    new.beat()
    data = old.raw(15.0)
    own = [packet for packet in split(data) if packet[0] == 0xFE]
    # Only what others said is passed on as it was.
    assert all(packet[5:7] == bytes([1, 191]) for packet in split(data) if packet[0] == 0xFD)
    parser = mavlink_1.MAVLink(None)
    messages = parser.parse_buffer(b"".join(own)) or []
    assert len(messages) == len(own) > 100
    assert {"HEARTBEAT", "GPS_RAW_INT", "BATTERY_STATUS"} <= {m.get_type() for m in messages}
    for packet in own:
        # The length without the fields that came with MAVLink 2, and nothing trimmed.
        assert packet[1] == mavlink_1.mavlink_map[packet[5]].unpacker.size
    old.command(REQUEST_MESSAGE, AUTOPILOT_VERSION)
    answer = mavlink_1.MAVLink(None).parse_buffer(old.raw()) or []
    assert {"COMMAND_ACK", "AUTOPILOT_VERSION"} <= {m.get_type() for m in answer}
    assert {packet[0] for packet in split(new.raw(1.0)) if packet[0] != 0xFE} == {0xFD}


def test_mavlink_1_is_understood_on_any_link(simulator: Simulator) -> None:
    ground = Party(simulator, 255, 190)
    ground.version_1 = True
    ground.command(SET_MODE, 1, HOLD)
    assert ground.acks() == [0]
