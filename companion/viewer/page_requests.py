"""Page requests: what people ask for on the page, asked of the companion as a ground station asks it.

Nouns: page request.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import Any

from companion.app import Companion
from companion.core.clock import stopwatch_s
from companion.core.frames import GeoPoint, LocalFrame, NedPoint
from companion.mavlink.local_station import LocalStation
from companion.vehicle.events import RequestAnswer, RequestForm, RoverMode

NO_ANSWER_S, CONFIRMED_S = 4.0, 3.0
OLD_S = 3.0
"""What is asked for by somebody who looks at an older moment is not done, except to stop. Seconds of the person's own
time: a simulated run may go faster."""
FORMS = {
    "pause": RequestForm.PAUSE,
    "resume": RequestForm.CONTINUE,
    "skip": RequestForm.SKIP,
    "goto": RequestForm.COMMAND,
}
NOT_HEARD = "no autopilot has been heard yet"
NOT_DRIVING = "the mission has not begun"
TOO_OLD = "it came too late: the page shows what was seconds ago"
NOT_CHANGED = "the autopilot has not changed its mode"
NOT_PAUSED = "it is not paused"
OTHER_GOAL = "the rover heads for something else by now"

MODES = ("pause", "resume")
"""These are done when the mode has changed."""

Json = dict[str, Any]


@dataclass(frozen=True, slots=True)
class _Asked:
    """A request that has no answer yet."""

    number: int
    action: str
    since_s: float


class PageRequests:
    """Gives each request to the station, and gives back its answer with the reason."""

    def __init__(self, station: LocalStation) -> None:
        self._station = station
        self._open: deque[_Asked] = deque()
        self._unconfirmed: deque[_Asked] = deque()
        """Accepted changes of the mode that no heartbeat has shown yet."""
        self._done: list[Json] = []
        self._moments: deque[tuple[float, float]] = deque()
        """The last ticks: a stopwatch, and the companion's clock."""

    def note(self, time_s: float) -> None:
        """Once a tick, before requests are taken. ``time_s``: the companion's clock."""
        now_s = stopwatch_s()
        self._moments.append((now_s, time_s))
        while now_s - self._moments[0][0] > OLD_S:
            self._moments.popleft()

    def _is_late(self, shown_s: float | None) -> bool:
        """Whether the page shows another moment than one of the last seconds."""
        if shown_s is None or not self._moments:
            return True
        return not self._moments[0][1] <= shown_s <= self._moments[-1][1] + OLD_S

    def take(self, asked: Json, companion: Companion, origin: GeoPoint | None = None) -> None:
        """A request as the web process passes it on.

        ``number``, ``action``, ``place`` (north and east of ``origin``, or of the companion's own), and what the page
        showed then: ``goal`` and the time ``t``.
        """
        number, action, shown_s = int(asked["number"]), str(asked["action"]), asked.get("t")
        fault = TOO_OLD if self._is_late(shown_s) and action != "pause" else self._ask(action, asked, companion, origin)
        if fault:
            self._answer(number, action, fault, ok=fault == NOT_PAUSED)
        else:
            self._open.append(_Asked(number, action, stopwatch_s()))

    def answered(self, companion: Companion) -> list[Json]:
        """The messages to the web process since the last call."""
        for answer in self._station.answers():
            asked = next((one for one in self._open if FORMS[one.action] is answer.form), None)
            if asked is None:
                continue
            self._open.remove(asked)
            if answer.answer is not RequestAnswer.ACCEPTED:
                self._answer(asked.number, asked.action, answer.reason or answer.answer.value)
            elif asked.action in MODES:
                self._unconfirmed.append(_Asked(asked.number, asked.action, stopwatch_s()))
            else:
                self._answer(asked.number, asked.action, "")
        self._confirm(companion)
        while self._open and stopwatch_s() - self._open[0].since_s > NO_ANSWER_S:
            late = self._open.popleft()
            self._answer(late.number, late.action, "the companion did not answer")
        done, self._done = self._done, []
        return done

    def _confirm(self, companion: Companion) -> None:
        """Tell of modes that have been changed, and of those that were not."""
        vehicle, waits = companion.vehicle, companion.mission_run.start_paused
        for asked in tuple(self._unconfirmed):
            holds = vehicle.heartbeat is not None and vehicle.heartbeat.mode == RoverMode.HOLD
            changed = holds or waits if asked.action == "pause" else vehicle.is_ours or companion.executor is None
            if changed or stopwatch_s() - asked.since_s > CONFIRMED_S:
                self._unconfirmed.remove(asked)
                self._answer(asked.number, asked.action, "" if changed else NOT_CHANGED)

    def _ask(self, action: str, asked: Json, companion: Companion, origin: GeoPoint | None) -> str:
        """Why a request is not passed on, in words; empty if it is."""
        if action == "resume" and companion.mission_run.is_driving:
            return NOT_PAUSED
        if companion.vehicle.heartbeat is None:
            return NOT_HEARD
        if action in MODES:
            self._station.pause(action == "pause")
            return ""
        executor = companion.executor
        if executor is None:
            return NOT_DRIVING
        if action == "goto":
            self._station.send_to(LocalFrame(origin or executor.layout.origin).to_geo(NedPoint(*asked["place"])))
            return ""
        progress = executor.progress
        if asked.get("goal") != progress.goal.name:
            return OTHER_GOAL
        self._station.skip_to(progress.following if progress.requested is None else progress.index)
        return ""

    def _answer(self, number: int, action: str, text: str, *, ok: bool = False) -> None:
        """``text``: what is wrong; empty for nothing. ``ok``: it is no fault."""
        answer = {"kind": "answer", "number": number, "action": action, "ok": ok or not text, "text": text}
        self._done.append(answer)
