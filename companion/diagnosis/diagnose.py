"""What would stop a mission, in plain words, from what an examination has found. Pure functions."""

from __future__ import annotations

from companion.diagnosis import eyes, parameters, presence, readiness
from companion.diagnosis.finding import Finding, Level
from companion.vehicle.survey import Examined

PARTS = (
    presence.others,
    presence.identity,
    presence.firmware,
    readiness.mode_of,
    readiness.position,
    readiness.arming,
    readiness.rates,
    eyes.ranges,
    parameters.avoidance,
    parameters.guided,
    parameters.sticks,
    parameters.stations,
    parameters.fence,
)


def diagnose(seen: Examined) -> list[Finding]:
    """Everything that is worth saying, the gravest first."""
    if not seen.rover_heard:
        return [*presence.nobody(seen), *presence.others(seen)]
    findings = [finding for part in PARTS for finding in part(seen)]
    order = list(Level)
    return sorted(findings, key=lambda finding: order.index(finding.level))


def kernels(cold: bool) -> list[Finding]:
    """``cold``: something would have to be compiled before a run."""
    if not cold:
        return []
    remedy = "begin a run once, or `rover-sitl drive`, where a minute's wait does not matter"
    return [Finding("kernels-cold", Level.WARN, "The planner is not compiled yet on this computer.", remedy)]
