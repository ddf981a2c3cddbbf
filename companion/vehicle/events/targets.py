"""Places that others give to the companion: a ground station's guided target, a leg that the autopilot's AUTO hands over."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum

from companion.core.frames import GeoPoint


class TargetForm(StrEnum):
    """How it was asked, which is how it is answered."""

    COMMAND = "command"
    """DO_REPOSITION, answered with COMMAND_ACK."""
    ITEM = "item"
    """A guided mission item, answered with MISSION_ACK."""


class TargetAnswer(StrEnum):
    """What the asker is told; the reason follows in words."""

    ACCEPTED = "accepted"
    DENIED = "denied"
    NOT_NOW = "not now"
    """The same may be accepted later."""
    BAD_FRAME = "bad frame"
    BAD_VALUE = "bad value"
    UNSUPPORTED = "unsupported"


@dataclass(frozen=True, slots=True)
class Asker:
    """Who asks, as MAVLink calls him."""

    system_id: int
    component_id: int


@dataclass(frozen=True, slots=True)
class TargetAsked:
    """DO_REPOSITION or a guided mission item, addressed to the companion itself.

    ``point`` is None when there is no place in it that could be driven to; ``fault`` and ``reason`` then say why.
    ``speed_m_s``: None for the mission's own.
    """

    time_s: float
    asker: Asker
    form: TargetForm
    point: GeoPoint | None
    speed_m_s: float | None = None
    fault: TargetAnswer = TargetAnswer.ACCEPTED
    reason: str = ""


@dataclass(frozen=True, slots=True)
class LegSeen:
    """SET_POSITION_TARGET_GLOBAL_INT of the autopilot to us: in AUTO, at NAV_GUIDED_ENABLE, once a second (ArduRover's ModeAuto)."""

    time_s: float
    point: GeoPoint


GUIDED_TARGET = 0


@dataclass(frozen=True, slots=True)
class ItemReachedSeen:
    """MISSION_ITEM_REACHED: a mission item is done; a guided target that was reached is told of as item 0."""

    time_s: float
    index: int


@dataclass(frozen=True, slots=True)
class ItemCurrentSeen:
    """MISSION_CURRENT: the navigation item under way, and how many items there are (None: not told)."""

    time_s: float
    index: int
    total: int | None = None


LEG_KEPT_S = 2.5
"""The autopilot repeats it every second: two repetitions may be lost, then nobody knows whether the leg is still ours."""


class LegState(StrEnum):
    """What is known of a leg that was handed over."""

    LIVE = "live"
    SILENT = "silent"
    """Not handed over any more, or not in AUTO: it may be again."""
    OVER = "over"
    """The autopilot has gone on to another item."""


@dataclass(frozen=True, slots=True)
class GuidedLeg:
    """A leg of AUTO's mission. ``told_s``: when it was handed over last; ``index``: its item, as soon as that is known."""

    point: GeoPoint
    told_s: float
    index: int | None = None
    state: LegState = LegState.LIVE


def leg_after(leg: GuidedLeg | None, event: LegSeen | ItemReachedSeen | ItemCurrentSeen) -> GuidedLeg | None:
    """The leg after one more event."""
    if isinstance(event, LegSeen):
        goes_on = leg is not None and leg.state is not LegState.OVER and leg.point == event.point
        return GuidedLeg(event.point, event.time_s, leg.index if leg is not None and goes_on else None)
    if leg is None or leg.state is LegState.OVER:
        return leg
    if isinstance(event, ItemReachedSeen):
        ours = event.index == leg.index or (leg.index is None and event.index != GUIDED_TARGET)
        return replace(leg, state=LegState.OVER) if ours else leg
    if leg.index is None:
        return replace(leg, index=event.index) if leg.state is LegState.LIVE else leg
    return leg if event.index == leg.index else replace(leg, state=LegState.OVER)


def leg_at_heartbeat(leg: GuidedLeg | None, time_s: float, *, in_auto: bool) -> GuidedLeg | None:
    """A leg is silent when AUTO (armed) has been left, or when it has not been handed over for too long."""
    if leg is None or leg.state is not LegState.LIVE or (in_auto and time_s - leg.told_s <= LEG_KEPT_S):
        return leg
    return replace(leg, state=LegState.SILENT)
