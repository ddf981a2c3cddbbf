"""The simulated rover moves as ArduRover 4.7's own simulated skid rover did, recorded and measured.

Tolerances: 0.4 m and 0.2 m/s at every moment of the recording (the recording's clock is only good to 0.1 s, which is 0.25 m
at top speed), 0.15 s for arrivals; 5 % or 0.05 m/s for the measured table.
"""

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.simulator import SimStart, Simulator
from sitl.world import World
from tests.shared_data import SHARED, needs_shared
from tests.sitl_client import HOME, Client, open_ground, ready
from tests.tlog import raw_packets

RECORDING = SHARED / "data" / "ardurover-4.7-transcripts" / "guided-drive.tlog"
LATENCY_S = 0.06


def timed(packets: list[bytes]) -> list[tuple[float, Any]]:
    """Each packet with the newest vehicle time before it."""
    parser, now_s, result = mavlink.MAVLink(None), 0.0, []
    for packet in packets:
        for message in parser.parse_buffer(packet) or []:
            if message.get_srcComponent() == 1 and hasattr(message, "time_boot_ms"):
                now_s = message.time_boot_ms / 1000
            result.append((now_s, message))
    return result


def motion(messages: list[Any]) -> NDArray[np.float64]:
    """Rows of time, north, east, speed."""
    return np.array(
        [
            (m.time_boot_ms / 1000, m.x, m.y, math.hypot(m.vx, m.vy))
            for m in messages
            if m.get_type() == "LOCAL_POSITION_NED"
        ]
    )


@pytest.fixture(scope="module")
def replay() -> tuple[list[tuple[float, Any]], Client]:
    """The recording, and a client that sent the same packets at the same times to the simulator."""
    recorded = timed(list(raw_packets(RECORDING)))
    client = Client(open_ground(heading_rad=math.radians(-7.8)))
    for time_s, message in recorded:
        if message.get_srcComponent() == 191:
            client.run_to(time_s + LATENCY_S)
            client.link.receive(bytes(message.get_msgbuf()))
    client.run_to(recorded[-1][0] + 0.1)
    return recorded, client


@needs_shared
def test_every_target_of_the_recording_is_driven_as_recorded(replay: tuple[list[tuple[float, Any]], Client]) -> None:
    recorded, client = replay
    real, ours = motion([m for _, m in recorded]), motion(client.received)
    real = real[(real[:, 0] > 45.3) & (real[:, 0] < 149.0)]
    assert len(real) > 900
    same_time = [np.interp(real[:, 0], ours[:, 0], ours[:, column]) for column in (1, 2, 3)]
    apart_m = np.hypot(real[:, 1] - same_time[0], real[:, 2] - same_time[1])
    apart_m_s = np.abs(real[:, 3] - same_time[2])
    assert apart_m.max() < 0.4
    assert float(np.sqrt(np.mean(apart_m**2))) < 0.25
    # Single moments of braking differ by up to 0.3 m/s through the recording's clock.
    assert float(np.percentile(apart_m_s, 95)) < 0.2
    assert float(np.sqrt(np.mean(apart_m_s**2))) < 0.1


@needs_shared
def test_arrivals_are_reported_when_the_recording_reports_them(
    replay: tuple[list[tuple[float, Any]], Client],
) -> None:
    recorded, client = replay
    real_s = [time_s for time_s, m in recorded if m.get_type() == "MISSION_ITEM_REACHED"]
    ours_s, now_s = [], 0.0
    for message in client.received:
        now_s = message.time_boot_ms / 1000 if hasattr(message, "time_boot_ms") else now_s
        if message.get_type() == "MISSION_ITEM_REACHED":
            ours_s.append(now_s)
    assert len(real_s) == 5
    # The recording's last target is replaced 0.3 s after its arrival, too soon to compare.
    assert ours_s[:4] == pytest.approx(real_s[:4], abs=0.15)


