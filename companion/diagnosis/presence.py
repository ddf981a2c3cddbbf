"""Who is there: the rover, somebody else, nobody; and whether all are who they should be."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from companion.diagnosis.finding import Finding, Level, to_set
from companion.diagnosis.parameters import STATIONS, station_of
from companion.vehicle.survey import Examined

FIRMWARE = (4, 7)
"""ArduRover's version that all this was written for and measured with."""
ROVER, BOAT = 10, 11
ARDUPILOT = 3
LOST_SHARE = 0.1


def nobody(seen: Examined) -> Iterator[Finding]:
    """No rover was heard: what was, if anything."""
    strangers = [one for one in seen.autopilots if (one.make, one.kind) not in ((ARDUPILOT, ROVER), (ARDUPILOT, BOAT))]
    if seen.signing:
        yield Finding("signing", Level.STOP, seen.signing, seen.signing_remedy)
    elif strangers:
        one = strangers[0]
        says = f"System {one.system} is a vehicle of type {one.kind} (autopilot {one.make}), no ArduPilot rover."
        yield Finding("not-a-rover", Level.STOP, says, "connect to the rover")
    elif seen.packets:
        says = f"MAVLink is heard on {seen.place}, but no autopilot."
        yield Finding(
            "no-autopilot", Level.STOP, says, "look which of the autopilot's ports this is, and whether it sends there"
        )
    else:
        says = f"Nothing is heard on {seen.place}."
        remedy = "look at power, cable, port and baud rate, and that SERIALn_PROTOCOL of that port is 2"
        yield Finding("no-autopilot", Level.STOP, says, remedy)


def others(seen: Examined) -> Iterator[Finding]:
    """Who else speaks on this line."""
    if seen.companion_heard:
        says = f"Somebody speaks as component {seen.component} already: a companion that is running?"
        yield Finding("two-companions", Level.STOP, says, "stop it before another one drives this rover")
    systems = sorted(one.system for one in seen.autopilots)
    if len(systems) > 1:
        says = f"Autopilots with the system ids {', '.join(map(str, systems))} are heard; a run takes the first rover it hears."
        yield Finding("several-autopilots", Level.WARN, says, "give each its own line, or switch the others off")
    if seen.rover_heard and seen.signing:
        yield Finding("signing", Level.WARN, f"{seen.signing}.", "see docs/signing.md")


def identity(seen: Examined) -> Iterator[Finding]:
    """Whether autopilot, ground station and companion can tell each other apart, and hear each other."""
    station = station_of(seen)
    if station is not None and int(station[1]) == seen.system:
        says = f"The autopilot and its ground station both have the system id {seen.system}: the failsafe would watch the companion."
        yield to_set("system-ids", Level.STOP, says, *station, 255.0)
    missing = [name for name in seen.asked if name not in seen.parameters]
    if len(missing) == len(seen.asked) > 0:
        says = "The autopilot tells none of its parameters."
        yield Finding("no-parameters", Level.WARN, says, "look whether it is asked through a radio that drops much")
    elif unheard := _unheard(missing, seen):
        says = f"Not told, and so not looked at: {', '.join(unheard)}."
        yield Finding("parameters-unheard", Level.WARN, says, "ask again, over a line that drops less")
    elif seen.packets and seen.lost > LOST_SHARE * seen.packets:
        says = f"{seen.lost} packets of the autopilot were lost, {seen.packets} came."
        yield Finding(
            "packets-lost", Level.WARN, says, "a faster baud rate, a better cable, or fewer messages on this line"
        )


def _unheard(missing: Sequence[str], seen: Examined) -> list[str]:
    """What should have been told: of the two names of one parameter each firmware has one."""
    station = station_of(seen) is not None
    return [name for name in missing if name not in STATIONS or (not station and name == STATIONS[0])]


def firmware(seen: Examined) -> Iterator[Finding]:
    """Whether this was written for its version."""
    if seen.version is None:
        yield Finding(
            "firmware", Level.NOTE, "The autopilot does not tell its version.", "this was written for ArduRover 4.7"
        )
    elif seen.version[:2] < FIRMWARE:
        told = ".".join(map(str, seen.version))
        says = f"ArduRover {told}; this was written for 4.7, and some parameters had other names before."
        yield Finding("firmware", Level.WARN, says, "install ArduRover 4.7 or later")
