"""Places that people ask for while the rover drives (DO_REPOSITION, a guided mission item): accepted, or refused with a reason."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable

from companion.core.frames import LocalFrame, NedPoint
from companion.core.grid import OBSTACLE
from companion.executive.mission_executor import MissionExecutor, Tell
from companion.executive.mission_layout import MissionLayout
from companion.executive.mission_progress import Leg
from companion.mission.mission import Mission, OnBlocked
from companion.mission.resolve import ResolvedTarget
from companion.settings import SafetySettings
from companion.vehicle.commands import AnswerTarget, Command
from companion.vehicle.events import TargetAnswer, TargetAsked
from companion.vehicle.state import VehicleState

INFO, WARNING = 6, 4
REPEAT_S = 5.0
"""The same request within so long after it was heard last is a repetition: ground stations repeat what was not answered in time."""
MOST_A_SECOND = 10
"""More requests are not even answered, until there are fewer."""
REFUSED_AGAIN_S = 1.0
SAME_M = 0.02
"""Places nearer to each other than this are one: a radio's rounding."""


def refusal(place: NedPoint, here: NedPoint, layout: MissionLayout, reach_m: float) -> str:
    """Why the rover must not be sent to a place, in words; empty when it may, as far as is known. The rest is found on the way."""
    distance_m = here.distance_m(place)
    if distance_m > reach_m:
        return f"{distance_m:.0f} m away, farther than {reach_m:g} m"
    evidence, bounds = layout.evidence, layout.bounds
    cell = evidence.base.cell_at(place)
    if not evidence.base.contains(cell):
        return "outside the mission's grid"
    if fence := bounds.outside(place):
        return f"beyond {fence}"
    if room := bounds.too_near(place):
        return f"it must be {room}"
    if evidence.base.weights[cell.y, cell.x] >= OBSTACLE:
        return "in or too near a fence or a known obstacle"
    if evidence.grid.weights[cell.y, cell.x] >= OBSTACLE:
        return "an obstacle was seen there"
    return ""


class GoalRequests:
    """Answers every request, and has the accepted ones driven. ``send`` is for commands, ``tell`` for texts."""

    def __init__(
        self, mission: Mission, settings: SafetySettings, send: Callable[[Command, float], None], tell: Tell
    ) -> None:
        self._reach_m = settings.errand_reach_m
        self._cruise_m_s = mission.rover.cruise_speed_m_s
        self._send = send
        self._tell = tell
        self._count = 0
        self._last: TargetAsked | None = None
        self._heard_s = self._refused_s = -math.inf
        self._reason = ""
        self._refusals = 0
        self._times_s: deque[float] = deque([-math.inf] * MOST_A_SECOND, maxlen=MOST_A_SECOND)

    def take_in(self, asked: TargetAsked, vehicle: VehicleState, executor: MissionExecutor | None, idle: str) -> None:
        """One request. ``idle`` says why the rover is not being driven; it is empty when it is."""
        flood = asked.time_s - self._times_s[0] < 1.0
        self._times_s.append(asked.time_s)
        if flood:
            self._tell(f"Errands not heard: more than {MOST_A_SECOND} a second", WARNING)
            return
        if asked.point is None:
            answer, reason = asked.fault, asked.reason
        elif executor is None or idle or not _may_drive(vehicle):
            answer, reason = TargetAnswer.NOT_NOW, f"not driving ({idle or 'mode is not GUIDED'})"
        else:
            answer, reason = self._judge(asked, vehicle, executor)
        if reason:
            self._refuse(reason, asked.time_s)
        self._send(AnswerTarget(asked.asker, asked.form, answer), asked.time_s)

    def _refuse(self, reason: str, now_s: float) -> None:
        """Say why. A reason that was the last one's too is said again, but not at every repetition of one request."""
        same = reason == self._reason
        if same and now_s - self._refused_s < REFUSED_AGAIN_S:
            return
        self._reason, self._refused_s = reason, now_s
        self._refusals = self._refusals + 1 if same else 1
        again = f" ({self._refusals} times)" if same else ""
        self._tell(f"Errand refused{again}: {reason}", WARNING)

    def _judge(self, asked: TargetAsked, vehicle: VehicleState, executor: MissionExecutor) -> tuple[TargetAnswer, str]:
        """A place, and a rover that is driven: the answer, and the reason of a refusal."""
        pose = vehicle.pose_at(asked.time_s)
        assert asked.point is not None
        if pose is None:
            return TargetAnswer.NOT_NOW, "no position"
        progress = executor.progress
        if progress.ended or progress.leg is Leg.HOME:
            return (
                TargetAnswer.NOT_NOW,
                "the rover is on its way back" if progress.leg is Leg.HOME else "the mission is over",
            )
        place = LocalFrame(executor.layout.origin).to_ned(asked.point)
        if self._is_repeated(asked, place, executor):
            self._heard_s = asked.time_s
            return TargetAnswer.ACCEPTED, ""
        if reason := refusal(place, pose.point, executor.layout, self._reach_m):
            return TargetAnswer.DENIED, reason
        self._last, self._heard_s = asked, asked.time_s
        self._count += 1
        name, cell = f"errand {self._count}", executor.evidence.base.cell_at(place)
        speed_m_s = None if asked.speed_m_s is None else min(asked.speed_m_s, self._cruise_m_s)
        self._tell(f"Errand {self._count}: {pose.point.distance_m(place):.1f} m away, then the mission goes on", INFO)
        executor.run_errand(ResolvedTarget(name, place, cell, 0.0, OnBlocked.SKIP, speed_m_s))
        return TargetAnswer.ACCEPTED, ""

    def _is_repeated(self, asked: TargetAsked, place: NedPoint, executor: MissionExecutor) -> bool:
        """Whether this very errand is under way, or was a moment ago."""
        last, errand = self._last, executor.progress.errand
        if last is None or last.point is None or asked.speed_m_s != last.speed_m_s:
            return False
        same = LocalFrame(executor.layout.origin).to_ned(last.point).distance_m(place) <= SAME_M
        return same and (errand is not None or asked.time_s - self._heard_s <= REPEAT_S)


def _may_drive(vehicle: VehicleState) -> bool:
    """As the newest heartbeat says, which may have come with the request itself. AUTO's legs are not for errands."""
    return not vehicle.in_auto and vehicle.is_ours and vehicle.heartbeat is not None and vehicle.heartbeat.armed