@needs_shared
def test_read_back_targets_are_the_recorded_ones(replay: tuple[list[tuple[float, Any]], Client]) -> None:
    recorded, client = replay

    def places(messages: list[Any]) -> list[tuple[int, int, int]]:
        found = [(m.lat_int, m.lon_int, m.type_mask) for m in messages if m.get_type() == "POSITION_TARGET_GLOBAL_INT"]
        return [place for place, before in zip(found, [None, *found], strict=False) if place != before]

    real, ours = places([m for _, m in recorded]), places(client.received)
    assert len(real) == len(ours) > 20
    for one, other in zip(real, ours, strict=True):
        assert abs(one[0] - other[0]) <= 1
        assert abs(one[1] - other[1]) <= 1
        assert one[2] == other[2]


def test_ten_metres_from_rest() -> None:
    client = ready(open_ground())
    began_s = client.simulator.time_s
    client.drive_to(10.0, 0.0)
    profile = []
    while client.simulator.time_s < began_s + 10.0:
        client.run_for(0.02)
        truth = client.simulator.truth
        profile.append((client.simulator.time_s - began_s, truth.north_m, truth.speed_m_s))
    moving = [row for row in profile if row[2] > 0.05]
    started_s = next(row[0] for row in profile if row[2] > 0.15)
    assert started_s == pytest.approx(0.8, abs=0.1)
    assert max(row[2] for row in profile) == pytest.approx(2.4, abs=0.05)
    assert moving[-1][0] == pytest.approx(8.0, abs=0.2)
    assert profile[-1][1] - 10.0 == pytest.approx(0.23, abs=0.08)
    assert profile[-1][2] < 0.001


def test_a_target_behind_is_faced_first_at_sixty_degrees_a_second() -> None:
    def seconds_to_drive(north_m: float) -> tuple[float, float]:
        client = ready(open_ground())
        began_s, fastest = client.simulator.time_s, 0.0
        client.drive_to(north_m, 0.1)
        while math.hypot(client.simulator.truth.north_m, 0.0) < 4.0:
            client.run_for(0.02)
            fastest = max(fastest, abs(client.simulator.truth.yaw_rate_rad_s))
            assert client.simulator.time_s < began_s + 30.0
        return client.simulator.time_s - began_s, math.degrees(fastest)

    ahead_s, _ = seconds_to_drive(10.0)
    behind_s, rate_deg_s = seconds_to_drive(-10.0)
    assert rate_deg_s == pytest.approx(60.0, abs=4.0)
    # Measured from another start, perhaps with some speed: 4.3 s.
    assert behind_s - ahead_s == pytest.approx(4.3, abs=0.8)


@pytest.mark.parametrize(
    ("left_m", "mean_m_s", "lowest_m_s"), [(3.0, 1.69, 1.61), (2.0, 1.37, 1.24), (1.0, 0.99, 0.78), (0.5, 0.77, 0.44)]
)
def test_chained_targets(left_m: float, mean_m_s: float, lowest_m_s: float) -> None:
    """Targets 3 m apart, the next one sent when so much is left to go, as far as the sender knows (0.1 s late)."""
    client = ready(open_ground())
    target_m, known_m, speeds = 3.0, 0.0, []
    client.drive_to(target_m, 0.0)
    while target_m < 45.0:
        client.run_for(0.1)
        truth = client.simulator.truth
        if target_m - known_m <= left_m:
            target_m += 3.0
            client.drive_to(target_m, 0.0)
        known_m = truth.north_m
        if target_m > 18.0:
            speeds.append(truth.speed_m_s)
    assert float(np.mean(speeds)) == pytest.approx(mean_m_s, rel=0.06)
    assert min(speeds) == pytest.approx(lowest_m_s, rel=0.12)


def resent_at_2_hz(target_of: Any, **options: Any) -> float:
    client = ready(open_ground(**options))
    for _ in range(40):
        known_m = client.simulator.truth.north_m
        client.run_for(0.1)  # what the sender knows is 0.1 s old
        client.drive_to(target_of(known_m), 0.0)
        client.run_for(0.4)
    return client.simulator.truth.speed_m_s


