"""Assembly: makes and connects the parts of one companion, with the monitors in their order of precedence."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from companion.checkpoint.checkpointer import Checkpointer
from companion.core.clock import Clock
from companion.core.round_marks import Mark
from companion.core.scan import RangeScan
from companion.executive.autopilot_mission import MissionChangeMonitor
from companion.executive.goal_requests import GoalRequests
from companion.executive.mission_executor import MissionExecutor
from companion.executive.mission_layout import MissionLayout
from companion.executive.mission_progress import MissionProgress
from companion.executive.mission_run import MissionRun
from companion.executive.setpoint_sender import SetpointSender
from companion.mavlink.autopilot_link import AutopilotLink
from companion.mission.mission import Mission
from companion.navigation.step_runner import NotedRunner, StepRunner
from companion.operator.figures import Telemetry
from companion.operator.notifications import Notifier, Outcome
from companion.operator.parameter_server import ParameterServer
from companion.recording.recorder import RunLog
from companion.safety.battery_monitor import BatteryMonitor
from companion.safety.watchdogs import DataMonitor, LoopMonitor, ScanMonitor, SticksMonitor
from companion.settings import Settings
from companion.settings.live_settings import LiveSettings
from companion.supervision.arming import Arming
from companion.supervision.fence_monitor import FenceMonitor
from companion.supervision.judge import Judge
from companion.supervision.keeper import Keeper
from companion.supervision.listener import Listener
from companion.supervision.localization_monitor import LocalizationMonitor
from companion.supervision.mission_limits import BorderMonitor, MissionLimits
from companion.supervision.pace import Pace
from companion.supervision.rival_monitor import RivalMonitor
from companion.supervision.shutdown import Shutdown
from companion.supervision.supervisor import LoopWatch, Supervisor
from companion.vehicle.rc_input import Sticks
from companion.vehicle.state import VehicleState


@dataclass(frozen=True, eq=False, slots=True)
class Parts:
    """What ``app`` calls, step by step."""

    run: MissionRun
    pace: Pace
    listener: Listener
    supervisor: Supervisor
    notifier: Notifier
    outcome: Outcome


@dataclass(frozen=True, eq=False, slots=True)
class Options:
    """``seed``: of random choices; ``arm``: whether to arm the motors; ``keep_settings``: takes changed settings."""

    seed: int
    arm: bool
    checkpointer: Checkpointer | None = None
    keep_settings: Callable[[Settings], None] | None = None


def assemble(
    autopilot: AutopilotLink,
    clock: Clock,
    mission: Mission,
    settings: Settings,
    runner: StepRunner,
    log: RunLog,
    options: Options,
) -> Parts:
    """The parts of a companion that has heard nothing yet."""
    checkpointer, live, outcome = options.checkpointer, LiveSettings(settings), Outcome()
    notifier, noted = Notifier(autopilot, clock, outcome.said), NotedRunner(runner, log.mark)
    sender = SetpointSender(autopilot, live, notifier)
    rng = np.random.default_rng(options.seed)

    def make_executor(layout: MissionLayout, progress: MissionProgress, scan: RangeScan) -> MissionExecutor:
        return MissionExecutor(mission, live, layout, progress, scan, noted, log, notifier, rng)

    vehicle = VehicleState(in_auto=mission.in_auto, sticks=checkpointer.sticks if checkpointer else Sticks())
    run = MissionRun(mission, vehicle, sender, live, notifier, make_executor)
    log.begin(clock.now_s(), Mark.BEGIN)

    localization, scans = LocalizationMonitor(run, autopilot, live, notifier), ScanMonitor()
    loop, rivals = LoopMonitor(settings.safety.planner_s), RivalMonitor(autopilot)
    fences, batteries = FenceMonitor(autopilot, settings.fence, notifier), BatteryMonitor(settings.power)
    monitors = (
        SticksMonitor(),
        DataMonitor(live),
        localization,
        loop,
        scans,
        rivals,
        fences,
        BorderMonitor(run),
    )
    parameters = ParameterServer(live, notifier, options.keep_settings)
    changes = MissionChangeMonitor(mission.stored, autopilot.downloads, notifier)
    requests = GoalRequests(run, live, notifier)
    telemetry = Telemetry(settings.link.figures_hz)
    listening = (changes, *monitors, batteries, requests)
    listener = Listener(run, autopilot, notifier, parameters, telemetry, listening, scans, localization)
    limits = MissionLimits(run, fences, batteries, rivals, settings.power, outcome)
    previous = checkpointer.previous if checkpointer else None
    pace = Pace(clock, live, localization)
    shutdown = Shutdown(run, autopilot, live, notifier)
    supervisor = Supervisor(
        run,
        Judge(run, monitors, live, notifier),
        Arming(run, autopilot, limits, live, notifier, arm=options.arm, previous=previous),
        limits,
        shutdown,
        loop=LoopWatch(loop, pace, noted),
        localization=localization,
        keeper=Keeper(run, checkpointer, log, notifier, localization, shutdown),
        log=log,
        notifier=notifier,
        outcome=outcome,
    )
    return Parts(run, pace, listener, supervisor, notifier, outcome)
