"""The companion: one tick is one round of the field step."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from companion.clock import Clock, stopwatch_s
from companion.commands import Command, Say, SetMode
from companion.driver import STANDSTILL, Driver
from companion.guidance import Guide, RoverLimits
from companion.itinerary import Itinerary, Leg, TargetStatus, on_reached, on_time, on_unreachable
from companion.laying import Laid, apart_m, from_home, lay, lay_again
from companion.mapfiles import save_ros_map
from companion.mapping import EvidenceMap, forget, integrate, known_fields
from companion.mavlink.autopilot_link import AutopilotLink
from companion.mavlink.codec import EncodeError
from companion.mission.mission import Mission
from companion.navigator import Action, Decision
from companion.outbox import Outbox
from companion.planning.registry import make_planner
from companion.recorder import DecisionLog
from companion.reporting import Reporter, Status
from companion.safety import Control, Reaction, Watch, check, latched
from companion.searching import Searcher
from companion.settings import Settings
from companion.startup import ASK_AGAIN_S, start_step
from companion.stepping import StepRunner
from companion.vehicle import (
    Event,
    HomeSeen,
    LocalPositionSeen,
    OriginSeen,
    RangeSeen,
    RoverMode,
    TextSeen,
    VehicleState,
    fold,
)

__all__ = ["Companion", "Outcome", "Status"]

INFO, WARNING = 6, 4
STEPS_KEPT = 100_000
HAND_OVER_S = 1.5
"""So long the companion stays, after its last command, to see that the rover is in HOLD."""
ORIGIN_MOVED_M = 0.2
HOME_MOVED_M = 2.0
ASK_PLACES_S = 0.5
"""While it is doubtful where the rover is, the origin is asked for this often,"""
SETTLED_S = 0.4
"""and an answer counts that comes so long after the doubt arose: position and origin then speak of the same frame."""


@dataclass
class Outcome:
    """What the run came to. ``step_seconds``: how long the newest ticks took."""

    targets: list[tuple[str, TargetStatus]] = field(default_factory=list)
    step_seconds: deque[float] = field(default_factory=lambda: deque(maxlen=STEPS_KEPT))
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
        self.driver: Driver | None = None
        self.itinerary: Itinerary | None = None
        self.watch = Watch()
        self._laid: Laid | None = None
        self._autopilot = autopilot
        self._clock = clock
        self._mission = mission
        self._settings = settings
        self._runner = runner
        self._log = log
        self._rng = np.random.default_rng(seed)
        self._arm = arm
        self._outbox = Outbox(settings.guidance)
        self._reporter = Reporter(self.outcome.said)
        self._next_tick_s = clock.now_s()
        self._scans = 0
        self._asked_s = -np.inf
        self._doubt = ""
        self._doubt_s = 0.0
        self._stopped = False
        self._stop_asked = False
        self._leave_at_s: float | None = None
        self._done = False

    @property
    def done(self) -> bool:
        """Whether the mission has ended, one way or another."""
        return self._done

    @property
    def evidence(self) -> EvidenceMap | None:
        """The map; None before the mission has begun."""
        return None if self._laid is None else self._laid.evidence

    def save_map(self, path_without_suffix: Path) -> bool:
        """Write what has been mapped as a ROS map (.yaml and .pgm), its place in metres from home.

        False when the mission has not begun. Raises MapError when it cannot be written.
        """
        if self._laid is None:
            return False
        save_ros_map(from_home(self._laid), path_without_suffix, known=known_fields(self._laid.evidence))
        return True

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
        self._reporter.news.clear()
        for event in self._autopilot.poll(now_s):
            self.vehicle = fold(self.vehicle, event)
            self._take_in(event)
        if self._stop_asked and self._leave_at_s is None:
            self._hand_over(now_s, "stopped by the user")
        if self._leave_at_s is None:
            self._act(now_s)
        elif self._is_handed_over(now_s):
            self._done = True
        self._tell_of_faults(now_s)
        self._autopilot.service(now_s)
        self.outcome.step_seconds.append(stopwatch_s() - began_s)

    def stop(self) -> None:
        """Ask for an orderly end at the next tick: the rover is stopped and put into HOLD. Safe in a signal handler."""
        self._stop_asked = True

    def close(self) -> None:
        """Last words on the way out after an error: a rover that is ours does not drive on."""
        if not self._done and self._leave_at_s is None:
            self._hand_over(self._clock.now_s(), "error")

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
            doing=self._reporter.doing,
            pose=self.vehicle.pose_at(self._clock.now_s()),
            decision=self.driver.decision if self.driver else None,
            target=self.itinerary.goal.name if self.itinerary and not self.itinerary.ended else "",
            targets_reached=reached,
            targets=len(self._mission.targets),
            steps=self.driver.tally.steps if self.driver else 0,
            news=tuple(self._reporter.news),
        )

    # Judging -----------------------------------------------------------------------------------------------------

    def _act(self, now_s: float) -> None:
        """Judge who may drive and whether it is safe; then drive, stop, or be silent."""
        if self.itinerary is None and not self._begin(now_s):
            return
        if self._doubt and now_s - self._asked_s >= ASK_PLACES_S:
            self._asked_s = now_s
            self._autopilot.ask_places()
        before = self.watch.control
        self.watch, verdict = check(self.watch, self.vehicle, now_s, self._settings.safety, self._doubt)
        if verdict.reaction is Reaction.DRIVE:
            if self._stopped or before is not Control.COMPANION:
                self._start_afresh()
            self._stopped = False
            self._command(self._drive(now_s), now_s)
            return
        if not self._stopped:
            self._start_afresh()
        self._stopped = True
        self._reporter.doing = f"stopped: {verdict.reason}"
        match verdict.reaction:
            case Reaction.STOP:
                self._tell(f"Stopping: {verdict.reason}", WARNING)
                self._command(STANDSTILL, now_s)
            case Reaction.HOLD:
                self._tell(f"HOLD: {verdict.reason}", WARNING)
                self._send(SetMode(RoverMode.HOLD), now_s)
            case _:
                if before is Control.COMPANION:
                    self._tell(f"Companion silent: {verdict.reason}", WARNING)

    def _begin(self, now_s: float) -> bool:
        """Everything before the first metre; True once the rover may be driven and the mission lies on the map."""
        self.watch = Watch(latched(self.watch.control, self.vehicle))
        step = start_step(self.vehicle, now_s, self._settings.safety, arm=self._arm, control=self.watch.control)
        if step.missing:
            self._wait_for(step.missing)
            if step.command is not None and now_s - self._asked_s > ASK_AGAIN_S:
                self._asked_s = now_s
                self._send(step.command, now_s)
            return False
        pose = self.vehicle.pose_at(now_s)
        assert pose is not None and self.vehicle.origin is not None and self.vehicle.home is not None
        origin, home = self.vehicle.origin.point, self.vehicle.home.point
        laid = lay(self._mission, self._settings.mapping, origin, home, pose)
        if not laid.evidence.base.contains(laid.evidence.base.cell_at(pose.point)):
            self._wait_for("the rover to stand on the mission's grid")
            return False
        self._take_ground(laid)
        self._tell(f"Companion: {self._mission.name}, {len(laid.itinerary.targets)} targets", INFO)
        return True

    def _wait_for(self, what: str) -> None:
        if what == "the autopilot's heartbeat":
            what = f"{what} on {self._autopilot.description}"
            if self._autopilot.codec.refused_type is not None:
                what += f" (heard a vehicle of type {self._autopilot.codec.refused_type}, which is no ArduPilot rover)"
        self._reporter.doing = f"waiting for {what}"

    def _take_ground(self, laid: Laid) -> None:
        """A map and who drives on it; what has been counted so far is kept."""
        self._laid, self.itinerary = laid, laid.itinerary
        self._runner.drop()
        assert self.vehicle.scan is not None
        rover = self._mission.rover
        limits = RoverLimits(rover.radius_m, rover.cruise_speed_m_s, self.vehicle.scan.scan.max_range_m)
        if self.driver is None:
            planner = make_planner(self._settings.navigator.planner, self._settings.planner)
            searcher = Searcher(planner, self._settings.navigator, self._rng)
            self.driver = Driver(laid.evidence, limits, self._settings, searcher, self._runner)
            return
        tally = self.driver.tally
        self.driver = Driver(laid.evidence, limits, self._settings, self.driver.searcher, self._runner)
        self.driver.tally = tally

    # Listening ---------------------------------------------------------------------------------------------------

    def _take_in(self, event: Event) -> None:
        """Scans go into the map; a position that jumps, or an origin that moves, makes the map worthless."""
        match event:
            case TextSeen() if event.severity <= WARNING:
                self._reporter.note(f"autopilot: {event.text}")
            case RangeSeen() if not self._doubt:
                self._map(event)
            case LocalPositionSeen() if self.vehicle.jump_m > self._settings.safety.jump_m and self._laid is not None:
                if not self._doubt:
                    self._tell(f"Position jumped {self.vehicle.jump_m:.1f} m: map forgotten", WARNING)
                self._doubt, self._doubt_s = "position jumped", event.time_s
            case OriginSeen() if self._laid is not None:
                self._find_ground(event, self._laid)
            case HomeSeen() if self._laid is not None and apart_m(event.point, self._laid.home) > HOME_MOVED_M:
                self._tell("Home has moved; the mission stays where it began", WARNING)
            case _:
                pass

    def _map(self, event: RangeSeen) -> None:
        evidence, attitude = self.evidence, self.vehicle.attitude
        pose = self.vehicle.pose_at(event.time_s)
        if evidence is None or attitude is None or pose is None:
            return
        if abs(attitude.yaw_rate_rad_s) <= np.radians(self._settings.mapping.max_yaw_rate_deg_s):
            self._scans += 1
            integrate(evidence, pose, event.scan, self._scans)

    def _find_ground(self, event: OriginSeen, laid: Laid) -> None:
        """The origin as it is now: after a jump this tells whether the frame has moved or only the rover's place in it."""
        moved_m = apart_m(event.point, laid.origin)
        if moved_m > ORIGIN_MOVED_M:
            assert self.itinerary is not None
            self._tell(f"EKF origin moved {moved_m:.1f} m: mission laid out anew", WARNING)
            self._take_ground(lay_again(laid, self.itinerary, self._mission, self._settings.mapping, event.point))
            self._doubt, self._doubt_s = "EKF origin moved", event.time_s
        elif self._doubt and event.time_s - self._doubt_s >= SETTLED_S:
            forget(laid.evidence)
            self._doubt = ""
            self._start_afresh()

    # Driving -----------------------------------------------------------------------------------------------------

    def _drive(self, now_s: float) -> Guide:
        """What to do for the mission now."""
        assert self.itinerary is not None and self.driver is not None
        self.itinerary = on_time(self.itinerary, now_s)
        if self.itinerary.ended:
            return self._finish(now_s)
        pose = self.vehicle.pose_at(now_s)
        assert pose is not None
        if self.itinerary.leg in (Leg.STAY, Leg.WAIT):
            self._reporter.doing = "holding" if self.itinerary.leg is Leg.STAY else "waiting for the way to clear"
            self.driver.pause()
            return STANDSTILL
        if self.driver.goal is not self.itinerary.goal:
            self._tell(f"Heading for {self.itinerary.goal.name}", INFO)
            self._runner.drop()
            self.driver.head_for(self.itinerary.goal, pose)
        self._reporter.doing = "driving"
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
        self._hand_over(now_s, "done")
        return STANDSTILL

    def _start_afresh(self) -> None:
        """What was sent before counts for nothing, and the rover may be moved: the leg begins again where it then is."""
        self._outbox.reset()
        self._runner.drop()
        if self.driver is not None:
            self.driver.leave()

    # Speaking ----------------------------------------------------------------------------------------------------

    def _command(self, guide: Guide, now_s: float) -> None:
        if self._leave_at_s is None:
            for command in self._outbox.due(guide, now_s, self._autopilot.target_confirmed):
                self._send(command, now_s)

    def _send(self, command: Command, now_s: float) -> None:
        """Say it; what cannot be said (degrees, while the autopilot has no origin) leaves the rover standing instead."""
        try:
            self._autopilot.send(command, now_s)
        except EncodeError as error:
            self._tell(f"Stopping: {error}", WARNING)
            self._autopilot.send(STANDSTILL.setpoint, now_s)

    def _hand_over(self, now_s: float, why: str) -> None:
        """Stop a rover that is ours and put it into HOLD; then there are a few moments to see that it has been taken."""
        self._leave_at_s = now_s
        self._reporter.doing = why
        heartbeat = self.vehicle.heartbeat
        if heartbeat is None or heartbeat.mode != RoverMode.GUIDED or self.watch.control is not Control.COMPANION:
            return
        self._leave_at_s = now_s + HAND_OVER_S
        if heartbeat.armed:
            self._send(STANDSTILL.setpoint, now_s)
        self._send(SetMode(RoverMode.HOLD), now_s)

    def _is_handed_over(self, now_s: float) -> bool:
        """Whether the rover has left GUIDED, or has said that it will, or time is up."""
        assert self._leave_at_s is not None
        ack = self._autopilot.last_ack(SetMode(RoverMode.HOLD))
        answered = ack is not None and ack.result == 0 and ack.time_s > self._leave_at_s - HAND_OVER_S
        heartbeat = self.vehicle.heartbeat
        left = heartbeat is not None and heartbeat.mode != RoverMode.GUIDED
        return answered or left or now_s >= self._leave_at_s

    def _tell_of_faults(self, now_s: float) -> None:
        """What a person should know though it stops nothing, once each."""
        if self._laid is not None:
            for text in self._reporter.faults(self._autopilot.rate_faults, self._log.problem, now_s):
                self._tell(text, WARNING)

    def _tell(self, text: str, severity: int) -> None:
        """Say it to the ground station, once."""
        if self._reporter.say(text):
            self._autopilot.send(Say(severity, text), self._clock.now_s())
