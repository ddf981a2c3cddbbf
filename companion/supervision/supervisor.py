"""The supervisor: judges in each tick whether the rover may be driven; begins the mission and ends the run."""

from __future__ import annotations

from companion.checkpoint.checkpointer import Memory
from companion.core.clock import Clock, stopwatch_s
from companion.core.rounds import Mark
from companion.core.severity import Severity
from companion.executive.mission_executor import Task
from companion.executive.mission_run import MissionRun, Order
from companion.mavlink.autopilot_link import AutopilotLink
from companion.navigation.step_runner import StepRunner
from companion.operator.notifications import Notifier, Outcome
from companion.recording.recorder import DecisionLog
from companion.safety.mode_latch import Control, Reaction, Verdict, awaited, check
from companion.safety.reasons import Activity, EndReason, Reason, RunPhase
from companion.safety.watchdogs import LoopMonitor, Monitor, first_doubt
from companion.settings.live_settings import LiveSettings
from companion.supervision.arming import Arming
from companion.supervision.fence_monitor import FenceMonitor
from companion.supervision.localization_monitor import LocalizationMonitor
from companion.supervision.mission_limits import MissionLimits
from companion.supervision.shutdown import Shutdown

SILENT = Verdict(Reaction.SILENT)


class Pace:
    """Sleeps until the next round begins; in lock-step this moves the world."""

    def __init__(self, clock: Clock, settings: LiveSettings, localization: LocalizationMonitor) -> None:
        self.late_s = 0.0
        """How late this round is."""
        self._clock = clock
        self._settings = settings
        self._localization = localization
        self._next_tick_s = clock.now_s()
        self._began_s = stopwatch_s()

    @property
    def elapsed_s(self) -> float:
        """How long this round has taken so far, by the computer's own stopwatch."""
        return stopwatch_s() - self._began_s

    def sleep(self) -> float:
        """Returns the time."""
        self._next_tick_s += 1.0 / self._settings.current.link.tick_hz
        self._clock.sleep_until_s(self._next_tick_s)
        now_s = self._clock.now_s()
        self.late_s = now_s - self._next_tick_s
        if self.late_s > 1.0:
            # After a stall (a suspended computer) do not catch up tick by tick, nor believe what piled up meanwhile.
            self._next_tick_s = now_s
            self._localization.stalled(now_s)
        self._began_s = stopwatch_s()
        return now_s


