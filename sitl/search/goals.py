"""What a search looks for, and how near a run has come to it.

Nouns: goal.
"""

from __future__ import annotations

from enum import StrEnum

from sitl.campaign.drive_run import NO_GROUND
from sitl.campaign.policies import ERROR, Policy, broken
from sitl.campaign.run_spec import RunResult
from sitl.lockstep import DriveOutcome

TOO_NEAR_M = 0.05
"""``clearance``: a rover that comes nearer to anything was lucky."""
FOUND = -100.0
"""Less than the distance of any run that shows nothing."""


class Goal(StrEnum):
    """What a run may do wrong."""

    COLLISION = "collision"
    """A rover that moves touches something."""
    CLEARANCE = "clearance"
    """It comes nearer to something than 5 cm."""
    STUCK = "stuck"
    """There is a way, it waits for nothing, and it does not come to the target within the time limit, or leaves it."""
    UNREACHABLE = "unreachable-but-free"
    """There is a way, and the target is called unreachable."""
    REFUSED = "refused"
    """The last look at a setpoint refuses it."""


NOT_DRIVEN = (ERROR, NO_GROUND)
POLICIES = {
    Goal.COLLISION: Policy.NO_CONTACT,
    Goal.UNREACHABLE: Policy.NO_FALSE_UNREACHABLE,
    Goal.REFUSED: Policy.NOTHING_REFUSED,
}
"""Goals that are the breaking of a policy."""
TOLD_TWICE = {**POLICIES, Goal.STUCK: Policy.ENDS}
"""The policy that a run breaks, too, when it shows a goal."""


MEASURES = {
    Goal.COLLISION: "closest distance, m",
    Goal.CLEARANCE: "closest distance, m",
    Goal.STUCK: "driving time over the bound, with a minus",
    Goal.UNREACHABLE: "driving time over the bound, with a minus",
    Goal.REFUSED: "closest distance in m, less 0.01 for each second",
}
"""What ``distance`` is of runs that do not show the goal."""


def shows(goal: Goal, result: RunResult) -> bool:
    """Whether the run has done it. One that was not driven has done nothing."""
    if result.outcome in NOT_DRIVEN:
        return False
    if goal in POLICIES:
        return POLICIES[goal] in broken(result)
    if goal == Goal.CLEARANCE:
        return result.clearance_m < TOO_NEAR_M
    late = result.outcome == DriveOutcome.TIME_LIMIT and result.waits_for == ""
    return _has_way(result) and result.unreachable == 0 and (late or result.left_out > 0)


def distance(goal: Goal, result: RunResult) -> float:
    """How far from it: the less, the nearer. What shows it has less than any that does not."""
    if shows(goal, result):
        return FOUND
    if goal in (Goal.COLLISION, Goal.CLEARANCE):
        return result.clearance_m
    if goal == Goal.REFUSED:
        return result.clearance_m - 0.01 * result.seconds
    # Slower against what was possible is nearer to no way at all.
    return -result.seconds / result.bound_s if _has_way(result) and result.seconds > 0.0 else 0.0


def _has_way(result: RunResult) -> bool:
    return result.bound_s > 0.0
