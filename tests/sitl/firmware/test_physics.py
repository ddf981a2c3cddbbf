"""The physics behind the real firmware, asked by a stand-in that reads answers as the firmware does."""

from __future__ import annotations

import json
import math
import struct
from dataclasses import replace

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.core.frames import GeoPoint
from sitl.firmware.physics import LONGEST_STEP_S, Physics, servo_output
from sitl.firmware.physics_log import PhysicsLog, summary
from sitl.plant.rover import SIM_ROVER, WHEEL_MOST_RAD, WHEEL_RATE_RAD_S
from sitl.sensors.range_flaws import Flaws
from sitl.sensors.range_sensors import SUITES, Beam, SensorSuite
from sitl.world.doors import Door
from sitl.world.movers import Announcement, Mover, timed_track
from sitl.world.truth import SimStart
from sitl.world.world import World
from tests.support.firmware import NEW, OLD, Firmware, frame

START = SimStart(10.0, 10.0, 0.0, GeoPoint(53.1325, 23.1688))
RADIUS_M = 2.5


def physics(
    world: World | None = None,
    suite: SensorSuite = SUITES["none"],
    *,
    turning_radius_m: float = 0.0,
    heading_deg: float = 0.0,
    linked: bool = False,
    seed: int = 0,
) -> Physics:
    start = replace(START, heading_rad=math.radians(heading_deg))
    return Physics(world or World.open(), start, suite, seed, turning_radius_m=turning_radius_m, linked=linked)


def walled(north_m: float = 15.0) -> World:
    """A wall from west to east, that far north; the rover starts at 10, 10."""
    obstacles = np.zeros((60, 60), dtype=np.bool_)
    obstacles[round(north_m / 0.5)] = True
    return World(obstacles, 0.5)


def firmware(behind: Physics, **settings: object) -> Firmware:
    return Firmware(behind.answer, **settings)  # type: ignore[arg-type]


@pytest.mark.parametrize("keys", [OLD, NEW], ids=["older", "newer"])
@pytest.mark.parametrize("channels", [16, 32])
@pytest.mark.parametrize("rate_hz", [50, 400, 1200])
def test_at_rest_it_shows_gravity_and_nothing_else(keys: list[str], channels: int, rate_hz: int) -> None:
    one = firmware(physics(heading_deg=90.0), keys=keys, channels=channels, rate_hz=rate_hz)
    one.drive(1.0)
    assert one.clock_s == pytest.approx(1.0, abs=1.0 / rate_hz)
    assert one.state["imu/gyro"] == [0.0, 0.0, 0.0]
    assert one.state["imu/accel_body"] == [0.0, 0.0, -9.81]
    assert one.state["position"] == one.state["velocity"] == [0.0, 0.0, 0.0]
    assert one.state["attitude"] == pytest.approx([0.0, 0.0, math.pi / 2])
    assert one.heading_rad == pytest.approx(math.pi / 2)
    assert one.complaints == []


def test_the_answer_is_one_json_object_between_newlines_without_spaces() -> None:
    behind = physics(walled(), SUITES["beams"])
    for count in range(40):
        answer = behind.answer(frame(count, 1900, 1600))
        assert answer.startswith(b"\n{") and answer.endswith(b"}\n")
        assert not set(answer[1:-1]) & set(b" \t\r\n")
        body = json.loads(answer)
        assert set(body) == {
            "timestamp", "imu", "position", "attitude", "quaternion", "velocity", "rng_1", "rng_2", "rng_3",
        }  # fmt: skip
        assert set(body["imu"]) == {"gyro", "accel_body"}
        assert body["timestamp"] == pytest.approx((count + 1) / 400.0)


@pytest.mark.parametrize("heading_deg", [0.0, 90.0, -135.0])
def test_both_motors_alike_drive_straight_on(heading_deg: float) -> None:
    one = firmware(physics(heading_deg=heading_deg))
    one.drive(5.0, 1750, 1750)
    speed_m_s = 0.5 * SIM_ROVER.top_speed_m_s
    ahead = (math.cos(math.radians(heading_deg)), math.sin(math.radians(heading_deg)))
    way_m = speed_m_s * (5.0 - SIM_ROVER.speed_lag_s)
    assert one.state["velocity"][:2] == pytest.approx([speed_m_s * part for part in ahead], abs=1e-3)
    assert one.state["position"][:2] == pytest.approx([way_m * part for part in ahead], abs=0.01)
    assert one.state["imu/gyro"][2] == 0.0


