"""The parts of a companion, put together."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from companion.navigation.step_runner import InlineRunner
from companion.supervision.assembly import Options, assemble
from companion.supervision.supervisor import Supervisor
from tests.support.fake_autopilot import FakeAutopilot
from tests.support.notices import HandClock
from tests.support.rig import yard
from tests.support.whole import SETTINGS, Log


def test_monitors_hear_of_an_event_before_the_drive_permission(tmp_path: Path) -> None:
    link: Any = FakeAutopilot()
    parts = assemble(link, HandClock(), yard(tmp_path), SETTINGS, InlineRunner(), Log(), Options(seed=0, arm=False))
    assert isinstance(parts.supervisor, Supervisor)
    names = [type(handler).__name__ for handler in parts.dispatcher._handlers]
    assert names[:2] == ["OperatorServer", "SticksMonitor"] and len(names) == 20
    assert names[-4:] == ["RequestedGoals", "MissionRequests", "MissionRun", "DrivePermission"]
