"""Checks of what a mission's commands need on the autopilot: servos, relays, gripper, sprayer, camera, gimbal.

Pure functions. A command is its number (MAV_CMD) and its first parameter.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

from companion.diagnosis.finding import Finding, Level
from companion.vehicle.survey import Survey

Command = tuple[int, float]
SET_SERVO, REPEAT_SERVO, SET_RELAY, REPEAT_RELAY = 183, 184, 181, 182
FREE_FUNCTIONS = frozenset({0, 1, 22, 23, 28, *range(51, 67), *range(140, 156)})
"""SERVOn_FUNCTION of outputs that a command may set (AP_ServoRelayEvents)."""
RELAY_FUNCTION, NO_PIN = 1.0, -1.0


@dataclass(frozen=True, slots=True)
class Needed:
    """A parameter that must not be 0, and what it switches on."""

    parameter: str
    what: str


NEEDS: Mapping[int, Needed] = MappingProxyType(
    {
        211: Needed("GRIP_ENABLE", "gripper"),
        216: Needed("SPRAY_ENABLE", "sprayer"),
        **dict.fromkeys((202, 203, 206, 531, 532, 534, 2000, 2001, 2500, 2501), Needed("CAM1_TYPE", "camera")),
        **dict.fromkeys((195, 197, 198, 201, 204, 205, 1000, 1001), Needed("MNT1_TYPE", "gimbal")),
    }
)


def parameters_of(commands: Sequence[Command]) -> tuple[str, ...]:
    """The parameters that tell whether these commands can be done."""
    names: dict[str, None] = {}
    for number, first in commands:
        if number in (SET_SERVO, REPEAT_SERVO):
            names[f"SERVO{int(first)}_FUNCTION"] = None
        elif number in (SET_RELAY, REPEAT_RELAY):
            names |= dict.fromkeys((f"RELAY{int(first) + 1}_FUNCTION", f"RELAY{int(first) + 1}_PIN"))
        elif number in NEEDS:
            names[NEEDS[number].parameter] = None
    return tuple(names)


def payload(seen: Survey, commands: Sequence[Command]) -> Iterator[Finding]:
    """What the autopilot would refuse, or do nothing about; each output and each device once."""
    found: dict[str, Finding] = {}
    for number, first in commands:
        for finding in _check(seen.parameters, number, int(first)):
            found.setdefault(finding.parameter, finding)
    yield from found.values()


def _check(table: Mapping[str, float], number: int, first: int) -> Iterator[Finding]:
    if number in (SET_SERVO, REPEAT_SERVO):
        name = f"SERVO{first}_FUNCTION"
        if name in table and int(table[name]) not in FREE_FUNCTIONS:
            says = f"The mission sets servo {first}, which the autopilot uses itself: it would refuse."
            yield _finding(says, "choose another output, or set it to 0", name, table)
    elif number in (SET_RELAY, REPEAT_RELAY):
        function, pin = f"RELAY{first + 1}_FUNCTION", f"RELAY{first + 1}_PIN"
        says = f"The mission switches relay {first}, which is not set up: the autopilot would refuse."
        if table.get(function, RELAY_FUNCTION) != RELAY_FUNCTION:
            yield _finding(says, f"set {function} to 1 and {pin}", function, table)
        elif table.get(pin, 0.0) == NO_PIN:
            yield _finding(says, f"set {pin} to the relay's pin", pin, table)
    elif number in NEEDS and table.get(NEEDS[number].parameter) == 0.0:
        parameter, what = NEEDS[number].parameter, NEEDS[number].what
        yield _finding(f"The mission uses a {what}, and the autopilot has none.", f"set {parameter}", parameter, table)


def _finding(says: str, remedy: str, parameter: str, table: Mapping[str, float]) -> Finding:
    return Finding("payload", Level.WARN, says, remedy, parameter, table[parameter])
