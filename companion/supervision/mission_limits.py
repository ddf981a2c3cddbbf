"""What is known beside the map that ends or bounds a mission: the autopilot's own fence, its batteries, another companion."""

from __future__ import annotations

import math

from companion.core.frames import LocalFrame, Pose
from companion.executive.mission_executor import MissionExecutor, Tell
from companion.mavlink.autopilot_link import AutopilotLink
from companion.mission.autopilot_fence import NO_FENCE, AutopilotFence
from companion.safety.battery_monitor import BatteryMonitor, Level
from companion.settings import Settings
from companion.supervision.fence_monitor import FenceMonitor
from companion.vehicle.events import (
    Event,
    HeartbeatSeen,
    RoverMode,
)
from companion.vehicle.state import VehicleState

LISTEN_S = 1.5
"""Who finds a rover armed in GUIDED listens so long before driving it: another companion's figures come every second."""


class MissionLimits:
    """Listens before and during the mission. ``ended_by``: why it was broken off, in words; empty while it was not."""

    def __init__(self, autopilot: AutopilotLink, settings: Settings, tell: Tell) -> None:
        self.ended_by = ""
        self._autopilot = autopilot
        self._fencing = FenceMonitor(autopilot, settings.fence, tell)
        self._power = BatteryMonitor(settings.power)
        self._to_rally = settings.power.to_rally
        self._breached = False
        self._listens_until_s = math.nan
        self._tell = tell

    def take_in(self, event: Event) -> None:
        """One more event."""
        if isinstance(event, HeartbeatSeen) and math.isnan(self._listens_until_s):
            driven = event.armed and event.mode == RoverMode.GUIDED
            self._listens_until_s = event.time_s + (LISTEN_S if driven else 0.0)
        self._fencing.take_in(event)
        self._power.take_in(event)

    def service(self, vehicle: VehicleState, now_s: float) -> None:
        """To be called every tick."""
        self._fencing.service(vehicle, now_s)
        breach = self._fencing.breached(now_s)
        if breach and not self._breached:
            self._tell(breach[0].upper() + breach[1:], 4)
        self._breached = bool(breach)

    def before_driving(self, now_s: float, *, out: bool = False) -> tuple[AutopilotFence, str]:
        """The autopilot's fence as known now, and what is awaited before the rover may be driven at all; empty when nothing is.

        ``out``: an earlier run has left it armed in GUIDED, perhaps far from anybody: nobody else drives it, and a low battery is a reason
        to go back, not to stay.
        """
        if out:
            return self._fence, self._fencing.missing
        doubt = "" if now_s >= self._listens_until_s else "signs of another companion (the rover is armed in GUIDED)"
        return self._fence, self._fencing.missing or doubt or self._power.hindrance(now_s)

    def emptied(self, now_s: float) -> str:
        """Why the rover must stop for good wherever it is, in words; empty while it need not."""
        if self._power.level(now_s) is not Level.HOLD:
            return ""
        self.ended_by = self._power.reason
        return self.ended_by

    def doubt(self, executor: MissionExecutor, pose: Pose | None, now_s: float) -> str:
        """Why the rover must not be driven now; empty when it may. A fence that has changed is in force from here on."""
        executor.heed_fence(self._fence)
        if self._autopilot.rival_heard(now_s):
            return "another companion drives this rover"
        return self._fencing.breached(now_s) or ("" if pose is None else executor.outside(pose.point))

    def broken_off(self, executor: MissionExecutor, pose: Pose, now_s: float) -> str:
        """Why the rover must stop for good here, in words; empty to go on, though perhaps only back."""
        level = self._power.level(now_s)
        if level is Level.FINE:
            return ""
        self.ended_by = self._power.reason
        if level is Level.HOLD:
            return self.ended_by
        if not executor.returning:
            frame = LocalFrame(executor.layout.origin)
            rally = [frame.to_ned(point) for point in self._fencing.rally] if self._to_rally else []
            executor.go_back(self.ended_by, rally, pose)
        return ""

    @property
    def _fence(self) -> AutopilotFence:
        return self._fencing.fence or NO_FENCE