def test_it_pulls_away_forwards_and_brakes_backwards() -> None:
    one = firmware(physics(heading_deg=30.0))
    one.update(2000, 2000)
    assert one.state["imu/accel_body"][0] == pytest.approx(SIM_ROVER.top_speed_m_s / SIM_ROVER.speed_lag_s, rel=0.01)
    one.drive(3.0, 2000, 2000)
    one.update(1500, 1500)
    assert one.state["imu/accel_body"][0] == pytest.approx(-SIM_ROVER.top_speed_m_s / SIM_ROVER.speed_lag_s, rel=0.01)
    assert one.state["imu/accel_body"][1] == pytest.approx(0.0, abs=1e-6)


def test_motors_against_each_other_pivot_on_the_spot() -> None:
    one = firmware(physics())
    one.drive(0.5, 1600, 1400)
    rate_rad_s = 0.4 * SIM_ROVER.turn_rate_rad_s
    assert one.state["imu/gyro"][2] == pytest.approx(rate_rad_s, abs=1e-5)
    assert one.heading_rad == pytest.approx(0.5 * rate_rad_s, abs=1e-6)
    assert one.state["position"] == [0.0, 0.0, 0.0]


def test_a_faster_left_motor_turns_right_and_pushes_to_the_right() -> None:
    one = firmware(physics())
    one.drive(4.0, 1800, 1700)
    speed_m_s, rate_rad_s = 0.5 * SIM_ROVER.top_speed_m_s, 0.2 * SIM_ROVER.turn_rate_rad_s
    assert math.hypot(*one.state["velocity"]) == pytest.approx(speed_m_s, rel=1e-3)
    assert one.state["imu/gyro"][2] == pytest.approx(rate_rad_s, rel=1e-5)
    assert one.state["imu/accel_body"] == pytest.approx([0.0, speed_m_s * rate_rad_s, -9.81], abs=0.01)


def test_steered_wheels_drive_the_turning_circle_and_never_pivot() -> None:
    behind = physics(turning_radius_m=RADIUS_M)
    one = firmware(behind)
    one.drive(2.0, 2000, 1500)
    assert one.state["position"] == [0.0, 0.0, 0.0]
    assert one.heading_rad == 0.0
    one.drive(4.0, 2000, 1625)
    speed_m_s = 0.25 * SIM_ROVER.top_speed_m_s
    assert math.hypot(*one.state["velocity"]) == pytest.approx(speed_m_s, rel=1e-3)
    assert one.state["imu/gyro"][2] == pytest.approx(speed_m_s / RADIUS_M, rel=1e-3)
    assert one.state["imu/accel_body"][1] == pytest.approx(speed_m_s**2 / RADIUS_M, rel=0.01)
    places = []
    for _ in range(round(2.0 * math.pi * RADIUS_M / speed_m_s / 0.05)):
        one.drive(0.05, 2000, 1625)
        places.append(one.state["position"][:2])
    assert max(math.dist(a, b) for a in places for b in places) == pytest.approx(2.0 * RADIUS_M, rel=0.01)


def test_steered_wheels_take_their_time_and_turn_the_other_way_backwards() -> None:
    one = firmware(physics(turning_radius_m=RADIUS_M))
    one.drive(3.0, 1500, 1300)
    one.drive(0.5 * WHEEL_MOST_RAD / WHEEL_RATE_RAD_S, 2000, 1300)
    half_rad_s = one.state["imu/gyro"][2]
    one.drive(1.0, 2000, 1300)
    full_rad_s = one.state["imu/gyro"][2]
    assert full_rad_s < half_rad_s < 0.0
    share = math.tan(0.5 * WHEEL_MOST_RAD) / math.tan(WHEEL_MOST_RAD)
    assert half_rad_s == pytest.approx(share * full_rad_s, rel=0.02)


