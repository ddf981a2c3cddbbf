"""Whether a rover that is led gets on, and if not, why; and why it has just taken another way.

To the companion it is driving all the while.

Nouns: hindrance, headway.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from enum import Enum

from companion.app import Companion, Status
from companion.core.frames import Pose
from companion.navigation.field_step import Decision, DecisionReason
from companion.safety.reasons import RunPhase

CIRCLES = ((0.3, 6.0), (1.0, 12.0))
"""Metres and seconds: a rover that gets on has left a circle of this radius after this time. A turn on the spot, or a
change of direction, takes less."""
YIELDS = ((0.3, 3.0),)
"""The same for one that makes way: it does not turn meanwhile."""
STANDS_M_S, STOOD_S = 0.15, 0.5
"""One that makes way and has been slower for so long stands for others."""
REROUTES = (
    DecisionReason.PATH_BLOCKED,
    DecisionReason.BETTER_PATH,
    DecisionReason.FOUND_GOING_BACK,
    DecisionReason.PAST_PATH_BLOCKED,
)
"""Decisions after which the rover turns off, so that people ask why."""
REROUTED_S = 5.0
"""So long the reason is told."""
MADE_WAY_S = 2.0
"""Way that was made longer ago is not why the rover stands now."""


class Hindrance(Enum):
    """Why a rover that is led does not get on."""

    STUCK = "stuck, looking for another way"
    MAKES_WAY = "making way for something that moves"
    HARDLY = "hardly any progress"


class Headway:
    """Watches one companion, tick by tick."""

    def __init__(self) -> None:
        self.hindrance: Hindrance | None = None
        """Why it does not get on now; None where it does, or is not to drive."""
        self.line = ""
        """The same in words, with where it is to drive."""
        self.begins = False
        """Whether this tick is the first of it."""
        self.rerouted = ""
        """Why it has just taken another way, in words; empty where it has not."""
        self.stands_for_others = False
        """Whether it stands now, because something moves: that is no hindrance yet, but what it does."""
        self._stands_since_s: float | None = None
        self._decision: Decision | None = None
        self._target = ""
        self._rerouted_s = -math.inf
        self._centres: dict[float, Pose] = {}
        self._made_way_s = -math.inf
        self._stuck: int | None = None
        """How often it had been stuck when it last knew where to drive."""

    def note(self, companion: Companion, status: Status) -> None:
        """To be called after each tick."""
        before, self.hindrance = self.hindrance, self._look(companion, status)
        self.line = "" if self.hindrance is None else _line(self.hindrance, status.target)
        self.begins = self.hindrance not in (None, before)
        self._note_decision(status)

    def doing(self, target: str) -> str:
        """What it does in place of driving; empty where it drives."""
        return self.line or (_line(Hindrance.MAKES_WAY, target) if self.stands_for_others else "")

    def _note_decision(self, status: Status) -> None:
        """A decision stands until the rover enters the next field; its reason is told for longer.

        It is no reason for where the rover goes after a stop, or to another target.
        """
        decision, before = status.decision, self._decision
        self._decision = decision
        if status.target != self._target or status.activity.phase is not RunPhase.DRIVING:
            self.rerouted, self._target = "", status.target
        elif decision is not None and decision is not before and decision.reason in REROUTES:
            self.rerouted, self._rerouted_s = str(decision.reason), status.time_s
        elif status.time_s - self._rerouted_s > REROUTED_S:
            self.rerouted = ""

    def _look(self, companion: Companion, status: Status) -> Hindrance | None:
        driver, pose = companion.driver, status.pose
        if driver is None or pose is None or status.activity.phase is not RunPhase.DRIVING or not status.target:
            self._centres, self._stuck, self._stands_since_s, self.stands_for_others = {}, None, None, False
            return None
        if abs(companion.vehicle.forward_m_s) > STANDS_M_S:
            self._stands_since_s = None
        elif self._stands_since_s is None:
            self._stands_since_s = status.time_s
        if self._stuck is None or driver.decision is not None:
            self._stuck = driver.tally.stuck
        if driver.makes_way:
            self._made_way_s = status.time_s
        made_way = status.time_s - self._made_way_s <= MADE_WAY_S
        since_s = self._stands_since_s
        self.stands_for_others = made_way and since_s is not None and status.time_s - since_s >= STOOD_S
        if driver.tally.stuck > self._stuck:
            self._centres = {}
            return Hindrance.STUCK
        if not self._lingers(pose, status.time_s, YIELDS if made_way else CIRCLES):
            return None
        return Hindrance.MAKES_WAY if made_way else Hindrance.HARDLY

    def _lingers(self, pose: Pose, time_s: float, circles: Sequence[tuple[float, float]]) -> bool:
        """Whether it has not left one of the circles in time."""
        for radius_m, _ in CIRCLES:
            centre = self._centres.get(radius_m)
            if centre is None or pose.point.distance_m(centre.point) >= radius_m:
                self._centres[radius_m] = pose
        return any(time_s - self._centres[radius_m].time_s >= limit_s for radius_m, limit_s in circles)


def _line(hindrance: Hindrance, target: str) -> str:
    where = " to" if hindrance is Hindrance.STUCK else ", heading for"
    return f"{hindrance.value}{where} {target}"
