"""Servo outputs: their functions (SERVOn_FUNCTION) and the kind of rover they make (behaviour of SRV_Channels).

Nouns: SRV_Channels.
"""

from __future__ import annotations

from collections.abc import Mapping

GROUND_STEERING, THROTTLE = 26, 70
"""SERVO1_FUNCTION and SERVO3_FUNCTION of a rover with steered wheels."""

THROTTLE_LEFT, THROTTLE_RIGHT = 73, 74
"""The same for skid steering."""

OUTPUTS = 16
"""Number of outputs (SERVOn_...); the plant is wired to 1 and 3."""


def functions_of(parameters: Mapping[str, float]) -> set[int]:
    """The functions of all outputs, as far as ``parameters`` names them."""
    names = [f"SERVO{number}_FUNCTION" for number in range(1, OUTPUTS + 1)]
    return {int(parameters[name]) for name in names if name in parameters}


def outputs_fault(parameters: Mapping[str, float]) -> str:
    """What the arming check reports about outputs that do not make a rover, else "" (behaviour of AP_MotorsUGV)."""
    functions = functions_of(parameters)
    left, right = THROTTLE_LEFT in functions, THROTTLE_RIGHT in functions
    throttle, steering = THROTTLE in functions, GROUND_STEERING in functions
    if not (left or right or throttle or steering):
        return "no motor, sail or scripting outputs defined"
    if left != right:
        return "check skid steering config"
    return "check steering and throttle config" if throttle != steering else ""


def is_skid(parameters: Mapping[str, float]) -> bool:
    """Whether these parameters describe a rover with skid steering: both motors have an output."""
    return {THROTTLE_LEFT, THROTTLE_RIGHT} <= functions_of(parameters)
