"""What is watched besides the age of data: each doubt why the rover must not move, in one place."""

from __future__ import annotations

from companion.perception.scan_filter import ScanWatch
from companion.safety.loop_watch import LoopWatch
from companion.settings import SafetySettings
from companion.vehicle.events.event import Event
from companion.vehicle.events.vehicle import RangeSeen
from companion.vehicle.state import VehicleState


class Watchdogs:
    """Takes events already folded into the vehicle's state, and says what is in doubt."""

    def __init__(self, settings: SafetySettings) -> None:
        self._loop = LoopWatch(settings.planner_s)
        self._scans = ScanWatch()
        self._fits = True

    @property
    def scan_fits(self) -> bool:
        """Whether the newest scan belongs where the rover is now, so that it may go on the map."""
        return self._fits

    def take_in(self, event: Event, vehicle: VehicleState) -> None:
        """One more event."""
        if isinstance(event, RangeSeen):
            self._fits = self._scans.take(event.scan, vehicle)

    def tick(self, now_s: float, late_s: float, *, planner_works: bool) -> None:
        """A tick begins, ``late_s`` after its time."""
        self._loop.tick(now_s, late_s, planner_works=planner_works)

    @property
    def reason(self) -> str:
        """Why the rover must not move now; empty when it may."""
        return self._loop.reason or self._scans.reason
