"""Whatever the firmware asks for, what it is told fits together; whatever else comes, nothing happens."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.core.frames import GeoPoint
from sitl.autopilot.lidar import ScannerPort
from sitl.firmware.json_frames import decode
from sitl.firmware.physics import Physics, frame_step_s
from sitl.plant.rover import SIM_ROVER
from sitl.sensors.range_sensors import SUITES
from sitl.world.truth import SimStart
from sitl.world.world import World
from tests.support.firmware import Firmware, frame
from tests.support.quick import examples, first_of

START = SimStart(15.0, 15.0, 0.3, GeoPoint(53.1325, 23.1688))
FASTEST_M_S = 5.0
"""A little more than the plant drives."""

pulses = st.one_of(st.integers(1000, 2000), st.integers(0, 65535))
orders = st.lists(st.tuples(pulses, pulses, st.integers(1, 40), st.integers(10, 1500)), min_size=1, max_size=8)


def physics(turning_radius_m: float, grip: float, *, walls: bool) -> Physics:
    obstacles = np.zeros((60, 60), dtype=np.bool_)
    if walls:
        obstacles[::12, ::7] = True
        obstacles[25:35, 25:35] = False
    ground = np.full((2, 60, 60), grip, dtype=np.float32)
    ground[1] = 1.0
    world = World(obstacles, 0.5, ground=ground)
    return Physics(world, START, SUITES["beams"], turning_radius_m=turning_radius_m)


def wrapped(angle_rad: float) -> float:
    return (angle_rad + math.pi) % (2.0 * math.pi) - math.pi


@pytest.mark.parametrize("turning_radius_m", [0.0, 2.0], ids=["skid", "ackermann"])
@first_of(2, ("grip", "walls"), [(1.0, False), (1.0, True), (0.05, True)], ids=["open", "walls", "ice"])
@settings(max_examples=25, deadline=None)
@given(orders=orders)
def test_turn_rate_acceleration_velocity_and_place_fit_together(
    turning_radius_m: float, grip: float, walls: bool, orders: list[tuple[int, int, int, int]]
) -> None:
    one = Firmware(physics(turning_radius_m, grip, walls=walls).answer)
    assert one.update()
    for servo_1, servo_3, frames, rate_hz in orders:
        one.rate_hz = rate_hz
        for _ in range(frames):
            before, heading_rad, stamp_s = dict(one.state), one.heading_rad, one.stamp_s
            assert one.update(servo_1, servo_3)
            step_s = one.stamp_s - stamp_s
            assert step_s == pytest.approx(frame_step_s(rate_hz), abs=2e-9)
            turned_rad = one.state["imu/gyro"][2] * step_s
            assert wrapped(one.heading_rad - heading_rad - turned_rad) == pytest.approx(0.0, abs=1e-7)
            ahead, right, down = one.state["imu/accel_body"]
            assert down == -9.81
            middle_rad = heading_rad + 0.5 * turned_rad
            gained = (
                (ahead * math.cos(middle_rad) - right * math.sin(middle_rad)) * step_s,
                (ahead * math.sin(middle_rad) + right * math.cos(middle_rad)) * step_s,
            )
            old, new = before["velocity"], one.state["velocity"]
            assert [new[0] - old[0], new[1] - old[1]] == pytest.approx(gained, abs=1e-6)
            assert new[2] == one.state["position"][2] == 0.0
            moved = [b - a for a, b in zip(before["position"], one.state["position"], strict=True)]
            # The mean of both velocities, except for what turning and accelerating within the step may bend; and near
            # walls, except for speed that was gained within the step and lost again.
            slack_m = step_s * (math.dist(old, new) + FASTEST_M_S * abs(turned_rad)) + 1e-8
            slack_m += FASTEST_M_S / SIM_ROVER.speed_lag_s * step_s**2 if walls else 0.0
            assert math.dist(moved, [0.5 * (a + b) * step_s for a, b in zip(old, new, strict=True)]) <= slack_m


@pytest.mark.thorough
@pytest.mark.parametrize("turning_radius_m", [0.0, 2.0], ids=["skid", "ackermann"])
@settings(max_examples=3, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_gyro_and_accelerometer_alone_find_the_place(turning_radius_m: float, seed: int) -> None:
    """Ten seconds of dead reckoning by the inertial sensors, as the firmware's estimator does it."""
    rng = np.random.default_rng(seed)
    one = Firmware(physics(turning_radius_m, 1.0, walls=False).answer)
    assert one.update()
    heading_rad, place, velocity = one.heading_rad, [0.0, 0.0], [0.0, 0.0]
    servo_1, servo_3 = 1500, 1500
    for count in range(4000):
        if count % 200 == 0:
            servo_1, servo_3 = (int(pulse) for pulse in rng.integers(1000, 2001, 2))
        assert one.update(servo_1, servo_3)
        turned_rad = one.state["imu/gyro"][2] / 400.0
        ahead, right, _ = one.state["imu/accel_body"]
        middle_rad = heading_rad + 0.5 * turned_rad
        heading_rad += turned_rad
        before = list(velocity)
        velocity[0] += (ahead * math.cos(middle_rad) - right * math.sin(middle_rad)) / 400.0
        velocity[1] += (ahead * math.sin(middle_rad) + right * math.cos(middle_rad)) / 400.0
        for axis in range(2):
            place[axis] += 0.5 * (before[axis] + velocity[axis]) / 400.0
    assert math.dist(place, one.state["position"][:2]) < 0.15
    assert wrapped(heading_rad - one.heading_rad) == pytest.approx(0.0, abs=1e-4)


