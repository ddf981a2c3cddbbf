"""The rival monitor: another companion that drives the same rover, or may do so.

Nouns: rival monitor.
"""

from __future__ import annotations

import math

from companion.mavlink.autopilot_link import AutopilotLink
from companion.safety.reasons import Doubt, Reason, WaitReason
from companion.safety.watchdogs import Monitor
from companion.vehicle.events import (
    Event,
    HeartbeatSeen,
    RoverMode,
)
from companion.vehicle.state import VehicleState

LISTEN_S = 1.5
"""How long to listen first to a rover found armed in GUIDED: another companion sends its figures every second."""


class RivalMonitor(Monitor):
    """Two companions must not steer one rover."""

    def __init__(self, autopilot: AutopilotLink) -> None:
        self._autopilot = autopilot
        self._listens_until_s = math.nan

    def take(self, event: Event, vehicle: VehicleState) -> None:
        """The first heartbeat says whether the rover is being driven already."""
        if isinstance(event, HeartbeatSeen) and math.isnan(self._listens_until_s):
            driven = event.armed and event.mode == RoverMode.GUIDED
            self._listens_until_s = event.time_s + (LISTEN_S if driven else 0.0)

    def doubt(self, now_s: float) -> Reason[Doubt] | None:
        """Whether another one drives at this moment."""
        return Reason(Doubt.OTHER_COMPANION) if self._autopilot.rival_heard(now_s) else None

    def awaited(self, now_s: float) -> Reason[WaitReason] | None:
        """Before this run drives for the first time: whether it has listened long enough."""
        listened = now_s >= self._listens_until_s
        return None if listened else Reason(WaitReason.OTHER_COMPANION_SIGNS)
