"""Activity of the simulated rover: one large line for the page, and what is awaited or why the rover stands.

Nouns: simulated activity.
"""

from __future__ import annotations

from typing import NamedTuple

from sitl.autopilot.modes import arming_faults
from sitl.autopilot.start_up import ARMABLE_S, POSITION_S
from sitl.autopilot.state import Mode
from sitl.autopilot.vehicle import Vehicle
from sitl.simulator import Simulator

MOVES_M_S, TURNS_RAD_S = 0.03, 0.05


class SimulatedActivity(NamedTuple):
    """``state``: one of those that the page has a colour for."""

    state: str
    line: str
    why: str = ""

    def as_json(self) -> dict[str, str]:
        """The keys of a frame. The line says that it is the simulator that speaks, not a companion."""
        return {"line": f"simulator: {self.line}", "why": self.why, "state": self.state}


def activity_of(simulator: Simulator, heard: bool, how: str) -> SimulatedActivity:
    """``heard``: whether anybody is connected; ``how``: how to connect."""
    truth, vehicle = simulator.truth, simulator.vehicle
    if simulator.is_off:
        return SimulatedActivity("stopped", "the autopilot has no power")
    if abs(truth.speed_m_s) > MOVES_M_S or abs(truth.yaw_rate_rad_s) > TURNS_RAD_S:
        line = f"driving in {vehicle.mode.name}" if vehicle.armed else "rolling, disarmed"
        return SimulatedActivity("driving", line, "" if heard else "nobody is connected")
    if not heard:
        return SimulatedActivity("waiting", "waiting for somebody to connect", how)
    if not vehicle.is_started:
        left_s = POSITION_S + vehicle.gps_late.position_s - vehicle.time_s
        why = f"the autopilot knows its position in {max(left_s, 0.0):.0f} s"
        return SimulatedActivity("waiting", "the autopilot starts up", why)
    if not vehicle.armed:
        return SimulatedActivity("waiting", f"disarmed in {vehicle.mode.name}", _why_disarmed(vehicle))
    return _standing(vehicle)


def _why_disarmed(vehicle: Vehicle) -> str:
    faults = arming_faults(vehicle)
    left_s = ARMABLE_S + vehicle.gps_late.position_s - vehicle.time_s
    if faults and left_s > 0.0:
        return f"it can be armed in {left_s:.0f} s"
    return f"it cannot be armed: {faults[0].text}" if faults else "waiting for somebody to arm it"


def _standing(vehicle: Vehicle) -> SimulatedActivity:
    """Armed, and it does not move."""
    if vehicle.mode is Mode.HOLD:
        return SimulatedActivity("stopped", "stopped in HOLD", "it drives again when somebody sets another mode")
    line = f"standing in {vehicle.mode.name}"
    if not vehicle.has_position:
        return SimulatedActivity("stopped", line, "the autopilot has lost its position")
    if vehicle.in_guided and not vehicle.has_target:
        return SimulatedActivity("waiting", line, "waiting for a target")
    return SimulatedActivity("waiting", line)