@pytest.mark.parametrize("pwm_us", [0, 1, 799, 2201, 65535])
def test_no_pulse_is_a_stop(pwm_us: int) -> None:
    assert servo_output(pwm_us) == 0.0
    one = firmware(physics())
    one.drive(1.0, pwm_us, pwm_us)
    assert one.state["position"] == [0.0, 0.0, 0.0]


@pytest.mark.parametrize(
    ("pwm_us", "output"), [(800, -1.0), (1000, -1.0), (1250, -0.5), (1500, 0.0), (2000, 1.0), (2200, 1.0)]
)
def test_pulses_are_outputs(pwm_us: int, output: float) -> None:
    assert servo_output(pwm_us) == output


def test_32_channels_do_what_16_do() -> None:
    few, many = physics(walled(), SUITES["beams"]), physics(walled(), SUITES["beams"])
    for count in range(200):
        assert few.answer(frame(count, 1800, 1600)) == many.answer(frame(count, 1800, 1600, channels=32))


@pytest.mark.parametrize("rate_hz", [1, 9, 10, 11, 12])
def test_a_step_stays_one_that_the_firmware_takes(rate_hz: int) -> None:
    one = firmware(physics(), rate_hz=rate_hz)
    assert one.update(1600, 1600) and one.update(1600, 1600)
    assert one.clock_s == pytest.approx(2.0 * min(1.0 / rate_hz, LONGEST_STEP_S))


def test_a_frame_asked_for_again_gets_the_same_answer_and_moves_nothing() -> None:
    behind = physics(walled(), SUITES["beams"])
    once = [behind.answer(frame(count, 1700, 1600)) for count in range(100)]
    other = physics(walled(), SUITES["beams"])
    for count, answer in enumerate(once):
        for _ in range(1 + count % 3):
            assert other.answer(frame(count, 1700, 1600)) == answer
    assert other.tally.repeated == sum(count % 3 for count in range(100))
    assert other.tally.steps == 100


def test_a_firmware_whose_answers_get_lost_asks_again_and_drives_on() -> None:
    behind = physics()
    asked = 0

    def lossy(datagram: bytes) -> bytes:
        nonlocal asked
        asked += 1
        answer = behind.answer(datagram)
        return b"" if asked % 4 == 0 else answer

    one = Firmware(lossy)
    for _ in range(800):
        one.update(1750, 1750)
    whole = firmware(physics())
    for _ in range(one.count):
        whole.update(1750, 1750)
    assert one.count == 600
    assert one.state == whole.state


def test_lost_frames_are_counted_and_take_no_time() -> None:
    behind = physics()
    one = firmware(behind)
    one.drive(0.1)
    one.count += 7
    one.drive(0.1)
    assert behind.tally.lost == 7
    assert one.clock_s == pytest.approx(0.2)


def test_frame_numbers_may_run_over() -> None:
    behind = physics()
    one = firmware(behind, count=(1 << 32) - 20)
    one.drive(0.25, 1600, 1600)
    assert (behind.tally.starts, behind.tally.lost, behind.tally.late) == (1, 0, 0)
    assert behind.time_s == pytest.approx(0.25)


def test_late_copies_are_left_alone() -> None:
    behind = physics()
    one = firmware(behind)
    one.drive(0.5, 1600, 1600)
    before = (behind.time_s, behind.motion)
    assert behind.answer(frame(one.count - 5)) == b""
    assert behind.tally.late == 1
    assert (behind.time_s, behind.motion) == before


def test_a_restarted_firmware_finds_the_world_as_at_first() -> None:
    world = replace(
        walled(), movers=(Mover("cart", 0.3, timed_track([(14.0, 5.0), (14.0, 15.0)], 1.0, 0.0, repeats=True)),)
    )
    behind = physics(world, SUITES["beams"], linked=True)
    first = [behind.answer(frame(count, 1700, 1600)) for count in range(300)]
    again = [behind.answer(frame(count, 1700, 1600)) for count in range(300)]
    assert again == first
    assert behind.tally.starts == 2


