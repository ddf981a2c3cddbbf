"""Which servo output carries what (SERVOn_FUNCTION), and which kind of rover that makes (behaviour of SRV_Channels)."""

from __future__ import annotations

from typing import Protocol

GROUND_STEERING, THROTTLE = 26, 70
"""SERVO1_FUNCTION and SERVO3_FUNCTION of a rover with steered wheels."""

THROTTLE_LEFT, THROTTLE_RIGHT = 73, 74
"""The same of a skid rover."""

THROTTLE_LEFT, THROTTLE_RIGHT = 73, 74
"""The same of a rover with skid steering."""

OUTPUTS = 16
"""How many outputs, SERVOn_..., an autopilot has; the plant is wired to 1 and 3."""


class Table(Protocol):
    """Parameters by name, all of them or some."""

    def __getitem__(self, name: str) -> float: ...
    def __contains__(self, name: object) -> bool: ...


def functions_of(parameters: Table) -> set[int]:
    """The SERVOn_FUNCTION that any output has."""
    names = [f"SERVO{number}_FUNCTION" for number in range(1, OUTPUTS + 1)]
    return {int(parameters[name]) for name in names if name in parameters}


def outputs_fault(parameters: Table) -> str:
    """What the arming check says of outputs that make no rover; empty if they do (behaviour of AP_MotorsUGV's pre-arm check)."""
    functions = functions_of(parameters)
    left, right = THROTTLE_LEFT in functions, THROTTLE_RIGHT in functions
    throttle, steering = THROTTLE in functions, GROUND_STEERING in functions
    if not (left or right or throttle or steering):
        return "no motor, sail or scripting outputs defined"
    if left != right:
        return "check skid steering config"
    return "check steering and throttle config" if throttle != steering else ""


def is_skid(parameters: Table) -> bool:
    """Whether these parameters are of a rover with skid steering: both of its motors have an output."""
    return {THROTTLE_LEFT, THROTTLE_RIGHT} <= functions_of(parameters)
