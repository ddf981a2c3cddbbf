"""Parameters of the autopilot that a mission cannot do with, and those that are odd."""

from __future__ import annotations

from collections.abc import Iterator

from companion.diagnosis.finding import Finding, Level, to_set
from companion.vehicle.survey import Examined

S_CURVES = 64
"""Bit of GUID_OPTIONS."""
RADIUS_M = 2.0
STICKS = {"RCMAP_ROLL": 1.0, "RCMAP_THROTTLE": 3.0}
"""Where the companion looks for them."""
STATIONS = ("MAV_GCS_SYSID", "SYSID_MYGCS")
"""The same parameter in 4.7 and before."""
PARAMETERS = (
    "OA_TYPE",
    "AVOID_ENABLE",
    "GUID_OPTIONS",
    "GUID_TIMEOUT",
    "WP_RADIUS",
    "WP_SPEED",
    "PRX1_TYPE",
    "RNGFND1_TYPE",
    "FS_GCS_ENABLE",
    "FENCE_ENABLE",
    *STICKS,
    *STATIONS,
)
"""To be asked for."""


def avoidance(seen: Examined) -> Iterator[Finding]:
    """Whether the autopilot would keep clear of obstacles by itself as well."""
    paths, simple = seen.parameters.get("OA_TYPE", 0.0), seen.parameters.get("AVOID_ENABLE", 0.0)
    if paths:
        says = "The autopilot plans ways round obstacles itself, and ignores new targets meanwhile."
        yield to_set("oa-type", Level.STOP, says, "OA_TYPE", paths, 0.0)
    if simple:
        says = "The autopilot's simple avoidance creeps towards obstacles and stays there, without a word."
        yield to_set("avoid-enable", Level.STOP, says, "AVOID_ENABLE", simple, 0.0)


def guided(seen: Examined) -> Iterator[Finding]:
    """How it takes guided targets."""
    options = int(seen.parameters.get("GUID_OPTIONS", 0.0))
    if options & S_CURVES:
        says = "With S-curves every repeated target nearly stops the rover."
        yield to_set("guid-options", Level.STOP, says, "GUID_OPTIONS", float(options), float(options & ~S_CURVES))
    timeout_s = seen.parameters.get("GUID_TIMEOUT", 3.0)
    if timeout_s > 3.0:
        says = f"A velocity goes on for {timeout_s:g} s after the companion has fallen silent."
        yield to_set("guid-timeout", Level.WARN, says, "GUID_TIMEOUT", timeout_s, 3.0)
    radius_m = seen.parameters.get("WP_RADIUS", 1.0)
    if radius_m > RADIUS_M:
        says = f"The autopilot takes a target for reached {radius_m:g} m before it, and cuts corners so."
        yield to_set("wp-radius", Level.WARN, says, "WP_RADIUS", radius_m, 1.0)
    if seen.parameters.get("WP_SPEED") == 0.0:
        yield to_set("wp-speed", Level.WARN, "Guided speed is left to CRUISE_SPEED.", "WP_SPEED", 0.0, 2.0)


def sticks(seen: Examined) -> Iterator[Finding]:
    """Whether the pilot's sticks are where they are looked for."""
    for name, wanted in STICKS.items():
        value = seen.parameters.get(name, wanted)
        if value != wanted:
            says = f"The pilot's sticks are looked for on channels 1 and 3, but {name} is {value:g}: they would not be seen."
            yield to_set("sticks", Level.WARN, says, name, value, wanted)


def stations(seen: Examined) -> Iterator[Finding]:
    """Whether the autopilot watches its ground station."""
    watching, station = seen.parameters.get("FS_GCS_ENABLE"), station_of(seen)
    if watching and station is not None and int(station[1]) not in seen.systems:
        says = f"The autopilot watches ground station {station[1]:g}, which is not heard here: if it falls silent, the rover goes into HOLD."
        yield Finding(
            "gcs-failsafe",
            Level.WARN,
            says,
            f"keep that ground station on, or set {station[0]} to its system id",
            *station,
        )
    elif watching == 0.0:
        says = "The autopilot does not watch the ground station: nobody notices when the people lose their link."
        yield to_set("gcs-failsafe", Level.NOTE, says, "FS_GCS_ENABLE", watching, 1.0)


def fence(seen: Examined) -> Iterator[Finding]:
    """Its own fence."""
    if seen.fence_breached:
        says = "The rover is outside the autopilot's fence: it would not be let drive."
        remedy = "drive it inside in MANUAL, or change the fence"
        yield Finding("fence-breached", Level.STOP, says, remedy, "FENCE_ENABLE", seen.parameters.get("FENCE_ENABLE"))
    elif seen.parameters.get("FENCE_ENABLE"):
        says = "The autopilot's fence is on: targets beyond it are not reached."
        yield Finding(
            "fence",
            Level.NOTE,
            says,
            "look that all targets lie inside",
            "FENCE_ENABLE",
            seen.parameters["FENCE_ENABLE"],
        )


def station_of(seen: Examined) -> tuple[str, float] | None:
    """Which ground station the autopilot heeds: the parameter's name and its value."""
    return next(((name, seen.parameters[name]) for name in STATIONS if name in seen.parameters), None)
