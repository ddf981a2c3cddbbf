"""Whether the rover would see where it drives."""

from __future__ import annotations

from collections.abc import Iterator

from companion.diagnosis.finding import Finding, Level, to_set
from companion.vehicle.survey import Examined

MAVLINK_SOURCE = 2
"""PRX1_TYPE that takes OBSTACLE_DISTANCE."""
NEAR_M, SHORT_M, FAR_M, SLOW_HZ = 0.6, 2.0, 120.0, 3.0
"""Range sensors are odd that are blind nearer than the first, see no farther than the second, claim more than the third."""


def ranges(seen: Examined) -> Iterator[Finding]:
    """What it sees with."""
    sensors = [one for one in seen.sources if not one.sector]
    if seen.parameters.get("PRX1_TYPE") == MAVLINK_SOURCE:
        says = "The autopilot sends the obstacles that it is told of back as sensors of its own (an echo); they are left out."
        yield to_set("echo", Level.NOTE, says, "PRX1_TYPE", MAVLINK_SOURCE, 0.0)
    if not seen.sources and seen.vehicle.scan is None:
        says = "No range data: the rover would be blind, and a run waits."
        remedy = "switch the lidar's driver on, or set RNGFND1_TYPE for a sensor that is wired to the autopilot"
        value = seen.parameters.get("RNGFND1_TYPE")
        yield Finding("no-range-sensor", Level.STOP, says, remedy, "RNGFND1_TYPE" if value == 0.0 else "", value)
        return
    if not sensors and seen.vehicle.scan is not None:
        says = "Range data comes only as the autopilot's sectors or as RANGEFINDER, which are coarse."
        yield Finding("coarse-range", Level.WARN, says, "have the lidar's driver send OBSTACLE_DISTANCE")
    if seen.vehicle.scan_ahead is None:
        says = "No range sensor tells what is straight ahead (within 20 degrees)."
        yield Finding("not-ahead", Level.STOP, says, "turn a sensor forward: RNGFNDn_ORIENT 0")
    for one in sensors:
        name = f"{one.message} {one.sensor} of component {one.component}"
        yield from _limits(name, one.min_m, one.max_m)
        if one.blind:
            yield Finding(
                "range-unknown", Level.WARN, f"{name} knows nothing: all readings are invalid.", "look at the sensor"
            )
        elif one.rate_hz < SLOW_HZ:
            says = f"{name} comes at {one.rate_hz:.1f} Hz; after a second without, the rover stops."
            yield Finding("range-slow", Level.WARN, says, "have it send at 5 to 15 Hz")


def _limits(name: str, min_m: float, max_m: float) -> Iterator[Finding]:
    told = f"{name} says that it sees from {min_m:g} m to {max_m:g} m"
    if max_m <= min_m:
        yield Finding(
            "range-limits",
            Level.STOP,
            f"{told}: it is not used.",
            "set RNGFNDn_MIN and RNGFNDn_MAX as in its data sheet",
        )
    elif max_m < SHORT_M:
        yield Finding(
            "range-limits", Level.WARN, f"{told}: the rover will creep.", "set RNGFNDn_MAX as in its data sheet"
        )
    elif max_m > FAR_M:
        yield Finding(
            "range-limits", Level.WARN, f"{told}: more than such sensors do.", "set RNGFNDn_MAX as in its data sheet"
        )
    elif min_m > NEAR_M:
        yield Finding(
            "range-limits", Level.WARN, f"{told}: blind for what is near.", "set RNGFNDn_MIN as in its data sheet"
        )
