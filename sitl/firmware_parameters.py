"""The parameters with which the real ArduRover drives our rover, as a file that it reads."""

from __future__ import annotations

from collections.abc import Mapping

from sitl.control import THROTTLE_LEFT, THROTTLE_RIGHT
from sitl.physics import MIDDLE_US, SPAN_US
from sitl.sensors import SensorSuite

SIMULATED_RANGEFINDER = 100
"""RNGFNDn_TYPE of a rangefinder that the simulation feeds."""


def firmware_parameters(parameters: Mapping[str, float], suite: SensorSuite) -> dict[str, float]:
    """By name: outputs, tuning of ArduRover's own simulated skid rover, rangefinders, and ``parameters``, which win.

    Steered wheels are among ``parameters``, see ``sitl.simulator.steered_wheels``. Ranges are in metres, as from version 4.7 on.
    """
    found = {
        "SERVO1_FUNCTION": float(THROTTLE_LEFT),
        "SERVO3_FUNCTION": float(THROTTLE_RIGHT),
        "CRUISE_SPEED": 3.0,
        "CRUISE_THROTTLE": 75.0,
        "ATC_SPEED_P": 0.1,
        "ATC_STR_RAT_FF": 0.2,
        "PRX1_TYPE": 0.0,
    }
    for servo in (1, 3):
        found |= {
            f"SERVO{servo}_MIN": float(MIDDLE_US - SPAN_US),
            f"SERVO{servo}_TRIM": float(MIDDLE_US),
            f"SERVO{servo}_MAX": float(MIDDLE_US + SPAN_US),
        }
    for number, beam in enumerate(suite.beams, 1):
        found |= {
            f"RNGFND{number}_TYPE": float(SIMULATED_RANGEFINDER),
            f"RNGFND{number}_ORIENT": float(beam.orientation),
            f"RNGFND{number}_MIN": beam.min_m,
            f"RNGFND{number}_MAX": beam.max_m,
        }
    return found | dict(parameters)


def parameter_file(parameters: Mapping[str, float]) -> str:
    """A name and its value on each line."""
    return "".join(f"{name} {value:g}\n" for name, value in parameters.items())
