"""One run of a mission: the vehicle's state, the mode latch, what the run does now, and the mission executor.

Nouns: mission run, order, stop.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from enum import Enum, auto

import numpy as np

from companion.control.controller import STANDSTILL, ControlCommand
from companion.control.drag import DragWatch, braked_harder
from companion.control.following import GUARDED_S
from companion.control.full_throttle import FullThrottle
from companion.control.setpoint_check import SetpointCheck
from companion.control.told import Told, after
from companion.core.changed import changed
from companion.core.frames import Pose
from companion.core.scan import RangeScan
from companion.core.severity import Severity, TextSink
from companion.executive.auto_mode_legs import AutoModeLegs
from companion.executive.mission_executor import MissionExecutor, MissionTask
from companion.executive.mission_layout import MissionLayout, MissionPlaces
from companion.executive.mission_progress import MissionProgress, TargetStatus
from companion.executive.setpoint_sender import SetpointSender
from companion.mavlink.autopilot_link import AutopilotLink
from companion.mission.mission import Mission
from companion.navigation.step_runner import StepRunner
from companion.recording.recorder import RunLog
from companion.safety.mode_latch import LatchState, Reaction, Verdict
from companion.safety.reasons import Activity, Doubt, EndReason, Reason, RunPhase, WaitReason
from companion.settings.live_settings import LiveSettings
from companion.vehicle.commands import Command, GuidedPosition, SetMode
from companion.vehicle.events import AckSeen, Event, RoverMode
from companion.vehicle.motion_limits import full_throttle_m_s, velocity_lasts_s
from companion.vehicle.state import VehicleState

MakeExecutor = Callable[[MissionLayout, MissionProgress, RangeScan], MissionExecutor]


@dataclass(frozen=True, eq=False, slots=True)
class LocatedScan:
    """A scan, and the pose and turn rate of the rover when it came."""

    pose: Pose
    yaw_rate_rad_s: float
    scan: RangeScan


@dataclass(frozen=True, slots=True)
class Stop:
    """Why the rover is not to be driven, and what is awaited before it may be again; None where nothing is."""

    reason: Reason[Enum] | None
    awaited: Reason[WaitReason] | None = None


class Order(Enum):
    """What to send in one tick where the mission has nothing to say."""

    NOTHING = auto()
    STOP = auto()
    HOLD = auto()


ORDERS = {Reaction.SILENT: Order.NOTHING, Reaction.STOP: Order.STOP, Reaction.HOLD: Order.HOLD}
COMMANDS: dict[Order, ControlCommand | Command | None] = {
    Order.NOTHING: None,
    Order.STOP: STANDSTILL,
    Order.HOLD: SetMode(RoverMode.HOLD),
}


class MissionRun:
    """What all parts of the companion share of a run.

    Each attribute has one writer: the event dispatcher writes ``vehicle`` (after an error, the shutdown), the drive
    permission ``latch``, ``stop``, ``taken_over`` and ``held_for``, arming ``awaited`` and ``laid``, the shutdown
    ``end``, the mission requests ``paused`` and ``start_paused``. ``activity`` follows from them.
    """

    def __init__(
        self,
        mission: Mission,
        vehicle: VehicleState,
        sender: SetpointSender,
        settings: LiveSettings,
        notifier: TextSink,
        make_executor: MakeExecutor,
    ) -> None:
        self.mission = mission
        self.vehicle = vehicle
        self.sender = sender
        self.latch = LatchState()
        self._notifier = notifier
        self.executor: MissionExecutor | None = None
        """None until the mission has begun."""
        self.awaited: Reason[WaitReason] | None = None
        """What arming waits for; None before it has looked."""
        self.laid: MissionPlaces | None = None
        """Where the mission lies, as arming has found before it begins; None before that is known."""
        self.stop: Stop | None = None
        """Why the rover was not to be driven in the last tick; None if it was."""
        self.taken_over = False
        """Somebody else changed the mode while the companion had the rover: a person, or the autopilot itself."""
        self.held_for: Reason[Doubt] | None = None
        """Why the companion has given the rover up and asked for HOLD; None once it drives again."""
        self.end: Reason[EndReason] | None = None
        """Why the run ends; None while it goes on."""
        self.paused = False
        """The autopilot's present HOLD was asked for as a pause."""
        self.start_paused = False
        """A pause was asked for before the mission began: it does not begin."""
        self.setpoint_check = SetpointCheck(notifier)
        self._drag, self.full_throttle = DragWatch(), FullThrottle()
        self._told: ControlCommand | None = None
        """What was sent, or still held, in the tick before."""
        self._lately: Told = ()
        self._placed_s = -math.inf
        self.legs = AutoModeLegs(notifier)
        self._settings = settings
        self._make_executor = make_executor

    @property
    def activity(self) -> Activity:
        """What the run does now."""
        return self.under_way if self.end is None else Activity(RunPhase.ENDED, self.end)

    @property
    def under_way(self) -> Activity:
        """What it does now, or did when it ended."""
        if self.executor is None:
            phase = RunPhase.CONNECTING if self.awaited is None else RunPhase.WAITING
            return Activity(phase, awaited=self.awaited)
        if self.stop is None:
            return Activity(self.executor.phase)
        phase = RunPhase.STOPPED if self.stop.awaited is None else RunPhase.STOPPED_AND_WAITING
        return Activity(phase, self.stop.reason, self.stop.awaited)

    @property
    def places(self) -> MissionPlaces | None:
        """Where the mission lies; None before that is known."""
        return self.laid if self.executor is None else self.executor.layout.places

    @property
    def told(self) -> ControlCommand | None:
        """What was told in the last tick; None where the rover is not driven."""
        return self._told

    @property
    def _lasts_s(self) -> float:
        """How long the autopilot goes on with a velocity or a turn."""
        return velocity_lasts_s(self.vehicle.parameters, self._settings.current.guidance.velocity_lasts_s)

    @property
    def stopped(self) -> bool:
        """Whether the rover was not to be driven in the last tick."""
        return self.stop is not None

    @property
    def is_driving(self) -> bool:
        """Whether the mission has begun and the rover is being driven."""
        return self.executor is not None and not self.stopped and self.end is None

    def statuses(self) -> list[tuple[str, TargetStatus]]:
        """Every target's name and what has become of it so far."""
        if self.executor is None:
            return [(target.name, TargetStatus.PENDING) for target in self.mission.targets]
        return self.executor.statuses()

    def begin(self, layout: MissionLayout, progress: MissionProgress, now_s: float) -> MissionExecutor:
        """The rover may be driven for the first time."""
        seen = self.vehicle.scan_ahead or self.vehicle.scan
        assert seen is not None
        self.executor = self._make_executor(layout, progress, seen.scan)
        if self.executor.controller != "points" and self.vehicle.guard_at(now_s) is None:
            text = f"No guard on the autopilot: each command must be safe for {self._lasts_s:g} s"
            if self._lasts_s > GUARDED_S:
                text += ", so the rover is slower"
            self._notifier.tell(text, Severity.INFO)
        return self.executor

    def start_afresh(self) -> None:
        """Forget what was sent; the rover may have been moved, so the leg begins again where it then is."""
        self.sender.reset()
        if self.executor is not None:
            self.executor.driver.leave()

    def map(self, scans: Iterable[LocatedScan]) -> None:
        """Take scans into the map."""
        if self.executor is not None:
            for seen in scans:
                self.executor.map_scan(seen.pose, seen.yaw_rate_rad_s, seen.scan)

    def decide(self, verdict: Verdict, now_s: float) -> MissionTask | Order:
        """What to do in this tick: what the verdict demands, or, if the rover may be driven, what the mission needs."""
        if verdict.reaction is not Reaction.DRIVE or self.executor is None:
            return ORDERS.get(verdict.reaction, Order.NOTHING)
        task = self.executor.decide(self.vehicle, now_s)
        self._command(self.executor, now_s)
        return task

    def _command(self, executor: MissionExecutor, now_s: float) -> None:
        """Send the command of the mission that is due now: only while the rover is driven, beside the setpoints."""
        command = executor.commands_due(self.vehicle, now_s)
        if command is not None:
            self.sender.send(command, now_s)

    def take(self, event: Event, vehicle: VehicleState) -> None:
        """One more event: the mission's commands await their answers."""
        if isinstance(event, AckSeen) and self.executor is not None:
            self.executor.answered(event)

    def guide(self, task: MissionTask | Order, now_s: float) -> ControlCommand | Command | None:
        """The command for that. What the mission wants passes the check of setpoints before it is sent."""
        if isinstance(task, Order):
            return COMMANDS[task]
        if task is MissionTask.END or self.executor is None:
            return None
        executor, view = self.executor, self.executor.view(self.vehicle, now_s)
        told = None if self._told is None else self._told.setpoint
        full_m_s = full_throttle_m_s(self.vehicle.parameters)
        self.full_throttle.note(self.vehicle.throttle, full_m_s, view)
        held_m_s = self._drag.held_m_s(self.vehicle.throttle, full_m_s, view)
        view = changed(view, held_m_s=held_m_s, dragged_m_s=self._drag.dragged_m_s(), lately_held=self._drag.closes())
        placed_m_s = self.sender.placed_m_s
        view = changed(view, told=told, lately=self._lately, placed_s=self._placed_s, placed_m_s=placed_m_s)
        if not self._drag.misleads():
            executor.learn(view)
        wanted = executor.guide(task, view)
        wanted = self.legs.guide(wanted, executor, view)
        wanted = braked_harder(wanted, view, executor.layout.bounds)
        return self.setpoint_check.passed(wanted, view, executor.layout.bounds)

    def speak(self, command: ControlCommand | Command | None, now_s: float) -> None:
        """Send it, if it is new or due again."""
        self._told = command if isinstance(command, ControlCommand) else None
        setpoint = None if self._told is None else self._told.setpoint
        self._lately = after(self._lately, setpoint, now_s)
        if isinstance(setpoint, GuidedPosition):
            self._placed_s = now_s
        self.sender.speak(command, now_s, self._lasts_s)


def new_run(
    mission: Mission,
    vehicle: VehicleState,
    autopilot: AutopilotLink,
    settings: LiveSettings,
    notifier: TextSink,
    runner: StepRunner,
    log: RunLog,
    seed: int,
) -> MissionRun:
    """A run that has not begun. ``seed``: of random choices."""
    rng = np.random.default_rng(seed)

    def make_executor(layout: MissionLayout, progress: MissionProgress, scan: RangeScan) -> MissionExecutor:
        return MissionExecutor(mission, settings, layout, progress, scan, runner, log, notifier, rng)

    sender = SetpointSender(autopilot, settings, notifier)
    return MissionRun(mission, vehicle, sender, settings, notifier, make_executor)
