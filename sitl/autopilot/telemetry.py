"""Telemetry: each message that the autopilot streams or sends on request, built from the vehicle's state."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.autopilot.control.records import LEG
from sitl.autopilot.ekf import NO_FIX
from sitl.autopilot.fence import fence_status
from sitl.autopilot.modes import NOT_ARMABLE, arming_faults, base_mode
from sitl.autopilot.proximity import echoes
from sitl.autopilot.start_up import ARMABLE_S, EKF_SEEN_S, LOCAL_POSITION_S
from sitl.autopilot.state import AUTOPILOT_MODES, Mode
from sitl.autopilot.vehicle import Vehicle
from sitl.sensors.range_sensors import Reading
from sitl.world import geodesy
from sitl.world.geodesy import ALTITUDE_M

GYRO_ACCEL_MAG_BARO, GPS, LASER = 0b1111, 1 << 5, 1 << 8

STABILISED, NAVIGATING = 1 << 10 | 1 << 11, 1 << 12 | 1 << 14

MOTORS_AND_RC, GEOFENCE, AHRS, LOGGING, BATTERY, PREARM = 1 << 15 | 1 << 16, 1 << 20, 1 << 21, 1 << 24, 1 << 25, 1 << 28

ALWAYS = GYRO_ACCEL_MAG_BARO | MOTORS_AND_RC | BATTERY

AHRS_USED_S = 22.0
"""From here on the estimate counts as in use (measured)."""

LOGGING_S = 15.0
"""The log continues for this long after disarming or a refused arming."""


def sys_status(vehicle: Vehicle) -> list[Any]:
    """SYS_STATUS: which parts are present, in use and healthy, as measured over a boot and in each mode."""
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
    enabled |= GEOFENCE if vehicle.fence.enabled and vehicle.parameters["FENCE_ACTION"] > 0.0 else 0
    health &= ~GEOFENCE if vehicle.fence.breached else ~0
    health &= ~BATTERY if vehicle.battery.worst else ~0
    battery = battery_readings(vehicle)
    return [
        mavlink.MAVLink_sys_status_message(
            present, enabled, health, 0, battery.volts_mv, battery.amps_ca, battery.percent, 0, 0, 0, 0, 0, 0
        )
    ]


class BatteryReadings(NamedTuple):
    """Readings of the battery monitor, each limited to the range of its field in a message."""

    volts_mv: int
    amps_ca: int
    used_mah: int
    used_hj: int
    """Hundreds of joules since boot."""
    percent: int


def battery_readings(vehicle: Vehicle) -> BatteryReadings:
    """The readings of this moment."""
    used_hj = 36.0 * float(vehicle.control["used_wh"][0])
    return BatteryReadings(
        _within(1000.0 * vehicle.volts() + 0.5, 0, 65534),
        _within(100.0 * vehicle.amps(), -32768, 32767),
        _within(vehicle.used_mah(), -(2**31), 2**31 - 1),
        _within(used_hj, -(2**31), 2**31 - 1),
        vehicle.battery_percent(),
    )


def _within(value: float, low: int, high: int) -> int:
    """The value as an integer between two limits; NaN becomes the lower one."""
    return int(min(max(value, low), high)) if value > low else low


NAN = float("nan")

GROUND_ROVER, SURFACE_BOAT = 10, 11
"""MAV_TYPE."""

BOAT = 2
"""FRAME_CLASS."""

STANDBY, ACTIVE, CALIBRATING = 3, 4, 2

CAPABILITIES = 61935
"""The firmware's capabilities (measured). File transfer is among them, see ``ftp``."""

Builder = Callable[[Vehicle], list[Any]]


def _ms(vehicle: Vehicle) -> int:
    return vehicle.time_us // 1000


def heartbeat(vehicle: Vehicle) -> list[Any]:
    """HEARTBEAT: a ground rover, or a boat if FRAME_CLASS says so; ArduPilot."""
    starting = vehicle.time_s < 1.0
    mode = Mode.INITIALISING if starting else vehicle.mode
    status = CALIBRATING if starting else STANDBY if mode == Mode.HOLD else ACTIVE
    kind = SURFACE_BOAT if int(vehicle.parameters["FRAME_CLASS"]) == BOAT else GROUND_ROVER
    return [mavlink.MAVLink_heartbeat_message(kind, 3, base_mode(vehicle), int(mode), status, 3)]


