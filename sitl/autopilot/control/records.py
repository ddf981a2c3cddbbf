"""Records shared by the compiled controllers: the estimate, the state of the controllers, their tuning parameters.

Each is an array of one record, so that compiled code can change it in place.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sitl.autopilot.control.servo_outputs import is_skid

LOOP_HZ = 50

LOOP_S = 1.0 / LOOP_HZ

STOP, WAYPOINT, HEADING, TURN_RATE, COAST, CIRCLE, LEG = 0, 1, 2, 3, 4, 5, 6
"""Tasks of motion control: brake, drive to a position target, hold a heading or a turn rate, pass the sticks through,
circle a place, drive along a leg between two waypoints."""

NEVER = -1_000_000
"""Tick of something that has not happened."""

Record = NDArray[Any]


class MotionRecords(NamedTuple):
    """The three records of motion control, each an array of one."""

    estimates: Record
    controls: Record
    tunings: Record


ESTIMATE = np.dtype(
    [
        (name, "f8")
        for name in (
            "north_m", "east_m", "vel_n", "vel_e", "accel_n", "accel_e", "heading_rad", "yaw_rate_rad_s",
            "imu_yaw_rate", "imu_ahead", "imu_aside",
            "bias_n", "bias_e", "drift_n", "drift_e", "bias_heading", "offset_n", "offset_e", "offset_vn", "offset_ve",
        )
    ]
    + [("imu_filters", "f8", (3, 2))]
)  # fmt: skip
"""The autopilot's estimate, in metres from the EKF origin, and the slowly wandering errors in it.

``imu_...``: turn rate and acceleration as gyro and accelerometer tell them, with the state of their ``imu_filters``.
``offset_...``: what a faulty GPS adds to position and velocity.
"""

CONTROL = np.dtype(
    [
        (name, "i8")
        for name in (
            "tick", "armed", "task", "reversed", "fresh_target", "reached", "arrived", "timed_out", "have_target",
            "target_tick", "nav_tick", "speed_change_tick", "pivoting", "pivot_done_tick", "place_tick",
            "place_valid", "speed_error_fresh", "steer_error_fresh", "vel_error_fresh", "speed_tick", "stop_tick",
            "steer_tick", "left_limited", "right_limited", "throttle_limited",
            "throttle_withheld", "fast", "corner", "halts", "on_circle",
        )
    ]
    + [
        (name, "f8")
        for name in (
            "dest_n", "dest_e", "target_heading", "target_turn_rate", "target_speed",
            "base_speed", "speed_max", "accel_max", "jerk_max",
            "shaped_n", "shaped_e", "shaped_vn", "shaped_ve", "shaped_an", "shaped_ae", "vel_error_n", "vel_error_e",
            "nav_speed", "nav_turn_rate",
            "desired_speed", "speed_target", "speed_error", "speed_slope", "speed_integral",
            "desired_turn_rate", "steer_target", "steer_error", "steer_slope", "steer_integral",
            "throttle", "throttle_before", "steering", "servo_1", "servo_3", "room_m",
            "stick_steering", "stick_throttle", "amps", "used_mah", "used_wh", "rest_v",
            "from_n", "from_e", "pace", "circle_radius", "circle_turned", "circle_angle", "circle_speed",
        )
    ]
    + [("legs", "f8", (3, 7))]
)  # fmt: skip
"""State of the motion controllers; metres, m/s, radians, outputs -1 to 1.

