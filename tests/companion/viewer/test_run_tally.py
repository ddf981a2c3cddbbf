"""What is counted of a run."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import pytest

from companion.core.frames import Pose
from companion.safety.reasons import Activity, RunPhase
from companion.viewer.run_tally import RunTally


def moment(time_s: float, heard_s: float) -> Any:
    """The companion at a time, in its own clock 100 s later; its newest position, 2 m/s, of ``heard_s``."""
    position = SimpleNamespace(time_s=100.0 + heard_s)
    vehicle = SimpleNamespace(speed_m_s=2.0, forward_m_s=2.0, battery=None, position=position)
    run = SimpleNamespace(activity=Activity(RunPhase.DRIVING), stop=None, is_driving=False)
    status = SimpleNamespace(time_s=100.0 + time_s, pose=None, activity=run.activity, target="gate", decision=None)
    return cast(
        Any,
        SimpleNamespace(
            vehicle=vehicle, mission_run=run, status=lambda: status, statuses=lambda: [("gate", "")], driver=None
        ),
    )


def test_a_speed_that_was_heard_long_ago_is_no_distance() -> None:
    tally = RunTally()
    for tick in range(1, 601):
        time_s = 0.05 * tick
        tally.ticked(moment(time_s, min(time_s, 10.0)), time_s)
    assert tally.driven_m == pytest.approx(2.0 * 11.0, abs=0.3) and tally.moving_s == pytest.approx(11.0, abs=0.1)


def test_a_rover_that_is_led_and_does_not_get_on_has_a_row_in_the_table() -> None:
    tally = RunTally()
    for tick in range(1, 201):
        now = moment(0.1 * tick, 0.1 * tick)
        now.driver = SimpleNamespace(decision=None, makes_way=True, tally=SimpleNamespace(stuck=0))
        now.status().pose = Pose(0.0, 0.0, 0.0, 100.0 + 0.1 * tick)
        tally.ticked(now, 0.1 * tick)
    spell = tally.stood["making way for something that moves"]
    assert spell.times == 1 and spell.seconds == pytest.approx(17.0, abs=0.3) and tally.stops == 0
