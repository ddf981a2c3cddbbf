"""The supervisor: the ends of a run."""

from __future__ import annotations

import pytest

from companion.core.tick_marks import Mark
from companion.safety.reasons import EndReason, Reason
from companion.supervision.supervisor import SILENT
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
    assert whole.companion._supervisor.supervise(whole.companion._clock.now_s()) is SILENT
    whole.mode = int(HOLD)
    assert whole.tick() == [] and whole.companion.done and whole.memory.notes[-1]
    assert whole.companion.status().doing == "stopped by the user" and not whole.companion.outcome.complete


@pytest.mark.parametrize("why", [EndReason.STOPPED_BY_USER, EndReason.TERMINATED])
def test_the_record_is_told_whether_a_signal_ended_the_run(whole: Whole, why: EndReason) -> None:
    whole.drive()
    whole.companion.stop(why)
    whole.tick()
    assert whole.companion.mission_run.end == Reason(why)
    assert (Mark.TERMINATED in whole.log.marks) is (why is EndReason.TERMINATED)


def test_an_error_ends_the_run_in_hold_before_close_returns(whole: Whole) -> None:
    whole.drive()
    whole.companion.close()
    assert SetMode(RoverMode.HOLD) in whole.autopilot.taken() and whole.companion.done
    assert whole.log.marks[-1] is Mark.CLOSE and whole.memory.notes[-1]
    whole.companion.close()
    assert whole.autopilot.taken() == [], "once"
