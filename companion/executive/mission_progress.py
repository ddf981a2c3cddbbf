"""Progress through the mission: which target is next, what happens when one cannot be reached, and laps. Pure.

Nouns: mission progress, mission phase, target status.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from enum import StrEnum

from companion.core.frames import NedPoint
from companion.executive.command_progress import NO_COMMANDS, START, CommandProgress, arrived, given_up, missed
from companion.mission.do_commands import DoCommand
from companion.mission.mission import OnBlocked, Patrol
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
    ``patrol``: the targets that are driven again and again, ``lap`` counts from 1; ``last_lap``: what became of the
    patrol's targets in the lap before; ``missed``: how many were not reached in all laps that have ended.
    """

    targets: tuple[ResolvedTarget, ...]
    home: ResolvedTarget
    statuses: tuple[TargetStatus, ...]
    index: int = 0
    phase: MissionPhase = MissionPhase.TRAVEL
    until_s: float = 0.0
    give_up_s: float | None = None
    requested: ResolvedTarget | None = None
    commands: CommandProgress = NO_COMMANDS
    patrol: Patrol | None = None
    lap: int = 1
    last_lap: tuple[TargetStatus, ...] = ()
    missed: int = 0

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

    @property
    def tries_again(self) -> bool:
        """Whether the target that counts as unreachable now will be tried again."""
        under_way = self.phase in (MissionPhase.TRAVEL, MissionPhase.WAIT) and self.index < len(self.targets)
        waits = self.give_up_s is not None and under_way
        return waits and self.statuses[self.index] is TargetStatus.UNREACHABLE

    @property
    def following(self) -> int:
        """The index of the target after the present one; the number of targets if there is none."""
        after = self.index + 1
        if self.patrol is None or after < len(self.targets) or self.is_last_lap:
            return after
        return self.patrol.first

    @property
    def is_last_lap(self) -> bool:
        """Whether the patrol ends with this lap; True without a patrol."""
        return self.patrol is None or (self.patrol.laps is not None and self.lap >= self.patrol.laps)


def plan_progress(
    targets: tuple[ResolvedTarget, ...],
    home: ResolvedTarget,
    patrol: Patrol | None = None,
    commands: tuple[DoCommand, ...] = (),
    now_s: float = 0.0,
) -> MissionProgress:
    """The progress at the start of a mission. ``commands``: to be sent there."""
    opened = arrived(NO_COMMANDS, START, commands, now_s, home.point)
    return MissionProgress(targets, home, (TargetStatus.PENDING,) * len(targets), commands=opened, patrol=patrol)


def with_requested(progress: MissionProgress, requested: ResolvedTarget) -> MissionProgress:
    """The requested goal first, replacing an earlier one. It ends a stay; a wait becomes another try."""
    progress = _leaving(progress)
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
    return _next(replace(_leaving(progress), give_up_s=None))


def ended_early(progress: MissionProgress) -> MissionProgress:
    """The mission ends here: the targets not reached yet are skipped."""
    return replace(_skipped_rest(_leaving(progress)), phase=MissionPhase.DONE, index=len(progress.targets))


def _leaving(progress: MissionProgress) -> MissionProgress:
    """The rover leaves a place though commands may be open there."""
    return replace(progress, commands=given_up(progress.commands)) if progress.commands.keeps_here else progress


def relaid(
    progress: MissionProgress,
    targets: tuple[ResolvedTarget, ...],
    home: ResolvedTarget,
    requested: ResolvedTarget | None = None,
) -> MissionProgress:
    """The same progress with every place where it lies now: the local frame has moved."""
    return replace(progress, targets=targets, home=home, requested=requested)


def on_reached(progress: MissionProgress, now_s: float, at: NedPoint | None = None) -> MissionProgress:
    """The goal has been reached: stay as long as the target asks, or be done.

    ``at``: where the rover is, in the local frame; None: at the goal itself.
    """
    if progress.requested is not None:
        return replace(progress, requested=None)
    if progress.phase is MissionPhase.HOME:
        return replace(progress, phase=MissionPhase.DONE)
    progress, target = _marked(progress, TargetStatus.REACHED), progress.targets[progress.index]
    return replace(
        progress,
        phase=MissionPhase.STAY,
        until_s=now_s + target.hold_s,
        give_up_s=None,
        commands=arrived(progress.commands, progress.index, target.commands, now_s, at or target.point),
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
    progress = replace(progress, commands=given_up(progress.commands))
    return replace(_skipped_rest(progress), phase=MissionPhase.HOME, home=place, requested=None)


def on_time(progress: MissionProgress, now_s: float) -> MissionProgress:
    """A stay that is over leads to the next target, a wait that is over to another try.

    A stay is not over while a command that belongs to the place is open.
    """
    if progress.phase is MissionPhase.STAY and now_s >= progress.until_s and not progress.commands.keeps_here:
        return _next(progress)
    if progress.phase is MissionPhase.WAIT and now_s >= progress.until_s:
        return replace(progress, phase=MissionPhase.TRAVEL)
    return progress


def stood_still(progress: MissionProgress, now_s: float, retry_s: float) -> MissionProgress:
    """A lap in which the rover has not moved: the next one begins after a while."""
    if progress.phase is not MissionPhase.TRAVEL:
        return progress
    return replace(progress, phase=MissionPhase.WAIT, until_s=now_s + retry_s)


def _next(progress: MissionProgress) -> MissionProgress:
    """On to the next target, the next lap, or the end. The commands of a target that was not reached are left out."""
    target = progress.targets[progress.index]
    if progress.statuses[progress.index] is not TargetStatus.REACHED:
        commands = missed(progress.commands, progress.index, target.commands)
        progress = replace(progress, commands=commands)
    following, patrol = progress.following, progress.patrol
    if patrol is not None and progress.index + 1 >= len(progress.targets):
        progress = _lap_ended(progress, patrol.first)
    if following >= len(progress.targets):
        commands = given_up(progress.commands)
        return replace(progress, index=following, phase=MissionPhase.DONE, commands=commands)
    return replace(progress, index=following, phase=MissionPhase.TRAVEL)


def _lap_ended(progress: MissionProgress, first: int) -> MissionProgress:
    lap, anew = progress.statuses[first:], progress.statuses[:first]
    return replace(
        progress,
        lap=progress.lap + 1,
        last_lap=lap,
        missed=progress.missed + sum(status is not TargetStatus.REACHED for status in lap),
        statuses=progress.statuses if progress.is_last_lap else anew + (TargetStatus.PENDING,) * len(lap),
    )


def _marked(progress: MissionProgress, status: TargetStatus) -> MissionProgress:
    statuses = list(progress.statuses)
    statuses[progress.index] = status
    return replace(progress, statuses=tuple(statuses))


def _skipped_rest(progress: MissionProgress) -> MissionProgress:
    rest = tuple(TargetStatus.SKIPPED if status is TargetStatus.PENDING else status for status in progress.statuses)
    return replace(progress, statuses=rest)
