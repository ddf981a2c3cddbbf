"""The supervisor: the ends of a run, and what the monitor of the loop is told."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

from companion.core.tick_marks import Mark
from companion.safety.reasons import EndReason, Reason
from companion.supervision.supervisor import LoopWatch
from companion.vehicle.commands import (
    SetMode,
)
from companion.vehicle.events import (
    RoverMode,
)
from tests.companion.safety.test_mode_latch import HOLD
from tests.support.whole import Whole


def test_a_stop_ends_the_run_in_hold(whole: Whole) -> None:
    whole.drive()
    whole.companion.stop()
    assert SetMode(RoverMode.HOLD) in whole.tick()
    end = Reason(EndReason.STOPPED_BY_USER)
    assert whole.companion.mission_run.end == end and Mark.STOP in whole.log.marks and not whole.companion.done
    whole.mode = int(HOLD)
    assert whole.tick() == [] and whole.companion.done and whole.memory.notes[-1]
    assert whole.companion.status().doing == "stopped by the user" and not whole.companion.outcome.complete


def test_an_error_ends_the_run_in_hold_before_close_returns(whole: Whole) -> None:
    whole.drive()
    whole.companion.close()
    assert SetMode(RoverMode.HOLD) in whole.autopilot.taken() and whole.companion.done
    assert whole.log.marks[-1] is Mark.CLOSE and whole.memory.notes[-1]
    whole.companion.close()
    assert whole.autopilot.taken() == [], "once"


def test_the_monitor_of_the_loop_is_told_how_late_a_tick_is_and_whether_the_navigator_works() -> None:
    told: list[tuple[float, float, bool]] = []
    monitor: Any = SimpleNamespace(
        tick=lambda now_s, late_s, *, planner_works: told.append((now_s, late_s, planner_works))
    )
    pace: Any = SimpleNamespace(late_s=0.25)
    runner: Any = SimpleNamespace(working=True)
    LoopWatch(monitor, pace, runner).tick(10.0)
    assert told == [(10.0, 0.25, True)]
