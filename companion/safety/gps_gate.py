"""The GPS gate: the rover stands while the GPS fix is worse than ``safety.gps_fix`` asks for, or is not told.

Nouns: GPS gate.
"""

from __future__ import annotations

import math

from companion.safety.reasons import Doubt, Reason
from companion.safety.watchdogs import Monitor
from companion.settings.live_settings import LiveSettings
from companion.vehicle.events import Event, GpsSeen
from companion.vehicle.gps_fix import NEEDED, GpsFix
from companion.vehicle.state import VehicleState

MADE_UP = 0.5
"""A good fix makes up for so much of its own time of bad ones: more than a third of them shut the gate in the end."""


class GpsGate(Monitor):
    """Shut until the fix has been good for ``gps_settle_s`` without a break; shut again after ``gps_lost_s`` without a
    good one, or with as much of bad ones, of which good ones make up for half their time.

    A message that is late, missing, or repeats the time of the fix before it is no good one. Times are the companion's.
    """

    def __init__(self, settings: LiveSettings) -> None:
        self._settings = settings
        self._open = False
        self._fix = GpsFix.NO_GPS
        self._heard_s = -math.inf
        self._good_s = -math.inf
        """When the last good fix came."""
        self._since_s = math.inf
        """When the first of an unbroken row of good ones came."""
        self._fix_us = 0
        self._bad_s = 0.0
        """The time of bad fixes, less what good ones have made up for."""

    def take(self, event: Event, vehicle: VehicleState) -> None:
        """One more event."""
        if not isinstance(event, GpsSeen) or (event.fix_us == self._fix_us != 0):
            return
        passed_s = min(event.time_s - self._heard_s, self._settings.current.safety.gps_lost_s)
        self._fix, self._heard_s, self._fix_us = event.fix, event.time_s, event.fix_us
        needed = self._needed
        good = needed is None or event.fix >= needed
        self._bad_s = max(self._bad_s + (-passed_s * MADE_UP if good else passed_s), 0.0)
        if good:
            self._good_s = event.time_s
            self._since_s = min(self._since_s, event.time_s)
        else:
            self._since_s = math.inf

    def tick(self, now_s: float) -> None:
        """Open or shut."""
        safety = self._settings.current.safety
        silent = now_s - self._good_s > safety.gps_lost_s
        if silent:
            self._since_s = math.inf
        settled = now_s - self._since_s >= safety.gps_settle_s
        if settled:
            self._bad_s = 0.0
        self._open = settled or (self._open and not silent and self._bad_s <= safety.gps_lost_s)

    def doubt(self, now_s: float) -> Reason[Doubt] | None:
        """Why the rover must stand, as of the last ``tick``."""
        needed, safety = self._needed, self._settings.current.safety
        if needed is None or self._open:
            return None
        if now_s - self._heard_s > safety.gps_lost_s:
            return Reason(Doubt.GPS_SILENT, (safety.gps_lost_s,))
        if self._fix < needed:
            return Reason(Doubt.GPS_POOR, (self._fix.text, needed.text))
        return Reason(Doubt.GPS_SETTLES, (self._fix.text, safety.gps_settle_s))

    @property
    def _needed(self) -> GpsFix | None:
        """None: any will do, even none."""
        return NEEDED.get(self._settings.current.safety.gps_fix)
