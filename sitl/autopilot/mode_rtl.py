"""RTL: return to home or to a rally point (behaviour of ModeRTL, AP_Rally).

Nouns: ModeRTL, AP_Rally.
"""

from __future__ import annotations

from companion.core.severity import Severity
from sitl.autopilot.destination import arrived, begin_driving, drive_to
from sitl.autopilot.fence import Place, allowed, distance_m, nearest
from sitl.autopilot.vehicle import Vehicle


def destination_of_rtl(vehicle: Vehicle) -> Place:
    """Home, or the nearest rally point inside the fence that is not too far away."""
    here = vehicle.place()
    points = [item.place for item in vehicle.storage.rally if allowed(vehicle, item.place)]
    point = nearest(here, points)
    if point is None:
        return vehicle.home
    limit_m = vehicle.parameters["RALLY_LIMIT_KM"] * 1000.0
    if 0.0 < limit_m < distance_m(here, point):
        return vehicle.home
    if vehicle.parameters["RALLY_INCL_HOME"] and distance_m(here, vehicle.home) <= distance_m(here, point):
        return vehicle.home
    return point


def begin_return(vehicle: Vehicle) -> None:
    """Begin RTL, as a mode or as a mission item."""
    begin_driving(vehicle, vehicle.parameters["RTL_SPEED"])
    vehicle.rtl_arrival_said = False
    drive_to(vehicle, destination_of_rtl(vehicle))
    vehicle.control["halts"] = 1


def run_return(vehicle: Vehicle) -> None:
    """Report the arrival, once."""
    if arrived(vehicle) and not vehicle.rtl_arrival_said:
        vehicle.rtl_arrival_said = True
        vehicle.say(Severity.INFO, "Reached destination")
