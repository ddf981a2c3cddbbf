"""ArduRover's parameters that the simulator knows: names, types, defaults of the simulated skid rover.

Nouns: ArduRover's parameters.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

from sitl.autopilot.control.servo_outputs import GROUND_STEERING, OUTPUTS, THROTTLE

INT8, INT16, INT32, REAL32 = 2, 4, 6, 9
"""MAV_PARAM_TYPE."""

DEFAULTS: dict[str, tuple[float, int]] = {
    "ACRO_TURN_RATE": (180, REAL32),
    "AHRS_EKF_TYPE": (3, INT8),
    "ARMING_REQUIRE": (1, INT8),
    "ATC_ACCEL_MAX": (1.0, REAL32),
    "ATC_BRAKE": (1, INT8),
    "ATC_DECEL_MAX": (0.0, REAL32),
    "ATC_SPEED_D": (0.0, REAL32),
    "ATC_SPEED_FF": (0.0, REAL32),
    "ATC_SPEED_FLTD": (0.0, REAL32),
    "ATC_SPEED_FLTE": (10.0, REAL32),
    "ATC_SPEED_FLTT": (0.0, REAL32),
    "ATC_SPEED_I": (0.2, REAL32),
    "ATC_SPEED_IMAX": (1.0, REAL32),
    "ATC_SPEED_P": (0.1, REAL32),
    "ATC_STOP_SPEED": (0.1, REAL32),
    "ATC_STR_ACC_MAX": (120.0, REAL32),
    "ATC_STR_ANG_P": (2.0, REAL32),
    "ATC_STR_RAT_D": (0.0, REAL32),
    "ATC_STR_RAT_FF": (0.2, REAL32),
    "ATC_STR_RAT_FLTD": (0.0, REAL32),
    "ATC_STR_RAT_FLTE": (10.0, REAL32),
    "ATC_STR_RAT_FLTT": (0.0, REAL32),
    "ATC_STR_RAT_I": (0.2, REAL32),
    "ATC_STR_RAT_IMAX": (1.0, REAL32),
    "ATC_STR_RAT_MAX": (120.0, REAL32),
    "ATC_STR_RAT_P": (0.2, REAL32),
    "ATC_TURN_MAX_G": (0.6, REAL32),
    "AVOID_ENABLE": (7, INT8),
    "AVOID_MARGIN": (2.0, REAL32),
    "BATT_ARM_VOLT": (0.0, REAL32),
    "BATT_CAPACITY": (3300, INT32),
    "BATT_CRT_MAH": (0.0, REAL32),
    "BATT_CRT_VOLT": (0.0, REAL32),
    "BATT_FS_CRT_ACT": (0, INT8),
    "BATT_FS_LOW_ACT": (0, INT8),
    "BATT_LOW_MAH": (0.0, REAL32),
    "BATT_LOW_TIMER": (10, INT8),
    "BATT_LOW_VOLT": (10.5, REAL32),
    "BATT_MONITOR": (4, INT8),
    "CAM1_TYPE": (0, INT8),
    "CRASH_ANGLE": (0, INT8),
    "CRUISE_SPEED": (3.0, REAL32),
    "CRUISE_THROTTLE": (75, INT8),
    "FENCE_ACTION": (2, INT8),
    "FENCE_ENABLE": (0, INT8),
    "FENCE_MARGIN": (2.0, REAL32),
    "FENCE_OPTIONS": (0, INT16),
    "FENCE_RADIUS": (300.0, REAL32),
    "FENCE_TOTAL": (0, INT8),
    "FENCE_TYPE": (6, INT8),
    "FRAME_CLASS": (1, INT8),
    "FRAME_TYPE": (0, INT8),
    "FS_ACTION": (2, INT8),
    "FS_CRASH_CHECK": (0, INT8),
    "FS_EKF_ACTION": (1, INT8),
    "FS_GCS_ENABLE": (0, INT8),
    "FS_GCS_TIMEOUT": (5.0, REAL32),
    "FS_TIMEOUT": (1.5, REAL32),
    "GRIP_ENABLE": (0, INT8),
    "GUID_OPTIONS": (0, INT32),
    "GUID_TIMEOUT": (3.0, REAL32),
    "INS_ACCEL_FILTER": (10, INT16),
    "INS_GYRO_FILTER": (4, INT16),
    "MAV_GCS_SYSID": (255, INT16),
    "MAV_SYSID": (1, INT16),
    "MIS_DONE_BEHAVE": (0, INT8),
    "MIS_RESTART": (0, INT8),
    "MIS_TOTAL": (0, INT16),
    "MNT1_TYPE": (0, INT8),
    "MOT_SLEWRATE": (100, INT16),
    "MOT_SPD_SCA_BASE": (1.0, REAL32),
    "MOT_STR_THR_MIX": (0.5, REAL32),
    "MOT_THR_MAX": (100, INT8),
    "MOT_THR_MIN": (0, INT8),
    "MOT_THST_ASYM": (1.0, REAL32),
    "MOT_THST_EXPO": (0.0, REAL32),
    "OA_TYPE": (0, INT8),
    "PRX1_TYPE": (0, INT8),
    "PSC_POS_P": (0.2, REAL32),
    "PSC_VEL_FLTE": (5.0, REAL32),
    "PSC_VEL_P": (1.0, REAL32),
    "RALLY_INCL_HOME": (1, INT8),
    "RALLY_LIMIT_KM": (0.5, REAL32),
    "RALLY_TOTAL": (0, INT8),
    "RCMAP_ROLL": (1, INT8),
    "RCMAP_THROTTLE": (3, INT8),
    "RC_OVERRIDE_TIME": (3.0, REAL32),
    **{f"RELAY{n}_FUNCTION": (0, INT8) for n in range(1, 7)},
    **{f"RELAY{n}_PIN": (-1, INT16) for n in range(1, 7)},
    "RNGFND1_MAX": (0.0, REAL32),
    "RNGFND1_MIN": (0.0, REAL32),
    "RNGFND1_ORIENT": (0, INT8),
    "RNGFND1_TYPE": (0, INT8),
    "RNGFND2_MAX": (0.0, REAL32),
    "RNGFND2_MIN": (0.0, REAL32),
    "RNGFND2_ORIENT": (0, INT8),
    "RNGFND2_TYPE": (0, INT8),
    "RNGFND3_MAX": (0.0, REAL32),
    "RNGFND3_MIN": (0.0, REAL32),
    "RNGFND3_ORIENT": (0, INT8),
    "RNGFND3_TYPE": (0, INT8),
    "RTL_SPEED": (0.0, REAL32),
    "SCHED_LOOP_RATE": (50, INT16),
    **{f"SERIAL{port}_PROTOCOL": (2, INT8) for port in range(8)},
    "SCR_ENABLE": (0, INT8),
    "SCR_USER1": (0.0, REAL32),
    **{f"SERVO{n}_FUNCTION": ({1: 73, 3: 74}.get(n, 0), INT16) for n in range(1, OUTPUTS + 1)},
    **{f"SERVO{n}_REVERSED": (0, INT8) for n in range(1, OUTPUTS + 1)},
    "SIM_BATT_CAP_AH": (0.0, REAL32),
    "SIM_BATT_VOLTAGE": (12.6, REAL32),
    "SPRAY_ENABLE": (0, INT8),
    "SRTL_ACCURACY": (2.0, REAL32),
    "SRTL_POINTS": (300, INT16),
    "TURN_RADIUS": (0.9, REAL32),
    "WP_ACCEL": (0.0, REAL32),
    "WP_JERK": (0.0, REAL32),
    "WP_PIVOT_ANGLE": (60, REAL32),
    "WP_PIVOT_DELAY": (0, REAL32),
    "WP_PIVOT_RATE": (60, REAL32),
    "WP_RADIUS": (3.0, REAL32),
    "WP_SPEED": (3.0, REAL32),
}
"""Value and type of each parameter, both those that have an effect and those that people look at."""

LIMITS = {INT8: (-128.0, 127.0), INT16: (-32768.0, 32767.0), INT32: (-(2.0**31), 2.0**31 - 1.0)}


class Parameters(Mapping[str, float]):
    """The parameter table: read by name or index, set with the firmware's rounding of integers."""

    def __init__(self, changes: Mapping[str, float] | None = None, kept: Mapping[str, int] | None = None) -> None:
        """The defaults with ``changes``.

        ``kept``: types of further parameters that can be read and set but have no effect. Raises KeyError for a
        parameter of ``changes`` that is neither known nor kept.
        """
        self._types = {name: kind for name, (_, kind) in DEFAULTS.items()} | dict(kept or {})
        self._values = {name: float(value) for name, (value, _) in DEFAULTS.items()} | dict.fromkeys(kept or (), 0.0)
        self._names = list(self._types)
        for name, value in (changes or {}).items():
            if not self.set(name, value):
                raise KeyError(f"the simulated rover has no parameter {name}")

    def __getitem__(self, name: str) -> float:
        return self._values[name]

    def __len__(self) -> int:
        return len(self._names)

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __contains__(self, name: object) -> bool:
        return name in self._values

    def name_of(self, index: int) -> str | None:
        """The name at an index; None outside the table."""
        return self._names[index] if 0 <= index < len(self._names) else None

    def index_of(self, name: str) -> int:
        """The index of a known parameter."""
        return self._names.index(name)

    def type_of(self, name: str) -> int:
        """MAV_PARAM_TYPE of a known parameter."""
        return self._types[name]

    def set(self, name: str, value: float) -> bool:
        """Set a parameter; False if the name is unknown or the value is not finite."""
        if name not in self._values or not math.isfinite(value):
            return False
        limits = LIMITS.get(self._types[name])
        if limits is not None:
            value = min(max(float(round(value)), limits[0]), limits[1])
        self._values[name] = float(value)
        return True

    def as_dict(self) -> dict[str, float]:
        """A copy of all values by name."""
        return dict(self._values)


def steered_wheels(turning_radius_m: float) -> dict[str, float]:
    """ArduRover's parameters for a rover with steered wheels: outputs, TURN_RADIUS, and the steering feed-forward.

    At MOT_SPD_SCA_BASE, 1 m/s, a turn rate of 1 rad/s is a turn of 1 m radius, so the feed-forward equals the radius
    at full lock.
    """
    return {
        "SERVO1_FUNCTION": float(GROUND_STEERING),
        "SERVO3_FUNCTION": float(THROTTLE),
        "TURN_RADIUS": turning_radius_m,
        "ATC_STR_RAT_FF": turning_radius_m,
    }
