"""The notifier: texts for the ground station and the terminal; the run's status and outcome as people see them.

Nouns: notifier, status, outcome.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, field

from companion.core.clock import Clock
from companion.core.frames import Pose
from companion.core.severity import Severity
from companion.executive.mission_progress import TargetStatus
from companion.executive.mission_run import MissionRun
from companion.mavlink.autopilot_link import AutopilotLink
from companion.mavlink.rates import RateFault
from companion.navigation.field_step import Decision
from companion.safety.mode_latch import Control
from companion.safety.reasons import Activity, PowerReason, Reason
from companion.vehicle.commands import StatusText
from companion.vehicle.motion_limits import FASTEST, full_throttle_m_s

NOT_FOLLOWED_S = 5.0
"""People are told when the autopilot's read-back has shown another target for this long."""
SILENT_S = 3.0
"""Without a heartbeat for so long the autopilot is silent."""
FAULT_AFTER_S = 5.0
"""A message rate that is too low for a moment is not told."""
TICKS_KEPT = 100_000
"""The times of this many of the newest ticks are kept."""
BACK_S = 2.0
"""A link that has another end again is told after so long: some end at once."""
CRUISE_SET_SHARE = 0.75
"""The throttle that is advised, with the speed that belongs to it."""
SAID_KEPT = 1000
"""This many texts are remembered as said."""


@dataclass(frozen=True, slots=True)
class News:
    """A text and how severe it is."""

    severity: Severity
    text: str
    own: bool = True
    """Whether the companion says it; otherwise the autopilot does."""


@dataclass(frozen=True, slots=True)
class Status:
    """What a person wants to see while it drives. ``news``: what was said, by the autopilot as well, in this tick."""

    time_s: float
    activity: Activity
    pose: Pose | None
    decision: Decision | None
    target: str
    targets_reached: int
    targets: int
    steps: int
    news: tuple[News, ...] = ()

    @property
    def doing(self) -> str:
        """The activity in words."""
        return str(self.activity)


@dataclass
class Outcome:
    """What the run came to. ``tick_seconds``: how long the newest ticks took; ``said``: the newest texts."""

    targets: list[tuple[str, TargetStatus]] = field(default_factory=list)
    tick_seconds: deque[float] = field(default_factory=lambda: deque(maxlen=TICKS_KEPT))
    said: list[str] = field(default_factory=list)
    missed: int = 0
    """Targets that were not reached in laps of a patrol that have ended."""
    broken_off: Reason[PowerReason] | None = None
    """Why the mission was broken off; None if it was not."""

    @property
    def complete(self) -> bool:
        """Whether every target has been reached, in every lap."""
        return (
            not self.missed and bool(self.targets) and all(status is TargetStatus.REACHED for _, status in self.targets)
        )


