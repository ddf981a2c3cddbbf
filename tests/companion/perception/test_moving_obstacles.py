"""Others on the air, and what becomes of them: heard, remembered, left out, told to planners."""

import math
from typing import Any

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.control.reference_path import ReferencePath, with_planned_speeds
from companion.core.frames import GeoPoint, LocalFrame, NedPoint, Pose
from companion.core.grid import empty_grid
from companion.mavlink.codec import Codec
from companion.perception.moving_obstacles import Moving, announced, merged, motion_changed, planners_movers
from companion.planning.problem import Path
from companion.settings import LinkSettings, TrafficSettings
from companion.vehicle.events import GlobalPositionSeen, OriginSeen, OtherSeen
from companion.vehicle.state import OTHERS_KEPT, VehicleState, fold

ORIGIN = GeoPoint(53.0, 23.0)
HERE = Pose(0.0, 0.0, 0.0, 10.0)
TRAFFIC = TrafficSettings()
ADSB = 1 | 2 | 4 | 8
AIS = mavlink.AIS_FLAGS_VALID_COG | mavlink.AIS_FLAGS_VALID_VELOCITY | mavlink.AIS_FLAGS_VALID_DIMENSIONS


def units(point: NedPoint) -> tuple[int, int]:
    geo = LocalFrame(ORIGIN).to_geo(point)
    return round(geo.lat_deg * 1e7), round(geo.lon_deg * 1e7)


def adsb(flags: int = ADSB, tslc: int = 0, altitude_mm: int = 120_000) -> Any:
    place = units(NedPoint(10.0, 5.0))
    return mavlink.MAVLink_adsb_vehicle_message(7, *place, 0, altitude_mm, 9000, 150, 0, b"x", 18, tslc, flags, 0)


def ais(flags: int = AIS) -> Any:
    place = units(NedPoint(10.0, 5.0))
    return mavlink.MAVLink_ais_vessel_message(9, *place, 18000, 0, 200, 0, 0, 0, 6, 2, 1, 1, b"c", b"n", 0, flags)


def heard(*packets: tuple[Any, int]) -> list[OtherSeen]:
    """What a companion whose rover is system 1 makes of messages from these systems."""
    codec = Codec(LinkSettings())
    rover = mavlink.MAVLink(None, 1, 1)
    codec.decode(bytes(mavlink.MAVLink_heartbeat_message(10, 3, 0, 0, 4, 3).pack(rover)), 1.0)
    packers = {1: rover}
    events = []
    for message, system in packets:
        packer = packers.setdefault(system, mavlink.MAVLink(None, system, 1))
        events += codec.decode(bytes(message.pack(packer)), 2.0)
    return [event for event in events if isinstance(event, OtherSeen)]


def test_another_systems_position_is_anothers_and_ours_is_not() -> None:
    message = mavlink.MAVLink_global_position_int_message(5, *units(NedPoint(10.0, 5.0)), 120_000, 0, -100, 250, 0, 0)
    (other,) = heard((message, 101), (message, 1))
    assert other.name == "system 101"
    assert (other.north_m_s, other.east_m_s, other.altitude_m) == (-1.0, 2.5, 120.0)
    place = LocalFrame(ORIGIN).to_ned(other.point)
    assert (place.north_m, place.east_m) == pytest.approx((10.0, 5.0), abs=0.02)


@pytest.mark.parametrize("system", [1, 77])
def test_receivers_speak_of_others_whoever_passes_it_on(system: int) -> None:
    plane, ship = heard((adsb(tslc=1), system), (ais(), system))
    assert (plane.north_m_s, plane.east_m_s) == pytest.approx((0.0, 1.5), abs=1e-9)
    assert (plane.seen_s, plane.altitude_m, plane.radius_m) == (1.0, 120.0, None)
    assert (ship.north_m_s, ship.east_m_s) == pytest.approx((-2.0, 0.0), abs=1e-9)
    assert (ship.radius_m, ship.altitude_m) == (6.0, None), "from the antenna to the bow"


def test_what_flags_do_not_vouch_for_is_not_believed() -> None:
    assert heard((adsb(flags=2 | 4 | 8), 1)) == []
    (plane, ship) = heard((adsb(flags=1), 1), (ais(flags=0), 1))
    assert (plane.north_m_s, plane.east_m_s, plane.altitude_m) == (0.0, 0.0, None)
    assert (ship.north_m_s, ship.east_m_s, ship.radius_m) == (0.0, 0.0, None)


def test_nobody_is_heard_before_the_rover_is_known() -> None:
    codec = Codec(LinkSettings())
    packer = mavlink.MAVLink(None, 101, 1)
    assert codec.decode(bytes(adsb().pack(packer)), 1.0) == []


def seen(name: str, time_s: float, north_m: float = 10.0, **changes: Any) -> OtherSeen:
    point = LocalFrame(ORIGIN).to_geo(NedPoint(north_m, 0.0))
    return OtherSeen(time_s, name, time_s, point, **{"north_m_s": -1.0, "east_m_s": 0.0, **changes})


