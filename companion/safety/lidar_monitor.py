"""Lidar monitor: the lidars that are wired to the companion, each of which must be heard, and must see.

A sensor on the autopilot's network may come and go. A lidar that a person gave on the command line is one that the
rover needs, also if another one still looks ahead. One whose
readings are all unknown, as those of a lidar without any echo, is as good as silent.

Nouns: lidar monitor.
"""

from __future__ import annotations

import math

from companion.core.scan import WIRED
from companion.safety.reasons import Doubt, Reason
from companion.safety.watchdogs import Monitor
from companion.settings.live_settings import LiveSettings
from companion.vehicle.events import Event, RangeSeen
from companion.vehicle.state import VehicleState

LATE_S = 0.3
"""By its own clock: the scan no longer fits the place where it is put on the map."""


class LidarMonitor(Monitor):
    """``names``: as the scans of the lidars bear them."""

    def __init__(self, names: tuple[str, ...], settings: LiveSettings) -> None:
        self._settings = settings
        self._heard_s: dict[str, float | None] = dict.fromkeys(names)
        self._on_time_s: dict[str, float] = dict.fromkeys(names, -math.inf)
        self._saw_s: dict[str, float] = dict.fromkeys(names, -math.inf)

    def take(self, event: Event, vehicle: VehicleState) -> None:
        """One more event."""
        if isinstance(event, RangeSeen) and event.scan.sender == WIRED:
            self._heard_s[event.scan.source] = event.time_s
            if (event.scan.late_s or 0.0) <= LATE_S:
                self._on_time_s[event.scan.source] = event.time_s
            if event.scan.tells:
                self._saw_s[event.scan.source] = event.time_s

    def doubt(self, now_s: float) -> Reason[Doubt] | None:
        """The first lidar that is silent, sees nothing, or is late: three turns or so, since a tick may be."""
        limit_s = self._settings.current.safety.stale_s
        for name, heard_s in self._heard_s.items():
            if heard_s is None:
                return Reason(Doubt.DATA_MISSING, (name,))
            if now_s - heard_s > limit_s:
                return Reason(Doubt.DATA_OLD, (name, limit_s))
            if now_s - self._saw_s[name] > limit_s:
                return Reason(Doubt.LIDAR_BLIND, (name, limit_s))
            if heard_s - self._on_time_s[name] > LATE_S:
                return Reason(Doubt.LIDAR_LATE, (name, LATE_S))
        return None
