"""What range messages mean."""

import math

import numpy as np
import pytest

from companion.core.scan import RangeScan
from companion.mavlink.codec import Codec
from companion.perception.scan_filter import MOST_SCANS
from companion.settings import LinkSettings
from companion.vehicle.events import RangeSeen
from tests.support.mavlink_vehicle import Station


class Listener:
    """A codec that already knows its vehicle, and the stations that talk to it."""

    def __init__(self) -> None:
        self.codec = Codec(LinkSettings())
        self.rover = Station(1, 1)
        self.lidar = Station(1, 196)
        self.codec.decode(self.rover.heartbeat(), 0.0)

    def scans(self, raw: bytes, time_s: float = 10.0) -> list[RangeScan]:
        return [event.scan for event in self.codec.decode(raw, time_s) if isinstance(event, RangeSeen)]


@pytest.fixture
def listener() -> Listener:
    return Listener()


@pytest.mark.parametrize("orientation", range(8))
def test_orientation_counts_clockwise_from_ahead(listener: Listener, orientation: int) -> None:
    (scan,) = listener.scans(listener.rover.distance(350, orientation))
    assert scan.bearing_rad.tolist() == pytest.approx([math.radians(45.0 * orientation)])
    assert scan.range_m.tolist() == [3.5]
    assert (scan.min_range_m, scan.max_range_m) == (0.2, 20.0)


def test_scans_that_wait_on_their_way_would_have_come_sooner_by_their_own_clock(listener: Listener) -> None:
    """A lidar's in microseconds since 1970, a rangefinder's in milliseconds since its start."""
    for number in range(40):
        made_s = 0.1 * number
        waited_s = 0.08 if number % 4 == 3 else 0.0
        lidar, beam = listener.lidar, listener.rover
        for raw in (
            lidar.cells([300] * 72, time_usec=round(1e6 * (1.7e9 + made_s))),
            beam.distance(350, 0, time_boot_ms=round(1e3 * made_s)),
        ):
            (scan,) = listener.scans(raw, 10.0 + made_s + waited_s)
            assert scan.time_s == 10.0 + made_s + waited_s
            if number > 20:
                assert scan.late_s == pytest.approx(waited_s, abs=0.002)


def test_one_sensor_too_many_does_not_matter_to_the_others(listener: Listener) -> None:
    late_s = []
    for number in range(60):
        made_s, waited_s = 0.1 * number, 0.08 if number % 4 == 3 else 0.0
        for sensor in range(MOST_SCANS + 3):
            raw = listener.rover.distance(350, 0, sensor_id=100 + sensor, time_boot_ms=round(1e3 * made_s))
            late_s += [(number, waited_s, one.late_s) for one in listener.scans(raw, 10.0 + made_s + waited_s)]
    assert len(late_s) == 60 * MOST_SCANS
    assert all(late == pytest.approx(waited_s, abs=0.002) for number, waited_s, late in late_s if number > 30)


@pytest.mark.parametrize("orientation", [8, 12, 24, 25, 99])
def test_sensors_that_do_not_look_along_the_ground_are_left_out(listener: Listener, orientation: int) -> None:
    assert listener.scans(listener.rover.distance(350, orientation)) == []


def test_custom_orientation_by_quaternion(listener: Listener) -> None:
    half = math.radians(30.0) / 2.0
    turned_right = [math.cos(half), 0.0, 0.0, math.sin(half)]
    (scan,) = listener.scans(listener.rover.distance(350, 100, quaternion=turned_right))
    assert scan.bearing_rad[0] == pytest.approx(math.radians(30.0))
    down = [math.cos(math.pi / 4), 0.0, -math.sin(math.pi / 4), 0.0]
    assert listener.scans(listener.rover.distance(350, 100, quaternion=down)) == []
    assert listener.scans(listener.rover.distance(350, 100)) == []


@pytest.mark.parametrize(("current_cm", "expected_m"), [(1999, 19.99), (2000, math.inf), (2100, math.inf), (5, 0.05)])
def test_limits_of_a_sensor(listener: Listener, current_cm: int, expected_m: float) -> None:
    (scan,) = listener.scans(listener.rover.distance(current_cm))
    assert scan.range_m.tolist() == [expected_m]


