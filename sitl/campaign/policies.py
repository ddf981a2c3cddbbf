"""Policies: what may happen in no run, whatever the world. Each is checked in every run of a campaign.

Nouns: policy.
"""

from __future__ import annotations

from enum import StrEnum

from sitl.campaign.run_spec import RunResult
from sitl.lockstep import DriveOutcome

ERROR = "error"


class Policy(StrEnum):
    """What a run must keep."""

    NO_ERROR = "error"
    """The programs do not end with an error."""
    NO_CONTACT = "contact"
    """A rover that moves touches nothing."""
    NOTHING_REFUSED = "refused"
    """The last look at a setpoint finds nothing to refuse: what is planned is what may be told."""
    NO_FALSE_UNREACHABLE = "unreachable-but-free"
    """A target is called unreachable only where no way leads for the rover."""
    LEAVES_NONE_OUT = "left-out"
    """A mission ends before its last target only where a target is called unreachable, or the battery is low."""
    PILOT_WINS = "against-pilot"
    """Nothing that moves, arms or switches goes out while the mode is another one or it is disarmed, as was told."""
    NOT_BLIND = "blind"
    """Without range data the rover is made to brake, and stands."""
    ENDS = "no-end"
    """A mission ends, or says what it waits for, within the time limit."""


def broken(result: RunResult) -> tuple[Policy, ...]:
    """The policies that a run breaks."""
    checks = {
        Policy.NO_ERROR: result.outcome == ERROR,
        Policy.NO_CONTACT: result.touched > 0,
        Policy.NOTHING_REFUSED: result.refused > 0,
        Policy.NO_FALSE_UNREACHABLE: result.called_wrongly > 0,
        Policy.LEAVES_NONE_OUT: result.left_out > 0,
        Policy.PILOT_WINS: result.against_pilot > 0,
        Policy.NOT_BLIND: result.blind_s > 0.0,
        Policy.ENDS: result.outcome == DriveOutcome.TIME_LIMIT and not result.waits_for,
    }
    return tuple(policy for policy, is_broken in checks.items() if is_broken)
