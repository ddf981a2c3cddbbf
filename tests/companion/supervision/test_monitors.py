"""The monitors of a companion."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from companion.navigation.step_runner import InlineRunner
from companion.supervision.monitors import make_monitors
from tests.companion.safety.test_watchdogs import Loop
from tests.support.desk import Desk


def test_the_monitors_stand_in_their_order_of_precedence(tmp_path: Path) -> None:
    desk = Desk(tmp_path)
    link: Any = desk.autopilot
    monitors = make_monitors(desk.run, link, desk.settings, desk.notices, Loop(), InlineRunner())
    assert [type(monitor).__name__ for monitor in monitors.by_precedence] == [
        "SticksMonitor",
        "LidarMonitor",
        "DataMonitor",
        "LocalizationMonitor",
        "LoopMonitor",
        "ScanMonitor",
        "RivalMonitor",
        "FenceMonitor",
        "BorderMonitor",
        "GpsGate",
        "BatteryMonitor",
        "GuardMonitor",
        "LidarTroubleMonitor",
        "LimitsMonitor",
        "MissionChangeMonitor",
    ]
