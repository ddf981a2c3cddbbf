"""Compiles what is called when a drive begins, so that no client waits for a compiler in the middle of one."""

from __future__ import annotations

from sitl.autopilot.circle import begin_circle
from sitl.autopilot.guided import begin_guided, begin_target
from sitl.autopilot.legs import begin_leg
from sitl.autopilot.vehicle import Vehicle


def begin_every_drive(vehicle: Vehicle) -> None:
    """Begin each kind of drive once; on copies, the vehicle itself stays as it is."""
    control, tuning, estimate = (records.copy()[0] for records in (vehicle.control, vehicle.tuning, vehicle.estimate))
    begin_guided(control, tuning)
    begin_target(control, tuning, estimate, 1.0, 0.0)
    begin_leg(control, tuning, estimate, 1.0, 0.0, 0.0, 0.0, False)
    begin_circle(control, estimate, 1.0, 0.0, 1.0)
