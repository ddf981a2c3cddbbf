"""Which commands are really sent: only what has changed, or is due again."""

from __future__ import annotations

import math

from companion.control.controller import ControlCommand
from companion.core.frames import wrap_pi_rad
from companion.settings import GuidanceSettings, Settings
from companion.vehicle.commands import ChangeSpeed, Command, GuidedHeading, GuidedPosition, GuidedVelocity, Setpoint

VELOCITY_PERIOD_S = 0.2
SPEED_PERIOD_S = 0.5
MOVED_M = 0.1
"""A position that has moved less is still the same."""
SPEED_AGAIN_S = 3.0


class Outbox:
    """Remembers what was sent last, and when."""

    def __init__(self, settings: GuidanceSettings) -> None:
        self._settings = settings
        self.reset()

    def retune(self, settings: Settings) -> None:
        """Other settings from now on."""
        self._settings = settings.guidance

    def reset(self) -> None:
        """Forget what was sent: the next setpoint goes out at once."""
        self._setpoint: Setpoint | None = None
        self._setpoint_s = -math.inf
        self._speed_m_s = math.nan
        self._speed_s = -math.inf

    def due(self, guide: ControlCommand, now_s: float, confirmed: bool | None) -> list[Command]:
        """The commands to send now. ``confirmed`` False: the autopilot follows something else, so say it again."""
        commands: list[Command] = []
        if self._is_due(guide.setpoint, now_s, confirmed):
            commands.append(guide.setpoint)
            self._setpoint, self._setpoint_s = guide.setpoint, now_s
        if isinstance(guide.setpoint, GuidedPosition) and self._speed_is_due(guide.speed_m_s, now_s):
            commands.append(ChangeSpeed(round(guide.speed_m_s, 2)))
            self._speed_m_s, self._speed_s = guide.speed_m_s, now_s
        return commands

    def _is_due(self, setpoint: Setpoint, now_s: float, confirmed: bool | None) -> bool:
        since_s = now_s - self._setpoint_s
        match setpoint, self._setpoint:
            case GuidedPosition(), GuidedPosition() as last:
                moved_m = setpoint.point.distance_m(last.point)
                limit_s = self._settings.resend_s / 2.0 if confirmed is False else self._settings.resend_s
                return since_s >= limit_s or (moved_m > MOVED_M and since_s >= self._settings.change_after_s)
            case GuidedHeading(), GuidedHeading() as last:
                turned = abs(wrap_pi_rad(setpoint.heading_rad - last.heading_rad))
                return since_s >= self._settings.resend_s or (turned > math.radians(5.0) and since_s >= 0.2)
            case GuidedVelocity(), GuidedVelocity() as last:
                return since_s >= VELOCITY_PERIOD_S or setpoint != last
            case _:
                return True

    def _speed_is_due(self, speed_m_s: float, now_s: float) -> bool:
        since_s = now_s - self._speed_s
        changed = not abs(speed_m_s - self._speed_m_s) < 0.15
        return since_s >= SPEED_AGAIN_S or (changed and since_s >= SPEED_PERIOD_S)
