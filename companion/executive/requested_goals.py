"""Requested goals: places that people ask for during a run (DO_REPOSITION, a guided item), accepted or refused.

Nouns: requested goal.
"""

from __future__ import annotations

import math
from collections import deque

from companion.core.frames import LocalFrame, NedPoint
from companion.core.grid import OBSTACLE
from companion.core.severity import Severity, TextSink
from companion.executive.mission_executor import MissionExecutor
from companion.executive.mission_layout import MissionLayout
from companion.executive.mission_progress import MissionPhase
from companion.executive.mission_run import MissionRun
from companion.mission.mission import OnBlocked
from companion.mission.resolve import ResolvedTarget
from companion.safety.reasons import LatchReason, Reason, Refusal
from companion.settings.live_settings import LiveSettings
from companion.vehicle.commands import AnswerRequest
from companion.vehicle.events import (
    Event,
    GoalRequested,
    RequestAnswer,
    RoverMode,
)
from companion.vehicle.state import VehicleState

REPEAT_S = 5.0
"""The same request within this time is a repetition: ground stations repeat what was not answered in time."""
MOST_A_SECOND = 10
"""More requests are not even answered, until there are fewer."""
REFUSED_AGAIN_S = 1.0
SAME_M = 0.02
"""Places nearer to each other than this are one: a radio rounds."""


def refusal(place: NedPoint, here: NedPoint, layout: MissionLayout, reach_m: float) -> Reason[Refusal] | None:
    """Why the rover must not be sent to a place; None when it may, as far as is known. The rest is found on the way."""
    distance_m = here.distance_m(place)
    if distance_m > reach_m:
        return Reason(Refusal.TOO_FAR, (round(distance_m), reach_m))
    evidence, bounds = layout.evidence, layout.bounds
    cell = evidence.base.cell_at(place)
    if not evidence.base.contains(cell):
        return Reason(Refusal.OFF_THE_GRID)
    if fence := bounds.outside(place):
        return Reason(Refusal.BEYOND_BORDER, (fence,))
    if room := bounds.too_near(place):
        return Reason(Refusal.NEAR_BORDER, (room,))
    if evidence.base.weights[cell.y, cell.x] >= OBSTACLE:
        return Reason(Refusal.CLOSED)
    return Reason(Refusal.OBSTACLE_SEEN) if evidence.grid.weights[cell.y, cell.x] >= OBSTACLE else None


class RequestedGoals:
    """Answers every request, and has the accepted ones driven."""

    def __init__(self, run: MissionRun, settings: LiveSettings, notifier: TextSink) -> None:
        self._run = run
        self._settings = settings
        self._notifier = notifier
        self._count = 0
        self._last: GoalRequested | None = None
        self._heard_s = self._refused_s = -math.inf
        self._reason: Reason[Refusal] | None = None
        self._refusals = 0
        self._times_s: deque[float] = deque([-math.inf] * MOST_A_SECOND, maxlen=MOST_A_SECOND)

    def take(self, event: Event, vehicle: VehicleState) -> None:
        """One more event; anything but a request is ignored."""
        if isinstance(event, GoalRequested):
            self._answer(event, vehicle)

    def _answer(self, asked: GoalRequested, vehicle: VehicleState) -> None:
        flood = asked.time_s - self._times_s[0] < 1.0
        self._times_s.append(asked.time_s)
        if flood:
            text = f"Requested goals not heard: more than {MOST_A_SECOND} a second"
            self._notifier.tell(text, Severity.WARNING)
            return
        run = self._run
        reason: Reason[Refusal] | None
        if asked.point is None:
            answer, reason = asked.fault, Reason(Refusal.MALFORMED, (asked.reason,)) if asked.reason else None
        elif run.executor is None or not run.is_driving:
            answer, reason = RequestAnswer.NOT_NOW, Reason(Refusal.NOT_DRIVING, (run.activity,))
        elif not _may_drive(vehicle):
            why = Reason(LatchReason.OTHER_MODE, (RoverMode.GUIDED.name,))
            answer, reason = RequestAnswer.NOT_NOW, Reason(Refusal.NOT_DRIVING, (why,))
        else:
            answer, reason = self._judge(asked, vehicle, run.executor)
        if reason is not None:
            self._refuse(reason, asked.time_s)
        words = "" if reason is None else str(reason)
        run.sender.send(AnswerRequest(asked.asker, asked.form, answer, words), asked.time_s)

    def _refuse(self, reason: Reason[Refusal], now_s: float) -> None:
        """Say why. A reason that was the last one's too is said again, but not at every repetition of one request."""
        same = reason == self._reason
        if same and now_s - self._refused_s < REFUSED_AGAIN_S:
            return
        self._reason, self._refused_s = reason, now_s
        self._refusals = self._refusals + 1 if same else 1
        again = f" ({self._refusals} times)" if same else ""
        self._notifier.tell(f"Requested goal refused{again}: {reason}", Severity.WARNING)

    def _judge(
        self, asked: GoalRequested, vehicle: VehicleState, executor: MissionExecutor
    ) -> tuple[RequestAnswer, Reason[Refusal] | None]:
        """A place, and a rover that is driven: the answer, and the reason of a refusal."""
        pose = vehicle.pose_at(asked.time_s)
        assert asked.point is not None
        if pose is None:
            return RequestAnswer.NOT_NOW, Reason(Refusal.NO_POSITION)
        progress = executor.progress
        if progress.phase is MissionPhase.HOME:
            return RequestAnswer.NOT_NOW, Reason(Refusal.RETURNING)
        if progress.ended:
            return RequestAnswer.NOT_NOW, Reason(Refusal.ENDED)
        place = LocalFrame(executor.layout.origin).to_ned(asked.point)
        if self._is_repeated(asked, place, executor):
            self._heard_s = asked.time_s
            return RequestAnswer.ACCEPTED, None
        reach_m = self._settings.current.safety.requested_goal_m
        if (reason := refusal(place, pose.point, executor.layout, reach_m)) is not None:
            return RequestAnswer.DENIED, reason
        self._last, self._heard_s = asked, asked.time_s
        self._count += 1
        name, cell = f"requested goal {self._count}", executor.evidence.base.cell_at(place)
        cruise_m_s = self._run.mission.rover.cruise_speed_m_s
        speed_m_s = None if asked.speed_m_s is None else min(asked.speed_m_s, cruise_m_s)
        distance_m = pose.point.distance_m(place)
        text = f"Requested goal {self._count}: {distance_m:.1f} m away, then the mission goes on"
        self._notifier.tell(text, Severity.INFO)
        executor.request(ResolvedTarget(name, place, cell, 0.0, OnBlocked.SKIP, speed_m_s))
        return RequestAnswer.ACCEPTED, None

    def _is_repeated(self, asked: GoalRequested, place: NedPoint, executor: MissionExecutor) -> bool:
        """Whether this very goal is under way, or was a moment ago."""
        last, requested = self._last, executor.progress.requested
        if last is None or last.point is None or asked.speed_m_s != last.speed_m_s:
            return False
        same = LocalFrame(executor.layout.origin).to_ned(last.point).distance_m(place) <= SAME_M
        return same and (requested is not None or asked.time_s - self._heard_s <= REPEAT_S)


def _may_drive(vehicle: VehicleState) -> bool:
    """As the newest heartbeat says, which may have come with the request. On legs of AUTO no request is accepted."""
    return not vehicle.in_auto and vehicle.is_ours and vehicle.heartbeat is not None and vehicle.heartbeat.armed
