"""From a link to a rover that may be driven: what is still missing, and the one command that would help."""

from __future__ import annotations

from dataclasses import dataclass

from companion.commands import Arm, Command, SetMode
from companion.safety import Control, unsafe_reason
from companion.settings import SafetySettings
from companion.vehicle import RoverMode, VehicleState

ASK_AGAIN_S = 3.0
"""A command that has not worked is given again after so long."""


@dataclass(frozen=True, slots=True)
class StartStep:
    """``missing`` is empty when the rover may be driven; otherwise it says in words what is awaited."""

    missing: str
    command: Command | None = None


def start_step(
    vehicle: VehicleState,
    now_s: float,
    settings: SafetySettings,
    *,
    arm: bool,
    control: Control = Control.NOBODY,
) -> StartStep:
    """What stands between now and driving.

    GUIDED is set only on a rover that nobody drives (disarmed, or in HOLD), and never on one that a person has just taken
    out of GUIDED (``control``); arming only if told to (``arm``).
    """
    if vehicle.heartbeat is None:
        return StartStep("the autopilot's heartbeat")
    if vehicle.origin is None or vehicle.home is None:
        return StartStep("the autopilot's origin and home")
    reason = unsafe_reason(vehicle, now_s, settings)
    if reason:
        return StartStep(f"good data ({reason})")
    if vehicle.heartbeat.mode != RoverMode.GUIDED:
        if control is Control.PERSON:
            return StartStep("a person to set GUIDED (somebody has taken the rover)")
        if vehicle.heartbeat.armed and vehicle.heartbeat.mode != RoverMode.HOLD:
            return StartStep("a person to set GUIDED (somebody is driving)")
        return StartStep("GUIDED", SetMode(RoverMode.GUIDED))
    if not vehicle.heartbeat.armed:
        return StartStep("arming", Arm()) if arm else StartStep("a person to arm (or run with --arm)")
    return StartStep("")
