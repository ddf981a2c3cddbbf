"""The event dispatcher: folds events into the vehicle's state and passes them to all that handle them.

Nouns: event dispatcher.
"""

from __future__ import annotations

from collections import deque
from dataclasses import replace
from typing import Protocol

from companion.core.scan import WIRED, RangeScan
from companion.core.severity import Severity
from companion.executive.mission_executor import MissionExecutor
from companion.executive.mission_run import LocatedScan, MissionRun
from companion.lidar.reader import Lidars
from companion.mavlink.autopilot_link import AutopilotLink
from companion.operator.notifications import Notifier
from companion.perception.deskew import deskewed
from companion.perception.range_age import RangeAges
from companion.perception.scan_filter import NEAREST_OF_ALL, Sensor, newest_ranges, sensor_of
from companion.safety.watchdogs import ScanMonitor, data_doubt
from companion.settings.live_settings import LiveSettings
from companion.supervision.localization_monitor import LocalizationMonitor
from companion.vehicle.events import Event, RangeSeen, TextSeen
from companion.vehicle.state import VehicleState, fold

KEPT = 5
"""So many of the newest scans make the map anew once their age is known."""
TOLD_ANEW_S = 0.04
"""An age of ranges is told again when it has changed by so much."""
FRESH_S = 0.3
"""Position and heading that are older say nothing about the age of ranges: a rover whose autopilot has just fallen
silent has stopped turning, but its last turn rate stands still."""
OLD_S = 0.3
"""What moves, and what comes into view late, is seen later than the rover counts on."""


class EventHandler(Protocol):
    """Takes events."""

    def take(self, event: Event, vehicle: VehicleState) -> None:
        """One more event, already folded into ``vehicle``."""
        ...


class Heard:
    """All that the companion hears: over the link, and from lidars of its own."""

    def __init__(self, autopilot: AutopilotLink, lidars: Lidars) -> None:
        self._autopilot = autopilot
        self._lidars = lidars

    def poll(self, now_s: float) -> list[Event]:
        """The events since the last call. RANGEFINDER is the last resort: beside a lidar it is left out."""
        events = self._autopilot.poll(now_s)
        if not self._lidars.readers:
            return events
        return [*filter(_is_no_last_resort, events), *self._lidars.poll(now_s)]


def _is_no_last_resort(event: Event) -> bool:
    return not isinstance(event, RangeSeen) or event.scan.source != NEAREST_OF_ALL


class EventDispatcher:
    """``handlers``: in this order."""

    def __init__(
        self,
        run: MissionRun,
        heard: Heard,
        notifier: Notifier,
        handlers: tuple[EventHandler, ...],
        scans: ScanMonitor,
        localization: LocalizationMonitor,
        settings: LiveSettings,
    ) -> None:
        self._run = run
        self._heard = heard
        self._notifier = notifier
        self._handlers = handlers
        self._scans = scans
        self._localization = localization
        self._settings = settings
        self._told_s: dict[Sensor, float] = {}
        self._newest: deque[LocatedScan] = deque(maxlen=KEPT)

    def listen(self, now_s: float) -> list[LocatedScan]:
        """Dispatch everything that has come in since the last tick; return the scans that may go on the map."""
        self._notifier.news.clear()
        run, found = self._run, []
        for event in newest_ranges(self._heard.poll(now_s)):
            run.vehicle = fold(run.vehicle, event)
            if run.executor is not None:
                run.executor.range_ages.hear(run.vehicle)
            self._note_text(event)
            for handler in self._handlers:
                handler.take(event, run.vehicle)
            if run.executor is not None and isinstance(event, RangeSeen):
                found += self._located(event, now_s, run.executor)
        return found

    def _note_text(self, event: Event) -> None:
        """The autopilot's own warnings are shown where the companion runs."""
        if isinstance(event, TextSeen) and event.severity <= Severity.WARNING:
            self._notifier.note(f"autopilot: {event.text}", Severity(event.severity))

    def _located(self, event: RangeSeen, now_s: float, executor: MissionExecutor) -> list[LocatedScan]:
        """The scan where it was taken; none when that is doubtful.

        One whose readings have ages is brought to the rover's place of now. One over MAVLink has the age of the
        settings, or that which was found, and lies where the rover was then. What was mapped before it was found lies
        aside: so the map is forgotten, and begins anew with the newest scans, as one alone leaves gaps. The rover does
        not stand for that: it was about to turn past something, perhaps.
        """
        if not self._scans.fits or self._localization.position_doubted:
            return []
        vehicle = self._run.vehicle
        if event.scan.age_s is not None:
            event = RangeSeen(now_s, replace(event.scan, age_s=event.scan.age_s + (now_s - event.time_s)))
        scan, attitude = event.scan, vehicle.attitude
        pose = vehicle.pose_at(vehicle.seen_s(event))
        if pose is None or attitude is None:
            return []
        forward_m_s, rate_rad_s = vehicle.forward_m_s, attitude.yaw_rate_rad_s
        now = LocatedScan(pose, rate_rad_s, deskewed(scan, forward_m_s, rate_rad_s))
        if scan.sender == WIRED or scan.age_s is not None:
            return [now]
        ages, located = executor.range_ages, [now]
        age_s, just_found = self._age_s(scan, now, ages)
        if just_found:
            executor.forget_map(now_s)
            located = [*(one for one in self._newest if sensor_of(one.scan) == sensor_of(scan)), now]
        self._newest.append(now)
        if age_s == 0.0:
            return located
        return [replace(one, pose=ages.before(one.pose, age_s, forward_m_s)) for one in located]

    def _age_s(self, scan: RangeScan, came: LocatedScan, ages: RangeAges) -> tuple[float, bool]:
        """How old the ranges are, over MAVLink, and whether that has just been found; told, also when it changes.

        ``came``: where the rover was when it came.
        """
        set_s = self._settings.current.mapping.range_age_s
        if set_s is not None:
            return set_s, False
        vehicle = self._run.vehicle
        if self._is_known_now(vehicle, scan.time_s):
            ages.note(scan, came.pose, vehicle.forward_m_s, came.yaw_rate_rad_s)
        age_s = ages.age_s(scan)
        sensor = sensor_of(scan)
        goes_on, before_s = sensor not in self._told_s, self._told_s.setdefault(sensor, 0.0)
        changes = abs(age_s - before_s) >= TOLD_ANEW_S
        if changes:
            self._told_s[sensor] = age_s
            severity = Severity.WARNING if age_s > OLD_S else Severity.NOTICE
            how = f"{age_s:.2f} s older than" if age_s > 0.0 else "as old as"
            self._notifier.tell(f"Ranges ({scan.source}) are {how} positions", severity)
        return age_s, changes and before_s == 0.0 and not goes_on  # an earlier run had laid its map with it

    def _is_known_now(self, vehicle: VehicleState, now_s: float) -> bool:
        """Whether position and heading are of now, and good."""
        assert vehicle.position is not None and vehicle.attitude is not None
        fresh = min(vehicle.position.time_s, vehicle.attitude.time_s) >= now_s - FRESH_S
        return fresh and data_doubt(vehicle, now_s, self._settings.current.safety) is None
