"""Flight modes, arming and failsafes: what ArduRover accepts, refuses and says (measured)."""

from __future__ import annotations

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.autopilot_fence import arming_fault
from sitl.autopilot_plan import GuidedTask, Submode
from sitl.autopilot_vehicle import ARMABLE_S, AUTOPILOT_MODES, HOME_S, PREARM_S, Mode, Vehicle
from sitl.autopilot_ways import begin_driving, begin_return, begin_way_back, remember_start
from sitl.control import COAST, STOP

NOT_ARMABLE = {Mode.RTL, Mode.SMART_RTL, Mode.INITIALISING}
FORCE = {2989, 21196}
"""Magic numbers that arm or disarm against the checks."""

CRITICAL, WARNING, NOTICE, INFO = 2, 4, 5, 6
GCS_SILENCE_S = 5.7
PREARM_TEXT_EVERY_S = 30.0


def set_mode(vehicle: Vehicle, number: int) -> bool:
    """Change the flight mode; a refused change leaves a text."""
    try:
        mode = Mode(number)
    except ValueError:
        vehicle.say(WARNING, f"No such mode {number}")
        return False
    if mode == vehicle.mode:
        return True
    if not _may_enter(vehicle, mode):
        vehicle.say(WARNING, "Flight mode change failed")
        return False
    if vehicle.mode == Mode.AUTO:
        vehicle.plan.mission.stop()
    vehicle.mode = mode
    _enter(vehicle)
    if vehicle.plan.fence.breached:
        # Whoever changes the mode now is taken to be driving back by hand.
        vehicle.plan.fence.recovering_since_s = vehicle.time_s
    for channel in vehicle.channels.values():
        channel.requested.append(mavlink.MAVLINK_MSG_ID_HEARTBEAT)
    return True


def _may_enter(vehicle: Vehicle, mode: Mode) -> bool:
    if mode == Mode.AUTO and not vehicle.plan.mission.present:
        vehicle.say(NOTICE, "No Mission. Can't set AUTO.")
        return False
    if mode == Mode.DOCK:
        vehicle.say(NOTICE, "Dock: target not acquired")
        return False
    if mode in (Mode.FOLLOW, Mode.INITIALISING):
        return False
    if mode in (Mode.RTL, Mode.SMART_RTL, Mode.LOITER) and not vehicle.has_position:
        return False
    if mode == Mode.SMART_RTL and not vehicle.plan.way_back.active:
        return False
    return not (vehicle.armed and mode in AUTOPILOT_MODES and not vehicle.has_position)


def _enter(vehicle: Vehicle) -> None:
    control = vehicle.control
    begin_driving(vehicle)
    control["task"] = STOP
    vehicle.destination = vehicle.place()
    # HOLD takes the throttle away at once, it does not brake by a controller.
    if vehicle.mode in (Mode.MANUAL, Mode.ACRO, Mode.STEERING, Mode.SIMPLE, Mode.HOLD):
        control["task"] = COAST
    elif vehicle.mode == Mode.RTL:
        begin_return(vehicle)
    elif vehicle.mode == Mode.SMART_RTL:
        begin_way_back(vehicle)
    elif vehicle.mode == Mode.AUTO:
        vehicle.plan.auto.waiting = True
        vehicle.plan.auto.submode = Submode.STOP
        vehicle.plan.auto.guided = GuidedTask()


def arm(vehicle: Vehicle, force: bool = False) -> bool:
    """Arm, or say why not."""
    if vehicle.armed:
        return True
    vehicle.clocks.logging_s = vehicle.time_s
    reasons = [] if force else arming_faults(vehicle)
    if vehicle.mode in NOT_ARMABLE and not force:
        reasons = ["Mode not armable"]
    for reason in reasons:
        vehicle.say(CRITICAL, f"Arm: {reason}")
    if reasons:
        return False
    vehicle.armed = True
    vehicle.clocks.armed_s = vehicle.time_s
    vehicle.control["armed"] = 1
    remember_start(vehicle)
    vehicle.say(INFO, "Throttle armed")
    return True


def arming_faults(vehicle: Vehicle) -> list[str]:
    """What the arming checks complain of in this mode at this time."""
    if vehicle.time_s < HOME_S:
        return ["Accels inconsistent", "AHRS: waiting for home"]
    if vehicle.mode in AUTOPILOT_MODES and vehicle.time_s < ARMABLE_S:
        return ["AHRS: not using configured AHRS type"]
    if vehicle.time_s < PREARM_S:
        return ["Accels inconsistent"]
    fault = arming_fault(vehicle)
    return [] if fault is None else [fault]


def disarm(vehicle: Vehicle) -> None:
    """Disarm; always possible."""
    if vehicle.armed:
        vehicle.armed = False
        vehicle.clocks.logging_s = vehicle.time_s
        vehicle.control["armed"] = 0
        if vehicle.mode != Mode.AUTO:
            vehicle.plan.mission.reset()
        vehicle.say(INFO, "Throttle disarmed")


def run_failsafes(vehicle: Vehicle) -> None:
    """Once a second: the ground station's silence, and the pre-arm complaint every half minute."""
    seen_s = vehicle.clocks.ground_station_s
    watched = vehicle.parameters["FS_GCS_ENABLE"] > 0 and seen_s is not None
    if watched and vehicle.armed and seen_s is not None and vehicle.time_s - seen_s >= GCS_SILENCE_S:
        vehicle.clocks.ground_station_s = None
        vehicle.say(WARNING, "Radio Failsafe")
        set_mode(vehicle, Mode.HOLD)
    due = vehicle.time_s - vehicle.clocks.prearm_text_s >= PREARM_TEXT_EVERY_S
    if not vehicle.armed and due:
        vehicle.clocks.prearm_text_s = vehicle.time_s
        for reason in arming_faults(vehicle)[:1]:
            vehicle.say(CRITICAL, f"PreArm: {reason}")


def base_mode(vehicle: Vehicle) -> int:
    """HEARTBEAT's base_mode."""
    flags = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
    if vehicle.mode in (Mode.MANUAL, Mode.ACRO, Mode.STEERING, Mode.SIMPLE, Mode.INITIALISING):
        flags |= mavlink.MAV_MODE_FLAG_MANUAL_INPUT_ENABLED
    elif vehicle.mode != Mode.HOLD:
        flags |= mavlink.MAV_MODE_FLAG_GUIDED_ENABLED
    if vehicle.armed:
        flags |= mavlink.MAV_MODE_FLAG_SAFETY_ARMED
    return int(flags)
