"""Parameters with which the real ArduRover drives the simulated rover, and the file that it reads."""

from __future__ import annotations

from collections.abc import Mapping

from sitl.autopilot.control.servo_outputs import GROUND_STEERING, THROTTLE, THROTTLE_LEFT, THROTTLE_RIGHT
from sitl.firmware.physics import MIDDLE_US, SPAN_US
from sitl.sensors.range_sensors import SensorSuite

SIMULATED_RANGEFINDER = 100
"""RNGFNDn_TYPE of a rangefinder whose ranges come from the simulation."""


def firmware_parameters(parameters: Mapping[str, float], suite: SensorSuite, *, steered: bool) -> dict[str, float]:
    """The tuning of ArduRover's own simulated skid rover, overridden by ``parameters``; outputs; rangefinders.

    ``steered``: the plant has steered wheels, not skid steering. Ranges are in metres, as in version 4.7 and later.
    """
    tuning = {"CRUISE_SPEED": 3.0, "CRUISE_THROTTLE": 75.0, "ATC_SPEED_P": 0.1, "ATC_STR_RAT_FF": 0.2, "PRX1_TYPE": 0.0}
    needed: dict[str, float] = {}
    functions = (GROUND_STEERING, THROTTLE) if steered else (THROTTLE_LEFT, THROTTLE_RIGHT)
    for servo, function in zip((1, 3), functions, strict=True):
        needed |= {
            f"SERVO{servo}_FUNCTION": float(function),
            f"SERVO{servo}_MIN": float(MIDDLE_US - SPAN_US),
            f"SERVO{servo}_TRIM": float(MIDDLE_US),
            f"SERVO{servo}_MAX": float(MIDDLE_US + SPAN_US),
            f"SERVO{servo}_REVERSED": 0.0,
        }
    for number, beam in enumerate(suite.beams, 1):
        needed |= {
            f"RNGFND{number}_TYPE": float(SIMULATED_RANGEFINDER),
            f"RNGFND{number}_ORIENT": float(beam.orientation),
            f"RNGFND{number}_MIN": beam.min_m,
            f"RNGFND{number}_MAX": beam.max_m,
        }
    return tuning | dict(parameters) | needed


def parameter_file(parameters: Mapping[str, float]) -> str:
    """The text of a parameter file: a name and its value on each line."""
    return "".join(f"{name} {value:.9g}\n" for name, value in parameters.items())
