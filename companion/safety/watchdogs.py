"""Watchdogs: monitors of the sticks, the age of data, the companion's own loop and repeated scans.

Nouns: watchdog, monitor.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable
from typing import Protocol

from companion.perception.scan_filter import ScanWatch
from companion.safety.reasons import WAITED_OUT, Doubt, Reason
from companion.settings import SafetySettings
from companion.settings.live_settings import LiveSettings
from companion.vehicle.events import (
    Event,
    RangeSeen,
)
from companion.vehicle.state import VehicleState

LATE_S = 0.1
"""A tick that begins this much after its time is late: two whole ticks at 20 Hz."""
WINDOW_S = 4.0
LATE_SHARE = 0.5
"""Late for more than this share of the window, the computer is too slow, or busy."""
STALL_S = 1.0
"""A tick that is later than this ends a stall. No stall counts for more, however long it was: a computer that was
suspended is not slow."""
SETTLE_S = 0.4
"""What piled up during a stall is not believed until this much later."""


class Monitor:
    """Watches one thing that must be well while the rover moves. A monitor overrides what concerns it.

    The order of the calls: ``take`` for each event that came in, ``tick`` once in every tick, then ``doubt``.
    """

    def take(self, event: Event, vehicle: VehicleState) -> None:
        """One more event, already folded into ``vehicle``."""

    def tick(self, now_s: float) -> None:
        """A tick of the companion: keep up with what does not come as an event."""

    def doubt(self, now_s: float) -> Reason[Doubt] | None:
        """Why the rover must not move now; None when it may."""
        return None


class Loop(Protocol):
    """The companion's own loop."""

    @property
    def late_s(self) -> float:
        """How late the present tick began."""
        ...


class Worker(Protocol):
    """What computes the navigator's steps."""

    @property
    def working(self) -> bool:
        """Whether a step is being computed beside the loop."""
        ...


def first_doubt(monitors: Iterable[Monitor], now_s: float) -> Reason[Doubt] | None:
    """The doubt of the first monitor that has one: their order is the order of precedence.

    One that is waited out comes after all others: it must not keep HOLD from the rover for their sake.
    """
    waited: Reason[Doubt] | None = None
    for monitor in monitors:
        doubt = monitor.doubt(now_s)
        if doubt is not None and doubt.kind not in WAITED_OUT:
            return doubt
        waited = waited or doubt
    return waited


class SticksMonitor(Monitor):
    """The pilot's sticks: a person who moves them wants the rover."""

    def __init__(self) -> None:
        self._moved = False

    def take(self, event: Event, vehicle: VehicleState) -> None:
        """One more event."""
        self._moved = vehicle.sticks.moved

    def doubt(self, now_s: float) -> Reason[Doubt] | None:
        """Whether they were moved since a person set our mode."""
        return Reason(Doubt.STICKS_MOVED) if self._moved else None


class DataMonitor(Monitor):
    """What the autopilot and the sensors tell: its age, and whether it agrees with itself."""

    def __init__(self, settings: LiveSettings) -> None:
        self._settings = settings
        self._vehicle = VehicleState()

    def take(self, event: Event, vehicle: VehicleState) -> None:
        """One more event."""
        self._vehicle = vehicle

    def doubt(self, now_s: float) -> Reason[Doubt] | None:
        """What is missing, old or contradictory. The latter is over when a person sets GUIDED."""
        if (doubt := data_doubt(self._vehicle, now_s, self._settings.current.safety)) is not None:
            return doubt
        if self._vehicle.restarted:
            return Reason(Doubt.AUTOPILOT_RESTARTED)
        return Reason(Doubt.POSITION_FROZEN) if self._vehicle.frozen else None


def data_doubt(vehicle: VehicleState, now_s: float, settings: SafetySettings) -> Reason[Doubt] | None:
    """What is missing, old or wrong in the data itself, so that nobody may drive on it; None when it is good."""
    ages = (
        ("autopilot heartbeat", vehicle.heartbeat, settings.heartbeat_s),
        ("position", vehicle.position, settings.stale_s),
        ("attitude", vehicle.attitude, settings.stale_s),
        ("range data ahead", vehicle.scan_ahead, settings.stale_s),
        ("EKF status", vehicle.ekf, settings.stale_s),
    )
    for name, event, limit_s in ages:
        if event is None:
            return Reason(Doubt.DATA_MISSING, (name,))
        if now_s - event.time_s > limit_s:
            return Reason(Doubt.DATA_OLD, (name, limit_s))
    if vehicle.ekf_lacks is not None:
        return Reason(Doubt.EKF_INCOMPLETE, (vehicle.ekf_lacks.value,))
    if now_s - vehicle.latency.jumped_s < settings.settle_s:
        return Reason(Doubt.CLOCK_JUMPED)
    if vehicle.latency.lasting_s > settings.latency_s:
        return Reason(Doubt.LINK_LATE, (settings.latency_s,))
    return None


class LoopMonitor(Monitor):
    """The companion's own work: a loop that stood still or is late again and again, a navigator's step without an end.

    All times are the companion's clock. ``planner_s``: how long a step may take.
    """

    def __init__(self, loop: Loop, worker: Worker, planner_s: float) -> None:
        self._loop = loop
        self._worker = worker
        self._planner_s = planner_s
        self._ticks: deque[tuple[float, float]] = deque()
        self._late_s = 0.0
        self._before_s: float | None = None
        self._works_since_s: float | None = None
        self._planning_long = False
        self._settled_s = -math.inf

    def tick(self, now_s: float) -> None:
        """How late is it, and is a step being computed?"""
        late_s, works = self._loop.late_s, self._worker.working
        if late_s > STALL_S:
            self._settled_s = now_s + SETTLE_S
        elapsed_s = now_s - (now_s if self._before_s is None else self._before_s)
        self._before_s = now_s
        self._note(now_s, min(elapsed_s, STALL_S) if late_s > LATE_S else 0.0)
        since_s = now_s if self._works_since_s is None else self._works_since_s
        self._works_since_s = since_s if works else None
        self._planning_long = works and now_s - since_s > self._planner_s

    def doubt(self, now_s: float) -> Reason[Doubt] | None:
        """As of the last ``tick``."""
        if now_s < self._settled_s:
            return Reason(Doubt.LOOP_STOOD_STILL)
        if self._planning_long:
            return Reason(Doubt.PLANNING_LONG, (self._planner_s,))
        return Reason(Doubt.LOOP_LATE) if self._late_s > LATE_SHARE * WINDOW_S else None

    def _note(self, now_s: float, late_s: float) -> None:
        self._ticks.append((now_s, late_s))
        self._late_s += late_s
        while self._ticks[0][0] < now_s - WINDOW_S:
            self._late_s -= self._ticks.popleft()[1]


class ScanMonitor(Monitor):
    """The range sensors: whether one repeats itself although the rover moves."""

    def __init__(self) -> None:
        self._watch = ScanWatch()
        self.fits = True
        """Whether the newest scan belongs where the rover is now, so that it may go on the map."""

    def take(self, event: Event, vehicle: VehicleState) -> None:
        """One more event."""
        if isinstance(event, RangeSeen):
            self.fits = self._watch.take(event.scan, vehicle)

    def doubt(self, now_s: float) -> Reason[Doubt] | None:
        """Why the range data cannot be believed."""
        sensor = self._watch.repeating
        return Reason(Doubt.SCAN_REPEATED, (sensor,)) if sensor is not None else None