def test_a_carrot_three_metres_ahead_is_followed_slowly() -> None:
    assert resent_at_2_hz(lambda north_m: north_m + 3.0) == pytest.approx(1.2, abs=0.06)


def test_one_far_target_repeated_is_driven_at_full_speed() -> None:
    assert resent_at_2_hz(lambda north_m: 200.0) == pytest.approx(3.0, abs=0.03)


def test_planning_from_rest_keeps_a_repeating_sender_standing() -> None:
    speed_m_s = resent_at_2_hz(lambda north_m: 200.0, parameters={"GUID_OPTIONS": 64})
    assert 0.0 < speed_m_s < 0.15


def test_velocity_targets_time_out_after_three_seconds() -> None:
    client = ready(open_ground())
    for _ in range(10):
        client.drive_at(1.0)
        client.run_for(0.3)
    last_s = client.simulator.time_s - 0.3
    assert client.simulator.truth.speed_m_s == pytest.approx(1.0, abs=0.05)
    client.run_to(last_s + 2.9)
    assert client.simulator.truth.speed_m_s == pytest.approx(1.0, abs=0.05)
    client.run_to(last_s + 3.2)
    assert "target not received last 3secs, stopping" in client.texts()
    client.run_to(last_s + 5.7)
    assert client.simulator.truth.speed_m_s < 0.02


def test_velocity_is_capped_at_wp_speed() -> None:
    client = ready(open_ground())
    for _ in range(20):
        client.drive_at(9.0)
        client.run_for(0.5)
    assert client.simulator.truth.speed_m_s == pytest.approx(3.0, abs=0.05)


def test_a_negative_velocity_turns_the_rover_round_unless_a_heading_or_rate_comes_with_it() -> None:
    pure, with_yaw, with_rate = (ready(open_ground()) for _ in range(3))
    for _ in range(16):
        pure.drive_at(-1.0)
        with_yaw.drive_at(-1.0, mask=2535, yaw=0.0)
        with_rate.drive_at(-1.0, mask=1511, rate=0.2)
        for client in (pure, with_yaw, with_rate):
            client.run_for(0.3)
    assert abs(pure.simulator.truth.heading_rad) == pytest.approx(math.pi, abs=0.05)
    assert pure.simulator.truth.speed_m_s == pytest.approx(1.0, abs=0.05)
    assert with_yaw.simulator.truth.heading_rad == pytest.approx(0.0, abs=0.02)
    assert with_yaw.simulator.truth.speed_m_s == pytest.approx(-1.0, abs=0.05)
    assert with_rate.simulator.truth.yaw_rate_rad_s == pytest.approx(0.2, abs=0.02)
    assert with_rate.simulator.truth.speed_m_s == pytest.approx(-1.0, abs=0.05)


def test_heading_and_turn_rate_alone_turn_on_the_spot() -> None:
    heading, rate = ready(open_ground()), ready(open_ground())
    for _ in range(10):
        heading.drive_at(0.0, mask=2559, yaw=2.0)
        rate.drive_at(0.0, mask=1535, rate=-0.5)
        heading.run_for(0.5)
        rate.run_for(0.5)
    assert heading.simulator.truth.heading_rad == pytest.approx(2.0, abs=0.02)
    assert rate.simulator.truth.yaw_rate_rad_s == pytest.approx(-0.5, abs=0.02)
    assert math.hypot(rate.simulator.truth.north_m, rate.simulator.truth.east_m) < 0.02


@pytest.mark.parametrize(("frame", "north_m", "east_m"), [(1, 5.0, 0.0), (7, 5.0, 4.0), (8, 0.0, 9.0), (9, 0.0, 9.0)])
def test_frames_of_local_targets(frame: int, north_m: float, east_m: float) -> None:
    """From the origin; from here; from here and turned with the rover, which stands at (0, 4) facing east."""
    client = ready(open_ground(heading_rad=math.pi / 2))
    client.drive_to(0.0, 4.0 - 0.2)
    client.run_for(12.0)
    stand = client.simulator.truth
    client.drive_to(5.0, 0.0, frame=frame)
    client.run_for(20.0)
    truth = client.simulator.truth
    from_here = frame != 1
    assert truth.north_m == pytest.approx(north_m + (stand.north_m if from_here else 0.0), abs=0.6)
    assert truth.east_m == pytest.approx(east_m + (stand.east_m - 4.0 if from_here else 0.0), abs=0.6)


