"""The companion: one tick is one round of the field step."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from companion.checkpoint.checkpointer import Memory
from companion.control.controller import STANDSTILL
from companion.control.setpoint_check import SetpointCheck
from companion.core.clock import Clock, stopwatch_s
from companion.core.frames import GeoPoint
from companion.core.rounds import Mark
from companion.executive.auto_mode_legs import AutoModeLegs
from companion.executive.goal_driver import GoalDriver
from companion.executive.goal_requests import GoalRequests
from companion.executive.mission_executor import MissionExecutor
from companion.executive.mission_layout import from_home
from companion.executive.mission_progress import MissionProgress, TargetStatus
from companion.executive.outbox import Outbox
from companion.executive.plan_watch import PlanWatch
from companion.executive.speaking import Speaker
from companion.mapping.evidence_map import EvidenceMap, known_fields
from companion.mapping.map_files import save_ros_map
from companion.mavlink.autopilot_link import AutopilotLink
from companion.mission.mission import Mission
from companion.navigation.step_runner import NotedRunner, StepRunner
from companion.operator.attendant import Attendant
from companion.operator.overview import status_of, statuses_of
from companion.operator.reporting import Outcome, Reporter, Status
from companion.operator.telling import Teller
from companion.perception.moving_obstacles import announced
from companion.perception.scan_filter import newest_ranges
from companion.recording.recorder import DecisionLog
from companion.safety.mode_latch import Control, LatchState, Reaction, Verdict, awaited, check, latched
from companion.safety.watchdogs import Watchdogs
from companion.settings import Settings
from companion.supervision.localization_monitor import LocalizationMonitor
from companion.supervision.mission_limits import MissionLimits
from companion.supervision.setting_out import SettingOut
from companion.supervision.shutdown import Shutdown
from companion.supervision.startup import StartUp
from companion.vehicle.commands import SetMode
from companion.vehicle.events.event import Event
from companion.vehicle.events.targets import TargetAsked
from companion.vehicle.events.vehicle import RangeSeen, RoverMode, TextSeen
from companion.vehicle.rc_input import Sticks
from companion.vehicle.state import VehicleState, fold

__all__ = ["Companion", "Outcome", "Status"]

INFO, WARNING = 6, 4


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
        memory: Memory | None = None,
        keep_settings: Callable[[Settings], None] | None = None,
    ) -> None:
        self.vehicle = VehicleState(in_auto=mission.in_auto, sticks=memory.sticks if memory else Sticks())
        self.outcome = Outcome()
        self._reporter = Reporter(self.outcome.said)
        self._teller = Teller(autopilot, clock, self._reporter)
        self._tell = self._teller.tell
        self.watch = LatchState()
        self._executor: MissionExecutor | None = None
        self._autopilot = autopilot
        self._clock = clock
        self._mission = mission
        self._settings = settings
        self._runner = NotedRunner(runner, log.mark)
        self._log = log
        self._rng = np.random.default_rng(seed)
        self._memory = memory
        self._start_up = StartUp(mission, settings, arm=arm, kept=memory.kept if memory else None)
        self._outbox = Outbox(settings.guidance)
        self._speaker = Speaker(autopilot, self._outbox, self._tell)
        self.output_check = SetpointCheck(self._tell)
        self.oversight = MissionLimits(autopilot, settings, self._tell)
        self._next_tick_s = now_s = clock.now_s()
        log.begin(now_s, Mark.BEGIN)
        self._watchdogs = Watchdogs(settings.safety)
        self._whereabouts = LocalizationMonitor(settings.safety.jump_m, self._tell, self._start_afresh)
        self._errands = GoalRequests(mission, settings.safety, self._speaker.send, self._tell)
        self._legs = AutoModeLegs(self._tell)
        self._plan_watch = PlanWatch(mission.stored, autopilot.downloads, self._tell)
        self._stopped = False
        self._stop_asked = False
        tuned = (self._outbox, self._whereabouts, self._start_up)
        self._attendant = Attendant(settings, autopilot, self._tell, keep_settings, tuned)
        self._handover = Shutdown(autopilot, self._speaker.send)
        waits = (self._start_up, autopilot, self.oversight, self._reporter, self._teller)
        self._setting_out = SettingOut(*waits, self._speaker.send, self._hand_over)
        self._done = False

    @property
    def done(self) -> bool:
        """Whether the mission has ended, one way or another."""
        return self._done

    @property
    def evidence(self) -> EvidenceMap | None:
        """The map; None before the mission has begun."""
        return None if self._executor is None else self._executor.evidence

    @property
    def driver(self) -> GoalDriver | None:
        """Who drives; None before the mission has begun."""
        return None if self._executor is None else self._executor.driver

    @property
    def progress(self) -> MissionProgress | None:
        """Progress through the targets; None before the mission has begun."""
        return None if self._executor is None else self._executor.progress

    @property
    def origin(self) -> GeoPoint | None:
        """What map and targets count from, in metres; None before the mission has begun."""
        return None if self._executor is None else self._executor.layout.origin

    def save_map(self, path_without_suffix: Path) -> bool:
        """Write what has been mapped as a ROS map (.yaml and .pgm), its place in metres from home.

        False when the mission has not begun. Raises MapError when it cannot be written.
        """
        if self._executor is None:
            return False
        save_ros_map(from_home(self._executor.layout), path_without_suffix, known=known_fields(self._executor.evidence))
        return True

    def run(self, observe: Callable[[Status], None] = lambda status: None) -> Outcome:
        """Tick until the mission has ended."""
        while not self.done:
            self.tick()
            observe(self.status())
        return self.outcome

    def tick(self) -> None:
        """One round: sleep, listen and map, judge, decide and guide, speak."""
        now_s, late_s = self._sleep()
        began_s = stopwatch_s()
        self._listen(now_s)
        self._watchdogs.tick(now_s, late_s, planner_works=self._runner.working)
        self._settings = self._attendant.attend(self._executor, now_s)
        self.oversight.service(self.vehicle, now_s)
        if self._stop_asked and not self._handover.begun:
            self._log.mark(Mark.STOP)
            self._hand_over(now_s, "stopped by the user")
        if not self._handover.begun:
            self._act(now_s)
        elif self._handover.is_over(self.vehicle, now_s):
            self._done = True
        self._remember(now_s)
        self._tell_of_faults(now_s)
        self._autopilot.service(now_s)
        self.outcome.step_seconds.append(stopwatch_s() - began_s)

    def stop(self) -> None:
        """Ask for an orderly end at the next tick: the rover is stopped and put into HOLD. Safe in a signal handler."""
        self._stop_asked = True

    def close(self) -> None:
        """The way out after an error: a rover that is ours is stopped and put into HOLD before this returns."""
        if self._done or self._handover.begun:
            return
        now_s = self._clock.now_s()
        self._log.begin(now_s, Mark.CLOSE)
        self._hand_over(now_s, "error")
        while not self._handover.is_over(self.vehicle, now_s):
            now_s += 1.0 / self._settings.link.tick_hz
            self._clock.sleep_until_s(now_s)
            for event in self._autopilot.poll(now_s):
                self.vehicle = fold(self.vehicle, event)
            self._autopilot.service(now_s)
        self._done = True
        self._remember(now_s)

    def statuses(self) -> list[tuple[str, TargetStatus]]:
        """Every target's name and what has become of it so far."""
        return statuses_of(self._mission, self._executor)

    def status(self) -> Status:
        """A picture of this moment."""
        return status_of(self._clock.now_s(), self.vehicle, self._mission, self._executor, self._reporter)

    # Listening ---------------------------------------------------------------------------------------------------

    def _sleep(self) -> tuple[float, float]:
        """Until the round begins; in lock-step this moves the world. Returns the time, and how late it is."""
        self._next_tick_s += 1.0 / self._settings.link.tick_hz
        self._clock.sleep_until_s(self._next_tick_s)
        now_s = self._clock.now_s()
        late_s = now_s - self._next_tick_s
        if late_s > 1.0:
            # After a stall (a suspended computer) do not catch up tick by tick, and do not believe what piled up meanwhile.
            self._next_tick_s = now_s
            self._whereabouts.stalled(now_s)
        return now_s, late_s

    def _listen(self, now_s: float) -> None:
        """Everything that has come in since the last round."""
        self._reporter.news.clear()
        for event in newest_ranges(self._autopilot.poll(now_s)):
            self.vehicle = fold(self.vehicle, event)
            self._attendant.take(event)
            self._take_in(event)

    def _take_in(self, event: Event) -> None:
        """Scans go into the map; a position that jumps, or an origin that moves, makes the map worthless."""
        if isinstance(event, TextSeen) and event.severity <= WARNING:
            self._reporter.note(f"autopilot: {event.text}", event.severity)
        self._watchdogs.take_in(event, self.vehicle)
        self.oversight.take_in(event)
        self._plan_watch.take_in(event)
        if isinstance(event, TargetAsked):
            idle = self._executor is None or self._stopped or self._handover.begun
            self._errands.take_in(event, self.vehicle, self._executor, self._reporter.doing if idle else "")
        if self._executor is None:
            # At every heartbeat: a person may take the rover out of GUIDED within a tick of our having set it.
            self.watch = LatchState(latched(self.watch.control, self.vehicle))
            return
        if isinstance(event, RangeSeen) and self._watchdogs.scan_fits and not self._whereabouts.position_doubted:
            pose, attitude = self.vehicle.pose_at(event.time_s), self.vehicle.attitude
            if pose is not None and attitude is not None:
                self._executor.map_scan(pose, attitude.yaw_rate_rad_s, event.scan)
        self._whereabouts.take_in(event, self.vehicle, self._executor)

    # Judging -----------------------------------------------------------------------------------------------------

    def _act(self, now_s: float) -> None:
        """Judge who may drive and whether it is safe; then drive, stop, or be silent."""
        if self._executor is None:
            self._executor = self._begin(now_s)
            if self._executor is None:
                return
        if self._legs.follow(self.vehicle, self._executor):
            self._end(self._executor, now_s)
            return
        if self._whereabouts.must_ask(now_s):
            self._autopilot.ask_places()
        before = self.watch.control
        doubt = self._doubt(self._executor, now_s)
        self.watch, verdict = check(self.watch, self.vehicle, now_s, self._settings.safety, doubt)
        if verdict.reaction is not Reaction.DRIVE:
            self._refrain(verdict, before, now_s)
            return
        if self._stopped or before is not Control.COMPANION:
            self._start_afresh()
        self._stopped = False
        self._drive(self._executor, now_s)

    def _doubt(self, executor: MissionExecutor, now_s: float) -> str:
        """Why the rover must not be driven now, besides old data and modes; empty when it may."""
        doubt = self._whereabouts.reason(now_s) or self._watchdogs.reason
        return doubt or self.oversight.doubt(executor, self.vehicle.pose_at(now_s), now_s)

    def _refrain(self, verdict: Verdict, before: Control, now_s: float) -> None:
        """Stop, HOLD or silence. ``before``: who drove until now."""
        if not self._stopped:
            self._start_afresh()
        self._stopped = True
        self._reporter.doing = f"stopped: {verdict.reason}"
        match verdict.reaction:
            case Reaction.STOP:
                self._tell(f"Stopping: {verdict.reason}", WARNING)
                self._speaker.guide(STANDSTILL, now_s)
            case Reaction.HOLD:
                self._tell(f"HOLD: {verdict.reason}", WARNING)
                self._speaker.send(SetMode(RoverMode.HOLD), now_s)
            case _:
                if before is Control.COMPANION:
                    self._tell(f"Companion silent: {verdict.reason}", WARNING)
                if missing := awaited(self.vehicle, now_s, self._settings.safety):
                    self._reporter.doing = f"stopped: {verdict.reason}, waiting for {missing}"

    # Driving -----------------------------------------------------------------------------------------------------

    def _begin(self, now_s: float) -> MissionExecutor | None:
        """Once the rover may be driven, the mission on the map; until then whatever brings it there."""
        layout = self._setting_out.step(self.vehicle, self.watch.control, now_s)
        if layout is None:
            return None
        self._tell(f"Companion: {self._mission.name}, {len(layout.progress.targets)} targets", INFO)
        assert self.vehicle.scan is not None
        scan = (self.vehicle.scan_ahead or self.vehicle.scan).scan
        executor = MissionExecutor(
            self._mission, self._settings, layout, scan, self._runner, self._log, self._tell, self._rng
        )
        if self._memory is not None and self._memory.take_up(executor, self.vehicle, now_s):
            self._tell(f"Resumed {self._start_up.found}, {executor.reached} targets reached before", INFO)
        return executor

    def _drive(self, executor: MissionExecutor, now_s: float) -> None:
        """One tick on the way."""
        pose = self.vehicle.pose_at(now_s)
        assert pose is not None
        # Within AUTO the battery is for the autopilot's own failsafe: there is no way back inside a leg.
        if not self.vehicle.in_auto and (reason := self.oversight.broken_off(executor, pose, now_s)):
            self._hand_over(now_s, reason)
            return
        others = announced(self.vehicle, pose, self._mission.rover.radius_m, self._settings.traffic)
        executor.heed_latency(self.vehicle.latency_s)
        view = executor.view(pose, self.vehicle.speed_m_s)
        command = executor.drive(view, now_s, others)
        self._reporter.doing = executor.doing
        command = self._legs.guide(command, executor, self._settings.guidance.min_speed_m_s)
        if command is not None:
            self._speaker.guide(self.output_check.passed(command, view, executor.layout.bounds), now_s)
        else:
            self._end(executor, now_s)

    def _end(self, executor: MissionExecutor, now_s: float) -> None:
        """The mission is over, one way or another."""
        self.outcome.targets = executor.statuses()
        self._tell(f"Mission ended: {executor.reached} of {len(self.outcome.targets)} targets reached", INFO)
        self._hand_over(now_s, "done")

    def _start_afresh(self) -> None:
        """What was sent before counts for nothing, and the rover may be moved: the leg begins again where it then is."""
        self._outbox.reset()
        if self._executor is not None:
            self._executor.driver.leave()

    # Ending, and what outlasts the round -------------------------------------------------------------------------

    def _hand_over(self, now_s: float, why: str) -> None:
        """The run ends."""
        self._reporter.doing = why
        stopped = self._handover.begin(self.vehicle, self.watch.control, now_s, driven=self._executor is not None)
        if stopped and why != "done":
            self._tell(f"Companion: {why}, HOLD", WARNING)

    def _remember(self, now_s: float) -> None:
        """What this run would need to go on after a crash."""
        if self._memory is not None and self._executor is not None:
            left, doubted = self._handover.ours, self._whereabouts.position_doubted
            self._memory.note(now_s, self.vehicle, self.watch.control, self._executor, doubted, left, self._done)

    def _tell_of_faults(self, now_s: float) -> None:
        """What a person should know though it stops nothing."""
        problem = self._log.problem or (self._memory.heed_problem(self._log) if self._memory else "")
        ours, underway = self.watch.control is Control.COMPANION, self._executor is not None
        self._teller.of_faults(now_s, problem, heard=self.vehicle.heartbeat is not None, underway=underway, ours=ours)
