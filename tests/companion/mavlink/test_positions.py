"""Positions in messages: which mean a place, and what other vehicles announce."""

from __future__ import annotations

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.core.frames import GeoPoint
from companion.mavlink.positions import LARGEST_M, adsb_vehicle, ais_vessel, point_of

PLACE = (530_000_000, 230_000_000)
ALL_VALID = 0xFFFF


@pytest.mark.parametrize(
    ("lat_e7", "lon_e7", "point"),
    [
        (530_000_000, 230_000_000, GeoPoint(53.0, 23.0)),
        (0, 1, GeoPoint(0.0, 1e-7)),
        (0, 0, None),
        (900_000_001, 0, None),
        (0, -1_800_000_001, None),
    ],
)
def test_a_place_is_on_the_earth_and_not_zero(lat_e7: int, lon_e7: int, point: GeoPoint | None) -> None:
    assert point_of(lat_e7, lon_e7) == point


def adsb(flags: int) -> mavlink.MAVLink_adsb_vehicle_message:
    return mavlink.MAVLink_adsb_vehicle_message(0xABCDEF, *PLACE, 0, 120_000, 9000, 250, 0, b"X", 0, 2, flags, 0)


def test_an_aircraft_is_where_it_was_when_its_signal_was_heard() -> None:
    seen = adsb_vehicle(adsb(ALL_VALID), 10.0)
    assert seen is not None and (seen.name, seen.seen_s, seen.altitude_m) == ("ADS-B ABCDEF", 8.0, 120.0)
    assert (seen.north_m_s, seen.east_m_s) == pytest.approx((0.0, 2.5), abs=1e-9)


def test_fields_without_their_flag_are_unknown() -> None:
    assert adsb_vehicle(adsb(0), 10.0) is None
    seen = adsb_vehicle(adsb(mavlink.ADSB_FLAGS_VALID_COORDS), 10.0)
    assert seen is not None and (seen.altitude_m, seen.north_m_s, seen.east_m_s) == (None, 0.0, 0.0)


@pytest.mark.parametrize(("stern", "radius_m"), [(40, 40.0), (60_000, LARGEST_M), (0, 6.0)])
def test_a_ship_reaches_from_its_antenna_to_its_farthest_side(stern: int, radius_m: float) -> None:
    message = mavlink.MAVLink_ais_vessel_message(
        7, *PLACE, 0, 0, 0, 0, 0, 0, 6, stern, 2, 2, b"", b"", 0, mavlink.AIS_FLAGS_VALID_DIMENSIONS
    )
    seen = ais_vessel(message, 10.0)
    assert seen is not None and (seen.name, seen.radius_m) == ("AIS 7", radius_m)
