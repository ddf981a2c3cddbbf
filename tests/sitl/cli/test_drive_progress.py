"""The speed of simulated time, and runs that nobody can help."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import pytest

from companion.operator.notifications import Status
from companion.safety.reasons import Activity, Doubt, EndReason, Reason, RunPhase, WaitReason
from sitl.cli.drive_progress import BEGINS_S, Pace, Unattended
from tests.support.notices import HandClock

AWAITED = Reason(WaitReason.GOOD_DATA, (Reason(Doubt.DATA_MISSING, ("range data ahead",)),))


def test_a_pace_counts_from_its_first_moment_and_catches_up() -> None:
    clock = HandClock(100.0)
    pace, free = Pace(10.0, clock), Pace(None, clock)
    pace.wait(5.0)
    free.wait(50.0)
    assert clock.time_s == 100.0
    pace.wait(25.0)
    assert clock.time_s == pytest.approx(102.0)
    clock.time_s = 110.0
    pace.wait(30.0)
    assert clock.time_s == 110.0


@dataclass
class Run:
    """Stands in for a drive and its companion."""

    executor: object | None = None
    station: None = None
    stops: list[EndReason] = field(default_factory=list)

    @property
    def companion(self) -> Run:
        return self

    def stop(self, why: EndReason) -> None:
        self.stops.append(why)


def looked_at(executor: object | None) -> tuple[list[str], list[EndReason]]:
    run: Any = Run(executor)
    said: list[str] = []
    unattended = Unattended(run, said.append)
    for time_s in (1.0, BEGINS_S - 1.0, BEGINS_S, BEGINS_S + 1.0):
        unattended.look(Status(time_s, Activity(RunPhase.WAITING, None, AWAITED), None, None, "", 0, 1, 0))
    return said, run.stops


def test_a_run_that_waits_for_data_that_never_comes_ends_with_its_reason() -> None:
    (line,), stops = looked_at(None)
    assert "ended: waiting for good data (no range data ahead) since the start" in line
    assert stops == [EndReason.NEVER_BEGINS]


def test_one_that_has_begun_may_wait_for_data() -> None:
    assert looked_at(object()) == ([], [])
