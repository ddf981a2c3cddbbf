"""DO commands of a mission: what ArduRover takes by itself, what only within its own AUTO, and what it does not take.

By ArduRover's source (4.7.0-dev, October 2025): ``handle_command_int_packet`` in GCS_Common.cpp and
GCS_MAVLink_Rover.cpp says what is taken as COMMAND_LONG or COMMAND_INT, AP_Mission_Commands.cpp and mode_auto.cpp what
is done within a mission.

Nouns: DO command.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from companion.core.frames import GeoPoint
from companion.mission import mav_commands as mav

PARAMETERS = 7
SHOWN_MOST, SHOWN_LEAST = 4, 2
"""So many parameters are told to people, if the command has so many."""
Params = tuple[float | None, ...]

TAKEN: Mapping[int, int] = MappingProxyType(
    {
        mav.DO_SET_HOME: 1,
        mav.DO_SET_RELAY: 2,
        mav.DO_REPEAT_RELAY: 3,
        mav.DO_SET_SERVO: 2,
        mav.DO_REPEAT_SERVO: 4,
        mav.DO_SET_ROI_LOCATION: 4,
        197: 0,
        198: 2,
        mav.DO_SET_ROI: 4,
        202: 7,
        mav.DO_DIGICAM_CONTROL: 7,
        204: 7,
        205: 7,
        206: 3,
        207: 2,
        211: 2,
        216: 1,
        218: 2,
        531: 2,
        532: 2,
        534: 3,
        mav.DO_GIMBAL_PITCHYAW: 7,
        1001: 7,
        mav.IMAGE_START_CAPTURE: 4,
        2001: 1,
        2500: 3,
        2501: 1,
    }
)
"""Commands that ArduRover takes in any mode, and how many parameters they have at most, without a place."""

NEEDED: Mapping[int, tuple[str, ...]] = MappingProxyType(
    {
        mav.DO_SET_RELAY: ("relay from 0", "0 off or 1 on"),
        mav.DO_REPEAT_RELAY: ("relay from 0", "how often", "seconds for one"),
        mav.DO_SET_SERVO: ("output from 1", "pulse in µs"),
        mav.DO_REPEAT_SERVO: ("output from 1", "pulse in µs", "how often", "seconds for one"),
        198: ("MAVLink system to look at",),
        206: ("metres, 0 to end",),
        207: ("0 off or 1 on",),
        211: ("gripper", "0 open or 1 close"),
        216: ("0 off or 1 on",),
        218: ("function", "switch 0 to 2"),
        531: ("kind", "value"),
        532: ("kind", "value"),
        mav.DO_GIMBAL_PITCHYAW: ("pitch", "yaw"),
    }
)
"""Of those: parameters without which a command says nothing."""

WITH_PLACE = frozenset({mav.DO_SET_HOME, mav.DO_SET_ROI_LOCATION, mav.DO_SET_ROI})
"""Of those: commands whose p5 to p7 are latitude, longitude and altitude."""

EACH_TIME_ANEW = frozenset({mav.DO_REPEAT_RELAY, mav.DO_REPEAT_SERVO, mav.DO_DIGICAM_CONTROL})
"""Of those: commands that begin something anew each time they arrive, so that a second one is not the same as one."""
MOVES = frozenset(
    {
        mav.NAV_WAYPOINT,
        mav.NAV_LOITER_UNLIM,
        mav.NAV_LOITER_TURNS,
        mav.NAV_LOITER_TIME,
        mav.NAV_RETURN_TO_LAUNCH,
        mav.NAV_DELAY,
        mav.DO_CHANGE_SPEED,
    }
)
"""Commands that a ground station's mission may have, and a target says in other words."""
OUTPUTS, RELAYS = 32, 16
PULSE_US = 65_535
"""ArduRover holds the length of a pulse in 16 bits."""
RELAY_STATES = (0.0, 1.0)
"""ArduRover switches a relay over with any other state (AP_ServoRelayEvents)."""

ONLY_IN_AUTO: Mapping[int, str] = MappingProxyType(
    {
        mav.NAV_SET_YAW_SPEED: "only the autopilot itself does it, in AUTO",
        mav.DO_SEND_SCRIPT_MESSAGE: "only the autopilot itself does it, in AUTO",
        mav.NAV_SCRIPT_TIME: "only the autopilot itself does it, in AUTO, with a script",
    }
)

WITHOUT_EFFECT: Mapping[int, str] = MappingProxyType(
    {
        mav.DO_GUIDED_LIMITS: "limits only NAV_GUIDED_ENABLE",
        mav.DO_SET_RESUME_REPEAT_DIST: "counts only in AUTO",
        mav.JUMP_TAG: "",
    }
)
"""Commands that change nothing here, and why; without a reason nobody needs to know."""