def test_a_firmware_that_is_under_way_already_is_answered_from_the_start() -> None:
    one = firmware(physics(), count=5000, stamp_s=12.5, clock_s=12.5)
    one.drive(1.0, 1600, 1600)
    assert one.complaints == ["physics reset"]


def test_of_two_firmwares_the_one_that_began_last_is_answered() -> None:
    behind = physics()
    for count in range(10):
        assert behind.answer(frame(count), "first")
    assert behind.answer(frame(3), "second") == b""
    assert behind.tally.strangers == 1
    assert behind.answer(frame(0), "second")
    assert behind.answer(frame(10), "first") == b""
    assert behind.answer(frame(1), "second")
    assert behind.tally.starts == 2


def test_a_firmware_may_go_on_from_another_address() -> None:
    behind = physics()
    first = [behind.answer(frame(count), "here") for count in range(10)]
    assert behind.answer(frame(9), "there") == first[9]
    assert behind.answer(frame(10), "there")
    assert behind.answer(frame(11), "elsewhere")
    assert (behind.tally.starts, behind.tally.strangers, behind.tally.steps) == (1, 0, 12)


@pytest.mark.parametrize(
    "datagram",
    [
        b"", b"\x1a", frame(0)[:-1], frame(0) + b"\0", frame(0, channels=32)[:40],
        frame(0)[:2] + frame(0, channels=32)[2:],
        struct.pack("<HHI16H", 18459, 400, 0, *[1500] * 16), frame(0, rate_hz=0), b"\n{}\n", bytes(70000),
    ],
)  # fmt: skip
def test_what_is_no_frame_is_counted_and_moves_nothing(datagram: bytes) -> None:
    behind = physics()
    one = firmware(behind)
    one.drive(0.5, 1700, 1600)
    before = (behind.time_s, behind.motion)
    assert behind.answer(datagram) == b""
    assert behind.tally.bad == 1
    assert (behind.time_s, behind.motion) == before


def test_a_wall_stops_the_rover_and_the_accelerometer_shows_it() -> None:
    behind = physics(walled())
    one = firmware(behind)
    one.drive(0.2, 2000, 2000)
    hit_m_s = 0.0
    while not behind.collisions:
        hit_m_s = one.state["velocity"][0]
        one.update(2000, 2000)
    assert one.state["velocity"][0] == 0.0
    assert one.state["imu/accel_body"][0] == pytest.approx(-hit_m_s * 400.0, rel=1e-6)
    one.drive(1.0, 2000, 2000)
    assert len(behind.collisions) == 1
    assert behind.collisions[0].north_m == pytest.approx(15.0 - 0.35, abs=0.02)
    assert behind.collisions[0].time_s == pytest.approx(behind.time_s - 1.0, abs=0.01)


def test_a_mover_that_comes_is_seen_and_felt() -> None:
    track = timed_track([(20.0, 10.0), (5.0, 10.0)], 2.0, 0.0, repeats=False)
    behind = physics(replace(World.open(), movers=(Mover("cart", 0.5, track),)), SUITES["beams"])
    one = firmware(behind)
    one.drive(3.0)
    assert one.ranges_m[0] == pytest.approx(4.0 - 0.5, abs=0.15)
    one.drive(2.0)
    assert [collision.mover for collision in behind.collisions] == ["cart"]


def test_a_door_opens_at_its_time() -> None:
    fields = walled().obstacles
    world = World(np.zeros_like(fields), 0.5, doors=(Door("gate", fields, ((4000, 60000),)),))
    shut, through = physics(world, SUITES["beams"]), physics(world, SUITES["beams"])
    early = firmware(shut)
    early.drive(3.5, 2000, 2000)
    assert len(shut.collisions) == 1
    late = firmware(through)
    late.drive(3.9)
    assert late.ranges_m[0] == pytest.approx(5.0, abs=0.1)
    late.drive(0.2)
    assert late.ranges_m[0] == pytest.approx(6.01)
    late.drive(4.0, 2000, 2000)
    assert not through.collisions and late.state["position"][0] > 10.0