def _attitude(vehicle: Vehicle) -> list[Any]:
    rate = float(vehicle.estimate["yaw_rate_rad_s"][0])
    return [mavlink.MAVLink_attitude_message(_ms(vehicle), 0.0, 0.0, vehicle.heading_rad(), 0.0, 0.0, rate)]


def _local_position(vehicle: Vehicle) -> list[Any]:
    if vehicle.time_s < LOCAL_POSITION_S or vehicle.stale_m is not None:
        return []
    place, speed = vehicle.position_m(), vehicle.velocity_m_s()
    return [mavlink.MAVLink_local_position_ned_message(_ms(vehicle), *place, 0.0, *speed, 0.0)]


def _global_position(vehicle: Vehicle) -> list[Any]:
    lat, lon = vehicle.place()
    north, east = vehicle.velocity_m_s()
    return [
        mavlink.MAVLink_global_position_int_message(
            _ms(vehicle), lat, lon, round(ALTITUDE_M * 1000), 0,
            round(north * 100), round(east * 100), 0, vehicle.heading_cdeg(),
        )
    ]  # fmt: skip


def _vfr_hud(vehicle: Vehicle) -> list[Any]:
    speed = math.hypot(*vehicle.velocity_m_s())
    throttle = min(abs(round(100.0 * float(vehicle.control["throttle_before"][0]))), 100)
    return [mavlink.MAVLink_vfr_hud_message(0.0, speed, vehicle.heading_cdeg() // 100, throttle, ALTITUDE_M, 0.0)]


def _ekf_status(vehicle: Vehicle) -> list[Any]:
    if vehicle.time_s < EKF_SEEN_S:
        return []
    position = max(0.002, vehicle.ekf.test_ratio) if vehicle.is_started else 0.002
    return [mavlink.MAVLink_ekf_status_report_message(vehicle.ekf_flags, 0.004, position, 0.01, 0.03, 0.0)]


def _gps_raw(vehicle: Vehicle) -> list[Any]:
    gps = vehicle.ekf.gps
    if not gps.told:
        return []
    searching = gps.fix_type == NO_FIX
    if vehicle.has_home and searching:
        return [mavlink.MAVLink_gps_raw_int_message(vehicle.time_us, NO_FIX, 0, 0, 0, 65535, 65535, 0, 0, 3)]
    if vehicle.has_home and vehicle.ekf.gps_has_fix and not gps.talks:
        return []  # while the receiver counts as present, only new fixes are sent
    if not vehicle.has_home or not vehicle.ekf.gps_has_fix:
        return [mavlink.MAVLink_gps_raw_int_message(0, 0, 0, 0, 0, 65535, 65535, 0, 0, 0)]
    lat, lon = vehicle.gps_place()
    north, east = vehicle.velocity_m_s()
    course = round(math.degrees(math.atan2(east, north)) * 100.0) % 36000
    altitude = round(ALTITUDE_M * 1000)
    return [
        mavlink.MAVLink_gps_raw_int_message(
            vehicle.time_us, gps.fix_type, lat, lon, altitude, 121, 200, round(math.hypot(north, east) * 100), course,
            10, altitude, 300, 300, 0, 0,
        )
    ]  # fmt: skip


def _cross_track_m(vehicle: Vehicle) -> float:
    """Metres left (positive) or right of the present leg; 0 without one."""
    control, (north_m, east_m) = vehicle.control[0], vehicle.position_m()
    leg_n, leg_e = float(control["dest_n"] - control["from_n"]), float(control["dest_e"] - control["from_e"])
    length_m = math.hypot(leg_n, leg_e)
    if int(control["task"]) != LEG or length_m == 0.0:
        return 0.0
    return float((north_m - control["from_n"]) * leg_e - (east_m - control["from_e"]) * leg_n) / length_m


def _navigation(vehicle: Vehicle) -> list[Any]:
    if vehicle.mode not in AUTOPILOT_MODES:
        return []
    bearing = distance = 0
    cross_track_m = 0.0
    if vehicle.has_target:
        north, east = geodesy.offset_m(vehicle.place(), vehicle.destination)
        bearing = round(math.degrees(math.atan2(east, north))) % 360
        distance = int(math.hypot(north, east))
        cross_track_m = _cross_track_m(vehicle)
    return [
        mavlink.MAVLink_nav_controller_output_message(
            0.0, 0.0, bearing, bearing, min(distance, 65535), 0.0, 0.0, cross_track_m
        )
    ]


def _position_target(vehicle: Vehicle) -> list[Any]:
    if not vehicle.has_target:
        return []
    lat, lon = vehicle.destination
    zeros = (0.0,) * 9
    return [mavlink.MAVLink_position_target_global_int_message(_ms(vehicle), 0, 65016, lat, lon, 0.0, *zeros[1:])]


def _servos(vehicle: Vehicle) -> list[Any]:
    control = vehicle.control[0]
    first, third = (1500 + round(500 * float(control[servo])) for servo in ("servo_1", "servo_3"))
    # The field has 32 bits: after 71 minutes it begins anew, as the autopilot's does.
    time_us = vehicle.time_us % 2**32
    return [mavlink.MAVLink_servo_output_raw_message(time_us, 0, first, 0, third, 0, 0, 0, 0, 0)]


def _simstate(vehicle: Vehicle) -> list[Any]:
    rover = vehicle.rover[0]
    north, east = float(rover["north_m"]) - vehicle.origin_m[0], float(rover["east_m"]) - vehicle.origin_m[1]
    lat, lon = geodesy.moved(vehicle.origin, north, east)
    rate = float(rover["yaw_rate_rad_s"])
    return [mavlink.MAVLink_simstate_message(0, 0, float(rover["heading_rad"]), 0, 0, -9.80665, 0, 0, rate, lat, lon)]


def _distance_sensors(vehicle: Vehicle) -> list[Any]:
    own = [
        mavlink.MAVLink_distance_sensor_message(
            _ms(vehicle), one.min_cm, one.max_cm, one.range_cm, one.kind, one.number, one.orientation, 0
        )
        for one in (*read_beams(vehicle), *vehicle.sensing.sectors())
    ]
    return own + echoes(vehicle)


def _rangefinder(vehicle: Vehicle) -> list[Any]:
    readings = [one.range_cm for one in read_beams(vehicle)]
    return [mavlink.MAVLink_rangefinder_message(min(readings) / 100.0, 0.0)] if readings else []


def read_beams(vehicle: Vehicle) -> list[Reading]:
    """The readings of the rangefinders at this moment."""
    rover = vehicle.rover[0]
    return vehicle.sensing.wired(float(rover["north_m"]), float(rover["east_m"]), float(rover["heading_rad"]))


def mission_current(vehicle: Vehicle, seq: int) -> Any:
    """MISSION_CURRENT with a given item; the total does not count home."""
    mission = vehicle.mission
    state = int(mission.state) if mission.present else mavlink.MISSION_STATE_NO_MISSION
    return mavlink.MAVLink_mission_current_message(
        seq, max(len(mission.items) - 1, 0), state, int(vehicle.mode == Mode.AUTO)
    )


def _home(vehicle: Vehicle) -> list[Any]:
    if not vehicle.has_home:
        return []
    lat, lon = vehicle.home
    return [
        mavlink.MAVLink_home_position_message(
            lat, lon, round(ALTITUDE_M * 1000), 0.0, 0.0, 0.0, [NAN] * 4, 0.0, 0.0, 0.0, vehicle.time_us
        )
    ]


def _gps_origin(vehicle: Vehicle) -> list[Any]:
    if not vehicle.has_origin:
        return []
    lat, lon = vehicle.origin
    return [mavlink.MAVLink_gps_global_origin_message(lat, lon, round(ALTITUDE_M * 1000), vehicle.time_us)]


def _version(vehicle: Vehicle) -> list[Any]:
    return [
        mavlink.MAVLink_autopilot_version_message(
            CAPABILITIES, 67567616, 0, 0, 0, b"rover-co", [0] * 8, [0] * 8, 0, 0, 0
        )
    ]


def _raw_imu(vehicle: Vehicle) -> list[Any]:
    rate = round(float(vehicle.estimate["yaw_rate_rad_s"][0]) * 1000)
    return [mavlink.MAVLink_raw_imu_message(vehicle.time_us, 0, 0, -1001, 0, 0, rate, 219, 91, -528, 0, 2756)]


def _second_imu(vehicle: Vehicle) -> list[Any]:
    rate = round(float(vehicle.estimate["yaw_rate_rad_s"][0]) * 1000)
    return [mavlink.MAVLink_scaled_imu2_message(_ms(vehicle), 0, 0, -1001, 0, 0, rate, 219, 91, -528, 2800)]


def _second_ahrs(vehicle: Vehicle) -> list[Any]:
    if vehicle.time_s < EKF_SEEN_S:
        return []
    return [mavlink.MAVLink_ahrs2_message(0.0, 0.0, vehicle.heading_rad(), ALTITUDE_M, *vehicle.place())]


def _rc_channels(vehicle: Vehicle) -> list[Any]:
    return [
        mavlink.MAVLink_rc_channels_message(
            _ms(vehicle),
            8,
            stick_us(vehicle.sticks.steering),
            1500,
            stick_us(vehicle.sticks.throttle),
            1500,
            1800,
            1000,
            1000,
            1800,
            *([0] * 10),
            255,
        )
    ]


def stick_us(share: float) -> int:
    """A stick's position, -1 to 1, as a pulse length in microseconds."""
    return 1500 + round(500.0 * share)


def _battery(vehicle: Vehicle) -> list[Any]:
    battery = battery_readings(vehicle)
    voltages = [battery.volts_mv] + [65535] * 9
    state = 1 + vehicle.battery.worst
    return [
        mavlink.MAVLink_battery_status_message(
            0, 0, 0, 32767, voltages, battery.amps_ca, battery.used_mah, battery.used_hj, battery.percent, 0, state
        )
    ]


MESSAGES: dict[int, Builder] = {
    30: _attitude,
    33: _global_position,
    74: _vfr_hud,
    1: sys_status,
    125: lambda _: [mavlink.MAVLink_power_status_message(5000, 0, 0)],
    152: lambda _: [mavlink.MAVLink_meminfo_message(0, 65535, 524288)],
    62: _navigation,
    42: lambda v: [mission_current(v, v.mission.current)],
    36: _servos,
    65: _rc_channels,
    27: _raw_imu,
    116: _second_imu,
    129: lambda v: [mavlink.MAVLink_scaled_imu3_message(_ms(v), 0, 0, 0, 0, 0, 0, 219, 91, -528, 0)],
    29: lambda v: [mavlink.MAVLink_scaled_pressure_message(_ms(v), 1000.0, 0.0, 2972)],
    137: lambda v: [mavlink.MAVLink_scaled_pressure2_message(_ms(v), 1000.0, 0.0, 2972)],
    24: _gps_raw,
    2: lambda v: [mavlink.MAVLink_system_time_message(0, _ms(v))],
    34: lambda v: [mavlink.MAVLink_rc_channels_scaled_message(_ms(v), 0, 0, 0, 0, 0, 0, 0, 0, 0, 255)],
    164: _simstate,
    193: _ekf_status,
    32: _local_position,
    241: lambda v: [mavlink.MAVLink_vibration_message(v.time_us, 0.003, 0.003, 0.003, 0, 0, 0)],
    147: _battery,
    178: _second_ahrs,
    163: lambda _: [mavlink.MAVLink_ahrs_message(0.0, 0.0, 0.0, 0.0, 0.0, 0.003, 0.004)],
    87: _position_target,
    132: _distance_sensors,
    173: _rangefinder,
    162: fence_status,
}
"""Streamed at 1 Hz unless requested otherwise; a builder returns nothing while there is nothing to send."""

ON_REQUEST: dict[int, Builder] = {0: heartbeat, 49: _gps_origin, 148: _version, 242: _home}


def streamable(number: int) -> bool:
    """Whether the firmware can send this message."""
    return number in MESSAGES or number in ON_REQUEST


def requested_messages(vehicle: Vehicle, number: int) -> list[Any]:
    """The message with this id, built now; empty if there is nothing to send."""
    builder = MESSAGES.get(number) or ON_REQUEST[number]
    return builder(vehicle)