class Supervisor:
    """``monitors``: in order of precedence. ``done`` when the run is over."""

    def __init__(
        self,
        run: MissionRun,
        monitors: tuple[Monitor, ...],
        *,
        pace: Pace,
        loop: LoopMonitor,
        localization: LocalizationMonitor,
        fences: FenceMonitor,
        limits: MissionLimits,
        arming: Arming,
        shutdown: Shutdown,
        autopilot: AutopilotLink,
        runner: StepRunner,
        settings: LiveSettings,
        log: DecisionLog,
        notifier: Notifier,
        outcome: Outcome,
        memory: Memory | None,
    ) -> None:
        self.done = False
        self._outcome = outcome
        self._run = run
        self._monitors = monitors
        self._pace = pace
        self._loop = loop
        self._localization = localization
        self._fences = fences
        self._limits = limits
        self._arming = arming
        self._shutdown = shutdown
        self._autopilot = autopilot
        self._runner = runner
        self._settings = settings
        self._log = log
        self._notifier = notifier
        self._memory = memory
        self._stop_asked = False

    def stop(self) -> None:
        """Ask for an orderly end at the next tick. Safe in a signal handler."""
        self._stop_asked = True

    def judge(self, now_s: float) -> Verdict:
        """What the rover may do in this tick. Silent before the mission has begun and while the run ends."""
        self._loop.tick(now_s, self._pace.late_s, planner_works=self._runner.working)
        self._fences.service(self._run.vehicle, now_s)
        if self._stop_asked and self._run.end is None:
            self._log.mark(Mark.STOP)
            self._shutdown.begin(Reason(EndReason.STOPPED_BY_USER), now_s)
        if self._run.end is not None:
            self.done = self.done or self._shutdown.is_over(now_s)
            return SILENT
        if self._run.executor is None:
            self._try_to_begin(now_s)
        if self._run.executor is None:
            return SILENT
        if self._run.legs.follow(self._run.vehicle, self._run.executor):
            self._conclude(now_s)
            return SILENT
        if self._localization.must_ask(now_s):
            self._autopilot.ask_places()
        self._run.executor.heed_fence(self._fences.fence)
        verdict = self._weigh(now_s)
        if verdict.reaction is Reaction.DRIVE and (reason := self._limits.enforce(now_s)) is not None:
            self._shutdown.begin(Reason(EndReason.BATTERY, (reason,)), now_s)
            return SILENT
        return verdict

    def _conclude(self, now_s: float) -> None:
        """The mission has ended, one way or another: say so, and end the run."""
        executor = self._run.executor
        assert executor is not None
        self._outcome.targets = executor.statuses()
        text = f"Mission ended: {executor.reached} of {len(executor.progress.targets)} targets reached"
        self._notifier.tell(text, Severity.INFO)
        self._shutdown.begin(Reason(EndReason.DONE), now_s)

    def close(self, clock: Clock) -> None:
        """The way out after an error: a rover that is ours is stopped and put into HOLD before this returns."""
        if self.done or self._run.end is not None:
            return
        now_s = clock.now_s()
        self._log.begin(now_s, Mark.CLOSE)
        self._shutdown.begin(Reason(EndReason.ERROR), now_s)
        now_s = self._shutdown.wait(clock, now_s, 1.0 / self._settings.current.link.tick_hz)
        self.done = True
        self._keep(now_s)

    def record(self, task: Task | Order, now_s: float) -> None:
        """End the run if the mission has ended; keep what it would need to go on after a crash, and tell of faults."""
        if task is Task.END:
            self._conclude(now_s)
        self._keep(now_s)
        problem = self._log.problem or (self._memory.heed_problem(self._log) if self._memory else "")
        self._notifier.tell_faults(self._run, now_s, problem)

    def _keep(self, now_s: float) -> None:
        """What this run would need to go on after a crash."""
        run = self._run
        if self._memory is not None and run.executor is not None:
            left, doubted = self._shutdown.stopped_ours, self._localization.position_doubted
            self._memory.note(now_s, run.vehicle, run.latch.control, run.executor, doubted, left, self.done)

    def _try_to_begin(self, now_s: float) -> None:
        """Once the rover may be driven, begin the mission; until then do whatever brings it there."""
        if (reason := self._arming.must_end(now_s)) is not None:
            self._shutdown.begin(Reason(EndReason.BATTERY, (reason,)), now_s)
            return
        cleared = self._arming.step(now_s)
        if cleared is None:
            return
        text = f"Companion: {self._run.mission.name}, {len(cleared.progress.targets)} targets"
        self._notifier.tell(text, Severity.INFO)
        executor = self._run.begin(cleared.layout, cleared.progress)
        if self._memory is not None and self._memory.take_up(executor, self._run.vehicle, now_s):
            text = f"Resumed {cleared.found}, {executor.reached} targets reached before"
            self._notifier.tell(text, Severity.INFO)

    def _weigh(self, now_s: float) -> Verdict:
        """Walk the monitors and ask the latch."""
        run, settings, before = self._run, self._settings.current.safety, self._run.latch.control
        doubt = first_doubt(self._monitors, now_s)
        run.latch, verdict = check(run.latch, run.vehicle, now_s, settings, doubt)
        drives = verdict.reaction is Reaction.DRIVE
        if drives == run.stopped or (drives and before is not Control.COMPANION):
            run.start_afresh()
        run.stopped = not drives
        if not drives:
            self._tell(verdict, before, now_s)
        return verdict

    def _tell(self, verdict: Verdict, before: Control, now_s: float) -> None:
        """Why the rover is not driven. ``before``: who drove until now."""
        run, reason = self._run, verdict.reason
        run.activity = Activity(RunPhase.STOPPED, reason)
        match verdict.reaction:
            case Reaction.STOP:
                self._notifier.tell(f"Stopping: {reason}", Severity.WARNING)
            case Reaction.HOLD:
                self._notifier.tell(f"HOLD: {reason}", Severity.WARNING)
            case _:
                if before is Control.COMPANION:
                    self._notifier.tell(f"Companion silent: {reason}", Severity.WARNING)
                if (missing := awaited(run.vehicle, now_s, self._settings.current.safety)) is not None:
                    run.activity = Activity(RunPhase.STOPPED_AND_WAITING, reason, missing)
