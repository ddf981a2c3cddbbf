"""Any bytes on any link leave the simulator up, and its state as it was unless they are a valid command."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.autopilot.autopilot import HANDLERS
from sitl.autopilot.commands import HANDLERS as COMMANDS
from sitl.autopilot.framing import Framer, packet_size
from sitl.simulator import Simulator
from tests.support.party import Party
from tests.support.quick import examples, first_of
from tests.support.sitl_client import open_ground

GUIDED, RETURN, REPOSITION = 15, 20, 192
NO_NUMBERS = (math.nan, math.inf, -math.inf)
EDGES: dict[str, list[Any]] = {
    "float": [*NO_NUMBERS, 3.4e38, -3.4e38, 0.0, 1.0, -1.0, 1e-38, 16.0, 1e9],
    "double": [*NO_NUMBERS, 1e300, 0.0],
    "uint8_t": [0, 1, 2, 127, 128, 255],
    "int8_t": [-128, -1, 0, 127],
    "uint16_t": [0, 1, 400, 32768, 65535],
    "int16_t": [-32768, -1, 0, 32767],
    "uint32_t": [0, 1, 10, 2**31, 2**32 - 1],
    "int32_t": [-(2**31), -1, 0, 900_000_001, 2**31 - 1],
    "uint64_t": [0, 1, 2**63, 2**64 - 1],
    "int64_t": [-(2**63), 0, 2**63 - 1],
}


class Driving:
    """An armed rover in GUIDED on its way to a target, a client on the cable and one on the radio."""

    def __init__(self) -> None:
        self.simulator: Simulator = open_ground(sensors="lidar-90")
        self.client = Party(self.simulator, 255, 190, 0)
        self.radio = Party(self.simulator, 254, 190, 1)
        self.simulator.advance_to_s(45.0)
        self.restart()

    def restart(self) -> None:
        """GUIDED, armed, one target far ahead."""
        self.client.command(176, 1, GUIDED)
        self.client.command(400, 1)
        self.client.send(target())
        self.client.raw(0.2)
        assert self.alive()
        assert self.state()[:2] == (GUIDED, True)

    def state(self) -> tuple[object, ...]:
        """What a command could change."""
        vehicle = self.simulator._vehicle
        control = vehicle.control[0]
        aims = tuple(
            float(control[name]) for name in ("task", "target_heading", "target_speed", "base_speed", "reversed")
        )
        parameters = tuple(vehicle.parameters.as_dict().items())
        return vehicle.mode, vehicle.armed, vehicle.destination, vehicle.home, vehicle.signing.stored, aims, parameters

    def alive(self) -> bool:
        """It answers, and it is somewhere."""
        truth = self.simulator.truth
        self.client.link.take()
        self.client.command(512, 148)
        numbers = (truth.north_m, truth.east_m, truth.heading_rad, truth.speed_m_s)
        return self.client.acks(0.1) == [0] and all(map(math.isfinite, numbers))


def target() -> Any:
    return mavlink.MAVLink_set_position_target_local_ned_message(0, 1, 1, 1, 3580, 900.0, 0.0, *[0.0] * 9)


@pytest.fixture(scope="module")
def driving() -> Iterator[Driving]:
    yield Driving()


def edge_message(kind: Any, rng: np.random.Generator) -> Any:
    """A message whose fields are edges of their types; strings fill their fields to the end."""
    values: list[Any] = []
    for name, field_type in zip(kind.fieldnames, kind.fieldtypes, strict=True):
        length = kind.array_lengths[kind.ordered_fieldnames.index(name)]
        if name in ("target_system", "target_component"):
            values.append(1)
        elif field_type == "char":
            values.append(rng.integers(1, 256, max(length, 1), dtype=np.uint8).tobytes())
        else:
            edges = EDGES[field_type]
            picked = [edges[int(rng.integers(len(edges)))] for _ in range(max(length, 1))]
            values.append(picked if length else picked[0])
    return kind(*values)


def handled() -> list[Any]:
    return [kind for kind in mavlink.mavlink_map.values() if kind.msgname in HANDLERS]


# Bytes that are no packets


@settings(max_examples=examples(150), deadline=None)
@given(
    pieces=st.lists(st.binary(max_size=600) | st.sampled_from([b"\xfd\xff", b"\xfe\xff", b"\xfd\x00\x02"]), max_size=6)
)
def test_noise_changes_nothing(driving: Driving, pieces: list[bytes]) -> None:
    before = driving.state()
    for piece in pieces:
        driving.radio.link.receive(piece)
        driving.simulator.advance_to_s(driving.simulator.time_s + 0.02)
    assert driving.state() == before
    assert driving.alive()


COMMAND_PACKETS = [
    bytes(message.pack(mavlink.MAVLink(None, 255, 190), force_mavlink1=old))
    for old in (False, True)
    for message in (
        mavlink.MAVLink_command_long_message(1, 1, 176, 0, 1, 4, 0, 0, 0, 0, 0),
        mavlink.MAVLink_command_long_message(1, 1, 400, 0, 0, 21196, 0, 0, 0, 0, 0),
        mavlink.MAVLink_param_set_message(1, 1, b"WP_SPEED", 7.0, 9),
        mavlink.MAVLink_set_mode_message(1, 1, 4),
        mavlink.MAVLink_set_position_target_global_int_message(0, 1, 1, 6, 3580, -353632613, 1491652299, *[0.0] * 9),
        mavlink.MAVLink_setup_signing_message(1, 1, list(range(32)), 12345),
    )
    if not (old and message.get_msgId() > 255)
]


def valid(data: bytes) -> bool:
    """Whether pymavlink finds a message in it."""
    mav = mavlink.MAVLink(None)
    mav.robust_parsing = True
    return any(m.get_msgId() >= 0 for m in mav.parse_buffer(data) or [])


@settings(max_examples=examples(300), deadline=None)
@given(data=st.data())
def test_damaged_commands_are_not_obeyed(driving: Driving, data: st.DataObject) -> None:
    packet = bytearray(data.draw(st.sampled_from(COMMAND_PACKETS)))
    for _ in range(data.draw(st.integers(1, 3))):
        at = data.draw(st.integers(0, len(packet) - 1))
        match data.draw(st.sampled_from(["flip", "cut", "insert", "end"])):
            case "flip":
                packet[at] ^= data.draw(st.integers(1, 255))
            case "cut":
                del packet[at]
            case "insert":
                packet.insert(at, data.draw(st.integers(0, 255)))
            case "end":
                del packet[at:]
        if not packet:
            return
    if valid(bytes(packet)):
        return
    before = driving.state()
    driving.radio.link.receive(bytes(packet) + bytes(300))  # zeros complete what is still waited for
    driving.simulator.advance_to_s(driving.simulator.time_s + 0.04)
    assert driving.state() == before
    assert driving.alive()


@given(noise=st.binary(max_size=40), cuts=st.lists(st.integers(1, 40), max_size=8))
def test_packets_are_found_in_any_pieces(noise: bytes, cuts: list[int]) -> None:
    """What is between packets is dropped; a beginning among it takes at most what its header claims."""
    clean = bytes(byte for byte in noise if byte not in (0xFD, 0xFE))
    stream = b"".join(clean + packet for packet in COMMAND_PACKETS)
    framer, found = Framer(), []
    for cut in cuts:
        found += framer.feed(stream[:cut])
        stream = stream[cut:]
    found += framer.feed(stream)
    assert found == COMMAND_PACKETS
    assert [packet_size(packet, 0) for packet in found] == [len(packet) for packet in COMMAND_PACKETS]


@first_of(2, "kind", ["random", "beginnings", "old beginnings", "long headers", "empty packets"])
def test_a_flood_of_a_megabyte_is_survived(driving: Driving, kind: str) -> None:
    pattern = {
        "random": np.random.default_rng(1).bytes(1_000_000),
        "beginnings": b"\xfd" * 1_000_000,
        "old beginnings": b"\xfe" * 1_000_000,
        "long headers": b"\xfd\xff\x00\x00\x00\x01\x01\x4c\x00\x00" * 100_000,
        "empty packets": b"\xfd\x00\x00\x00\x00\x01\x01\x00\x00\x00\x00\x00" * 83_333,
    }[kind]
    before = driving.state()
    driving.radio.link.receive(pattern)
    driving.simulator.advance_to_s(driving.simulator.time_s + 0.1)
    assert driving.state() == before
    driving.radio.link.receive(bytes(300))
    assert driving.alive()


def test_a_flood_of_complaints_keeps_the_newest_texts(driving: Driving) -> None:
    driving.client.link.take()
    for number in range(1000):
        driving.client.send(mavlink.MAVLink_set_mode_message(1, 1, 1000 + number))
    texts = [m.text for m in driving.client.heard(0.1) if m.get_type() == "STATUSTEXT"]
    assert texts == [f"No such mode {1000 + number}" for number in range(970, 1000)]


# Packets with senseless contents


def floats_of(kind: Any) -> list[str]:
    return [name for name, field_type in zip(kind.fieldnames, kind.fieldtypes, strict=True) if field_type == "float"]


@pytest.mark.parametrize("number", [*sorted(set(COMMANDS) - {RETURN}), REPOSITION])
@pytest.mark.parametrize("kind", [mavlink.MAVLink_command_long_message, mavlink.MAVLink_command_int_message])
def test_a_command_of_no_numbers_changes_nothing(driving: Driving, kind: Any, number: int) -> None:
    before = driving.state()
    for value in NO_NUMBERS:
        if kind is mavlink.MAVLink_command_long_message:
            driving.client.send(kind(1, 1, number, 0, *[value] * 7))
        else:
            driving.client.send(kind(1, 1, 6, number, 0, 0, *[value] * 4, 2**31 - 1, 2**31 - 1, value))
        assert len(driving.client.acks()) == 1
        assert driving.state() == before
        assert driving.alive()


@pytest.mark.parametrize("value", NO_NUMBERS)
@pytest.mark.parametrize("name", floats_of(mavlink.MAVLink_set_position_target_local_ned_message))
@pytest.mark.parametrize("mask", [3580, 3559, 2559, 1535, 2535, 1511])
def test_a_target_of_no_number_is_dropped(driving: Driving, name: str, mask: int, value: float) -> None:
    driving.restart()
    before = driving.state()
    message = target()
    message.type_mask = mask
    setattr(message, name, value)
    used = {"x": 3, "y": 3, "vx": 24, "vy": 24, "yaw": 1024, "yaw_rate": 2048}.get(name, 4095) & mask == 0
    driving.client.send(message)
    driving.client.raw(0.1)
    if used:
        assert driving.state() == before
    assert driving.alive()


def test_parameters_take_numbers_only(driving: Driving) -> None:
    before = driving.state()
    driving.client.link.take()
    for value in NO_NUMBERS:
        driving.client.send(mavlink.MAVLink_param_set_message(1, 1, b"WP_SPEED", value, 9))
    driving.client.send(mavlink.MAVLink_param_set_message(1, 1, b"NO_SUCH_NAME_16C", 1.0, 9))
    driving.client.send(mavlink.MAVLink_param_set_message(1, 1, b"\xff" * 16, 1.0, 9))
    driving.client.send(mavlink.MAVLink_param_request_read_message(1, 1, b"\xc3\x28" * 8, -1))
    driving.client.send(mavlink.MAVLink_param_request_read_message(1, 1, b"", 32767))
    assert "PARAM_VALUE" not in [m.get_type() for m in driving.client.heard()]
    assert driving.state() == before


@first_of(1, "seed", range(4))
def test_edges_of_all_fields_of_everything_it_takes_in(seed: int) -> None:
    """Commands may well be obeyed here; the vehicle stays up, wherever it is sent and however it is tuned."""
    rng = np.random.default_rng(seed)
    driving, kinds = Driving(), handled()
    parameters = list(driving.simulator._vehicle.parameters)
    for number in range(250):
        message = edge_message(kinds[int(rng.integers(len(kinds)))], rng)
        if message.get_type().startswith("COMMAND"):
            message.command = int(rng.choice([*COMMANDS, REPOSITION, 0, 65535]))
        if message.get_type() == "PARAM_SET":
            message._param_id_raw = parameters[int(rng.integers(len(parameters)))].encode()
        driving.client.send(message)
        driving.client.raw(float(rng.choice([0.02, 0.1, 1.0])))
        if number % 25 == 0:
            driving.client.command(176, 1, GUIDED)
            driving.client.command(400, 1, 21196)
            driving.client.send(target())
        if driving.client.link.dropped:
            driving.client.reconnect()
    assert driving.alive()


def test_edges_of_everything_there_is() -> None:
    """Also what it only passes on: each message of the dialect once, with two listeners."""
    rng = np.random.default_rng(7)
    driving = Driving()
    driving.radio.beat()
    for kind in mavlink.mavlink_map.values():
        driving.client.send(edge_message(kind, rng))
        driving.client.raw(0.02)
        driving.radio.link.take()
        if driving.client.link.dropped:
            driving.client.reconnect()
    assert driving.alive()


@first_of(1, "value", [0.0, -1.0, 3.4e38, -3.4e38])
def test_every_parameter_alone_at_an_extreme(value: float) -> None:
    driving = Driving()
    defaults = driving.simulator._vehicle.parameters.as_dict()
    for name, default in defaults.items():
        driving.client.send(mavlink.MAVLink_param_set_message(1, 1, name.encode(), value, 9))
        driving.client.send(target())
        driving.client.raw(0.3)
        driving.client.send(mavlink.MAVLink_param_set_message(1, 1, name.encode(), default, 9))
        driving.client.raw(0.04)
    assert driving.alive()
    assert driving.simulator._vehicle.parameters.as_dict() == pytest.approx(defaults)


@pytest.mark.parametrize(("value", "system"), [(0.0, 1), (-5.0, 1), (300.0, 255), (7.0, 7)])
def test_a_system_id_that_does_not_exist(value: float, system: int) -> None:
    simulator = open_ground()
    client = Party(simulator, 255, 190)
    client.send(mavlink.MAVLink_param_set_message(1, 1, b"MAV_SYSID", value, 4))
    client.command(246, 1)
    client.raw()
    client.reconnect()
    assert {m.get_srcSystem() for m in client.heard(5.0)} == {system}


@first_of(1, "seed", range(3))
def test_absurd_parameters_and_reboots(seed: int) -> None:
    rng = np.random.default_rng(seed)
    driving = Driving()
    parameters = list(driving.simulator._vehicle.parameters)
    for _ in range(12):
        for name in rng.choice(parameters, 3):
            value = float(rng.choice([0.0, -1.0, 1e-38, 3.4e38, -3.4e38, 32767.0, 1e-3]))
            driving.client.send(mavlink.MAVLink_param_set_message(1, 1, str(name).encode(), value, 9))
        driving.client.command(176, 1, float(rng.choice([GUIDED, GUIDED, 11, 5, 8])))
        driving.client.command(400, 1, 21196)
        driving.client.send(target())
        driving.client.raw(3.0)
        if rng.random() < 0.3:
            driving.client.command(400, 0, 21196)
            driving.client.command(246, 1)
            driving.client.raw(0.1)
            driving.client.reconnect()
            driving.client.raw(45.0)
    truth = driving.simulator.truth
    assert all(map(math.isfinite, (truth.north_m, truth.east_m, truth.heading_rad, truth.speed_m_s)))
