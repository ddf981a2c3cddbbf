"""One thing that is worth saying of an autopilot: how grave it is, and what to do about it."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum


class Level(StrEnum):
    """How grave."""

    STOP = "stop"
    """A mission would not begin, or not end well."""
    WARN = "warn"
    """It may go wrong, or badly."""
    NOTE = "note"
    """Good to know."""


@dataclass(frozen=True, slots=True)
class Finding:
    """``parameter``, ``value`` (as it is) and ``wanted`` where there is one to be set."""

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
