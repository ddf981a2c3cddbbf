"""The limits monitor: reads the autopilot's limits, by which motions are planned, its timeout, and its throttle.

Nouns: limits monitor.
"""

from __future__ import annotations

import math

from companion.core.severity import Severity, TextSink
from companion.mavlink.autopilot_link import AutopilotLink
from companion.safety.reasons import Doubt, Reason
from companion.safety.watchdogs import Monitor
from companion.settings.live_settings import LiveSettings
from companion.vehicle.commands import ReadParameter
from companion.vehicle.events import Event
from companion.vehicle.motion_limits import CHANGES, CRUISE_THROTTLE, LIMITS, MOST_TIMEOUT_S, THROTTLE_SCALE, TIMEOUT
from companion.vehicle.state import VehicleState

ASK_S = 1.0
TRIES = 10


TIMEOUT_AGAIN_S = 30.0
"""Then the timeout is asked for again: older firmware has none, but a ground station may change it."""


class LimitsMonitor(Monitor):
    """What is not answered is assumed, and that is told. A timeout too long to plan with is a reason not to drive."""

    def __init__(self, autopilot: AutopilotLink, settings: LiveSettings, notifier: TextSink) -> None:
        self._notifier = notifier
        self._autopilot = autopilot
        self._settings = settings
        self._vehicle = VehicleState()
        self._asked_s, self._tries, self._told = -math.inf, 0, False
        self._timeout_s, self._timeout_tries = -math.inf, 0
        """When it was asked for, and how often without an answer."""

    def doubt(self, now_s: float) -> Reason[Doubt] | None:
        """A velocity that goes on for longer than a way is looked ahead is safe nowhere."""
        told_s = self._vehicle.parameters.get(TIMEOUT, 0.0)
        return Reason(Doubt.TIMEOUT_LONG, (told_s,)) if told_s > MOST_TIMEOUT_S else None

    def take(self, event: Event, vehicle: VehicleState) -> None:
        """One more event."""
        self._vehicle = vehicle

    def tick(self, now_s: float) -> None:
        """Ask for what is not known, each second, a few times; then tell that it is assumed."""
        plans = self._settings.current.guidance.controller != "points"
        if self._vehicle.heartbeat is not None:
            self._ask_timeout(now_s, plans=plans)
        needed = dict.fromkeys((*LIMITS, *THROTTLE_SCALE) if plans else THROTTLE_SCALE)
        missing = [name for name in needed if name not in self._vehicle.parameters]
        if not missing or self._vehicle.heartbeat is None or self._told:
            return
        if now_s - self._asked_s < ASK_S:
            return
        if self._tries >= TRIES:
            self._told = True
            self._notifier.tell(_not_told(missing, plans=plans), Severity.WARNING)
        else:
            self._asked_s, self._tries = now_s, self._tries + 1
            for name in missing:
                self._autopilot.send(ReadParameter(name), now_s)

    def _ask_timeout(self, now_s: float, *, plans: bool) -> None:
        """Each second until it is known, or a few times; then seldom. Older firmware has none, and that is told."""
        known = TIMEOUT in self._vehicle.parameters
        if known and math.isinf(self._timeout_s):
            self._timeout_s = now_s
        if now_s - self._timeout_s < (TIMEOUT_AGAIN_S if known or self._timeout_tries >= TRIES else ASK_S):
            return
        self._timeout_s = now_s
        self._timeout_tries += not known
        if self._timeout_tries == TRIES and not known and plans:
            lasts_s = self._settings.current.guidance.velocity_lasts_s
            text = f"The autopilot does not tell {TIMEOUT}: a velocity is taken to last {lasts_s:g} s"
            self._notifier.tell(text, Severity.INFO)
        self._autopilot.send(ReadParameter(TIMEOUT), now_s)


def _not_told(missing: list[str], *, plans: bool) -> str:
    """What is assumed instead. Where motions are planned (``plans``), most of the names are of limits."""
    shipped = [name for name in missing if name in (*CHANGES, CRUISE_THROTTLE) or not plans]
    others = [name for name in missing if name not in shipped]
    parts = [f"{', '.join(shipped)}: taken to be as shipped"] if shipped else []
    parts += [f"{', '.join(others)}: taken to be no limit"] if others else []
    return f"The autopilot does not tell {'; '.join(parts)}"