def state(*others: OtherSeen) -> VehicleState:
    known = fold(fold(VehicleState(), OriginSeen(0.0, ORIGIN)), GlobalPositionSeen(0.0, 0.0, ORIGIN, 120.0))
    for other in others:
        known = fold(known, other)
    return known


def test_no_more_are_remembered_than_there_is_room_for_and_the_silent_are_forgotten() -> None:
    crowd = state(*(seen(f"s{i}", 1.0 + 0.01 * i) for i in range(3 * OTHERS_KEPT)))
    assert len(crowd.others) == OTHERS_KEPT
    assert f"s{3 * OTHERS_KEPT - 1}" in crowd.others and "s0" not in crowd.others
    assert set(state(seen("a", 1.0), seen("b", 20.0), seen("c", 40.0)).others) == {"b", "c"}
    assert state(seen("a", 1.0), seen("a", 2.0)).others["a"].time_s == 2.0


def test_who_counts() -> None:
    known = state(
        seen("near", 9.0),
        seen("stale", 4.0),
        seen("above", 9.0, altitude_m=300.0),
        seen("level", 9.0, altitude_m=124.0),
        seen("far", 9.0, 500.0),
        seen("far, coming", 9.0, 100.0, north_m_s=-10.0),
        seen("ourselves", 10.0, 0.1, north_m_s=0.0),
    )
    found = {one.name: one for one in announced(known, HERE, 0.35, TRAFFIC)}
    assert set(found) == {"near", "level", "far, coming"}
    assert found["near"].at(10.0).north_m == pytest.approx(9.0, abs=0.02)
    assert found["near"].radius_m == TRAFFIC.radius_m
    assert announced(VehicleState(others=known.others), HERE, 0.35, TRAFFIC) == ()


def test_planners_get_fields_and_the_rovers_radius() -> None:
    grid = empty_grid(20, 20, 2.0, NedPoint(-4.0, -6.0))
    moving = Moving("m", 8.0, NedPoint(1.0, 1.0), 0.5, -1.0, 0.65)
    (mover,) = planners_movers((moving,), grid, 0.35, 10.0, TRAFFIC)
    assert mover.radius_fields == pytest.approx(0.5)
    place = grid.centre_of(grid.cell_at(moving.at(10.0)))
    assert mover.track[0] == pytest.approx([0.0, (-1.0 + 6.0) / 2.0 - 0.5, (2.0 + 4.0) / 2.0 - 0.5])
    assert math.hypot(place.north_m - 2.0, place.east_m + 1.0) <= math.sqrt(2.0)
    assert mover.track[1, 0] == TRAFFIC.horizon_s
    assert mover.track[1, 1:] - mover.track[0, 1:] == pytest.approx([-10.0, 5.0])


def test_what_is_seen_where_somebody_announces_himself_is_he() -> None:
    told = Moving("told", 0.0, NedPoint(0.0, 0.0), 1.0, 0.0, 1.0)
    same = Moving("seen 1", 2.0, NedPoint(2.3, 0.2), 0.6, 0.1, 0.65)
    else_where = Moving("seen 2", 2.0, NedPoint(2.0, 3.0), 0.6, 0.1, 0.65)
    assert merged((told,), (same, else_where), 2.0) == (told, else_where)
    assert merged((), (same,), 2.0) == (same,)


def test_a_change_of_motion_is_noticed_and_jitter_is_not() -> None:
    one = Moving("m", 0.0, NedPoint(0.0, 0.0), 1.0, 0.0, 0.5)
    turned = Moving("m", 2.0, NedPoint(2.0, 0.0), 0.0, 1.0, 0.5)
    jitter = Moving("m", 2.0, NedPoint(2.0, 0.0), 1.2, 0.1, 0.5)
    parked = Moving("p", 2.0, NedPoint(2.0, 0.0), 0.0, 0.0, 0.5)
    assert motion_changed((one,), (turned,), TRAFFIC)
    assert motion_changed((), (one,), TRAFFIC)
    assert not motion_changed((one,), (jitter, parked), TRAFFIC)
    assert not motion_changed((one,), (), TRAFFIC)


def test_planned_speeds_lie_along_the_route() -> None:
    route = ReferencePath(np.column_stack((np.linspace(0.0, 20.0, 81), np.zeros(81))))
    curve = np.array([[0.0, 0.0], [0.0, 2.0], [0.0, 10.0]])
    planned = with_planned_speeds(route, Path((), 1.0, curve, np.array([0.5, 0.8])), 2.0)
    assert planned.speeds_m_s is not None
    assert planned.speeds_m_s[:16] == pytest.approx(1.0) and planned.speeds_m_s[17:] == pytest.approx(1.6)
    assert planned.planned_m_s == pytest.approx(1.0)
    assert with_planned_speeds(route, Path((), 1.0, curve), 2.0).planned_m_s == math.inf
