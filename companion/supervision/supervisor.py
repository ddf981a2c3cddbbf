"""The supervisor: takes a run from arming through the mission to its shutdown; says whether the rover may drive.

Nouns: supervisor.
"""

from __future__ import annotations

from companion.core.clock import Clock
from companion.core.severity import Severity
from companion.core.tick_marks import Mark
from companion.executive.command_report import commands_done
from companion.executive.mission_executor import MissionTask
from companion.executive.mission_run import MissionRun, Order
from companion.operator.notifications import Notifier, Outcome
from companion.recording.recorder import RunLog
from companion.safety.mode_latch import Reaction, Verdict
from companion.safety.reasons import EndReason, Parting, Reason
from companion.safety.watchdogs import Monitor
from companion.supervision.arming import Arming
from companion.supervision.drive_permission import DrivePermission
from companion.supervision.mission_limits import MissionLimits
from companion.supervision.run_saver import RunSaver
from companion.supervision.shutdown import Shutdown

SILENT = Verdict(Reaction.SILENT)


class Supervisor:
    """``done`` when the run is over."""

    def __init__(
        self,
        run: MissionRun,
        permission: DrivePermission,
        arming: Arming,
        limits: MissionLimits,
        shutdown: Shutdown,
        *,
        monitors: tuple[Monitor, ...],
        saver: RunSaver,
        log: RunLog,
        notifier: Notifier,
        outcome: Outcome,
    ) -> None:
        self.done = False
        self._run = run
        self._permission = permission
        self._arming = arming
        self._limits = limits
        self._shutdown = shutdown
        self._monitors = monitors
        self._saver = saver
        self._log = log
        self._notifier = notifier
        self._outcome = outcome
        self._stop_asked: EndReason | None = None

    def stop(self, why: EndReason) -> None:
        """Ask for an orderly end at the next tick. Safe in a signal handler."""
        self._stop_asked = why

    def supervise(self, now_s: float) -> Verdict:
        """Go on with arming, mission or shutdown, whichever it is, and say what the rover may do in this tick.

        Silent before the mission has begun and while the run ends.
        """
        for monitor in self._monitors:
            monitor.tick(now_s)
        if self._stop_asked is not None and self._run.end is None:
            self._log.mark(Mark.STOP)
            if self._stop_asked is EndReason.TERMINATED:
                self._log.mark(Mark.TERMINATED)
            figures = (str(self._run.activity),) if self._stop_asked is EndReason.NEVER_BEGINS else ()
            self._shutdown.begin(Reason(self._stop_asked, figures), now_s)
        if self._run.end is not None:
            self.done = self.done or self._shutdown.is_over(now_s)
            return SILENT
        if self._run.executor is None:
            self._try_to_begin(now_s)
        if self._run.executor is None:
            return SILENT
        if self._run.legs.follow(self._run.vehicle, self._run.executor):
            self._end_mission(now_s)
            return SILENT
        return self._mission_verdict(now_s)

    def conclude(self, task: MissionTask | Order, now_s: float) -> None:
        """The end of a tick: end the run if the mission has ended, save the run's state, and tell of faults."""
        if task is MissionTask.END:
            self._end_mission(now_s)
        self._saver.save(now_s, done=self.done)
        self._notifier.tell_faults(self._run, now_s, self._saver.note_problems())

    def close(self, clock: Clock) -> None:
        """The way out after an error: a rover that is ours is stopped and put into HOLD before this returns."""
        if self.done or self._run.end is not None:
            return
        now_s = clock.now_s()
        self._log.begin(now_s, Mark.CLOSE)
        self._shutdown.begin(Reason(EndReason.ERROR), now_s)
        now_s = self._shutdown.wait(clock, now_s)
        self.done = True
        self._saver.save(now_s, done=True)

    def parting(self, now_s: float) -> Reason[Parting] | None:
        """How the rover is left when the run ends."""
        return self._shutdown.parting(now_s)

    def _mission_verdict(self, now_s: float) -> Verdict:
        self._limits.heed_fence()
        verdict = self._permission.check(now_s)
        if verdict.reaction is Reaction.DRIVE and (reason := self._limits.enforce(now_s)) is not None:
            self._shutdown.begin(Reason(EndReason.BATTERY, (reason,)), now_s)
            return SILENT
        return verdict

    def _try_to_begin(self, now_s: float) -> None:
        """Once the rover may be driven, begin the mission; until then do whatever brings it there."""
        if (reason := self._arming.must_end(now_s)) is not None:
            self._shutdown.begin(Reason(EndReason.BATTERY, (reason,)), now_s)
            return
        cleared = self._arming.step(now_s)
        if cleared is None:
            return
        count = len(cleared.progress.targets)
        text = f"Companion: {self._run.mission.name}, {count} target{'s' * (count != 1)}"
        self._notifier.tell(text, Severity.INFO)
        executor = self._run.begin(cleared.layout, cleared.progress, now_s)
        if self._saver.resume(executor, now_s):
            text = f"Resumed {cleared.found}, {executor.reached} targets reached before"
            self._notifier.tell(text, Severity.INFO)

    def _end_mission(self, now_s: float) -> None:
        """The mission has ended, one way or another: say so, and end the run."""
        executor = self._run.executor
        assert executor is not None
        self._outcome.targets, self._outcome.missed = executor.statuses(), executor.progress.missed
        text = f"Mission ended: {executor.reached} of {len(executor.progress.targets)} targets reached"
        done = commands_done(self._run.mission, executor.progress.commands)
        self._notifier.tell(f"{text}; commands: {done}" if done else text, Severity.INFO)
        self._shutdown.begin(Reason(EndReason.DONE), now_s)
