"""Whether the rover could set off now: mode, position, arming, and messages that come often enough."""

from __future__ import annotations

from collections.abc import Iterator

from companion.diagnosis.finding import Finding, Level
from companion.vehicle.events.vehicle import RoverMode
from companion.vehicle.state import EKF_CONST_POSITION, EKF_POSITION
from companion.vehicle.survey import Examined

EKF_UNINITIALISED, EKF_GPS_GLITCH = 1024, 32768


def mode_of(seen: Examined) -> Iterator[Finding]:
    """Whether somebody drives it already."""
    beat = seen.vehicle.heartbeat
    if beat is None or not beat.armed:
        return
    if beat.mode in (RoverMode.GUIDED, RoverMode.HOLD):
        yield Finding(
            "armed", Level.NOTE, "The rover is armed: a run would drive off at once.", "disarm it if it should not"
        )
    else:
        mode = RoverMode(beat.mode).name if beat.mode in list(RoverMode) else str(beat.mode)
        says = f"The rover is armed in mode {mode}: somebody is driving, and a run waits."
        yield Finding("mode", Level.STOP, says, "set HOLD or GUIDED, or disarm")


def position(seen: Examined) -> Iterator[Finding]:
    """Whether it knows where it is."""
    vehicle = seen.vehicle
    if vehicle.ekf is None:
        says, remedy = "EKF_STATUS_REPORT does not come.", "look at the rates of this port"
        yield Finding("ekf", Level.STOP, says, remedy)
    elif vehicle.ekf_lacks == "position":
        flags = vehicle.ekf.flags
        why = "it only knows where it began" if flags & EKF_CONST_POSITION else "it has none"
        why = (
            "it has just been switched on"
            if flags & EKF_UNINITIALISED or not flags & (EKF_POSITION | EKF_CONST_POSITION)
            else why
        )
        why = "GPS jumps" if flags & EKF_GPS_GLITCH else why
        says = f"The EKF has no position: {why}."
        yield Finding(
            "ekf", Level.STOP, says, "wait for GPS under open sky (about 45 s), or set up another source of position"
        )
    elif vehicle.ekf_lacks:
        says = f"The EKF has no {vehicle.ekf_lacks}."
        yield Finding(
            "ekf", Level.STOP, says, "let the rover stand until it has, and look at the messages of the autopilot"
        )
    if vehicle.origin is None or vehicle.home is None:
        what = " and ".join(name for name, one in (("origin", vehicle.origin), ("home", vehicle.home)) if one is None)
        says = f"The autopilot has no {what} yet."
        yield Finding("origin", Level.STOP, says, "wait for GPS, or set the EKF origin at the ground station's map")
    if vehicle.position is None and vehicle.ekf_ok:
        yield Finding("no-position", Level.STOP, "LOCAL_POSITION_NED does not come.", "look at the rates of this port")


def arming(seen: Examined) -> Iterator[Finding]:
    """Its last word counts: complaints from before are over when its own checks pass."""
    beat, prearm = seen.vehicle.heartbeat, seen.vehicle.prearm
    complaints = [text for text in seen.texts if text.startswith(("PreArm:", "Arm:"))]
    refuses = bool(complaints) if prearm is None else not prearm.ok
    if refuses and not (beat is not None and beat.armed):
        reasons = "; ".join(text.partition(": ")[2] for text in complaints) or "it does not say why"
        says = f"The autopilot would not arm: {reasons}."
        yield Finding("pre-arm", Level.STOP, says, "do as the message says; leave its checks switched on")
    for text in seen.texts:
        if text not in complaints:
            yield Finding("text", Level.NOTE, f"The autopilot says: {text}", "")


def rates(seen: Examined) -> Iterator[Finding]:
    """Which messages come too seldom. Without a position of the EKF there is none to be sent, whatever the line carries."""
    no_position = seen.vehicle.ekf is not None and seen.vehicle.ekf_lacks == "position"
    for message in seen.slow:
        if message.name == "LOCAL_POSITION_NED" and no_position:
            continue
        vital = message.name in ("LOCAL_POSITION_NED", "ATTITUDE", "EKF_STATUS_REPORT") and message.measured_hz < 1.5
        says = f"{message.name} comes at {message.measured_hz:.1f} Hz though {message.wanted_hz:g} Hz were asked for."
        remedy = "a faster baud rate (115200), or keep ground stations from setting their own rates on this port"
        yield Finding("rate", Level.STOP if vital else Level.WARN, says, remedy)