def is_frame(datagram: bytes) -> bool:
    return (len(datagram), datagram[:2]) in ((40, b"\x1a\x48"), (72, b"\x81\x73")) and datagram[2:4] != b"\0\0"


headed = st.tuples(st.sampled_from([b"\x1a\x48", b"\x81\x73", b"\n"]), st.binary(max_size=80)).map(b"".join)
rest = st.sampled_from([38, 70]).flatmap(lambda n: st.binary(min_size=n, max_size=n))
exact = st.tuples(st.sampled_from([b"\x1a\x48", b"\x81\x73"]), rest).map(b"".join)


@settings(max_examples=examples(200), deadline=None)
@given(datagrams=st.lists(st.one_of(st.binary(max_size=100), headed, exact), max_size=10))
def test_any_bytes_leave_it_up_and_only_frames_move_it(datagrams: list[bytes]) -> None:
    behind = physics(0.0, 1.0, walls=True)
    for count in range(3):
        assert behind.answer(frame(count, 1700, 1600))
    for datagram in datagrams:
        before, bad = (behind.time_s, behind.motion), behind.tally.bad
        answer = behind.answer(datagram)
        assert (decode(datagram) is not None) == is_frame(datagram)
        if is_frame(datagram):
            assert behind.tally.bad == bad
        else:
            assert answer == b"" and behind.tally.bad == bad + 1
        if answer:
            assert json.loads(answer)["timestamp"] == pytest.approx(behind.time_s)
        else:
            assert (behind.time_s, behind.motion) == before
    assert behind.answer(frame(0))


beat = bytes(mavlink.MAVLink_heartbeat_message(10, 3, 0, 0, 4, 3).pack(mavlink.MAVLink(None, 7, 1)))
damaged = st.tuples(st.integers(0, len(beat) - 1), st.integers(1, 255)).map(
    lambda change: bytes(byte ^ change[1] if at == change[0] else byte for at, byte in enumerate(beat))
)


@settings(max_examples=examples(200), deadline=None)
@given(pieces=st.lists(st.one_of(st.binary(max_size=50), damaged, st.just(beat[:5])), max_size=10))
def test_any_bytes_on_the_lidars_line_leave_it_its_name(pieces: list[bytes]) -> None:
    port = ScannerPort()
    for piece in pieces:
        port.hear(piece)
    packed = port.packed([mavlink.MAVLink_heartbeat_message(18, 8, 0, 0, 4, 3)])
    assert (packed[5], packed[6]) == (1, 196)
