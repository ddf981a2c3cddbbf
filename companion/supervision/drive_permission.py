"""Drive permission: whether the rover may be driven in this tick, by the monitors and the mode latch, and why not.

Nouns: drive permission.
"""

from __future__ import annotations

from dataclasses import replace

from companion.core.severity import Severity, TextSink
from companion.executive.mission_run import MissionRun, Stop
from companion.safety.mode_latch import Control, LatchState, Reaction, Verdict, awaited, check, latched
from companion.safety.reasons import FOR_A_PERSON, Doubt, LatchReason, Reason, WaitReason
from companion.safety.watchdogs import Monitor, first_doubt
from companion.settings.live_settings import LiveSettings
from companion.vehicle.events import Event
from companion.vehicle.state import VehicleState


class DrivePermission:
    """``monitors``: in order of precedence. It alone writes the run's latch, and why the rover is not driven."""

    def __init__(
        self, run: MissionRun, monitors: tuple[Monitor, ...], settings: LiveSettings, notifier: TextSink
    ) -> None:
        self._run = run
        self._monitors = monitors
        self._settings = settings
        self._notifier = notifier

    def take(self, event: Event, vehicle: VehicleState) -> None:
        """Before the mission has begun the latch follows the mode with every event.

        A person may take the rover out of GUIDED within a tick of our having set it.
        """
        if self._run.executor is None:
            self._run.latch = LatchState(latched(self._run.latch.control, vehicle))

    def check(self, now_s: float) -> Verdict:
        """Ask the monitors and the latch. Why the rover is not driven is told here."""
        run, settings, before = self._run, self._settings.current.safety, self._run.latch.control
        doubt = first_doubt(self._monitors, now_s)
        run.latch, verdict = check(run.latch, run.vehicle, now_s, settings, doubt)
        if run.paused and verdict.reaction is Reaction.SILENT:
            verdict = replace(verdict, reason=Reason(LatchReason.PAUSED))
        elif verdict.reaction is Reaction.SILENT and _has_restarted(run.vehicle):
            verdict = replace(verdict, reason=Reason(LatchReason.RESTARTED))
        drives = verdict.reaction is Reaction.DRIVE
        changed = drives == run.stopped
        if changed or (drives and before is not Control.COMPANION):
            run.start_afresh()
        run.stop = None if drives else self._stop(verdict, now_s)
        run.held_for = None if drives else self._held_for(verdict, now_s)
        run.taken_over = not drives and (run.taken_over or _is_taken(verdict, before))
        if not drives:
            self._tell(verdict, before)
        return verdict

    def _held_for(self, verdict: Verdict, now_s: float) -> Reason[Doubt] | None:
        """Why HOLD was asked for: the first doubt; or that the autopilot is silent, which has led to all others."""
        run = self._run
        if verdict.reaction is Reaction.HOLD and verdict.reason is not None and isinstance(verdict.reason.kind, Doubt):
            return Reason(verdict.reason.kind, verdict.reason.figures)
        awaited, heartbeat = None if run.stop is None else run.stop.awaited, run.vehicle.heartbeat
        if run.held_for is None or run.held_for.kind is not Doubt.DATA_OLD or heartbeat is None or awaited is None:
            return run.held_for
        not_since = run.latch.hold_sent and heartbeat.time_s < run.latch.hold_s
        silent = not_since and awaited.kind is WaitReason.AUTOPILOT_HEARD
        return Reason(Doubt.DATA_OLD, ("autopilot", int(now_s - heartbeat.time_s))) if silent else run.held_for

    def _stop(self, verdict: Verdict, now_s: float) -> Stop:
        """What is awaited is of interest only once the companion is silent."""
        vehicle = self._run.vehicle
        if verdict.reaction is not Reaction.SILENT:
            return Stop(verdict.reason, None)
        waits = awaited(vehicle, now_s, self._settings.current.safety)
        if self._run.paused and waits is not None and waits.kind is WaitReason.PERSON_SETS_MODE:
            waits = Reason(WaitReason.REQUEST_TO_GO_ON, waits.figures)
        return Stop(verdict.reason, waits)

    def _tell(self, verdict: Verdict, before: Control) -> None:
        """``before``: who drove until now."""
        match verdict.reaction:
            case Reaction.STOP:
                self._notifier.tell(f"Stopping: {verdict.reason}", Severity.WARNING)
            case Reaction.HOLD:
                self._notifier.tell(f"HOLD: {verdict.reason}", Severity.WARNING)
            case _ if (
                before is Control.COMPANION and not self._run.paused
            ):  # a pause has been told when it was asked for
                to_do = _for_person(self._run.stop)
                self._notifier.tell(f"Companion no longer steers: {verdict.reason}{to_do}", Severity.WARNING)
            case _:
                pass


def _for_person(stop: Stop | None) -> str:
    """What a person is to do; not what data is awaited, which changes from tick to tick."""
    awaited = None if stop is None else stop.awaited
    person = awaited.figures[1] if awaited is not None and awaited.kind is WaitReason.GOOD_DATA_AND else awaited
    to_do = isinstance(person, Reason) and person.kind in FOR_A_PERSON
    return f"; it waits for {person}" if to_do else ""


def _has_restarted(vehicle: VehicleState) -> bool:
    """Whether the autopilot has restarted and disarmed the rover: that has led to everything else."""
    return vehicle.restarted and vehicle.heartbeat is not None and not vehicle.heartbeat.armed


def _is_taken(verdict: Verdict, before: Control) -> bool:
    """Whether somebody else changes the mode now. After a HOLD of its own the companion has not had the rover."""
    other = verdict.reason is not None and verdict.reason.kind is LatchReason.OTHER_MODE
    return other and verdict.reaction is Reaction.SILENT and before is Control.COMPANION
