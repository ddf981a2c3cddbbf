"""Assembly: makes and connects the components of one companion."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from companion.checkpoint.checkpointer import Checkpointer
from companion.core.clock import Clock
from companion.core.tick_marks import Mark
from companion.executive.mission_requests import MissionRequests
from companion.executive.mission_run import MissionRun, new_run
from companion.executive.requested_goals import RequestedGoals
from companion.lidar.reader import Lidars
from companion.mavlink.autopilot_link import AutopilotLink
from companion.mission.mission import Mission
from companion.navigation.step_runner import NotedRunner, StepRunner
from companion.operator.notifications import Notifier, Outcome
from companion.operator.operator_server import OperatorServer
from companion.recording.recorder import RunLog
from companion.settings import Settings
from companion.settings.live_settings import LiveSettings
from companion.supervision.arming import Arming
from companion.supervision.drive_permission import DrivePermission
from companion.supervision.event_dispatcher import EventDispatcher, EventHandler, Heard
from companion.supervision.mission_limits import MissionLimits
from companion.supervision.monitors import make_monitors
from companion.supervision.pace import Pace
from companion.supervision.run_saver import RunSaver
from companion.supervision.shutdown import Shutdown
from companion.supervision.supervisor import Supervisor
from companion.vehicle.rc_input import Sticks
from companion.vehicle.state import VehicleState


@dataclass(frozen=True, eq=False, slots=True)
class Components:
    """What ``app`` calls, step by step."""

    run: MissionRun
    pace: Pace
    dispatcher: EventDispatcher
    operator_server: OperatorServer
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
    lidars: Lidars = field(default_factory=Lidars)


def assemble(
    autopilot: AutopilotLink,
    clock: Clock,
    mission: Mission,
    settings: Settings,
    runner: StepRunner,
    log: RunLog,
    options: Options,
) -> Components:
    """The components of a companion that has heard nothing yet."""
    checkpointer, live, outcome = options.checkpointer, LiveSettings(settings), Outcome()
    notifier, noted = Notifier(autopilot, clock, outcome.said), NotedRunner(runner, log.mark)
    vehicle = VehicleState(in_auto=mission.in_auto, sticks=checkpointer.sticks if checkpointer else Sticks())
    run = new_run(mission, vehicle, autopilot, live, notifier, noted, log, options.seed)
    log.begin(clock.now_s(), Mark.BEGIN)

    pace = Pace(clock, live)
    monitors = make_monitors(run, autopilot, live, notifier, pace, noted, options.lidars)
    permission = DrivePermission(run, monitors.by_precedence, live, notifier)
    operator_server = OperatorServer(run, autopilot, live, notifier, options.keep_settings)
    requests = (RequestedGoals(run, live, notifier), MissionRequests(run, notifier))
    handlers: tuple[EventHandler, ...]
    handlers = (operator_server, *monitors.by_precedence, *requests, run, permission)
    heard = Heard(autopilot, options.lidars)
    dispatcher = EventDispatcher(run, heard, notifier, handlers, monitors.scans, monitors.localization, live)

    limits = MissionLimits(
        run, monitors.fences, monitors.batteries, monitors.rivals, monitors.gate, settings.power, outcome
    )
    previous = checkpointer.previous if checkpointer else None
    shutdown = Shutdown(run, autopilot, live, notifier)
    supervisor = Supervisor(
        run,
        permission,
        Arming(run, autopilot, limits, live, notifier, arm=options.arm, previous=previous),
        limits,
        shutdown,
        monitors=monitors.by_precedence,
        saver=RunSaver(run, checkpointer, log, monitors.localization, shutdown),
        log=log,
        notifier=notifier,
        outcome=outcome,
    )
    return Components(run, pace, dispatcher, operator_server, supervisor, notifier, outcome)