@dataclass(frozen=True, slots=True)
class DoCommand:
    """A command that the autopilot is given at a place of the mission.

    ``params``: p1 to p7, None where none is given; ``place``: latitude and longitude for the commands that have one, in
    ``frame`` (its altitude is p7). ``item``: its number in the file, None if it has none. ``after_s``: so long after
    the place was reached. ``delay_s``, ``within_m``: not here but on the way on, so long after it could be sent, or so
    near to the next target (CONDITION_DELAY, CONDITION_DISTANCE); what follows it waits for it.
    """

    command: int
    params: Params
    place: GeoPoint | None = None
    frame: int = 0
    item: int | None = None
    after_s: float = 0.0
    delay_s: float | None = None
    within_m: float | None = None

    @property
    def name(self) -> str:
        """Its MAVLink name and the parameters that were given, for people."""
        shown = min(TAKEN.get(self.command, SHOWN_MOST), SHOWN_MOST)
        last = max((i for i, value in enumerate(self.params[:shown], 1) if value), default=0)
        values = " ".join(f"{value or 0.0:g}" for value in self.params[: max(last, min(shown, SHOWN_LEAST))])
        return f"{mav.NAMES[self.command]}{f' {values}' if values else ''}"

    @property
    def is_conditional(self) -> bool:
        """Whether it is sent on the way to the next target."""
        return self.delay_s is not None or self.within_m is not None

    @property
    def repeatable(self) -> bool:
        """Whether a second one changes nothing that the first has not done: it sets a state.

        A second series of pictures (IMAGE_START_CAPTURE, p3 pictures, 0: without end) is taken beside the first one.
        """
        if self.command == mav.DO_SET_RELAY:
            return (self.params[1] or 0.0) in RELAY_STATES
        if self.command == mav.IMAGE_START_CAPTURE:
            return self.params[2] == 1.0
        return self.command not in EACH_TIME_ANEW


def lacking(command: DoCommand) -> str:
    """What this command lacks to be done, with the remedy; empty if nothing."""
    needed, first = NEEDED.get(command.command, ()), command.params[0]
    if any(value is None for value in command.params[: len(needed)]):
        return f"needs {len(needed)} parameter{'s' * (len(needed) > 1)} ({', '.join(needed)})"
    if command.command in (mav.DO_SET_RELAY, mav.DO_REPEAT_RELAY) and first not in range(RELAYS):
        return f"there is no relay {first:g}; relays are counted from 0 to {RELAYS - 1}"
    if command.command in (mav.DO_SET_SERVO, mav.DO_REPEAT_SERVO) and first not in range(1, OUTPUTS + 1):
        return f"there is no output {first:g}; give the number of a SERVOn_FUNCTION, from 1 to {OUTPUTS}"
    if command.command in (mav.DO_SET_SERVO, mav.DO_REPEAT_SERVO) and not 0.0 <= (command.params[1] or 0.0) <= PULSE_US:
        return f"a pulse of {command.params[1]:g} µs; it is from 0 (none) to {PULSE_US}, mostly 1000 to 2000"
    if command.command == mav.DO_SET_ROI_LOCATION and command.place is None:
        return "has no place to look at; give its latitude and longitude, or DO_SET_ROI_NONE to look ahead again"
    return ""


def why_not(command: int) -> str:
    """Why this cannot be driven; for a command that neither moves the rover nor is in ``TAKEN``."""
    if command in ONLY_IN_AUTO:
        return ONLY_IN_AUTO[command]
    return "ArduRover does not take it" if command > mav.NAV_LAST else "no rover can do it"


def command_of_name(name: str) -> int:
    """The number of a command that can be given at a place. Raises ValueError with the reason."""
    plain = name.upper().removeprefix("MAV_CMD_")
    number = next((number for number, known in mav.NAMES.items() if known == plain), None)
    if number is None:
        meant = f"did you mean DO_{plain}?" if f"DO_{plain}" in mav.NAMES.values() else "docs/missions.md lists them"
        raise ValueError(f"name: {name!r:.60} is no MAVLink command known here; {meant}")
    if number in TAKEN:
        return number
    why = "it moves the rover, and targets do that" if number in MOVES else why_not(number)
    raise ValueError(f"name: {plain} cannot be given at a place: {why}; docs/missions.md lists those")


def padded(params: tuple[float | None, ...]) -> Params:
    """Seven parameters."""
    return (*params, *(None,) * (PARAMETERS - len(params)))
