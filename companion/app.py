"""The companion: one tick is one round of the field step."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from companion.clock import Clock, stopwatch_s
from companion.commands import Say, SetMode
from companion.driver import STANDSTILL, Driver
from companion.frames import LocalFrame, Pose
from companion.grid import Grid, inflated
from companion.guidance import Guide, RoverLimits
from companion.itinerary import Itinerary, Leg, TargetStatus, on_reached, on_time, on_unreachable, plan_itinerary
from companion.mapping import EvidenceMap, forget, integrate, new_map
from companion.mavlink.autopilot_link import AutopilotLink
from companion.mission.mission import Mission, OnBlocked
from companion.mission.resolve import ResolvedTarget, resolve
from companion.navigator import Action, Decision
from companion.outbox import Outbox
from companion.planning.registry import make_planner
from companion.recorder import DecisionLog
from companion.safety import Control, Reaction, Watch, check
from companion.searching import Searcher
from companion.settings import Settings
from companion.startup import start_step
from companion.stepping import StepRunner
from companion.vehicle import Event, LocalPositionSeen, RangeSeen, RoverMode, VehicleState, fold

INFO, WARNING = 6, 4


@dataclass(frozen=True, slots=True)
class Status:
    """What a person wants to see while it drives."""

    time_s: float
    doing: str
    pose: Pose | None
    decision: Decision | None
    target: str
    targets_reached: int
    targets: int
    steps: int


@dataclass
class Outcome:
    """What the run came to."""

    targets: list[tuple[str, TargetStatus]] = field(default_factory=list)
    step_seconds: list[float] = field(default_factory=list)
    said: list[str] = field(default_factory=list)

    @property
    def complete(self) -> bool:
        """Whether every target has been reached."""
        return bool(self.targets) and all(status is TargetStatus.REACHED for _, status in self.targets)


class Companion:
    """Reads the vehicle, keeps the map, decides, and commands, tick by tick.

    It owns no socket and no clock: both are handed in, so that the same companion runs in real time and in lock-step.
    """

    def __init__(
        self,
        autopilot: AutopilotLink,
        clock: Clock,
        mission: Mission,
        settings: Settings,
        runner: StepRunner,
        log: DecisionLog,
        *,
        seed: int,
        arm: bool,
    ) -> None:
        self.vehicle = VehicleState()
        self.outcome = Outcome()
        self.evidence: EvidenceMap | None = None
        self.driver: Driver | None = None
        self.itinerary: Itinerary | None = None
        self.watch = Watch()
        self._autopilot = autopilot
        self._clock = clock
        self._mission = mission
        self._settings = settings
        self._runner = runner
        self._log = log
        self._rng = np.random.default_rng(seed)
        self._arm = arm
        self._outbox = Outbox(settings.guidance)
        self._next_tick_s = clock.now_s()
        self._scans = 0
        self._last_said = ""
        self._asked_s = -np.inf
        self._doing = "connecting"
        self._stop_asked = False
        self._done = False

    @property
    def done(self) -> bool:
        """Whether the mission has ended, one way or another."""
        return self._done

    def run(self, observe: Callable[[Status], None] = lambda status: None) -> Outcome:
        """Tick until the mission has ended."""
        while not self.done:
            self.tick()
            observe(self.status())
        return self.outcome

    def tick(self) -> None:
        """One round: listen, judge, map, decide, command."""
        self._next_tick_s += 1.0 / self._settings.link.tick_hz
        self._clock.sleep_until_s(self._next_tick_s)
        now_s = self._clock.now_s()
        if now_s - self._next_tick_s > 1.0:
            self._next_tick_s = now_s  # after a stall (a suspended computer), do not catch up tick by tick
        began_s = stopwatch_s()
        for event in self._autopilot.poll(now_s):
            self.vehicle = fold(self.vehicle, event)
            self._take_in(event)
        if self._stop_asked:
            self.close()
            self._done = True
        else:
            self._act(now_s)
        self._autopilot.service(now_s)
        self.outcome.step_seconds.append(stopwatch_s() - began_s)

    def stop(self) -> None:
        """Ask for an orderly end at the next tick: the rover is stopped and put into HOLD. Safe in a signal handler."""
        self._stop_asked = True

    def close(self) -> None:
        """Last words on the way out, also after an error: a rover that is ours does not drive on."""
        if self.watch.control is Control.COMPANION and not self._done:
            now_s = self._clock.now_s()
            self._autopilot.send(STANDSTILL.setpoint, now_s)
            self._autopilot.send(SetMode(RoverMode.HOLD), now_s)

    def statuses(self) -> list[tuple[str, TargetStatus]]:
        """Every target's name and what has become of it so far."""
        if self.itinerary is None:
            return [(target.name, TargetStatus.PENDING) for target in self._mission.targets]
        return [(t.name, status) for t, status in zip(self.itinerary.targets, self.itinerary.statuses, strict=True)]

    def status(self) -> Status:
        """A picture of this moment."""
        reached = sum(status is TargetStatus.REACHED for status in self.itinerary.statuses) if self.itinerary else 0
        return Status(
            time_s=self._clock.now_s(),
            doing=self._doing,
            pose=self.vehicle.pose_at(self._clock.now_s()),
            decision=self.driver.decision if self.driver else None,
            target=self.itinerary.goal.name if self.itinerary else "",
            targets_reached=reached,
            targets=len(self._mission.targets),
            steps=self.driver.tally.steps if self.driver else 0,
        )

    def _act(self, now_s: float) -> None:
        """Judge who may drive and whether it is safe; then drive, stop, or be silent."""
        if self.itinerary is None and not self._begin(now_s):
            return
        before = self.watch.control
        self.watch, verdict = check(self.watch, self.vehicle, now_s, self._settings.safety)
        match verdict.reaction:
            case Reaction.DRIVE:
                if before is not Control.COMPANION or self._doing.startswith("stopped"):
                    self._resume()
                self._command(self._drive(now_s), now_s)
            case Reaction.STOP:
                self._tell(f"Stopping: {verdict.reason}", WARNING)
                self._doing = f"stopped: {verdict.reason}"
                self._pause()
                self._command(STANDSTILL, now_s)
            case Reaction.HOLD:
                self._tell(f"HOLD: {verdict.reason}", WARNING)
                self._doing = f"stopped: {verdict.reason}"
                self._autopilot.send(SetMode(RoverMode.HOLD), now_s)
            case Reaction.SILENT:
                if before is Control.COMPANION and verdict.reason:
                    self._tell(f"Companion silent: {verdict.reason}", WARNING)
                self._doing = f"stopped: {verdict.reason}"
                self._pause()

    def _begin(self, now_s: float) -> bool:
        """Everything before the first metre; True once the rover may be driven and the mission lies on the map."""
        step = start_step(self.vehicle, now_s, self._settings.safety, arm=self._arm)
        if step.missing:
            if self._doing != f"waiting for {step.missing}":
                self._doing = f"waiting for {step.missing}"
            if step.command is not None and now_s - self._asked_s > 3.0:
                self._asked_s = now_s
                self._autopilot.send(step.command, now_s)
            return False
        pose = self.vehicle.pose_at(now_s)
        assert pose is not None and self.vehicle.origin is not None and self.vehicle.home is not None
        frame = LocalFrame(self.vehicle.origin.point)
        laid = resolve(self._mission, frame, frame.to_ned(self.vehicle.home.point))
        self._open_map(laid.grid, laid.targets, pose)
        self._tell(f"Companion: {self._mission.name}, {len(laid.targets)} targets", INFO)
        return True

    def _open_map(self, grid: Grid, targets: tuple[ResolvedTarget, ...], pose: Pose) -> None:
        """The map, and who drives on it."""
        rover = self._mission.rover
        grid = grid.with_weights(inflated(grid.weights, rover.radius_m / grid.resolution_m))
        self.evidence = new_map(grid, rover.radius_m, self._settings.mapping)
        assert self.vehicle.scan is not None
        limits = RoverLimits(rover.radius_m, rover.cruise_speed_m_s, self.vehicle.scan.scan.max_range_m)
        planner = make_planner(self._settings.navigator.planner, self._settings.planner)
        searcher = Searcher(planner, self._settings.navigator, self._rng)
        self.driver = Driver(self.evidence, limits, self._settings, searcher, self._runner)
        start = ResolvedTarget("start", pose.point, grid.cell_at(pose.point), 0.0, OnBlocked.HOLD, None)
        self.itinerary = plan_itinerary(targets, start)

    def _take_in(self, event: Event) -> None:
        """Scans go into the map; a jump of the position makes the map worthless."""
        if self.evidence is None:
            return
        if isinstance(event, RangeSeen):
            attitude = self.vehicle.attitude
            pose = self.vehicle.pose_at(event.time_s)
            turning = 0.0 if attitude is None else abs(attitude.yaw_rate_rad_s)
            if pose is not None and turning <= np.radians(self._settings.mapping.max_yaw_rate_deg_s):
                self._scans += 1
                integrate(self.evidence, pose, event.scan, self._scans)
        elif isinstance(event, LocalPositionSeen) and self.vehicle.jump_m > self._settings.safety.jump_m:
            self._tell(f"Position jumped {self.vehicle.jump_m:.1f} m: map forgotten", WARNING)
            forget(self.evidence)
            self._resume()

    def _drive(self, now_s: float) -> Guide:
        """What to do for the mission now."""
        assert self.itinerary is not None and self.driver is not None
        self.itinerary = on_time(self.itinerary, now_s)
        if self.itinerary.leg is Leg.DONE or self.itinerary.leg is Leg.HOLD:
            return self._finish(now_s)
        pose = self.vehicle.pose_at(now_s)
        assert pose is not None
        if self.itinerary.leg in (Leg.STAY, Leg.WAIT):
            self._doing = "holding" if self.itinerary.leg is Leg.STAY else "waiting for the way to clear"
            self.driver.pause()
            return STANDSTILL
        if self.driver.goal is not self.itinerary.goal:
            self._tell(f"Heading for {self.itinerary.goal.name}", INFO)
            self.driver.head_for(self.itinerary.goal, pose)
        self._doing = "driving"
        guide, decision = self.driver.update(pose, self.vehicle.speed_m_s)
        if decision is not None:
            self._take_decision(decision, now_s)
        return guide

    def _take_decision(self, decision: Decision, now_s: float) -> None:
        assert self.itinerary is not None and self.driver is not None
        goal = self.itinerary.goal
        self._log.write_decision(now_s, goal.name, decision)
        if decision.action is Action.REACHED:
            self._tell(f"Reached {goal.name}", INFO)
            self.itinerary = on_reached(self.itinerary, now_s)
        elif decision.action is Action.UNREACHABLE:
            self._tell(f"Unreachable: {goal.name} ({decision.reason})", WARNING)
            navigator = self._settings.navigator
            self.itinerary = on_unreachable(self.itinerary, now_s, navigator.wait_retry_s, navigator.wait_limit_s)
        if decision.action in (Action.REACHED, Action.UNREACHABLE):
            self.driver.leave()

    def _finish(self, now_s: float) -> Guide:
        """The mission has ended: stand, and hand over in HOLD."""
        assert self.itinerary is not None
        self.outcome.targets = self.statuses()
        reached = sum(status is TargetStatus.REACHED for status in self.itinerary.statuses)
        self._tell(f"Mission ended: {reached} of {len(self.itinerary.targets)} targets reached", INFO)
        self._autopilot.send(SetMode(RoverMode.HOLD), now_s)
        self._doing = "done"
        self._done = True
        return STANDSTILL

    def _command(self, guide: Guide, now_s: float) -> None:
        for command in self._outbox.due(guide, now_s, self._autopilot.target_confirmed):
            self._autopilot.send(command, now_s)

    def _pause(self) -> None:
        self._outbox.reset()
        if self.driver is not None:
            self.driver.pause()

    def _resume(self) -> None:
        """Driving (again): what was sent before counts for nothing, and the rover may have been moved."""
        self._outbox.reset()
        if self.driver is not None:
            self.driver.leave()

    def _tell(self, text: str, severity: int) -> None:
        """Say it to the ground station, once."""
        if text != self._last_said:
            self._last_said = text
            self.outcome.said.append(text)
            self._autopilot.send(Say(severity, text), self._clock.now_s())
