"""Controller protocol: a path and a moment in, a command to the autopilot out. The command is defined here, too.

Nouns: controller, control command, purpose.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from enum import StrEnum
from typing import Protocol

from companion.control.local_view import LocalView
from companion.control.reference_path import Points, ReferencePath
from companion.vehicle.commands import GuidedVelocity, Setpoint

STOP = GuidedVelocity(0.0, 0.0)


class Purpose(StrEnum):
    """What a command is for."""

    DRIVE = "drive"
    """Get on along the path."""
    LOOK = "look"
    """Turn to see unseen ground, or move out of the way of something."""
    BRAKE = "brake"
    """Come to a stop; the path may go on afterwards."""
    BLOCKED = "blocked"
    """Stand: not even the next piece of the path can be driven."""
    STAND = "stand"
    """Stand: there is nothing to do."""


@dataclass(frozen=True, slots=True)
class ControlCommand:
    """What to tell the autopilot now. ``speed_m_s``: the speed to drive at, without a sign."""

    purpose: Purpose
    setpoint: Setpoint
    speed_m_s: float


def stop_for(purpose: Purpose) -> ControlCommand:
    """Velocity zero, for this purpose."""
    return ControlCommand(purpose, STOP, 0.0)


STANDSTILL = stop_for(Purpose.STAND)


class Controller(Protocol):
    """Leads one rover along paths. It may remember what it began; ``reset`` makes it forget that."""

    @property
    def backwards(self) -> bool:
        """Whether the rover rolls tail first."""
        ...

    def follow(self, path: ReferencePath, view: LocalView) -> ControlCommand:
        """The command for this moment on the way along a path."""
        ...

    def line_ahead(self, path: ReferencePath | None) -> ReferencePath | None:
        """The line that the rover is really led along: the path, or a manoeuvre back to it."""
        ...

    def foreseen(self, path: ReferencePath, view: LocalView, times_s: Points) -> Points | None:
        """Where the rover will be at these moments from now on, if nothing comes across; one row each, north and east.

        None: it follows the line ahead as it is told.
        """
        ...

    def turned_stops(self, view: LocalView, times_s: Points) -> Iterable[tuple[ControlCommand, Points]]:
        """Ways to stop while the rover turns that the ground allows: what to tell it, and where it then is, as above.

        Of the moment in which it was led last.
        """
        ...

    def reset(self) -> None:
        """The path is void, and with it any manoeuvre back to it."""
        ...