def test_readings_that_say_nothing_are_no_scan(listener: Listener) -> None:
    assert listener.scans(listener.rover.distance(350, quality=1)) == []
    assert listener.scans(listener.rover.distance(0)) == []
    assert listener.scans(listener.rover.distance(65535, max_cm=65535)) == []
    assert listener.scans(listener.rover.distance(10, max_cm=0, min_cm=0)) == []
    assert len(listener.scans(listener.rover.distance(350, quality=100))) == 1


def test_stated_field_of_view_is_the_beam(listener: Listener) -> None:
    (scan,) = listener.scans(listener.rover.distance(350, fov_rad=0.05))
    assert scan.beam_width_rad == pytest.approx(0.05)
    (wide,) = listener.scans(listener.rover.distance(350, fov_rad=0.5))
    assert len(wide.range_m) > 1 and set(wide.range_m) == {3.5}
    assert wide.beam_width_rad * len(wide.range_m) == pytest.approx(0.5)
    span_rad = wide.bearing_rad.max() - wide.bearing_rad.min() + wide.beam_width_rad
    assert span_rad == pytest.approx(0.5)


def test_sectors_cover_45_degrees_when_nothing_finer_is_heard(listener: Listener) -> None:
    (scan,) = listener.scans(listener.rover.distance(400, 2, sensor_id=12, max_cm=1000))
    assert scan.source == "sector 12"
    assert scan.bearing_rad.mean() == pytest.approx(math.radians(90.0))
    assert scan.beam_width_rad * len(scan.bearing_rad) == pytest.approx(math.radians(45.0))
    (empty,) = listener.scans(listener.rover.distance(1000, 3, sensor_id=13, max_cm=1000))
    assert np.isinf(empty.range_m).all()


def test_sectors_that_echo_the_lidar_are_left_out(listener: Listener) -> None:
    assert len(listener.scans(listener.lidar.cells([300] * 72), 10.0)) == 1
    assert listener.scans(listener.rover.distance(300, 0, sensor_id=10), 11.9) == []
    assert len(listener.scans(listener.rover.distance(300, 0, sensor_id=10), 12.1)) == 1


def test_sectors_that_echo_a_rangefinder_are_left_out_in_its_direction_only(listener: Listener) -> None:
    listener.scans(listener.rover.distance(300, 0, sensor_id=0), 10.0)
    assert listener.scans(listener.rover.distance(300, 0, sensor_id=10), 10.5) == []
    assert len(listener.scans(listener.rover.distance(300, 1, sensor_id=11), 10.5)) == 1


def test_a_sector_that_sees_what_finer_data_does_not_is_no_echo(listener: Listener) -> None:
    """The autopilot has a sensor of its own, and somebody else sends that there is nothing."""
    listener.scans(listener.lidar.cells([801] * 72), 10.0)
    listener.scans(listener.lidar.distance(2000, 0, sensor_id=0), 10.0)
    assert listener.scans(listener.rover.distance(2000, 0, sensor_id=10), 10.1) == []
    (scan,) = listener.scans(listener.rover.distance(300, 0, sensor_id=10), 10.1)
    assert scan.source == "sector 10" and np.all(scan.range_m == 3.0)
    listener.scans(listener.lidar.cells([801] * 9 + [300] + [801] * 62), 10.2)
    assert listener.scans(listener.rover.distance(300, 0, sensor_id=10), 10.3) == []
    assert len(listener.scans(listener.rover.distance(300, 4, sensor_id=14), 10.3)) == 1


def test_ever_new_sensors_do_not_keep_out_those_that_were_there_first(listener: Listener) -> None:
    crowd = Station(1, 158)
    listener.scans(listener.lidar.cells([300] * 72), 10.0)
    taken = sum(
        len(listener.scans(crowd.distance(300 + n, n % 8, sensor_id=n % 250), 10.0 + 0.001 * n)) for n in range(1000)
    )
    assert 0 < taken < 100
    (scan,) = listener.scans(listener.lidar.cells([301] * 72), 11.0)
    assert scan.voice == (196, "obstacle distance")
    assert len(listener.scans(crowd.distance(900, 0, sensor_id=251), 20.0)) == 1, "who falls silent gives up its place"


def test_a_sensor_10_of_another_component_is_no_sector(listener: Listener) -> None:
    listener.scans(listener.lidar.cells([300] * 72), 10.0)
    (scan,) = listener.scans(listener.lidar.distance(300, 0, sensor_id=10), 10.1)
    assert scan.source == "distance sensor 10"


