"""Which runs break which policy."""

from __future__ import annotations

from dataclasses import replace

import pytest

from sitl.campaign.policies import Policy, broken
from sitl.campaign.run_spec import RunResult

FINE = RunResult("points", "reached", 1, 1, seconds=31.25, bound_s=20.0, clearance_m=0.4)


@pytest.mark.parametrize(
    ("changes", "policies"),
    [
        ({}, ()),
        ({"outcome": "error"}, (Policy.NO_ERROR,)),
        ({"touched": 2, "outcome": "collision"}, (Policy.NO_CONTACT,)),
        ({"run_into": 1, "outcome": "collision"}, ()),
        ({"refused": 1}, (Policy.NOTHING_REFUSED,)),
        ({"unreachable": 1, "reached": 0, "outcome": "incomplete"}, ()),
        ({"unreachable": 2, "called_wrongly": 1, "reached": 0, "bound_s": 0.0}, (Policy.NO_FALSE_UNREACHABLE,)),
        ({"left_out": 1, "reached": 0, "outcome": "incomplete"}, (Policy.LEAVES_NONE_OUT,)),
        ({"against_pilot": 1}, (Policy.PILOT_WINS,)),
        ({"blind_s": 0.05}, (Policy.NOT_BLIND,)),
        ({"outcome": "time limit"}, (Policy.ENDS,)),
        ({"outcome": "time limit", "waits_for": "a person who sets GUIDED"}, ()),
    ],
)
def test_each_is_broken_by_what_it_forbids_and_by_nothing_else(changes: dict, policies: tuple[Policy, ...]) -> None:  # type: ignore[type-arg]
    assert broken(replace(FINE, **changes)) == policies
