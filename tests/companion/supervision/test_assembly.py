"""The parts of a companion, put together."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from companion.navigation.step_runner import InlineRunner
from companion.supervision.assembly import Options, assemble
from companion.supervision.listener import Listener
from companion.supervision.supervisor import Supervisor
from tests.support.fake_autopilot import FakeAutopilot
from tests.support.notices import HandClock
from tests.support.rig import yard
from tests.support.whole import SETTINGS, Log


def test_the_monitors_stand_in_their_order_of_precedence(tmp_path: Path) -> None:
    link: Any = FakeAutopilot()
    parts = assemble(link, HandClock(), yard(tmp_path), SETTINGS, InlineRunner(), Log(), Options(seed=0, arm=False))
    assert isinstance(parts.supervisor, Supervisor) and isinstance(parts.listener, Listener)
    names = [type(monitor).__name__ for monitor in parts.supervisor._judge._monitors]
    assert names == [
        "SticksMonitor",
        "DataMonitor",
        "LocalizationMonitor",
        "LoopMonitor",
        "ScanMonitor",
        "RivalMonitor",
        "FenceMonitor",
        "BorderMonitor",
    ]
