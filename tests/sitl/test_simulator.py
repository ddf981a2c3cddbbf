import hashlib
import math
import random

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.autopilot.parameters import DEFAULTS
from sitl.plant.closed_loop import NoiseSettings
from sitl.simulator import Simulator
from sitl.world.truth import SimStart
from sitl.world.world import World
from tests.support.quick import examples
from tests.support.sitl_client import HOME, Client, open_ground, ready


def walled(north_m: float = 10.0) -> World:
    """Open ground with a wall across at this many metres north."""
    obstacles = np.zeros((40, 40), dtype=np.bool_)
    obstacles[int(north_m) : int(north_m) + 2, :] = True
    return World(obstacles)


def sent_hash(seed: int, step_loops: int = 2) -> str:
    """Hash of everything sent during a minute with a drive in it, time moved by so many main loops at once."""
    simulator = Simulator(walled(30), SimStart(5.0, 20.0, 0.3, HOME), "lidar-360", seed)
    client = Client(simulator)
    for loop in range(step_loops, 2161, step_loops):
        client.run_to(loop / 50)
    client.command(176, 1, 15)
    client.command(400, 1)
    client.command(511, 30, 50_000)
    client.drive_to(12.0, 4.0)
    for loop in range(2160 + step_loops, 3001, step_loops):
        client.run_to(loop / 50)
    assert simulator.truth.north_m > 10.0
    return hashlib.sha256(client.raw).hexdigest()


def test_the_same_seed_and_bytes_give_the_same_bytes() -> None:
    assert sent_hash(7) == sent_hash(7)
    assert sent_hash(7) != sent_hash(8)


def test_how_time_is_cut_into_calls_does_not_matter() -> None:
    assert sent_hash(7, step_loops=1) == sent_hash(7, step_loops=20)


def test_time_goes_in_whole_loops_and_never_back() -> None:
    simulator = open_ground()
    simulator.advance_to_s(0.999)
    assert simulator.time_s == pytest.approx(0.98)
    simulator.advance_to_s(0.5)
    assert simulator.time_s == pytest.approx(0.98)
    simulator.advance_to_s(1.0)
    assert simulator.time_s == pytest.approx(1.0)


def test_the_rover_is_stopped_by_a_wall_and_that_counts_once() -> None:
    simulator = Simulator(walled(), SimStart(5.0, 20.0, 0.0, HOME), "none", noise=False)
    client = ready(simulator)
    client.drive_to(20.0, 0.0)
    client.run_for(15.0)
    assert simulator.truth.north_m == pytest.approx(10.0 - 0.35, abs=0.02)
    assert simulator.truth.speed_m_s == 0.0
    assert len(simulator.collisions) == 1
    collision = simulator.collisions[0]
    assert collision.north_m == pytest.approx(9.65, abs=0.02)
    assert collision.time_s < simulator.time_s - 5.0
    assert simulator.clearance_m < 0.02
    client.set_mode(4)
    client.run_for(1.0)
    client.set_mode(15)
    for _ in range(10):
        client.drive_at(-1.0, mask=2535)
        client.run_for(0.3)
    assert simulator.truth.north_m < 9.0
    client.drive_to(20.0, 0.0)
    client.run_for(10.0)
    assert len(simulator.collisions) == 2


def test_driving_alongside_a_wall_is_no_collision() -> None:
    simulator = Simulator(walled(), SimStart(10.0 - 0.37, 5.0, math.pi / 2, HOME), "none", noise=False)
    client = ready(simulator)
    client.drive_to(0.0, 10.0)
    client.run_for(12.0)
    assert simulator.truth.east_m > 14.0
    assert not simulator.collisions


def test_local_position_begins_at_zero_wherever_the_rover_stands() -> None:
    simulator = Simulator(walled(), SimStart(3.0, 25.0, 1.0, HOME), "none", noise=False)
    client = ready(simulator)
    client.drive_to(2.0, -4.0)
    client.run_for(10.0)
    truth, told = simulator.truth, client.of("LOCAL_POSITION_NED")[-1]
    assert (told.x, told.y) == pytest.approx((truth.north_m - 3.0, truth.east_m - 25.0), abs=0.01)
    assert simulator.driven_m > 4.0
    here = client.of("GLOBAL_POSITION_INT")[-1]
    assert (here.lat / 1e7 - HOME.lat_deg) * 111_318.8 == pytest.approx(told.x, abs=0.05)


