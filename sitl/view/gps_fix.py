"""The simulated receiver's fix in words."""

from __future__ import annotations

from sitl.autopilot.vehicle import Vehicle

FIXES = {1: "no fix", 3: "3D", 4: "3D DGPS", 5: "RTK float", 6: "RTK fixed"}
NO_GPS = "no GPS"


def fix_told(vehicle: Vehicle) -> str:
    """The kind of its fix; ``NO_GPS`` as long as the autopilot has no position from it."""
    if vehicle.has_home and vehicle.ekf.gps_has_fix:
        return FIXES[vehicle.ekf.gps.fix_type]
    return NO_GPS
