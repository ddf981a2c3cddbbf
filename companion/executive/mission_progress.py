"""Progress through the mission: which target is next, and what happens when one cannot be reached. Pure.

Nouns: mission progress, mission phase, target status.
"""

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


class MissionPhase(StrEnum):
    """What the rover is doing for the mission as a whole."""

    TRAVEL = "travel"
    STAY = "stay"
    WAIT = "wait"
    HOME = "home"
    HOLD = "hold"
    DONE = "done"


@dataclass(frozen=True, slots=True)
class MissionProgress:
    """Progress through the targets. ``until_s`` ends a stay or a wait; ``home`` is where the mission began.

    ``requested``: a place that a person asked for on the way; it comes first, then the mission goes on where it was.
    """

    targets: tuple[ResolvedTarget, ...]
    home: ResolvedTarget
    statuses: tuple[TargetStatus, ...]
    index: int = 0
    phase: MissionPhase = MissionPhase.TRAVEL
    until_s: float = 0.0
    give_up_s: float | None = None
    requested: ResolvedTarget | None = None

    @property
    def ended(self) -> bool:
        """Whether there is nowhere left to go."""
        return self.requested is None and self.phase in (MissionPhase.DONE, MissionPhase.HOLD)

    @property
    def goal(self) -> ResolvedTarget:
        """Where the rover is heading now."""
        if self.requested is not None:
            return self.requested
        return (
            self.home
            if self.phase is MissionPhase.HOME or self.index >= len(self.targets)
            else self.targets[self.index]
        )


def plan_progress(targets: tuple[ResolvedTarget, ...], home: ResolvedTarget) -> MissionProgress:
    """The progress at the start of a mission."""
    return MissionProgress(targets, home, (TargetStatus.PENDING,) * len(targets))


def with_requested(progress: MissionProgress, requested: ResolvedTarget) -> MissionProgress:
    """The requested goal first, replacing an earlier one. It ends a stay; a wait becomes another try."""
    if progress.requested is None and progress.phase is MissionPhase.STAY:
        progress = _next(progress)
    elif progress.phase is MissionPhase.WAIT:
        progress = replace(progress, phase=MissionPhase.TRAVEL)
    return replace(progress, requested=requested)


def parked(progress: MissionProgress) -> MissionProgress:
    """Nowhere to go until a leg is handed over; the end when every target has had its turn."""
    over = TargetStatus.PENDING not in progress.statuses
    return replace(progress, phase=MissionPhase.DONE if over else MissionPhase.STAY, until_s=math.inf)


def sent_to(progress: MissionProgress, index: int) -> MissionProgress:
    """To this target, whatever the order."""
    return replace(progress, index=index, phase=MissionPhase.TRAVEL, give_up_s=None)


def ended_at(progress: MissionProgress, status: TargetStatus) -> MissionProgress:
    """The autopilot has ended this target; ``status`` is what has become of it."""
    return parked(_marked(progress, status))


def skipped(progress: MissionProgress) -> MissionProgress:
    """Without the present goal: a requested one is dropped, a target counts as skipped unless it was reached."""
    if progress.requested is not None:
        return replace(progress, requested=None)
    if progress.statuses[progress.index] is not TargetStatus.REACHED:
        progress = _marked(progress, TargetStatus.SKIPPED)
    return _next(replace(progress, give_up_s=None))


def relaid(
    progress: MissionProgress,
    targets: tuple[ResolvedTarget, ...],
    home: ResolvedTarget,
    requested: ResolvedTarget | None = None,
) -> MissionProgress:
    """The same progress with every place where it lies now: the local frame has moved."""
    return replace(progress, targets=targets, home=home, requested=requested)


def on_reached(progress: MissionProgress, now_s: float) -> MissionProgress:
    """The goal has been reached: stay as long as the target asks, or be done."""
    if progress.requested is not None:
        return replace(progress, requested=None)
    if progress.phase is MissionPhase.HOME:
        return replace(progress, phase=MissionPhase.DONE)
    progress = _marked(progress, TargetStatus.REACHED)
    return replace(
        progress, phase=MissionPhase.STAY, until_s=now_s + progress.targets[progress.index].hold_s, give_up_s=None
    )


def on_unreachable(progress: MissionProgress, now_s: float, retry_s: float, wait_limit_s: float) -> MissionProgress:
    """The goal cannot be reached: ``on_blocked`` decides. A requested goal is dropped."""
    if progress.requested is not None:
        return replace(progress, requested=None)
    if progress.phase is MissionPhase.HOME:
        return replace(progress, phase=MissionPhase.HOLD)
    progress = _marked(progress, TargetStatus.UNREACHABLE)
    match progress.targets[progress.index].on_blocked:
        case OnBlocked.SKIP:
            return _next(progress)
        case OnBlocked.WAIT:
            give_up_s = now_s + wait_limit_s if progress.give_up_s is None else progress.give_up_s
            if now_s >= give_up_s:
                return _next(replace(progress, give_up_s=None))
            return replace(progress, phase=MissionPhase.WAIT, until_s=now_s + retry_s, give_up_s=give_up_s)
        case OnBlocked.RETURN:
            return replace(_skipped_rest(progress), phase=MissionPhase.HOME)
        case _:
            return replace(_skipped_rest(progress), phase=MissionPhase.HOLD)


def returning(progress: MissionProgress, place: ResolvedTarget) -> MissionProgress:
    """Nothing but back to a place: the targets not reached yet are skipped, a requested goal is dropped."""
    return replace(_skipped_rest(progress), phase=MissionPhase.HOME, home=place, requested=None)


def on_time(progress: MissionProgress, now_s: float) -> MissionProgress:
    """A stay that is over leads to the next target, a wait that is over to another try."""
    if progress.phase is MissionPhase.STAY and now_s >= progress.until_s:
        return _next(progress)
    if progress.phase is MissionPhase.WAIT and now_s >= progress.until_s:
        return replace(progress, phase=MissionPhase.TRAVEL)
    return progress


def _next(progress: MissionProgress) -> MissionProgress:
    if progress.index + 1 >= len(progress.targets):
        return replace(progress, index=len(progress.targets), phase=MissionPhase.DONE)
    return replace(progress, index=progress.index + 1, phase=MissionPhase.TRAVEL)


def _marked(progress: MissionProgress, status: TargetStatus) -> MissionProgress:
    statuses = list(progress.statuses)
    statuses[progress.index] = status
    return replace(progress, statuses=tuple(statuses))


def _skipped_rest(progress: MissionProgress) -> MissionProgress:
    rest = tuple(TargetStatus.SKIPPED if status is TargetStatus.PENDING else status for status in progress.statuses)
    return replace(progress, statuses=rest)