def test_cells_of_a_lidar(listener: Listener) -> None:
    (scan,) = listener.scans(listener.lidar.cells([150, 65535, 801, 800, 799, 10, 0]))
    assert scan.bearing_rad[:7].tolist() == pytest.approx([math.radians(5.0 * i) for i in range(7)])
    assert scan.range_m[[0, 2, 3, 4, 5]].tolist() == [1.5, math.inf, math.inf, 7.99, 0.1]
    assert np.isnan(scan.range_m[[1, 6]]).all()
    assert scan.beam_width_rad == pytest.approx(math.radians(5.0))
    assert (scan.min_range_m, scan.max_range_m) == (0.2, 8.0)


def test_fractional_increment_wins_and_the_offset_is_from_ahead(listener: Listener) -> None:
    (scan,) = listener.scans(listener.lidar.cells([200] * 72, increment=5, increment_f=1.25, offset_deg=-45.0))
    assert math.degrees(scan.bearing_rad[0]) == pytest.approx(-45.0)
    assert math.degrees(scan.bearing_rad[-1]) == pytest.approx(-45.0 + 71 * 1.25)
    (left,) = listener.scans(listener.lidar.cells([200] * 72, increment_f=-2.5))
    assert math.degrees(left.bearing_rad[1]) == pytest.approx(-2.5)


def test_cells_beyond_a_full_turn_are_left_out(listener: Listener) -> None:
    (scan,) = listener.scans(listener.lidar.cells([200] * 72, increment=6))
    assert len(scan.range_m) == 60


@pytest.mark.parametrize("frame", [0, 1, 8, 12])
def test_cells_are_relative_to_the_rover_in_any_frame(listener: Listener, frame: int) -> None:
    (scan,) = listener.scans(listener.lidar.cells([200] * 72, frame=frame))
    assert scan.bearing_rad[0] == 0.0


def test_cells_that_make_no_sense_or_say_nothing_are_no_scan(listener: Listener) -> None:
    assert listener.scans(listener.lidar.cells([65535] * 72)) == []
    assert listener.scans(listener.lidar.cells([0] * 72)) == []
    assert listener.scans(listener.lidar.cells([200] * 72, increment=0)) == []
    assert listener.scans(listener.lidar.cells([200] * 72, max_cm=0, min_cm=0)) == []
    assert listener.scans(listener.lidar.cells([200] * 72, increment_f=math.nan)) == []
    assert listener.scans(listener.lidar.cells([200] * 72, offset_deg=math.inf)) == []


def test_the_nearest_of_all_sensors_is_the_last_resort(listener: Listener) -> None:
    rover = listener.rover
    assert listener.scans(rover.rangefinder(1.5), 1.0) == [], "better data may be about to come"
    (scan,) = listener.scans(rover.rangefinder(1.5), 2.5)
    assert (scan.bearing_rad.tolist(), scan.range_m.tolist(), scan.source) == ([0.0], [1.5], "rangefinder")
    (far,) = listener.scans(rover.rangefinder(21.0), 2.6)
    assert far.range_m.tolist() == [math.inf] and far.max_range_m == 5.0
    assert listener.scans(rover.rangefinder(0.0), 2.7) == []
    assert listener.scans(rover.rangefinder(math.nan), 2.8) == []
    listener.scans(rover.distance(300), 3.0)
    assert listener.scans(rover.rangefinder(1.5), 4.9) == []
    assert len(listener.scans(rover.rangefinder(1.5), 5.1)) == 1


def test_range_data_of_another_system_is_ignored(listener: Listener) -> None:
    assert listener.scans(Station(2, 196).cells([200] * 72)) == []
    assert listener.codec.counters.other_systems == 1


@pytest.mark.parametrize("step_deg", [math.inf, -math.inf, 3e38, -1e9, 360.1])
def test_a_field_wider_than_a_turn_is_no_scan_and_takes_no_memory(listener: Listener, step_deg: float) -> None:
    assert listener.scans(listener.lidar.cells([200] * 72, increment_f=step_deg)) == []
    assert len(listener.scans(listener.lidar.cells([200] * 72, increment_f=360.0))) == 1


@pytest.mark.parametrize("offset_deg", [math.inf, math.nan, 1e30, -361.0])
def test_an_offset_of_more_than_a_turn_is_no_scan(listener: Listener, offset_deg: float) -> None:
    assert listener.scans(listener.lidar.cells([200] * 72, offset_deg=offset_deg)) == []
