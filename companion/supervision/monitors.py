"""The monitors of a companion, all of one shape, in their order of precedence.

Nouns: monitors.
"""

from __future__ import annotations

from dataclasses import dataclass

from companion.core.severity import TextSink
from companion.executive.autopilot_mission import MissionChangeMonitor
from companion.executive.mission_run import MissionRun
from companion.lidar.reader import Lidars
from companion.mavlink.autopilot_link import AutopilotLink
from companion.safety.battery_monitor import BatteryMonitor
from companion.safety.gps_gate import GpsGate
from companion.safety.guard_monitor import GuardMonitor
from companion.safety.lidar_monitor import LidarMonitor
from companion.safety.watchdogs import DataMonitor, Loop, LoopMonitor, Monitor, ScanMonitor, SticksMonitor, Worker
from companion.settings.live_settings import LiveSettings
from companion.supervision.fence_monitor import FenceMonitor
from companion.supervision.lidar_trouble_monitor import LidarTroubleMonitor
from companion.supervision.limits_monitor import LimitsMonitor
from companion.supervision.localization_monitor import LocalizationMonitor
from companion.supervision.mission_limits import BorderMonitor
from companion.supervision.rival_monitor import RivalMonitor
from companion.vehicle.guard import IN_TIME_S


@dataclass(frozen=True, eq=False, slots=True)
class Monitors:
    """``by_precedence``: all of them. Those whose answers other components need have names as well."""

    by_precedence: tuple[Monitor, ...]
    localization: LocalizationMonitor
    scans: ScanMonitor
    rivals: RivalMonitor
    fences: FenceMonitor
    batteries: BatteryMonitor
    gate: GpsGate


def make_monitors(
    run: MissionRun,
    autopilot: AutopilotLink,
    live: LiveSettings,
    notifier: TextSink,
    loop: Loop,
    worker: Worker,
    lidars: Lidars | None = None,
) -> Monitors:
    """The monitors of a run that has not begun. ``lidars``: those wired to the companion."""
    settings, wired = live.current, lidars or Lidars()
    localization, scans = LocalizationMonitor(run, autopilot, live, notifier), ScanMonitor()
    rivals, batteries = RivalMonitor(autopilot), BatteryMonitor(settings.power)
    fences, gate = FenceMonitor(autopilot, settings.fence, notifier), GpsGate(live)
    by_precedence = (
        SticksMonitor(),
        LidarMonitor(wired.names, live),
        DataMonitor(live),
        localization,
        LoopMonitor(loop, worker, settings.safety.planner_s),
        scans,
        rivals,
        fences,
        BorderMonitor(run),
        gate,
        batteries,
        GuardMonitor(notifier, IN_TIME_S),
        LidarTroubleMonitor(wired, notifier),
        LimitsMonitor(autopilot, live, notifier),
        MissionChangeMonitor(run.mission.stored, autopilot.downloads, notifier),
    )
    return Monitors(by_precedence, localization, scans, rivals, fences, batteries, gate)
