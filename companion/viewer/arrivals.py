"""How many positions and range readings come a second, of those that a tick can see.

Nouns: arrivals.
"""

from __future__ import annotations

from collections import deque
from typing import Any

from companion.vehicle.state import VehicleState

RATE_S = 2.0


class Arrivals:
    """Counts over the last seconds."""

    def __init__(self) -> None:
        self._arrived: dict[str, deque[float]] = {"position": deque(), "range": deque()}

    def note(self, vehicle: VehicleState) -> None:
        """Once a tick."""
        for name, seen in (("position", vehicle.position), ("range", vehicle.scan)):
            times_s = self._arrived[name]
            if seen is not None and (not times_s or seen.time_s != times_s[-1]):
                times_s.append(seen.time_s)
                while times_s[-1] - times_s[0] > RATE_S:  # nobody may ask for long
                    times_s.popleft()

    def at(self, vehicle: VehicleState, now_s: float) -> dict[str, Any]:
        """As of now, over the last seconds."""
        for times_s in self._arrived.values():
            while times_s and not 0.0 <= now_s - times_s[0] <= RATE_S:
                times_s.popleft()
        heartbeat, position = vehicle.heartbeat, vehicle.position
        return {
            **{name: round(len(times_s) / RATE_S, 1) for name, times_s in self._arrived.items()},
            "heartbeat_age_s": None if heartbeat is None else round(max(now_s - heartbeat.time_s, 0.0), 1),
            "position_age_s": None if position is None else round(max(now_s - position.time_s, 0.0), 1),
        }
