"""What people are told: at the ground station, and where the companion runs. Nothing twice in a row."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field

from companion.core.frames import Pose
from companion.executive.mission_progress import TargetStatus
from companion.mavlink.rates import RateFault
from companion.navigation.field_step import Decision

FAULT_AFTER_S = 5.0
"""A message rate that is too low for a moment is not worth a word."""
STEPS_KEPT = 100_000
"""The times of so many of the newest rounds are kept."""

SAID_KEPT = 1000
"""Of so many texts it is remembered that they were said."""


@dataclass(frozen=True, slots=True)
class News:
    """A text and how severe it is (as in MAVLink: 6 info, 4 warning, 3 error)."""

    severity: int
    text: str


@dataclass(frozen=True, slots=True)
class Status:
    """What a person wants to see while it drives. ``news``: what was said, by the autopilot as well, in this tick."""

    time_s: float
    doing: str
    pose: Pose | None
    decision: Decision | None
    target: str
    targets_reached: int
    targets: int
    steps: int
    news: tuple[News, ...] = ()


@dataclass
class Outcome:
    """What the run came to. ``step_seconds``: how long the newest ticks took."""

    targets: list[tuple[str, TargetStatus]] = field(default_factory=list)
    step_seconds: deque[float] = field(default_factory=lambda: deque(maxlen=STEPS_KEPT))
    said: list[str] = field(default_factory=list)

    @property
    def complete(self) -> bool:
        """Whether every target has been reached."""
        return bool(self.targets) and all(status is TargetStatus.REACHED for _, status in self.targets)


@dataclass
class Reporter:
    """Keeps what has been said."""

    said: list[str]
    doing: str = "connecting"
    news: list[News] = field(default_factory=list)
    _slow_since_s: dict[int, float] = field(default_factory=dict)
    _told: set[str] = field(default_factory=set)

    def say(self, text: str, severity: int) -> bool:
        """Note a text for the ground station; False when it is what was said last."""
        if self.said and self.said[-1] == text:
            return False
        self.said.append(text)
        del self.said[:-SAID_KEPT]
        self.news.append(News(severity, text))
        return True

    def note(self, text: str, severity: int) -> None:
        """Note a text for those who watch the companion itself."""
        self.news.append(News(severity, text))

    def faults(self, rates: tuple[RateFault, ...], problem: str, now_s: float) -> list[str]:
        """What is to be said of messages that come too seldom for some time, and of a record that has ended; each once."""
        slow = {fault.message_id: self._slow_since_s.get(fault.message_id, now_s) for fault in rates}
        self._slow_since_s = slow
        texts = {
            f"{fault.name} too seldom": f"{fault.name}: {fault.measured_hz:.1f} Hz instead of {fault.wanted_hz:g}, asking again"
            f"{': ' if fault.means else ''}{fault.means}"
            for fault in rates
            if now_s - slow[fault.message_id] >= FAULT_AFTER_S
        }
        if problem:
            texts[problem] = problem
        new = [text for what, text in texts.items() if what not in self._told]
        self._told.update(texts)
        return new
