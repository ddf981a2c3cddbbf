"""The judge: walks the monitors and asks the mode latch whether the rover may be driven, and tells why not."""

from __future__ import annotations

from companion.core.severity import Severity, TextSink
from companion.executive.mission_run import MissionRun
from companion.safety.mode_latch import Control, Reaction, Verdict, awaited, check
from companion.safety.reasons import Activity, RunPhase
from companion.safety.watchdogs import Monitor, first_doubt
from companion.settings.live_settings import LiveSettings


class Judge:
    """``monitors``: in order of precedence."""

    def __init__(
        self, run: MissionRun, monitors: tuple[Monitor, ...], settings: LiveSettings, notifier: TextSink
    ) -> None:
        self._run = run
        self._monitors = monitors
        self._settings = settings
        self._notifier = notifier

    def judge(self, now_s: float) -> Verdict:
        """Walk the monitors and ask the latch; what is said of it is told here."""
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
