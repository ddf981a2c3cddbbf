"""Page requests: what people ask for on the page, asked of the companion as a ground station asks it.

Nouns: page request.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import Any

from companion.app import Companion
from companion.core.clock import stopwatch_s
from companion.core.frames import LocalFrame, NedPoint
from companion.mavlink.local_station import LocalStation
from companion.vehicle.events import RequestAnswer, RequestForm

NO_ANSWER_S = 4.0
FORMS = {
    "pause": RequestForm.PAUSE,
    "resume": RequestForm.PAUSE,
    "skip": RequestForm.SKIP,
    "goto": RequestForm.COMMAND,
}
NOT_DRIVING = "the mission has not begun"
OTHER_GOAL = "the rover heads for something else by now"

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
        self._done: list[Json] = []

    def take(self, asked: Json, companion: Companion) -> None:
        """A request as the web process passes it on: ``number``, ``action``, ``place`` (north and east), ``goal``."""
        number, action = int(asked["number"]), str(asked["action"])
        fault = self._ask(action, asked, companion)
        if fault:
            self._answer(number, action, fault)
        else:
            self._open.append(_Asked(number, action, stopwatch_s()))

    def answered(self) -> list[Json]:
        """The messages to the web process since the last call."""
        for answer in self._station.answers():
            asked = next((one for one in self._open if FORMS[one.action] is answer.form), None)
            if asked is not None:
                self._open.remove(asked)
                accepted = answer.answer is RequestAnswer.ACCEPTED
                self._answer(asked.number, asked.action, "" if accepted else answer.reason or answer.answer.value)
        while self._open and stopwatch_s() - self._open[0].since_s > NO_ANSWER_S:
            late = self._open.popleft()
            self._answer(late.number, late.action, "the companion did not answer")
        done, self._done = self._done, []
        return done

    def _ask(self, action: str, asked: Json, companion: Companion) -> str:
        """What is wrong with a request, in words; empty if it has been passed on."""
        if action in ("pause", "resume"):
            self._station.pause(action == "pause")
            return ""
        executor = companion.executor
        if executor is None:
            return NOT_DRIVING
        if action == "goto":
            self._station.send_to(LocalFrame(executor.layout.origin).to_geo(NedPoint(*asked["place"])))
            return ""
        progress = executor.progress
        if asked.get("goal") != progress.goal.name:
            return OTHER_GOAL
        self._station.skip_to(progress.index + (progress.requested is None))
        return ""

    def _answer(self, number: int, action: str, fault: str) -> None:
        answer = {"kind": "answer", "number": number, "action": action, "ok": not fault, "text": fault}
        self._done.append(answer)
