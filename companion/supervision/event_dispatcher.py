"""The event dispatcher: folds events into the vehicle's state and passes them to all that handle them.

Nouns: event dispatcher.
"""

from __future__ import annotations

from typing import Protocol

from companion.core.severity import Severity
from companion.executive.mission_run import LocatedScan, MissionRun
from companion.mavlink.autopilot_link import AutopilotLink
from companion.operator.notifications import Notifier
from companion.perception.scan_filter import newest_ranges
from companion.safety.watchdogs import ScanMonitor
from companion.supervision.localization_monitor import LocalizationMonitor
from companion.vehicle.events import Event, RangeSeen, TextSeen
from companion.vehicle.state import VehicleState, fold


class EventHandler(Protocol):
    """Takes events."""

    def take(self, event: Event, vehicle: VehicleState) -> None:
        """One more event, already folded into ``vehicle``."""
        ...


class EventDispatcher:
    """``handlers``: in this order."""

    def __init__(
        self,
        run: MissionRun,
        autopilot: AutopilotLink,
        notifier: Notifier,
        handlers: tuple[EventHandler, ...],
        scans: ScanMonitor,
        localization: LocalizationMonitor,
    ) -> None:
        self._run = run
        self._autopilot = autopilot
        self._notifier = notifier
        self._handlers = handlers
        self._scans = scans
        self._localization = localization

    def listen(self, now_s: float) -> list[LocatedScan]:
        """Dispatch everything that has come in since the last tick; return the scans that may go on the map."""
        self._notifier.news.clear()
        run, found = self._run, []
        for event in newest_ranges(self._autopilot.poll(now_s)):
            run.vehicle = fold(run.vehicle, event)
            self._note_text(event)
            for handler in self._handlers:
                handler.take(event, run.vehicle)
            if run.executor is not None and isinstance(event, RangeSeen):
                located = self._located(event)
                found += [] if located is None else [located]
        return found

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
