"""Mission limits: what keeps a mission from beginning and what breaks it off (fence, low battery, borders).

Nouns: mission limits, low battery, borders.
"""

from __future__ import annotations

from companion.core.frames import LocalFrame
from companion.executive.mission_run import MissionRun
from companion.mission.autopilot_fence import AutopilotFence
from companion.operator.notifications import Outcome
from companion.safety.battery_monitor import BatteryLevel, BatteryMonitor
from companion.safety.gps_gate import GpsGate
from companion.safety.reasons import Doubt, PowerReason, Reason, WaitReason
from companion.safety.watchdogs import Monitor
from companion.settings import PowerSettings
from companion.supervision.fence_monitor import FenceMonitor
from companion.supervision.rival_monitor import RivalMonitor


class BorderMonitor(Monitor):
    """The borders of the mission and of the autopilot's fence: whether the rover is beyond one."""

    def __init__(self, run: MissionRun) -> None:
        self._run = run

    def doubt(self, now_s: float) -> Reason[Doubt] | None:
        """Where the rover is now."""
        pose, executor = self._run.vehicle.pose_at(now_s), self._run.executor
        name = "" if pose is None or executor is None else executor.layout.bounds.outside(pose.point)
        return Reason(Doubt.BEYOND_BORDER, (name,)) if name else None


class MissionLimits:
    """Asked before and during the mission. It writes into ``outcome`` why the mission was broken off."""

    def __init__(
        self,
        run: MissionRun,
        fences: FenceMonitor,
        batteries: BatteryMonitor,
        rivals: RivalMonitor,
        gate: GpsGate,
        settings: PowerSettings,
        outcome: Outcome,
    ) -> None:
        self._outcome = outcome
        self._run = run
        self._fences = fences
        self._batteries = batteries
        self._rivals = rivals
        self._gate = gate
        self._to_rally = settings.to_rally

    @property
    def fence(self) -> AutopilotFence:
        """The autopilot's, as known now."""
        return self._fences.fence

    def heed_fence(self) -> None:
        """A fence that has changed is in force from here on."""
        if self._run.executor is not None:
            self._run.executor.heed_fence(self._fences.fence)

    def awaited(self, now_s: float, *, left_driving: bool) -> Reason[WaitReason] | None:
        """What is awaited before the rover may be driven; None if nothing is.

        ``left_driving``: an earlier run left it armed in GUIDED, perhaps far from any person. Then only the fence is
        awaited: no other companion drives the rover, a low battery is a reason to return, not to wait, and for a better
        GPS fix it can stand where it is.
        """
        fence = self._fences.awaited()
        if fence is not None or left_driving:
            return fence
        poor = self._gate.doubt(now_s)
        fix = None if poor is None else Reason(WaitReason.GOOD_DATA, (poor,))
        return self._rivals.awaited(now_s) or fix or self._batteries.awaited(now_s)

    def must_stop(self, now_s: float) -> Reason[PowerReason] | None:
        """Why the rover must stop for good wherever it is; None while it need not."""
        if self._batteries.level(now_s) is not BatteryLevel.HOLD:
            return None
        self._outcome.broken_off = self._batteries.reason
        return self._outcome.broken_off

    def enforce(self, now_s: float) -> Reason[PowerReason] | None:
        """During the mission: why the rover must stop here for good; None if it may go on.

        With a low battery the mission is given up, and the rover goes on only to return. In AUTO the battery is left to
        the autopilot's own failsafe, because the companion cannot turn back within a leg.
        """
        executor, pose = self._run.executor, self._run.vehicle.pose_at(now_s)
        if self._run.vehicle.in_auto or executor is None or pose is None:
            return None
        level = self._batteries.level(now_s)
        if level is not BatteryLevel.RETURN:
            return None if level is BatteryLevel.FINE else self.must_stop(now_s)
        self._outcome.broken_off = self._batteries.reason
        if not executor.returning:
            frame = LocalFrame(executor.layout.origin)
            rally = [frame.to_ned(point) for point in self._fences.rally] if self._to_rally else []
            executor.go_back(str(self._outcome.broken_off), rally, pose)
        return None