@pytest.mark.thorough
def test_position_errors_wander_slowly_within_the_size_asked_for() -> None:
    simulator = open_ground(noise=NoiseSettings(position_bias_m=0.12), seed=5)
    client = Client(simulator)
    client.run_to(50.0)
    client.ask(511, 32, 200_000)
    client.run_for(600.0)
    told = np.array([(m.x, m.y, m.vx, m.vy) for m in client.of("LOCAL_POSITION_NED")[-2900:]])
    assert 0.05 < float(told[:, :2].std()) < 0.25
    steps = np.abs(np.diff(told[:, :2], axis=0))
    assert float(np.percentile(steps, 99)) < 0.06
    assert float(np.abs(told[:, 2:]).max()) < 0.15


def test_without_noise_the_estimate_is_the_truth() -> None:
    client = Client(open_ground(heading_rad=0.7))
    client.run_to(50.0)
    assert client.of("ATTITUDE")[-1].yaw == pytest.approx(0.7, abs=1e-6)
    assert client.of("LOCAL_POSITION_NED")[-1].x == 0.0


def test_parameters_are_listed_read_and_set_with_effect() -> None:
    client = Client(open_ground())
    client.run_to(44.0)
    client.send(mavlink.MAVLink_param_request_list_message(1, 1))
    client.run_for(2.0)
    listed = {m.param_id: m for m in client.of("PARAM_VALUE")}
    assert set(listed) == set(DEFAULTS)
    assert {m.param_index for m in listed.values()} == set(range(len(DEFAULTS)))
    for name in ("WP_SPEED", "WP_RADIUS", "WP_PIVOT_ANGLE", "ATC_ACCEL_MAX", "OA_TYPE", "FS_GCS_ENABLE", "MAV_SYSID"):
        assert listed[name].param_value == DEFAULTS[name][0]
    client.received.clear()
    client.send(mavlink.MAVLink_param_request_read_message(1, 1, b"NOPE", -1))
    client.send(mavlink.MAVLink_param_request_read_message(1, 1, b"", 0))
    client.send(mavlink.MAVLink_param_set_message(1, 1, b"WP_SPEED", 1.0, 9))
    client.send(mavlink.MAVLink_param_set_message(1, 1, b"OA_TYPE", 1.4, 9))
    client.send(mavlink.MAVLink_param_set_message(1, 1, b"WP_RADIUS", math.nan, 9))
    client.run_for(0.2)
    values = [(m.param_id, m.param_value) for m in client.of("PARAM_VALUE")]
    first = next(iter(DEFAULTS))
    assert values == [(first, DEFAULTS[first][0]), ("WP_SPEED", 1.0), ("OA_TYPE", 1.0)]
    assert client.simulator._vehicle.parameters["WP_RADIUS"] == 3.0  # no number: dropped without a word
    assert client.set_mode(15) == 0
    assert client.arm() == 0
    client.drive_to(50.0, 0.0)
    client.run_for(8.0)
    assert client.simulator.truth.speed_m_s == pytest.approx(1.0, abs=0.02)


def test_unknown_parameters_of_a_scenario_are_refused() -> None:
    with pytest.raises(KeyError, match="WP_SPED"):
        open_ground(parameters={"WP_SPED": 2.0})


def test_texts_of_a_companion_reach_the_ground_station_and_targets_find_their_component() -> None:
    simulator = open_ground()
    companion, station = Client(simulator), Client(simulator, system=255, component=190)
    heartbeat = mavlink.MAVLink_heartbeat_message(18, 8, 0, 0, 4, 3)
    companion.send(heartbeat)
    station.send(heartbeat)
    companion.run_to(1.0)
    companion.send(mavlink.MAVLink_statustext_message(6, b"hello", 0, 0))
    companion.run_for(0.1)
    station.run_for(0.1)
    assert ("hello", 191) in [(m.text, m.get_srcComponent()) for m in station.of("STATUSTEXT")]
    station.send(mavlink.MAVLink_command_long_message(1, 191, 31000, 0, 1, 2, 3, 4, 5, 6, 7))
    station.run_for(0.1)
    companion.run_for(0.1)
    assert [m.command for m in companion.of("COMMAND_LONG")] == [31000]
    assert not station.of("COMMAND_ACK")


