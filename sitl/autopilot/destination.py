"""Driving to a place in GUIDED, AUTO, RTL and SMART_RTL: set the destination, change the speed, check for arrival."""

from __future__ import annotations

import math

from sitl.autopilot.control.guided import begin_guided, begin_target
from sitl.autopilot.control.records import CIRCLE, HEADING, LEG, STOP, WAYPOINT
from sitl.autopilot.control.wp_nav import begin_leg
from sitl.autopilot.fence import Place
from sitl.autopilot.state import DRIVEN_MODES, Mode, Submode
from sitl.autopilot.vehicle import Vehicle
from sitl.world import geodesy

SLOWEST_M_S = 0.05


def begin_driving(vehicle: Vehicle, speed_m_s: float = 0.0) -> None:
    """Reset motion control to the limits of the parameters; a speed of 0 means WP_SPEED."""
    begin_guided(vehicle.control[0], vehicle.tuning[0])
    if speed_m_s > 0.0:
        vehicle.control["base_speed"] = vehicle.control["speed_max"] = max(speed_m_s, SLOWEST_M_S)


def drive_to(vehicle: Vehicle, place: Place, following: Place | None = None) -> None:
    """Drive to a place along a leg; with ``following``, on to that place without stopping."""
    vehicle.destination = place
    north_m, east_m = geodesy.offset_m(vehicle.origin, place)
    after = (0.0, 0.0) if following is None else geodesy.offset_m(vehicle.origin, following)
    records = vehicle.control[0], vehicle.tuning[0], vehicle.estimate[0]
    begin_leg(*records, (north_m, east_m), after, following is not None)


def stand(vehicle: Vehicle) -> None:
    """Brake and stand still."""
    vehicle.control["task"] = STOP


def arrived(vehicle: Vehicle) -> bool:
    """Whether the end of the present leg has been reached."""
    control = vehicle.control[0]
    return int(control["task"]) == LEG and bool(control["reached"])


def go_to(vehicle: Vehicle, place: tuple[int, int]) -> None:
    """Drive to a position target, (latitude, longitude) in 1e-7 degree."""
    vehicle.destination = place
    north_m, east_m = geodesy.offset_m(vehicle.origin, place)
    begin_target(vehicle.control[0], vehicle.tuning[0], vehicle.estimate[0], north_m, east_m)


def valid_place(lat: int, lon: int) -> bool:
    """Whether latitude and longitude are within their ranges."""
    return abs(lat) <= 900_000_000 and abs(lon) <= geodesy.HALF_TURN


def change_speed(vehicle: Vehicle, speed_m_s: float) -> bool:
    """DO_CHANGE_SPEED: accepted while there is a destination, and in AUTO at any time."""
    task = int(vehicle.control[0]["task"])
    if vehicle.mode == Mode.AUTO and task == HEADING:
        vehicle.control["target_speed"] = speed_m_s
        return math.isfinite(speed_m_s)
    waiting = vehicle.mode == Mode.AUTO and vehicle.auto.submode == Submode.STOP
    if vehicle.mode not in DRIVEN_MODES or not speed_m_s >= SLOWEST_M_S:
        return False
    if task not in (WAYPOINT, CIRCLE, LEG) and not waiting:
        return False
    vehicle.control["base_speed"] = speed_m_s
    return True
