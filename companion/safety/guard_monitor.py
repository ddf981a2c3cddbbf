"""The guard monitor: tells whether a guard on the autopilot would stop the rover if the companion fell silent.

Nouns: guard monitor.
"""

from __future__ import annotations

from companion.core.severity import Severity, TextSink
from companion.safety.watchdogs import Monitor
from companion.vehicle.events import Event, GuardSeen
from companion.vehicle.state import VehicleState


class GuardMonitor(Monitor):
    """Never a reason not to drive: without a guard the rover is told what it may be left alone with for longer."""

    def __init__(self, notifier: TextSink, soon_s: float) -> None:
        """``soon_s``: with a guard that waits longer, motions are planned by the strict rule."""
        self._notifier = notifier
        self._soon_s = soon_s
        self._vehicle = VehicleState()
        self._is_there = self._acted = False

    def take(self, event: Event, vehicle: VehicleState) -> None:
        """One more event."""
        self._vehicle = vehicle

    def tick(self, now_s: float) -> None:
        """Tell when the guard appears, acts or disappears."""
        guard = self._vehicle.guard_at(now_s)
        if guard is None and self._is_there:
            self._notifier.tell("The guard on the autopilot is gone: driving as without one", Severity.WARNING)
        elif guard is not None and not self._is_there:
            self._notifier.tell(_greeting(guard, self._soon_s), Severity.INFO)
        if guard is not None and guard.acted and not self._acted:
            text = "The guard on the autopilot has put HOLD: it heard nothing of the companion"
            self._notifier.tell(text, Severity.WARNING)
        self._is_there, self._acted = guard is not None, guard is not None and guard.acted


def _greeting(guard: GuardSeen, soon_s: float) -> str:
    if guard.waits_s <= soon_s + 1e-6:
        return f"Guarded: the autopilot puts HOLD {guard.waits_s:g} s after the companion's last packet"
    return (
        f"A late guard: the autopilot puts HOLD {guard.waits_s:g} s after the companion's last packet, so planned "
        f"motions keep more room, as without a guard; set SCR_USER1 to {1000.0 * soon_s:.0f} or less"
    )
