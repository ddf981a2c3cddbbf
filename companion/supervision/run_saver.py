"""The run saver: saves in each tick what the run would need to go on after a crash; resumes an earlier run.

Nouns: run saver.
"""

from __future__ import annotations

from companion.checkpoint.checkpointer import Checkpointer, RunMoment
from companion.core.tick_marks import Mark
from companion.executive.mission_executor import MissionExecutor
from companion.executive.mission_run import MissionRun
from companion.recording.recorder import RunLog
from companion.supervision.localization_monitor import LocalizationMonitor
from companion.supervision.shutdown import Shutdown


class RunSaver:
    """``checkpointer``: None where nothing is saved."""

    def __init__(
        self,
        run: MissionRun,
        checkpointer: Checkpointer | None,
        log: RunLog,
        localization: LocalizationMonitor,
        shutdown: Shutdown,
    ) -> None:
        self._run = run
        self._checkpointer = checkpointer
        self._log = log
        self._localization = localization
        self._shutdown = shutdown

    def note_problems(self) -> tuple[str, ...]:
        """What is wrong with the record and with the state file, for people. Noted in the record."""
        unsaved = self._checkpointer.problem_text(self._log) if self._checkpointer else ""
        return tuple(filter(None, (self._log.problem, unsaved)))

    def resume(self, executor: MissionExecutor, now_s: float) -> bool:
        """Go on in the middle of the leg of an earlier run; False when there is none to take up."""
        return self._checkpointer is not None and self._checkpointer.resume(executor, self._run.vehicle, now_s)

    def save(self, now_s: float, *, done: bool) -> None:
        """Save what this run would need to go on. ``done``: this is the last tick."""
        run = self._run
        if self._checkpointer is not None and run.executor is not None:
            released, doubted = self._shutdown.stopped_ours, self._localization.position_doubted
            control = run.latch.control
            moment = RunMoment(now_s, run.vehicle, control, run.executor, doubted, released=released, done=done)
            self._checkpointer.update(moment)
        if run.executor is not None:
            self._let_commands_go(run.executor)

    def _let_commands_go(self, executor: MissionExecutor) -> None:
        """A command goes out once the saved state says that it may have been sent."""
        progress = executor.progress
        if not executor.command_sender.awaits_save(progress.commands):
            return
        if self._checkpointer is None or self._checkpointer.holds(progress):
            self._log.mark(Mark.SAVED)
            executor.command_sender.saved()
