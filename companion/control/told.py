"""What the rover was told lately by velocity: a command shows only after the dead time of autopilot and rover.

Nouns: told velocity.
"""

from __future__ import annotations

from typing import NamedTuple

from companion.vehicle.commands import GuidedVelocity, Setpoint

KEPT_S = 2.0


class ToldVelocity(NamedTuple):
    """A command, and when it was given: forward speed (m/s) and turn rate (rad/s, clockwise)."""

    time_s: float
    speed_m_s: float
    turn_rad_s: float


Told = tuple[ToldVelocity, ...]
"""The oldest first."""


def after(told: Told, setpoint: Setpoint | None, now_s: float) -> Told:
    """What was told, with one more setpoint. Nothing, or another kind of setpoint: velocities count no more."""
    if not isinstance(setpoint, GuidedVelocity):
        return ()
    kept = tuple(one for one in told if one.time_s > now_s - KEPT_S)
    return (*kept, ToldVelocity(now_s, setpoint.forward_m_s, setpoint.yaw_rate_rad_s))


def in_force(told: Told, time_s: float) -> ToldVelocity | None:
    """The newest one given until then; None where there is none."""
    return next((one for one in reversed(told) if one.time_s <= time_s), None)
