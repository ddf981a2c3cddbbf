"""Mission requests: what people ask for during a run besides places: to pause, to go on, to leave a target out.

Nouns: mission request.
"""

from __future__ import annotations

import math
from collections import deque

from companion.core.severity import Severity, TextSink
from companion.executive.mission_progress import MissionPhase
from companion.executive.mission_run import MissionRun
from companion.executive.requested_goals import MOST_A_SECOND
from companion.safety.reasons import Reason, Refusal
from companion.vehicle.commands import AnswerRequest, SetMode
from companion.vehicle.events import (
    Asker,
    Event,
    HeartbeatSeen,
    PauseAsked,
    RequestAnswer,
    RequestForm,
    RoverMode,
    TargetAsked,
)
from companion.vehicle.state import VehicleState

ARRIVES_S = 3.0
"""A mode that was asked for shows in a heartbeat by then, or it never arrived."""
FRESH_S = 2.0
"""Whoever may have taken over is known from a heartbeat that is no older: it comes once a second."""
AGAIN_S = 2.0
"""A heartbeat that still shows HOLD so long after it was left was sent before."""


class MissionRequests:
    """Answers every request. A pause is HOLD, which any pilot may end; it is taken back only if it is still that one.

    Whoever sets another mode meanwhile keeps the rover, also with a HOLD that follows. To go on is refused as well
    while the autopilot is not heard, and on a rover that was disarmed.
    """

    def __init__(self, run: MissionRun, notifier: TextSink) -> None:
        self._run = run
        self._notifier = notifier
        self._asked_s = self._left_s = -math.inf
        self._times_s: deque[float] = deque([-math.inf] * MOST_A_SECOND, maxlen=MOST_A_SECOND)

    def take(self, event: Event, vehicle: VehicleState) -> None:
        """One more event."""
        match event:
            case HeartbeatSeen():
                self._note_mode(event)
            case PauseAsked() if event.pauses or self._is_heard(event.time_s):  # a flood keeps nobody from stopping
                act = self._pause if event.pauses else self._go_on
                form = RequestForm.PAUSE if event.pauses else RequestForm.CONTINUE
                self._answer(form, event.asker, act(event.time_s, vehicle), event.time_s)
            case TargetAsked() if self._is_heard(event.time_s):
                self._answer(RequestForm.SKIP, event.asker, self._skip(event.index), event.time_s)
            case _:
                pass

    def _note_mode(self, seen: HeartbeatSeen) -> None:
        if seen.mode == RoverMode.HOLD:
            self._run.paused |= 0.0 <= seen.time_s - self._asked_s <= ARRIVES_S
            self._asked_s = -math.inf
            return
        self._run.paused = False
        if seen.mode != self._run.vehicle.own_mode:
            self._asked_s = -math.inf  # somebody took over before it arrived

    def _is_heard(self, now_s: float) -> bool:
        """Whether there are not too many."""
        flood = now_s - self._times_s[0] < 1.0
        self._times_s.append(now_s)
        return not flood

    def _pause(self, now_s: float, vehicle: VehicleState) -> Reason[Refusal] | None:
        """HOLD, while the companion drives. A mission that has not begun is kept from beginning."""
        if self._run.executor is None:
            if not self._run.start_paused:
                self._notifier.tell("Paused on request: the mission does not begin", Severity.WARNING)
            self._run.start_paused = True
            return None
        heard = _heard(vehicle, now_s)
        if heard is not None and heard.mode == RoverMode.HOLD:
            return None
        if not vehicle.is_ours:
            return Reason(Refusal.NOT_DRIVING, (self._run.activity,))
        self._asked_s = now_s
        self._run.sender.send(SetMode(RoverMode.HOLD), now_s)
        if heard is None:
            return Reason(Refusal.HOLD_NOT_HEARD)
        self._notifier.tell("Paused on request: HOLD", Severity.WARNING)
        return None

    def _go_on(self, now_s: float, vehicle: VehicleState) -> Reason[Refusal] | None:
        """Back to the mode of the mission, from a HOLD that was asked for here."""
        own = vehicle.own_mode
        if self._run.start_paused:
            self._run.start_paused = False
            self._notifier.tell("Going on as requested: the mission may begin", Severity.WARNING)
            return None
        if vehicle.is_ours or now_s - self._left_s < AGAIN_S:
            return None
        if not self._run.paused:
            return Reason(Refusal.NOT_PAUSED, (own.name,))
        heard = _heard(vehicle, now_s)
        if heard is None:
            return Reason(Refusal.NOT_HEARD)
        if not heard.armed:
            return Reason(Refusal.DISARMED)
        self._left_s = now_s
        self._notifier.tell(f"Going on as requested: {own.name}", Severity.WARNING)
        self._run.sender.send(SetMode(own), now_s)
        return None

    def _skip(self, index: int) -> Reason[Refusal] | None:
        """Leave the present goal out. ``index``: of the target to go on with, so that none is skipped by mistake.

        The number of targets ends a patrol at any time.
        """
        executor = self._run.executor
        if executor is None:
            return Reason(Refusal.NOT_DRIVING, (self._run.activity,))
        progress = executor.progress
        if self._run.mission.in_auto:
            return Reason(Refusal.LEGS_OF_AUTO)
        if progress.phase is MissionPhase.HOME:
            return Reason(Refusal.RETURNING)
        if progress.ended:
            return Reason(Refusal.ENDED)
        if progress.requested is None and index == progress.index:
            return None
        if progress.patrol is not None and index == len(progress.targets):
            self._notifier.tell("Ending the patrol as requested", Severity.WARNING)
            executor.end_early()
            return None
        if index != (progress.following if progress.requested is None else progress.index):
            return Reason(Refusal.NOT_NEXT)
        self._notifier.tell(f"Skipping {progress.goal.name} as requested", Severity.WARNING)
        executor.skip()
        return None

    def _answer(self, form: RequestForm, asker: Asker, refused: Reason[Refusal] | None, now_s: float) -> None:
        if refused is not None:
            self._notifier.tell(f"Request refused: {refused}", Severity.WARNING)
        answer, reason = RequestAnswer.ACCEPTED, ""
        if refused is not None:
            answer = RequestAnswer.NOT_NOW if refused.kind is Refusal.NOT_DRIVING else RequestAnswer.DENIED
            reason = str(refused)
        self._run.sender.send(AnswerRequest(asker, form, answer, reason), now_s)


def _heard(vehicle: VehicleState, now_s: float) -> HeartbeatSeen | None:
    """The newest heartbeat; None if it says nothing of now."""
    heartbeat = vehicle.heartbeat
    return None if heartbeat is None or now_s - heartbeat.time_s > FRESH_S else heartbeat