@pytest.mark.parametrize("keys", [OLD, NEW], ids=["older", "newer"])
def test_rangefinders_come_out_in_their_order(keys: list[str]) -> None:
    beams = tuple(Beam(number, 0.2, 20.0) for number in (0, 1, 2, 4, 6, 7))
    obstacles = np.zeros((60, 60), dtype=np.bool_)
    obstacles[0], obstacles[-1], obstacles[:, 0], obstacles[:, 48] = True, True, True, True
    one = firmware(physics(World(obstacles, 0.5), SensorSuite(beams=beams)), keys=keys)
    one.drive(0.1)
    assert one.ranges_m == pytest.approx([19.5, 14.0 * math.sqrt(2.0), 14.0, 9.5, 9.5, 9.5 * math.sqrt(2.0)], abs=0.12)


def test_nothing_seen_is_out_of_range_and_nothing_known_is_no_reading() -> None:
    blind = Beam(1, 0.2, 6.0, rate_hz=20.0, flaws=Flaws(dropout=1.0))
    one = firmware(physics(World.open(), SensorSuite(beams=(Beam(0, 0.2, 6.0), blind))))
    one.drive(1.0)
    assert one.ranges_m[0] == pytest.approx(6.01)
    assert math.isnan(one.ranges_m[1])


def test_more_rangefinders_than_six_are_refused() -> None:
    with pytest.raises(ValueError, match="7 rangefinders: the firmware accepts at most 6"):
        physics(suite=SensorSuite(beams=(Beam(0, 0.2, 6.0),) * 7))


def messages(data: bytes) -> list[mavlink.MAVLink_message]:
    return mavlink.MAVLink(None).parse_buffer(data) or []


def test_the_lidar_publishes_scans_and_heartbeats_as_component_196() -> None:
    behind = physics(walled(), SUITES["lidar-90"], linked=True)
    one = firmware(behind)
    one.drive(5.0)
    said = messages(behind.take())
    scans = [message for message in said if message.get_type() == "OBSTACLE_DISTANCE"]
    beats = [message for message in said if message.get_type() == "HEARTBEAT"]
    assert {(m.get_srcSystem(), m.get_srcComponent()) for m in said} == {(1, 196)}
    assert len(scans) == 50 and len(beats) in (5, 6)
    assert {(beat.type, beat.autopilot) for beat in beats} == {(18, 8)}
    assert [scan.time_usec for scan in scans[:3]] == pytest.approx([1e5, 2e5, 3e5], abs=2500)
    assert (scans[0].increment_f, scans[0].min_distance, scans[0].max_distance) == (1.25, 10, 450)
    one.drive(1.0, 1625, 1625)
    nearer = [m for m in messages(behind.take()) if m.get_type() == "OBSTACLE_DISTANCE"][-1]
    assert nearer.distances[36] == pytest.approx(100.0 * (5.0 - one.state["position"][0]), abs=15)


def test_moving_things_announce_themselves_on_the_link_even_without_a_lidar() -> None:
    track = timed_track([(14.0, 5.0), (14.0, 15.0)], 1.0, 0.0, repeats=True)
    movers = tuple(Mover(kind.value, 0.3, track, announce=kind) for kind in Announcement)
    behind = physics(replace(walled(), movers=movers), SUITES["none"], linked=True)
    firmware(behind).drive(3.0)
    said = messages(behind.take())
    senders = {message.get_type(): (message.get_srcSystem(), message.get_srcComponent()) for message in said}
    vehicle, receiver = (101, 1), (1, 156)
    assert senders == {
        "HEARTBEAT": vehicle, "GLOBAL_POSITION_INT": vehicle, "ADSB_VEHICLE": receiver, "AIS_VESSEL": receiver,
    }  # fmt: skip
    places = [message for message in said if message.get_type() == "GLOBAL_POSITION_INT"]
    assert 11 <= len(places) <= 13
    assert places[-1].vy == pytest.approx(100, abs=1) and places[-1].lon > places[0].lon
    beat = mavlink.MAVLink_heartbeat_message(10, 3, 0, 0, 4, 3)
    behind.hear(beat.pack(mavlink.MAVLink(None, 7, 1)))
    firmware(behind).drive(3.0)
    assert {m.get_srcSystem() for m in messages(behind.take()) if m.get_type() == "ADSB_VEHICLE"} == {7}