def test_do_change_speed_and_reverse() -> None:
    client = ready(open_ground())
    client.drive_to(100.0, 0.0)
    assert client.ask(178, 1, 1.0) == 0
    client.run_for(10.0)
    assert client.simulator.truth.speed_m_s == pytest.approx(1.0, abs=0.02)
    backwards = ready(open_ground())
    assert backwards.ask(194, 1) == 0
    backwards.drive_to(-20.0, 0.0)
    backwards.run_for(6.0)
    assert backwards.simulator.truth.speed_m_s < -1.0
    assert abs(backwards.simulator.truth.heading_rad) < 0.1


def test_hold_stops_and_clears_the_target() -> None:
    client = ready(open_ground())
    client.drive_to(50.0, 0.0)
    client.run_for(5.0)
    assert client.simulator.truth.speed_m_s > 2.0
    assert client.set_mode(4) == 0
    client.run_for(3.0)
    stand = client.simulator.truth
    assert abs(stand.speed_m_s) < 0.02
    assert client.set_mode(15) == 0
    client.run_for(5.0)
    assert client.simulator.truth.north_m == pytest.approx(stand.north_m, abs=0.02)


def test_a_target_kept_while_disarmed_is_driven_to_on_arming() -> None:
    client = Client(open_ground())
    client.run_to(44.0)
    assert client.set_mode(15) == 0
    client.drive_to(5.0, 0.0)
    client.run_for(2.0)
    assert client.simulator.truth.north_m == pytest.approx(0.0, abs=1e-6)
    assert client.arm() == 0
    client.run_for(8.0)
    assert client.simulator.truth.north_m == pytest.approx(5.2, abs=0.3)


def towards_a_wall(lidar: bool = True, **parameters: float) -> Client:
    """An armed rover 9 m before a wall with a target behind it, after 15 s."""
    obstacles = np.zeros((20, 40), dtype=np.bool_)
    obstacles[14:16, :] = True
    start = SimStart(5.0, 20.0, 0.0, HOME)
    suite = "lidar-360" if lidar else "none"
    client = ready(Simulator(World(obstacles), start, suite, noise=False, parameters=parameters))
    client.ask(511, 132, 100_000)
    client.drive_to(14.0, 0.0)
    client.run_for(15.0)
    return client


def test_simple_avoidance_creeps_up_to_an_obstacle_and_stays_there_in_silence() -> None:
    client = towards_a_wall(PRX1_TYPE=2)
    assert 14.0 - client.simulator.truth.north_m == pytest.approx(2.1, abs=0.2)
    assert not client.simulator.collisions
    assert not client.of("MISSION_ITEM_REACHED")


@pytest.mark.parametrize("parameters", [{"PRX1_TYPE": 0}, {"PRX1_TYPE": 2, "AVOID_ENABLE": 0}])
def test_without_avoidance_or_without_ranges_the_rover_drives_into_it(parameters: dict[str, float]) -> None:
    assert towards_a_wall(**parameters).simulator.collisions
    assert towards_a_wall(lidar=False, PRX1_TYPE=2).simulator.collisions


def test_the_echo_trap() -> None:
    echoed = {m.id: m for m in towards_a_wall(PRX1_TYPE=2).of("DISTANCE_SENSOR")}
    assert {number: m.orientation for number, m in echoed.items()} == {10 + octant: octant for octant in range(8)}
    assert echoed[10].current_distance == pytest.approx(210, abs=20)
    assert echoed[14].current_distance == echoed[14].max_distance
    assert not towards_a_wall(PRX1_TYPE=0).of("DISTANCE_SENSOR")
