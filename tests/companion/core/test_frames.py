import math

import pytest

from companion.core.frames import METRES_PER_DEGREE, GeoPoint, LocalFrame, NedPoint, Pose, wrap_pi_rad

HOME = GeoPoint(-35.363262, 149.165237)


def test_bearings_are_clockwise_from_north():
    here = NedPoint(1.0, 2.0)
    assert here.bearing_rad(NedPoint(5.0, 2.0)) == 0.0
    assert here.bearing_rad(NedPoint(1.0, 9.0)) == pytest.approx(math.pi / 2)
    assert here.bearing_rad(NedPoint(1.0, -9.0)) == pytest.approx(-math.pi / 2)
    assert here.moved(math.pi / 2, 3.0).east_m == pytest.approx(5.0)


def test_north_is_latitude_and_east_is_longitude():
    frame = LocalFrame(HOME)
    north = frame.to_ned(GeoPoint(HOME.lat_deg + 0.001, HOME.lon_deg))
    east = frame.to_ned(GeoPoint(HOME.lat_deg, HOME.lon_deg + 0.001))
    assert (north.north_m, north.east_m) == (pytest.approx(111.3188, abs=1e-3), 0.0)
    assert east.north_m == 0.0
    assert east.east_m == pytest.approx(111.3188 * math.cos(math.radians(HOME.lat_deg)), abs=1e-3)


def test_one_constant_scales_both_axes_as_in_the_autopilot():
    """A geodesic would give 110.95 m for this thousandth of a degree: 0.3 % less."""
    assert pytest.approx(111318.845, abs=1e-3) == METRES_PER_DEGREE
    frame = LocalFrame(GeoPoint(0.0, 0.0))
    assert frame.to_ned(GeoPoint(0.0, 1.0)).east_m == pytest.approx(frame.to_ned(GeoPoint(1.0, 0.0)).north_m)


def test_longitude_wraps_at_the_date_line():
    frame = LocalFrame(GeoPoint(10.0, 179.9999))
    place = frame.to_ned(GeoPoint(10.0, -179.9999))
    assert 0.0 < place.east_m < 30.0
    assert frame.to_geo(place).lon_deg == pytest.approx(-179.9999)


@pytest.mark.parametrize("angle", [math.pi, -math.pi, 3.0 * math.pi])
def test_half_a_turn_is_always_minus_pi(angle):
    assert wrap_pi_rad(angle) == pytest.approx(-math.pi)


def test_a_pose_has_a_place():
    assert Pose(1.0, 2.0, 0.5, 7.0).point == NedPoint(1.0, 2.0)
