"""Flight modes, arming and failsafes: what ArduRover accepts and refuses, and its texts (measured)."""

from __future__ import annotations

from typing import NamedTuple

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.core.severity import Severity
from sitl.autopilot.battery import LOW, NAMES, OK, arming_complaint
from sitl.autopilot.control.records import COAST, STOP
from sitl.autopilot.control.servo_outputs import outputs_fault
from sitl.autopilot.destination import begin_driving
from sitl.autopilot.ekf import Change
from sitl.autopilot.fence import arming_fault
from sitl.autopilot.mode_rtl import begin_return
from sitl.autopilot.mode_smart_rtl import begin_smart_rtl, remember_start
from sitl.autopilot.start_up import ARMABLE_S, PREARM_S
from sitl.autopilot.state import AUTOPILOT_MODES, GuidedTask, Mode, Submode
from sitl.autopilot.vehicle import Vehicle

NOT_ARMABLE = {Mode.RTL, Mode.SMART_RTL, Mode.INITIALISING}

FORCE = {2989, 21196}
"""Magic numbers that arm or disarm regardless of the checks."""

GCS_SILENCE_S = 5.7

PREARM_TEXT_EVERY_S = 30.0

VARIANCE_TEXT_EVERY_S = 30.0

NO_EKF_ACTION, REPORT_ONLY = 0, 2
"""FS_EKF_ACTION; all other values mean HOLD."""

DISARM_ACTION = 5

BATTERY_MODES = {
    1: (Mode.RTL, Mode.HOLD),
    2: (Mode.HOLD,),
    3: (Mode.SMART_RTL, Mode.RTL, Mode.HOLD),
    4: (Mode.SMART_RTL, Mode.HOLD),
}
"""BATT_FS_LOW_ACT and BATT_FS_CRT_ACT: the modes to try in turn."""


def set_mode(vehicle: Vehicle, number: int) -> bool:
    """Change the flight mode; False, with a text, if that is refused."""
    try:
        mode = Mode(number)
    except ValueError:
        vehicle.say(Severity.WARNING, f"No such mode {number}")
        return False
    if mode == vehicle.mode:
        return True
    if not _may_enter(vehicle, mode):
        vehicle.say(Severity.WARNING, "Flight mode change failed")
        return False
    if vehicle.mode == Mode.AUTO:
        vehicle.mission.stop()
    vehicle.mode = mode
    _enter(vehicle)
    if vehicle.fence.breached:
        # A change of mode during a breach counts as the pilot driving back by hand.
        vehicle.fence.recovering_since_s = vehicle.time_s
    for channel in vehicle.channels.values():
        channel.requested.append(mavlink.MAVLINK_MSG_ID_HEARTBEAT)
    return True


def _may_enter(vehicle: Vehicle, mode: Mode) -> bool:
    if mode == Mode.AUTO and not vehicle.mission.present:
        vehicle.say(Severity.NOTICE, "No Mission. Can't set AUTO.")
        return False
    if mode == Mode.DOCK:
        vehicle.say(Severity.NOTICE, "Dock: target not acquired")
        return False
    if mode in (Mode.FOLLOW, Mode.INITIALISING):
        return False
    if mode in (Mode.RTL, Mode.SMART_RTL, Mode.LOITER) and not vehicle.has_position:
        return False
    if mode == Mode.SMART_RTL and not vehicle.smart_rtl.active:
        return False
    return not (vehicle.armed and mode in AUTOPILOT_MODES and not vehicle.has_position)


def _enter(vehicle: Vehicle) -> None:
    control = vehicle.control
    begin_driving(vehicle)
    control["task"] = STOP
    apply_sticks(vehicle)
    vehicle.destination = vehicle.place()
    # HOLD cuts the throttle at once; it does not brake with a controller.
    if vehicle.mode in (Mode.MANUAL, Mode.ACRO, Mode.STEERING, Mode.SIMPLE, Mode.HOLD):
        control["task"] = COAST
    elif vehicle.mode == Mode.RTL:
        begin_return(vehicle)
    elif vehicle.mode == Mode.SMART_RTL:
        begin_smart_rtl(vehicle)
    elif vehicle.mode == Mode.AUTO:
        vehicle.auto.waiting = True
        vehicle.auto.submode = Submode.STOP
        vehicle.auto.guided = GuidedTask()


def apply_sticks(vehicle: Vehicle) -> None:
    """In MANUAL, pass the pilot's sticks directly to the motors."""
    manual = vehicle.mode == Mode.MANUAL
    vehicle.control["stick_steering"] = vehicle.sticks.steering if manual else 0.0
    vehicle.control["stick_throttle"] = vehicle.sticks.throttle if manual else 0.0


def arm(vehicle: Vehicle, force: bool = False) -> bool:
    """Arm; False, with texts that say why, if that is refused."""
    if vehicle.armed:
        return True
    vehicle.clocks.logging_s = vehicle.time_s
    faults = [] if force else arming_faults(vehicle)
    if vehicle.mode in NOT_ARMABLE and not force:
        faults = [ArmingFault("Mode not armable")]
    for fault in faults:
        vehicle.say(Severity.CRITICAL, f"{'PreArm' if fault.always_prearm else 'Arm'}: {fault.text}")
    if faults:
        return False
    vehicle.armed = True
    vehicle.control["armed"] = 1
    remember_start(vehicle)
    vehicle.say(Severity.INFO, "Throttle armed")
    return True