class Notifier:
    """Tells texts to the ground station, none twice in a row, and keeps them in the list ``said``."""

    def __init__(self, autopilot: AutopilotLink, clock: Clock, said: list[str]) -> None:
        self.said = said
        self.news: list[News] = []
        """What was said in this tick, by the autopilot as well."""
        self._autopilot = autopilot
        self._clock = clock
        self._followed_s = clock.now_s()
        self._slow_since_s: dict[int, float] = {}
        self._faults_told: set[str] = set()
        self._warned: set[str] = set()
        self._connected, self._cut_s, self._scale_told = True, -math.inf, False

    def tell(self, text: str, severity: Severity) -> None:
        """Say it, unless it is what was said last."""
        if self.said and self.said[-1] == text:
            return
        self.said.append(text)
        del self.said[:-SAID_KEPT]
        self.news.append(News(severity, text))
        self._autopilot.send(StatusText(severity, text), self._clock.now_s())

    def once(self, text: str) -> None:
        """Warn of what stays so, the first time only."""
        if text not in self._warned:
            self._warned.add(text)
            self.tell(text, Severity.WARNING)

    def note(self, text: str, severity: Severity) -> None:
        """Keep a text of the autopilot's for the terminal."""
        self.news.append(News(severity, text, own=False))

    def _tell_link(self, now_s: float) -> None:
        """That the link is cut, and that it is back for some time; not over the link, where nobody would hear it."""
        connected, place = self._autopilot.connected, self._autopilot.description
        if not connected:
            self._cut_s = now_s
        if self._connected and not connected:
            self.news.append(News(Severity.WARNING, f"The link is cut: {place}"))
            self._connected = False
        elif not self._connected and now_s - self._cut_s > BACK_S:
            self.news.append(News(Severity.INFO, f"The link is back: {place}"))
            self._connected = True

    def tell_faults(self, run: MissionRun, now_s: float, problems: tuple[str, ...]) -> None:
        """Faults that stop nothing, each told once. ``problems``: of the record and the state file."""
        if run.vehicle.heartbeat is not None:
            self._tell_link(now_s)
            if self._autopilot.signing_trouble:
                self.once(self._autopilot.signing_trouble)
        if run.executor is None:
            for text in self.lasting_faults((), problems, now_s):  # a full disk can be mended before the mission begins
                self.once(text)
            return
        if intruder := self._autopilot.intruder(now_s):
            self.once(intruder)
        if run.latch.control is not Control.COMPANION or self._autopilot.target_confirmed is not False:
            self._followed_s = now_s
        elif now_s - self._followed_s > NOT_FOLLOWED_S:
            self.once("The autopilot follows another target than the one sent: does another program steer it?")
        if run.full_throttle.doubted and run.full_throttle.m_s is not None and not self._scale_told:
            self._scale_told = True
            self.tell(_throttle_text(run.full_throttle.m_s, run.vehicle.parameters), Severity.WARNING)
        heartbeat = run.vehicle.heartbeat
        silent = heartbeat is None or now_s - heartbeat.time_s > SILENT_S  # then everything is missing
        rates = () if silent else self._autopilot.rate_faults
        for text in self.lasting_faults(rates, problems, now_s):
            self.once(text)

    def lasting_faults(self, rates: tuple[RateFault, ...], problems: tuple[str, ...], now_s: float) -> list[str]:
        """The texts for messages that have come too seldom for some time, and for ``problems``; each is given once."""
        slow = {fault.message_id: self._slow_since_s.get(fault.message_id, now_s) for fault in rates}
        self._slow_since_s = slow
        texts = {
            f"{fault.name} too seldom": _rate_text(fault)
            for fault in rates
            if now_s - slow[fault.message_id] >= FAULT_AFTER_S
        }
        texts.update({problem: problem for problem in problems})
        new = [text for what, text in texts.items() if what not in self._faults_told]
        self._faults_told.update(texts)
        return new


def _throttle_text(seen_m_s: float, parameters: Mapping[str, float]) -> str:
    """What to set where the scale of the throttle is far off."""
    told_m_s, cruise_m_s = full_throttle_m_s(parameters), CRUISE_SET_SHARE * seen_m_s
    fastest_m_s = parameters.get(FASTEST, 0.0)
    slower = f", and WP_SPEED to {0.9 * seen_m_s:.2f}" if fastest_m_s > seen_m_s else ""
    return (
        f"The rover drives {seen_m_s:.2f} m/s at full throttle, not {told_m_s:.2f} as CRUISE_SPEED and CRUISE_THROTTLE "
        f"say: if this ground is firm, set them to {cruise_m_s:.2f} and {100 * CRUISE_SET_SHARE:.0f}{slower}"
    )


def _rate_text(fault: RateFault) -> str:
    means = f": {fault.means}" if fault.means else ""
    return f"{fault.name}: {fault.measured_hz:.1f} Hz instead of {fault.wanted_hz:g}, asking again{means}"


def status_of(run: MissionRun, notifier: Notifier, now_s: float) -> Status:
    """A picture of this moment."""
    executor = run.executor
    return Status(
        time_s=now_s,
        activity=run.activity,
        pose=run.vehicle.pose_at(now_s),
        decision=executor.driver.decision if executor else None,
        target=executor.progress.goal.name if executor and not executor.progress.ended else "",
        targets_reached=executor.reached if executor else 0,
        targets=len(run.mission.targets),
        steps=executor.driver.tally.steps if executor else 0,
        news=tuple(notifier.news),
    )