def test_without_a_line_the_lidar_is_silent_and_so_is_what_moves() -> None:
    track = timed_track([(14.0, 5.0), (14.0, 15.0)], 1.0, 0.0, repeats=True)
    cart = Mover("cart", 0.3, track, announce=Announcement.VEHICLE)
    behind = physics(replace(walled(), movers=(cart,)), SUITES["lidar-90"])
    firmware(behind).drive(2.0)
    assert behind.take() == b""


def test_the_lidar_takes_the_system_id_of_the_first_autopilot_it_hears() -> None:
    behind = physics(walled(), SUITES["lidar-90"], linked=True)
    one = firmware(behind)
    one.drive(0.5)
    assert {message.get_srcSystem() for message in messages(behind.take())} == {1}

    def hear(system: int, component: int, autopilot: int = 3) -> None:
        beat = mavlink.MAVLink_heartbeat_message(10, autopilot, 0, 0, 4, 3)
        behind.hear(beat.pack(mavlink.MAVLink(None, system, component)))

    hear(255, 190, 8)
    hear(9, 1, 8)
    hear(7, 1)
    hear(101, 1)
    one.drive(0.5)
    assert {message.get_srcSystem() for message in messages(behind.take())} == {7}
    again = firmware(behind)
    again.drive(0.1)
    hear(8, 1)
    behind.take()
    again.drive(0.5)
    assert {message.get_srcSystem() for message in messages(behind.take())} == {8}


def test_noise_on_the_lidars_line_hurts_nothing() -> None:
    behind = physics(walled(), SUITES["lidar-90"], linked=True)
    beat = mavlink.MAVLink_heartbeat_message(10, 3, 0, 0, 4, 3).pack(mavlink.MAVLink(None, 7, 1))
    behind.hear(bytes(range(256)) * 3)
    for _ in range(30):
        behind.hear(beat)
    firmware(behind).drive(0.5)
    assert {message.get_srcSystem() for message in messages(behind.take())} == {7}


def test_rehearsing_leaves_no_trace() -> None:
    rehearsed, fresh = (physics(walled(), SUITES["lidar-360"], linked=True) for _ in range(2))
    rehearsed.rehearse()
    for count in range(100):
        assert rehearsed.answer(frame(count, 1700, 1600)) == fresh.answer(frame(count, 1700, 1600))
    assert rehearsed.take() == fresh.take() != b""


def test_seeds_change_ranges_only() -> None:
    def run(seed: int) -> Firmware:
        one = firmware(physics(walled(), SUITES["beams"], seed=seed))
        one.drive(1.0, 1700, 1600)
        return one

    assert run(1).state == run(1).state
    assert run(1).state["position"] == run(2).state["position"]
    assert run(1).ranges_m != run(2).ranges_m


def test_without_a_firmware_there_is_nothing_to_sum_up() -> None:
    behind = physics()
    assert summary(behind) == "stopped; no firmware has asked"
    behind.answer(b"noise")
    assert summary(behind) == "stopped; no firmware has asked (1 not frames)"


def test_events_are_logged_once_and_summed_up() -> None:
    behind = physics(walled())
    said: list[str] = []
    now_s = 0.0
    log = PhysicsLog(behind, said.append, lambda: now_s)
    log.look()
    assert said == []
    one = firmware(behind)
    while len(behind.collisions) < 1:
        one.update(2000, 2000)
    for _ in range(3):
        behind.answer(b"noise", "scanner")
    behind.answer(frame(5), "another")
    one.count += 2
    one.update()
    log.look()
    log.look()
    assert [line.split(";")[0].split(":")[0] for line in said] == [
        "the firmware has started and is answered",
        "a datagram was no frame of ArduPilot's JSON interface",
        "a second firmware asks at the same port",
        "frames were lost",
        "collision 1",
    ]
    assert summary(behind) == (
        f"stopped; {behind.tally.steps} steps, 2 lost, 1 from another firmware, 3 not frames; "
        f"since the firmware's last start {behind.time_s:.0f} s and 1 collision"
    )
    behind.answer(frame(0, 1500, 1500))
    log.look()
    assert said[-1].startswith("the firmware has started again")
