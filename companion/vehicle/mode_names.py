"""Names of ArduRover's flight modes."""

from __future__ import annotations

from companion.vehicle.events import RoverMode
from companion.vehicle.state import VehicleState

MODE_NAMES = {
    1: "ACRO",
    3: "STEERING",
    5: "LOITER",
    6: "FOLLOW",
    7: "SIMPLE",
    8: "DOCK",
    9: "CIRCLE",
    12: "SMART_RTL",
    16: "INITIALISING",
}
"""ArduRover's other modes."""


def mode_name(vehicle: VehicleState) -> str | None:
    """The flight mode by its name, or its number where it has none here; None before the first heartbeat."""
    if vehicle.heartbeat is None:
        return None
    mode = vehicle.heartbeat.mode
    if mode in RoverMode.__members__.values():
        return RoverMode(mode).name
    return MODE_NAMES.get(mode, f"mode {mode}")
