"""A finding of the doctor: what is wrong with an autopilot, how grave it is, and what to do about it."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum


class Level(StrEnum):
    """How grave a finding is."""

    STOP = "stop"
    """A mission would not begin, or would fail."""
    WARN = "warn"
    """A mission may fail or drive badly."""
    NOTE = "note"
    """Good to know."""


@dataclass(frozen=True, slots=True)
class Finding:
    """A finding. ``parameter``, its ``value`` and the ``wanted`` value, if one is to be set."""

    name: str
    level: Level
    says: str
    remedy: str
    parameter: str = ""
    value: float | None = None
    wanted: float | None = None


def to_set(name: str, level: Level, says: str, parameter: str, value: float, wanted: float) -> Finding:
    """A parameter that should have another value."""
    return Finding(name, level, says, f"set {parameter} to {wanted:g}", parameter, value, wanted)