``servo_1`` and ``servo_3``: left and right motor with skid steering, steering and throttle with steered wheels.
``stick_...``: the pilot's sticks in MANUAL; ``amps``: current of the motors; ``used_...``: what the battery monitor
has counted; ``rest_v``: the battery's voltage at rest; ``legs``: rows and columns see ``wp_nav`` and ``scurve``.
"""

TUNING_NAMES = {
    "wp_speed": "WP_SPEED",
    "wp_radius": "WP_RADIUS",
    "wp_accel": "WP_ACCEL",
    "wp_jerk": "WP_JERK",
    "pivot_angle_deg": "WP_PIVOT_ANGLE",
    "pivot_rate_deg": "WP_PIVOT_RATE",
    "pivot_delay_s": "WP_PIVOT_DELAY",
    "accel_max": "ATC_ACCEL_MAX",
    "decel_max": "ATC_DECEL_MAX",
    "turn_max_g": "ATC_TURN_MAX_G",
    "steer_angle_p": "ATC_STR_ANG_P",
    "steer_accel_deg": "ATC_STR_ACC_MAX",
    "steer_rate_deg": "ATC_STR_RAT_MAX",
    "steer_ff": "ATC_STR_RAT_FF",
    "steer_p": "ATC_STR_RAT_P",
    "steer_i": "ATC_STR_RAT_I",
    "steer_imax": "ATC_STR_RAT_IMAX",
    "steer_d": "ATC_STR_RAT_D",
    "steer_target_hz": "ATC_STR_RAT_FLTT",
    "steer_filter_hz": "ATC_STR_RAT_FLTE",
    "steer_slope_hz": "ATC_STR_RAT_FLTD",
    "speed_p": "ATC_SPEED_P",
    "speed_i": "ATC_SPEED_I",
    "speed_imax": "ATC_SPEED_IMAX",
    "speed_d": "ATC_SPEED_D",
    "speed_ff": "ATC_SPEED_FF",
    "speed_target_hz": "ATC_SPEED_FLTT",
    "speed_filter_hz": "ATC_SPEED_FLTE",
    "speed_slope_hz": "ATC_SPEED_FLTD",
    "brake": "ATC_BRAKE",
    "stop_speed": "ATC_STOP_SPEED",
    "pos_p": "PSC_POS_P",
    "vel_p": "PSC_VEL_P",
    "vel_filter_hz": "PSC_VEL_FLTE",
    "cruise_speed": "CRUISE_SPEED",
    "cruise_throttle": "CRUISE_THROTTLE",
    "slew_rate": "MOT_SLEWRATE",
    "guided_timeout_s": "GUID_TIMEOUT",
    "guided_options": "GUID_OPTIONS",
    "avoid": "AVOID_ENABLE",
    "avoid_margin_m": "AVOID_MARGIN",
    "servo_1": "SERVO1_FUNCTION",
    "servo_3": "SERVO3_FUNCTION",
    "thrust_expo": "MOT_THST_EXPO",
    "asymmetry": "MOT_THST_ASYM",
    "mix": "MOT_STR_THR_MIX",
    "turn_radius_m": "TURN_RADIUS",
    "steering_base_m_s": "MOT_SPD_SCA_BASE",
    "gyro_filter_hz": "INS_GYRO_FILTER",
    "accel_filter_hz": "INS_ACCEL_FILTER",
}
"""Fields of a tuning record, and the parameters they come from."""

LEAST = {"turn_max_g": 0.1, "pos_p": 0.001}
"""Lower limits of values that the controllers divide by (0.1 g is the firmware's own limit)."""

DERIVED = ("skids", "servo_1_sign", "servo_3_sign", "throttle_min", "throttle_max")
"""Fields made of several parameters, or in other units; ``skids`` is 1 with skid steering."""

TUNING = np.dtype([(name, "f8") for name in (*TUNING_NAMES, *DERIVED)])


def new_estimate() -> Record:
    """An estimate of zeros."""
    return np.zeros(1, dtype=ESTIMATE)


def new_control() -> Record:
    """Controllers that have never run."""
    control = np.zeros(1, dtype=CONTROL)
    names = CONTROL.names or ()
    for name in names:
        if name.endswith("_tick"):
            control[name] = NEVER
    control["task"] = COAST
    control["room_m"] = np.inf
    return control


def new_tuning(parameters: dict[str, float]) -> Record:
    """A tuning record with the values of these parameters."""
    tuning = np.zeros(1, dtype=TUNING)
    for field, parameter in TUNING_NAMES.items():
        tuning[field] = max(parameters[parameter], LEAST.get(field, -math.inf))
    tuning["skids"] = 1.0 if is_skid(parameters) else 0.0
    for number in (1, 3):
        tuning[f"servo_{number}_sign"] = -1.0 if parameters[f"SERVO{number}_REVERSED"] else 1.0
    most = min(max(parameters["MOT_THR_MAX"], 5.0), 100.0)
    tuning["throttle_max"] = most / 100.0
    tuning["throttle_min"] = min(max(parameters["MOT_THR_MIN"], 0.0), 20.0, most) / 100.0
    return tuning
