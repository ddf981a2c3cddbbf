"""Places that others ask the companion to drive to while it drives: a ground station's guided target."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from companion.frames import GeoPoint


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
