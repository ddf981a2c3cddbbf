"""The limits monitor: reads the autopilot's limits, by which motions are planned, its timeout, and its throttle.

Nouns: limits monitor.
"""

from __future__ import annotations

import math

from companion.core.severity import Severity, TextSink
from companion.mavlink.autopilot_link import AutopilotLink
from companion.safety.watchdogs import Monitor
from companion.settings.live_settings import LiveSettings
from companion.vehicle.commands import ReadParameter
from companion.vehicle.events import Event
from companion.vehicle.motion_limits import CHANGES, CRUISE_THROTTLE, LIMITS, THROTTLE_SCALE, TIMEOUT
from companion.vehicle.state import VehicleState

ASK_S = 1.0
TRIES = 10


class LimitsMonitor(Monitor):
    """Never a reason not to drive: what is not answered is assumed, and that is told."""

    def __init__(self, autopilot: AutopilotLink, settings: LiveSettings, notifier: TextSink) -> None:
        self._notifier = notifier
        self._autopilot = autopilot
        self._settings = settings
        self._vehicle = VehicleState()
        self._asked_s, self._tries, self._told = -math.inf, 0, False

    def take(self, event: Event, vehicle: VehicleState) -> None:
        """One more event."""
        self._vehicle = vehicle

    def tick(self, now_s: float) -> None:
        """Ask for what is not known, each second, a few times; then tell that it is assumed."""
        plans = self._settings.current.guidance.controller != "points"
        needed = dict.fromkeys((TIMEOUT, *LIMITS, *THROTTLE_SCALE) if plans else (TIMEOUT, *THROTTLE_SCALE))
        missing = [name for name in needed if name not in self._vehicle.parameters]
        if not missing or self._vehicle.heartbeat is None or self._told:
            return
        if now_s - self._asked_s < ASK_S:
            return
        if self._tries >= TRIES:
            self._told = True
            if missing != [TIMEOUT]:  # older firmware has none
                self._notifier.tell(_not_told(missing, plans=plans), Severity.WARNING)
        else:
            self._asked_s, self._tries = now_s, self._tries + 1
            for name in missing:
                self._autopilot.send(ReadParameter(name), now_s)


def _not_told(missing: list[str], *, plans: bool) -> str:
    """What is assumed instead. Where motions are planned (``plans``), most of the names are of limits."""
    missing = [name for name in missing if name != TIMEOUT]
    shipped = [name for name in missing if name in (*CHANGES, CRUISE_THROTTLE) or not plans]
    others = [name for name in missing if name not in shipped]
    parts = [f"{', '.join(shipped)}: taken to be as shipped"] if shipped else []
    parts += [f"{', '.join(others)}: taken to be no limit"] if others else []
    return f"The autopilot does not tell {'; '.join(parts)}"
