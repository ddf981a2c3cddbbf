"""Documented ranges of the ArduRover parameters that have an effect in the simulator.

The firmware accepts any number; a value outside its range is most likely a mistake. PSC_POS_P is left out, because
its default is outside its own range. Source: the @Range and @Values remarks of ArduRover 4.7.
"""

from __future__ import annotations

from collections.abc import Mapping

GAIN, FILTER_HZ = (0.0, 2.0), (0.0, 100.0)

RANGES: dict[str, tuple[float, float]] = {
    "ATC_ACCEL_MAX": (0.0, 10.0),
    "ATC_BRAKE": (0.0, 1.0),
    "ATC_DECEL_MAX": (0.0, 10.0),
    "ATC_SPEED_D": (0.0, 0.4),
    "ATC_SPEED_FF": (0.0, 0.5),
    "ATC_SPEED_FLTD": FILTER_HZ,
    "ATC_SPEED_FLTE": FILTER_HZ,
    "ATC_SPEED_FLTT": FILTER_HZ,
    "ATC_SPEED_I": GAIN,
    "ATC_SPEED_IMAX": (0.0, 1.0),
    "ATC_SPEED_P": (0.01, 2.0),
    "ATC_STOP_SPEED": (0.0, 0.5),
    "ATC_STR_ACC_MAX": (0.0, 1000.0),
    "ATC_STR_ANG_P": (1.0, 10.0),
    "ATC_STR_RAT_D": (0.0, 0.4),
    "ATC_STR_RAT_FF": (0.0, 3.0),
    "ATC_STR_RAT_FLTD": FILTER_HZ,
    "ATC_STR_RAT_FLTE": FILTER_HZ,
    "ATC_STR_RAT_FLTT": FILTER_HZ,
    "ATC_STR_RAT_I": GAIN,
    "ATC_STR_RAT_IMAX": (0.0, 1.0),
    "ATC_STR_RAT_MAX": (0.0, 1000.0),
    "ATC_STR_RAT_P": GAIN,
    "ATC_TURN_MAX_G": (0.1, 10.0),
    "CRUISE_SPEED": (0.0, 100.0),
    "CRUISE_THROTTLE": (0.0, 100.0),
    "FS_TIMEOUT": (1.0, 100.0),
    "MAV_GCS_SYSID": (1.0, 255.0),
    "MOT_SLEWRATE": (0.0, 1000.0),
    "MOT_SPD_SCA_BASE": (0.0, 10.0),
    "MOT_STR_THR_MIX": (0.2, 1.0),
    "MOT_THR_MAX": (5.0, 100.0),
    "MOT_THR_MIN": (0.0, 20.0),
    "MOT_THST_ASYM": (1.0, 10.0),
    "MOT_THST_EXPO": (-1.0, 1.0),
    "PSC_VEL_FLTE": FILTER_HZ,
    "PSC_VEL_P": (0.1, 6.0),
    "SCHED_LOOP_RATE": (50.0, 400.0),
    "TURN_RADIUS": (0.0, 10.0),
    "WP_ACCEL": (0.0, 100.0),
    "WP_JERK": (0.0, 100.0),
    "WP_PIVOT_ANGLE": (0.0, 360.0),
    "WP_PIVOT_DELAY": (0.0, 60.0),
    "WP_PIVOT_RATE": (0.0, 360.0),
    "WP_RADIUS": (0.0, 100.0),
    "WP_SPEED": (0.0, 100.0),
}


def outside(values: Mapping[str, float]) -> list[str]:
    """A text for each value outside its range."""
    return [
        f"{name} {values[name]:g} ({low:g} to {high:g})"
        for name, (low, high) in RANGES.items()
        if name in values and not low <= values[name] <= high
    ]
