"""The leg of an AUTO mission that the autopilot has handed over to the companion (NAV_GUIDED_ENABLE)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum

from companion.core.frames import GeoPoint
from companion.vehicle.events import GUIDED_TARGET, ItemCurrentSeen, ItemReachedSeen, LegSeen

LEG_KEPT_S = 2.5
"""The autopilot repeats the target every second.

After two lost repetitions it is unknown whether the leg still counts.
"""


class LegState(StrEnum):
    """Whether the companion may drive a leg that was handed over."""

    LIVE = "live"
    SILENT = "silent"
    """No longer repeated, or not in AUTO; it may become live again."""
    OVER = "over"
    """The autopilot has gone on to another item."""


@dataclass(frozen=True, slots=True)
class GuidedLeg:
    """A leg of an AUTO mission.

    ``told_s``: when its target was repeated last; ``index``: its mission item, None until known.
    """

    point: GeoPoint
    told_s: float
    index: int | None = None
    state: LegState = LegState.LIVE


def leg_after(leg: GuidedLeg | None, event: LegSeen | ItemReachedSeen | ItemCurrentSeen) -> GuidedLeg | None:
    """The leg after one more event of the AUTO mission."""
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
    """The leg after a heartbeat: silent when AUTO (armed) has been left, or after LEG_KEPT_S without repetition."""
    if leg is None or leg.state is not LegState.LIVE or (in_auto and time_s - leg.told_s <= LEG_KEPT_S):
        return leg
    return replace(leg, state=LegState.SILENT)
