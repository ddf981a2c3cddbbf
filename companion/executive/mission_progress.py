"""Which target is next, and what becomes of the mission when one cannot be reached. Pure."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from enum import StrEnum

from companion.mission.mission import OnBlocked
from companion.mission.resolve import ResolvedTarget


class TargetStatus(StrEnum):
    """What became of a target."""

    PENDING = "pending"
    REACHED = "reached"
    UNREACHABLE = "unreachable"
    SKIPPED = "skipped"


class Leg(StrEnum):
    """What the rover is doing for the mission as a whole."""

    TRAVEL = "travel"
    STAY = "stay"
    WAIT = "wait"
    HOME = "home"
    HOLD = "hold"
    DONE = "done"


@dataclass(frozen=True, slots=True)
class Itinerary:
    """Progress through the targets. ``until_s`` ends a stay or a wait; ``home`` is where the mission began.

    ``errand``: a place that somebody asked for on the way; it comes first, then the mission goes on where it was.
    """

    targets: tuple[ResolvedTarget, ...]
    home: ResolvedTarget
    statuses: tuple[TargetStatus, ...]
    index: int = 0
    leg: Leg = Leg.TRAVEL
    until_s: float = 0.0
    give_up_s: float | None = None
    errand: ResolvedTarget | None = None

    @property
    def ended(self) -> bool:
        """Whether there is nowhere left to go."""
        return self.errand is None and self.leg in (Leg.DONE, Leg.HOLD)

    @property
    def goal(self) -> ResolvedTarget:
        """Where the rover is heading now."""
        if self.errand is not None:
            return self.errand
        return self.home if self.leg is Leg.HOME or self.index >= len(self.targets) else self.targets[self.index]


def plan_itinerary(targets: tuple[ResolvedTarget, ...], home: ResolvedTarget) -> Itinerary:
    """The itinerary at the start of a mission."""
    return Itinerary(targets, home, (TargetStatus.PENDING,) * len(targets))


def with_errand(itinerary: Itinerary, errand: ResolvedTarget) -> Itinerary:
    """The errand first, instead of one under way. A stay that it interrupts is over, a wait becomes another try after it."""
    if itinerary.errand is None and itinerary.leg is Leg.STAY:
        itinerary = _next(itinerary)
    elif itinerary.leg is Leg.WAIT:
        itinerary = replace(itinerary, leg=Leg.TRAVEL)
    return replace(itinerary, errand=errand)


def parked(itinerary: Itinerary) -> Itinerary:
    """Nowhere to go until somebody says so; all over when every target has had its turn."""
    over = TargetStatus.PENDING not in itinerary.statuses
    return replace(itinerary, leg=Leg.DONE if over else Leg.STAY, until_s=math.inf)


def sent_to(itinerary: Itinerary, index: int) -> Itinerary:
    """To this target, whatever the order."""
    return replace(itinerary, index=index, leg=Leg.TRAVEL, give_up_s=None)


def ended_at(itinerary: Itinerary, status: TargetStatus) -> Itinerary:
    """Somebody else has ended this target: that is what has become of it."""
    return parked(_marked(itinerary, status))


def relaid(
    itinerary: Itinerary,
    targets: tuple[ResolvedTarget, ...],
    home: ResolvedTarget,
    errand: ResolvedTarget | None = None,
) -> Itinerary:
    """The same progress with every place where it lies now: the local frame has moved."""
    return replace(itinerary, targets=targets, home=home, errand=errand)


def on_reached(itinerary: Itinerary, now_s: float) -> Itinerary:
    """The goal has been reached: stay as long as the target asks, or be done."""
    if itinerary.errand is not None:
        return replace(itinerary, errand=None)
    if itinerary.leg is Leg.HOME:
        return replace(itinerary, leg=Leg.DONE)
    itinerary = _marked(itinerary, TargetStatus.REACHED)
    return replace(itinerary, leg=Leg.STAY, until_s=now_s + itinerary.targets[itinerary.index].hold_s, give_up_s=None)


def on_unreachable(itinerary: Itinerary, now_s: float, retry_s: float, wait_limit_s: float) -> Itinerary:
    """The goal cannot be reached, and the rover is back where the leg began: ``on_blocked`` decides. An errand is dropped."""
    if itinerary.errand is not None:
        return replace(itinerary, errand=None)
    if itinerary.leg is Leg.HOME:
        return replace(itinerary, leg=Leg.HOLD)
    itinerary = _marked(itinerary, TargetStatus.UNREACHABLE)
    match itinerary.targets[itinerary.index].on_blocked:
        case OnBlocked.SKIP:
            return _next(itinerary)
        case OnBlocked.WAIT:
            give_up_s = now_s + wait_limit_s if itinerary.give_up_s is None else itinerary.give_up_s
            if now_s >= give_up_s:
                return _next(replace(itinerary, give_up_s=None))
            return replace(itinerary, leg=Leg.WAIT, until_s=now_s + retry_s, give_up_s=give_up_s)
        case OnBlocked.RETURN:
            return replace(_skipped_rest(itinerary), leg=Leg.HOME)
        case _:
            return replace(_skipped_rest(itinerary), leg=Leg.HOLD)


def returning(itinerary: Itinerary, place: ResolvedTarget) -> Itinerary:
    """Nothing but back to a place: the targets not reached yet are skipped, an errand is dropped."""
    return replace(_skipped_rest(itinerary), leg=Leg.HOME, home=place, errand=None)


def on_time(itinerary: Itinerary, now_s: float) -> Itinerary:
    """A stay that is over leads to the next target, a wait that is over to another try."""
    if itinerary.leg is Leg.STAY and now_s >= itinerary.until_s:
        return _next(itinerary)
    if itinerary.leg is Leg.WAIT and now_s >= itinerary.until_s:
        return replace(itinerary, leg=Leg.TRAVEL)
    return itinerary


def _next(itinerary: Itinerary) -> Itinerary:
    if itinerary.index + 1 >= len(itinerary.targets):
        return replace(itinerary, index=len(itinerary.targets), leg=Leg.DONE)
    return replace(itinerary, index=itinerary.index + 1, leg=Leg.TRAVEL)


def _marked(itinerary: Itinerary, status: TargetStatus) -> Itinerary:
    statuses = list(itinerary.statuses)
    statuses[itinerary.index] = status
    return replace(itinerary, statuses=tuple(statuses))


def _skipped_rest(itinerary: Itinerary) -> Itinerary:
    rest = tuple(TargetStatus.SKIPPED if status is TargetStatus.PENDING else status for status in itinerary.statuses)
    return replace(itinerary, statuses=rest)