class ArmingFault(NamedTuple):
    """A complaint of the arming checks, in the firmware's words; some say "PreArm" even when arming was tried."""

    text: str
    always_prearm: bool = False


def arming_faults(vehicle: Vehicle) -> list[ArmingFault]:
    """What the arming checks complain about in this mode at this time."""
    if not vehicle.has_home:
        return [ArmingFault("Accels inconsistent"), ArmingFault("AHRS: waiting for home")]
    battery = arming_complaint(vehicle.parameters, vehicle.volts(), vehicle.used_mah())
    outputs = outputs_fault(vehicle.parameters)
    faults = [ArmingFault(battery)] if battery else []
    faults += [ArmingFault(outputs, always_prearm=True)] if outputs else []
    located = vehicle.has_position and vehicle.time_s >= ARMABLE_S + vehicle.gps_late.position_s
    if vehicle.mode in AUTOPILOT_MODES and not located:
        return [*faults, ArmingFault("AHRS: not using configured AHRS type")]
    if vehicle.time_s < PREARM_S:
        return [*faults, ArmingFault("Accels inconsistent")]
    fence = arming_fault(vehicle)
    return faults if fence is None else [*faults, ArmingFault(fence)]


def disarm(vehicle: Vehicle) -> None:
    """Disarm; always possible."""
    if vehicle.armed:
        vehicle.armed = False
        vehicle.clocks.logging_s = vehicle.time_s
        vehicle.control["armed"] = 0
        if vehicle.mode != Mode.AUTO:
            vehicle.mission.reset()
        vehicle.say(Severity.INFO, "Throttle disarmed")


def run_failsafes(vehicle: Vehicle) -> None:
    """Once a second: ground station failsafe, battery failsafe, and the pre-arm complaint every half minute."""
    _watch_battery(vehicle)
    _forget_override(vehicle)
    seen_s = vehicle.clocks.ground_station_s
    watched = vehicle.parameters["FS_GCS_ENABLE"] > 0 and seen_s is not None
    if watched and vehicle.armed and seen_s is not None and vehicle.time_s - seen_s >= GCS_SILENCE_S:
        vehicle.clocks.ground_station_s = None
        vehicle.say(Severity.WARNING, "Radio Failsafe")
        set_mode(vehicle, Mode.HOLD)
    due = vehicle.time_s - vehicle.clocks.prearm_text_s >= PREARM_TEXT_EVERY_S
    if not vehicle.armed and due:
        vehicle.clocks.prearm_text_s = vehicle.time_s
        for fault in arming_faults(vehicle)[:1]:
            vehicle.say(Severity.CRITICAL, f"PreArm: {fault.text}")


def _watch_battery(vehicle: Vehicle) -> None:
    """Rover's battery failsafe: a text, and the action of BATT_FS_LOW_ACT or BATT_FS_CRT_ACT."""
    vehicle.drain()
    if not vehicle.armed or int(vehicle.parameters["BATT_MONITOR"]) == 0:
        return
    volts, used_mah = vehicle.volts(), vehicle.used_mah()
    level = vehicle.battery.check(vehicle.parameters, volts, used_mah, vehicle.time_s)
    if level == OK:
        return
    vehicle.say(Severity.WARNING, f"Battery 1 is {NAMES[level]} {volts:.2f}V used {used_mah:.0f} mAh")
    _battery_action(vehicle, int(vehicle.parameters["BATT_FS_LOW_ACT" if level == LOW else "BATT_FS_CRT_ACT"]))


def _battery_action(vehicle: Vehicle, action: int) -> None:
    """0 nothing, 1 RTL, 2 HOLD, 3 SMART_RTL, 4 SMART_RTL or HOLD, 5 disarm; a refused mode falls back to the next."""
    if action == DISARM_ACTION:
        disarm(vehicle)
        return
    for mode in BATTERY_MODES.get(action, ()):
        if set_mode(vehicle, mode):
            return


def _forget_override(vehicle: Vehicle) -> None:
    heard_s = vehicle.sticks.overridden_s
    patience_s = vehicle.parameters["RC_OVERRIDE_TIME"]
    if heard_s is not None and 0.0 <= patience_s < vehicle.time_s - heard_s:
        vehicle.sticks = vehicle.transmitter
        apply_sticks(vehicle)


def report_ekf(vehicle: Vehicle, changes: list[Change]) -> None:
    """Report changes of the EKF, and take the action of Rover's EKF failsafe."""
    for change in changes:
        if change is Change.FAILED:
            _ekf_failsafe(vehicle)
        elif change is Change.CLEARED:
            vehicle.say(Severity.CRITICAL, "EKF failsafe cleared")
        else:
            vehicle.say(Severity.WARNING if change is Change.STOPPED_AIDING else Severity.INFO, change.value)


def _ekf_failsafe(vehicle: Vehicle) -> None:
    if vehicle.time_s - vehicle.clocks.variance_text_s > VARIANCE_TEXT_EVERY_S:
        vehicle.clocks.variance_text_s = vehicle.time_s
        vehicle.say(Severity.CRITICAL, "EKF variance")
    action = int(vehicle.parameters["FS_EKF_ACTION"])
    if vehicle.mode not in AUTOPILOT_MODES or action == NO_EKF_ACTION:
        return
    if action != REPORT_ONLY:
        set_mode(vehicle, Mode.HOLD)
    vehicle.say(Severity.CRITICAL, "EKF failsafe")


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
