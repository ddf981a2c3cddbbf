import math

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.sensors.range_sensors import SUITES, RangeSensing, suite_named
from sitl.simulator import Simulator
from sitl.world.truth import SimStart
from sitl.world.world import World
from tests.support.sitl_client import HOME, Client


def wall_north() -> World:
    """A wall from north 10 on, and a post one metre wide at north 5, east 12."""
    obstacles = np.zeros((12, 24), dtype=np.bool_)
    obstacles[10:, :] = True
    obstacles[5, 12] = True
    return World(obstacles)


def sensing(name: str, noise_m: float = 0.0) -> RangeSensing:
    return RangeSensing(suite_named(name), wall_north(), noise_m, np.random.default_rng(1))


def test_unknown_suites_are_refused_by_name() -> None:
    with pytest.raises(ValueError, match=r"sonar.*lidar-90"):
        suite_named("sonar")


@pytest.mark.parametrize(("name", "first_deg", "last_deg"), [("lidar-90", -45.0, 45.0), ("lidar-360", -2.5, 357.5)])
def test_sectors_cover_the_view_without_gap_or_overlap(name: str, first_deg: float, last_deg: float) -> None:
    lidar = SUITES[name].lidar
    assert lidar is not None
    middle = np.degrees(lidar.bearings_rad()).mean(axis=1)
    assert len(middle) == 72
    assert middle[0] - lidar.increment_deg / 2 == pytest.approx(first_deg)
    assert middle[-1] + lidar.increment_deg / 2 == pytest.approx(last_deg)
    assert np.degrees(lidar.bearings_rad()).min() >= first_deg
    assert np.degrees(lidar.bearings_rad()).max() <= last_deg


def test_lidar_90_sees_ahead_only_and_says_when_it_sees_nothing() -> None:
    cells = sensing("lidar-90").scan_cm(7.0, 5.0, 0.0)
    assert min(cells) == 300
    assert cells[0] == cells[71] == round(300 / math.cos(math.radians(44.375)))
    assert set(sensing("lidar-90").scan_cm(7.0, 5.0, math.pi)) == {451}


def test_lidar_360_sees_all_round_clockwise() -> None:
    cells = sensing("lidar-360").scan_cm(5.5, 8.5, 0.0)
    assert cells[0] == 450
    assert cells[18] == 350
    assert cells[36] == 801
    turned = sensing("lidar-360").scan_cm(5.5, 8.5, math.pi / 2)
    assert turned[0] == 350
    assert turned[54] == 450


def test_beams_look_ahead_left_and_right() -> None:
    ahead, left, right = sensing("beams").beams_cm(5.5, 2.0, 0.0)
    assert ahead == 450
    assert left == 600
    assert right == 600
    ahead, left, right = sensing("beams").beams_cm(8.0, 5.0, math.pi / 4)
    assert ahead == pytest.approx(283, abs=1)
    assert left == 200
    assert right == 600


def test_noise_has_the_size_asked_for_and_never_touches_the_no_echo_value() -> None:
    noisy = sensing("lidar-90", noise_m=0.02)
    scans = np.array([noisy.scan_cm(7.0, 5.0, 0.0) for _ in range(200)], dtype=np.float64)
    middle = scans[:, 34:38]
    assert float(middle.mean()) == pytest.approx(300.0, abs=1.0)
    assert float(middle.std()) == pytest.approx(2.0, abs=0.4)
    assert {451} == set(noisy.scan_cm(7.0, 5.0, math.pi))


@pytest.mark.parametrize("rate_hz", [10.0, 15.0])
def test_the_lidar_is_a_component_of_its_own_heard_on_every_link(rate_hz: float) -> None:
    simulator = Simulator(wall_north(), SimStart(7.0, 5.0, 0.0, HOME), "lidar-90", lidar_rate_hz=rate_hz)
    one, other = Client(simulator), Client(simulator, system=255, component=190)
    for client in (one, other):  # nobody is heard before he has spoken
        client.send(mavlink.MAVLink_heartbeat_message(18, 8, 0, 0, 4, 3))
    one.run_to(1.0)
    one.received.clear()
    one.run_to(11.0)
    scans = one.of("OBSTACLE_DISTANCE")
    assert len(scans) == pytest.approx(10 * rate_hz, abs=1)
    scan = scans[-1]
    assert (scan.get_srcSystem(), scan.get_srcComponent()) == (1, 196)
    assert (scan.min_distance, scan.max_distance, scan.increment_f, scan.angle_offset) == (10, 450, 1.25, -44.375)
    assert scan.distances[36] == pytest.approx(300, abs=8)
    other.run_to(11.0)
    assert len(other.of("OBSTACLE_DISTANCE")) == pytest.approx(11 * rate_hz, abs=1)


def test_beams_come_from_the_autopilot() -> None:
    simulator = Simulator(wall_north(), SimStart(5.5, 2.0, 0.0, HOME), "beams", noise=False)
    client = Client(simulator)
    client.run_to(10.0)
    latest = {m.orientation: m for m in client.of("DISTANCE_SENSOR")}
    assert {number: m.current_distance for number, m in latest.items()} == {0: 450, 7: 600, 1: 600}
    assert {m.get_srcComponent() for m in latest.values()} == {1}
    assert {(m.min_distance, m.max_distance) for m in latest.values()} == {(20, 600)}
    assert client.of("RANGEFINDER")[-1].distance == pytest.approx(4.5)
    assert not client.of("OBSTACLE_DISTANCE")
