"""The monitors of a companion, in their order of precedence.

Nouns: monitors.
"""

from __future__ import annotations

from dataclasses import dataclass

from companion.core.severity import TextSink
from companion.executive.mission_run import MissionRun
from companion.mavlink.autopilot_link import AutopilotLink
from companion.safety.battery_monitor import BatteryMonitor
from companion.safety.watchdogs import DataMonitor, LoopMonitor, Monitor, ScanMonitor, SticksMonitor
from companion.settings.live_settings import LiveSettings
from companion.supervision.fence_monitor import FenceMonitor
from companion.supervision.localization_monitor import LocalizationMonitor
from companion.supervision.mission_limits import BorderMonitor
from companion.supervision.rival_monitor import RivalMonitor


@dataclass(frozen=True, eq=False, slots=True)
class Monitors:
    """``by_precedence``: those that may doubt that the rover may move. The others are named where parts need them."""

    by_precedence: tuple[Monitor, ...]
    localization: LocalizationMonitor
    loop: LoopMonitor
    scans: ScanMonitor
    rivals: RivalMonitor
    fences: FenceMonitor
    batteries: BatteryMonitor


def make_monitors(run: MissionRun, autopilot: AutopilotLink, live: LiveSettings, notifier: TextSink) -> Monitors:
    """The monitors of a run that has not begun."""
    settings = live.current
    localization, scans = LocalizationMonitor(run, autopilot, live, notifier), ScanMonitor()
    loop, rivals = LoopMonitor(settings.safety.planner_s), RivalMonitor(autopilot)
    fences, batteries = FenceMonitor(autopilot, settings.fence, notifier), BatteryMonitor(settings.power)
    by_precedence = (
        SticksMonitor(),
        DataMonitor(live),
        localization,
        loop,
        scans,
        rivals,
        fences,
        BorderMonitor(run),
    )
    return Monitors(by_precedence, localization, loop, scans, rivals, fences, batteries)
