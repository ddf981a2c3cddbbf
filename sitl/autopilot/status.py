"""SYS_STATUS: which parts of the autopilot are there, in use and well, as measured over a boot and in each mode."""

from __future__ import annotations

from typing import Any, NamedTuple

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.autopilot.boot import ARMABLE_S
from sitl.autopilot.modes import NOT_ARMABLE, arming_faults
from sitl.autopilot.vehicle import AUTOPILOT_MODES, Mode, Vehicle

GYRO_ACCEL_MAG_BARO, GPS, LASER = 0b1111, 1 << 5, 1 << 8
STABILISED, NAVIGATING = 1 << 10 | 1 << 11, 1 << 12 | 1 << 14
MOTORS_AND_RC, GEOFENCE, AHRS, LOGGING, BATTERY, PREARM = 1 << 15 | 1 << 16, 1 << 20, 1 << 21, 1 << 24, 1 << 25, 1 << 28
ALWAYS = GYRO_ACCEL_MAG_BARO | MOTORS_AND_RC | BATTERY
AHRS_USED_S = 22.0
"""The estimate counts as in use from here on (measured)."""
LOGGING_S = 15.0
"""The log goes on for so long after disarming or a refused arming."""


def sys_status(vehicle: Vehicle) -> list[Any]:
    """SYS_STATUS of this moment."""
    gps = GPS if vehicle.has_home and vehicle.ekf.gps_has_fix else 0
    laser = LASER if vehicle.sensing.suite.beams else 0
    control = 0 if vehicle.mode in (Mode.MANUAL, Mode.HOLD, Mode.INITIALISING) else STABILISED
    control |= NAVIGATING if vehicle.mode in AUTOPILOT_MODES else 0
    present = ALWAYS | gps | laser | STABILISED | NAVIGATING | GEOFENCE | AHRS | LOGGING | PREARM
    enabled = ALWAYS | gps | laser | control | PREARM
    enabled |= AHRS if vehicle.time_s >= AHRS_USED_S else 0
    logging = vehicle.armed or vehicle.time_s - vehicle.clocks.logging_s < LOGGING_S
    enabled |= LOGGING if logging else 0
    health = ALWAYS | gps | LASER | control | GEOFENCE | LOGGING
    health |= AHRS if vehicle.time_s >= ARMABLE_S else 0
    health |= 0 if arming_faults(vehicle) or vehicle.mode in NOT_ARMABLE else PREARM
    enabled |= GEOFENCE if vehicle.plan.fence.enabled and vehicle.parameters["FENCE_ACTION"] > 0.0 else 0
    health &= ~GEOFENCE if vehicle.plan.fence.breached else ~0
    health &= ~BATTERY if vehicle.battery.worst else ~0
    battery = battery_readings(vehicle)
    return [
        mavlink.MAVLink_sys_status_message(
            present, enabled, health, 0, battery.volts_mv, battery.amps_ca, battery.percent, 0, 0, 0, 0, 0, 0
        )
    ]


class BatteryReadings(NamedTuple):
    """What the battery monitor tells, each as far as its field in a message goes (a parameter may ask for more)."""

    volts_mv: int
    amps_ca: int
    used_mah: int
    used_hj: int
    """Hundreds of joules since boot."""
    percent: int


def battery_readings(vehicle: Vehicle) -> BatteryReadings:
    """The readings of this moment."""
    used_hj = 36.0 * float(vehicle.control[0]["used_wh"])
    return BatteryReadings(
        _within(1000.0 * vehicle.volts() + 0.5, 0, 65534),
        _within(100.0 * vehicle.amps(), -32768, 32767),
        _within(vehicle.used_mah(), -(2**31), 2**31 - 1),
        _within(used_hj, -(2**31), 2**31 - 1),
        vehicle.battery_percent(),
    )


def _within(value: float, low: int, high: int) -> int:
    """Whole, and between the two; what is no number is the lower one."""
    return int(min(max(value, low), high)) if value > low else low
