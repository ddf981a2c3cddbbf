"""The listener: folds events into the vehicle's state, passes them to all that take them, and answers operators.

Nouns: listener.
"""

from __future__ import annotations

from typing import Protocol

from companion.core.severity import Severity
from companion.executive.mission_run import LocatedScan, MissionRun
from companion.mavlink.autopilot_link import AutopilotLink
from companion.operator.figures import Telemetry
from companion.operator.notifications import Notifier
from companion.operator.parameter_server import ParameterServer
from companion.perception.scan_filter import newest_ranges
from companion.safety.mode_latch import LatchState, latched
from companion.safety.watchdogs import ScanMonitor
from companion.supervision.localization_monitor import LocalizationMonitor
from companion.vehicle.events import (
    Event,
    RangeSeen,
    TextSeen,
)
from companion.vehicle.state import VehicleState, fold


class Takes(Protocol):
    """Listens to events."""

    def take(self, event: Event, vehicle: VehicleState) -> None:
        """One more event, already folded into ``vehicle``."""
        ...


class Listener:
    """``listening``: the monitors and all others that take events, in this order."""

    def __init__(
        self,
        run: MissionRun,
        autopilot: AutopilotLink,
        notifier: Notifier,
        parameters: ParameterServer,
        telemetry: Telemetry,
        listening: tuple[Takes, ...],
        scans: ScanMonitor,
        localization: LocalizationMonitor,
    ) -> None:
        self._run = run
        self._autopilot = autopilot
        self._notifier = notifier
        self._parameters = parameters
        self._telemetry = telemetry
        self._listening = listening
        self._scans = scans
        self._localization = localization

    def listen(self, now_s: float) -> list[LocatedScan]:
        """Everything that has come in since the last round; the scans that may go on the map are returned."""
        self._notifier.news.clear()
        run, found = self._run, []
        for event in newest_ranges(self._autopilot.poll(now_s)):
            run.vehicle = fold(run.vehicle, event)
            self._parameters.take(event, run.vehicle)
            self._note_text(event)
            for one in self._listening:
                one.take(event, run.vehicle)
            if run.executor is None:
                # At every heartbeat: a person may take the rover out of GUIDED within a tick of our having set it.
                run.latch = LatchState(latched(run.latch.control, run.vehicle))
            elif isinstance(event, RangeSeen) and (scan := self._located(event)) is not None:
                found.append(scan)
        return found

    def answer(self, now_s: float) -> None:
        """What ground stations have asked for, and figures for them to plot."""
        for command in (*self._parameters.due(now_s), *self._telemetry.due(self._run.executor, now_s)):
            self._autopilot.send(command, now_s)

    def _note_text(self, event: Event) -> None:
        """The autopilot's own warnings are shown where the companion runs."""
        if isinstance(event, TextSeen) and event.severity <= Severity.WARNING:
            self._notifier.note(f"autopilot: {event.text}", Severity(event.severity))

    def _located(self, event: RangeSeen) -> LocatedScan | None:
        """The scan where it was taken; None when that is doubtful."""
        if not self._scans.fits or self._localization.position_doubted:
            return None
        pose, attitude = self._run.vehicle.pose_at(event.time_s), self._run.vehicle.attitude
        if pose is None or attitude is None:
            return None
        return LocatedScan(pose, attitude.yaw_rate_rad_s, event.scan)