def test_commands_to_a_component_nobody_has_heard_are_answered_by_the_autopilot() -> None:
    station = Client(open_ground(), system=255, component=190)
    station.send(mavlink.MAVLink_command_long_message(1, 191, 512, 0, 148, 0, 0, 0, 0, 0, 0))
    station.run_to(0.1)
    assert [m.result for m in station.of("COMMAND_ACK")] == [0]


def test_commands_to_another_system_are_not_answered() -> None:
    station = Client(open_ground(), system=255, component=190)
    station.send(mavlink.MAVLink_command_long_message(9, 1, 512, 0, 148, 0, 0, 0, 0, 0, 0))
    station.run_to(0.1)
    assert not station.of("COMMAND_ACK")


def test_a_closed_link_gets_nothing_and_costs_nothing() -> None:
    simulator = open_ground()
    keeps, leaves = Client(simulator), Client(simulator, system=255, component=190)
    leaves.send(mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3))
    keeps.run_to(5.0)
    simulator.disconnect(leaves.link)
    leaves.link.take()
    keeps.run_to(20.0)
    assert leaves.link.take() == b""
    assert keeps.of("ATTITUDE")


def every_message(rng: random.Random) -> list[bytes]:
    """One packet of every message of the dialect, filled with random bytes."""
    packets = []
    for kind in mavlink.mavlink_map.values():
        size = kind.unpacker.size
        payload = rng.randbytes(size)
        head = bytes([0xFD, size, 0, 0, 0, 1, 191]) + kind.id.to_bytes(3, "little")
        crc = mavlink.x25crc(head[1:] + payload)
        crc.accumulate(bytes([kind.crc_extra]))
        packets.append(head + payload + crc.crc.to_bytes(2, "little"))
    return packets


@pytest.mark.parametrize("seed", range(4))
def test_any_message_with_any_content_leaves_the_link_up(seed: int) -> None:
    client = ready(open_ground(seed=seed))
    rng = random.Random(seed)
    for packet in every_message(rng):
        client.link.receive(packet)
        client.run_for(0.02)
    client.run_for(1.0)
    client.received.clear()
    client.command(512, 148)
    client.run_for(1.1)
    assert client.of("AUTOPILOT_VERSION")
    assert client.of("HEARTBEAT")
    assert math.isfinite(client.simulator.truth.north_m)


@settings(max_examples=examples(60), deadline=None)
@given(st.lists(st.binary(min_size=1, max_size=300), max_size=5))
def test_noise_on_the_line_leaves_the_link_up(chunks: list[bytes]) -> None:
    client = Client(open_ground())
    for chunk in chunks:
        client.link.receive(chunk)
        client.run_for(0.02)
    for _ in range(12):  # a false start in the noise may swallow up to 280 bytes
        client.command(512, 148)
    client.run_for(0.1)
    assert any(m.get_type() == "COMMAND_ACK" and m.result == 0 for m in client.received)


def test_commands_to_the_lidar_are_not_answered_by_the_autopilot() -> None:
    simulator = open_ground(sensors="lidar-90")
    station = Client(simulator, system=255, component=190)
    station.send(mavlink.MAVLink_command_long_message(1, 196, 512, 0, 148, 0, 0, 0, 0, 0, 0))
    station.run_to(0.2)
    assert not station.of("COMMAND_ACK")
    assert 196 in {m.get_srcComponent() for m in station.of("HEARTBEAT")}


def test_a_sharp_new_target_is_followed_sooner_when_the_rover_was_turned_towards_it_first() -> None:
    """A pivot keeps the old shaped motion, which must be undone afterwards; a heading target lets it start afresh."""

    def seconds(turn_first: bool) -> float:
        client = ready(open_ground(parameters={"WP_SPEED": 2.0, "WP_RADIUS": 1.0}))
        client.drive_to(100.0, 0.0)
        client.run_for(6.0)
        began_s, turn_m = client.simulator.time_s, client.simulator.truth.north_m
        while turn_first and abs(client.simulator.truth.heading_rad) < 2.5:
            client.drive_at(0.0, mask=2559, yaw=3.0)
            client.run_for(0.1)
        client.drive_to(turn_m - 20.0, 0.0)
        while client.simulator.truth.speed_m_s < 0.5 or abs(client.simulator.truth.heading_rad) < 2.5:
            client.run_for(0.1)
            assert client.simulator.time_s < began_s + 20.0
        return client.simulator.time_s - began_s

    assert seconds(turn_first=True) < seconds(turn_first=False) - 2.0
