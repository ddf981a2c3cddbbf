"""The setpoint sender: sends setpoints that are new or due again, and every other command, to the autopilot.

Nouns: setpoint sender.
"""

from __future__ import annotations

import math

from companion.control.controller import STANDSTILL, ControlCommand
from companion.core.frames import wrap_pi_rad
from companion.core.severity import Severity, TextSink
from companion.mavlink.autopilot_link import AutopilotLink
from companion.mavlink.codec import EncodeError
from companion.settings import GuidanceSettings
from companion.settings.live_settings import LiveSettings
from companion.vehicle.commands import ChangeSpeed, Command, GuidedHeading, GuidedPosition, GuidedVelocity, Setpoint

VELOCITY_PERIOD_S = 0.2
AGAIN_SHARE = 1.0 / 3.0
"""Headings and velocities are said again after this share of the time that they last: two may be lost."""
SPEED_PERIOD_S = 0.5
MOVED_M = 0.1
"""A position that has moved less is still the same."""
SPEED_AGAIN_S = 3.0


class SentSetpoints:
    """Remembers what was sent last, and when: the autopilot brakes for every new setpoint."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Forget what was sent: the next setpoint goes out at once."""
        self._setpoint: Setpoint | None = None
        self._setpoint_s = -math.inf
        self._speed_m_s = self._speed_before_m_s = math.nan
        self._speed_s = -math.inf

    @property
    def placed_m_s(self) -> float:
        """How fast the autopilot drives to positions, as told last or before that; inf until both are known.

        What it answered does not count, nor what others tell it.
        """
        speeds_m_s = (self._speed_m_s, self._speed_before_m_s)
        return math.inf if any(map(math.isnan, speeds_m_s)) else max(speeds_m_s)

    def due(
        self,
        wanted: ControlCommand,
        now_s: float,
        settings: GuidanceSettings,
        lasts_s: float,
        *,
        confirmed: bool | None,
    ) -> list[Command]:
        """The commands to send now. ``confirmed`` False: the autopilot follows something else, so say it again.

        ``lasts_s``: the autopilot ends a heading or a velocity that is not said again.
        """
        commands: list[Command] = []
        if self._is_due(wanted.setpoint, now_s, settings, lasts_s, confirmed=confirmed):
            commands.append(wanted.setpoint)
            self._setpoint, self._setpoint_s = wanted.setpoint, now_s
        if isinstance(wanted.setpoint, GuidedPosition) and self._speed_is_due(wanted.speed_m_s, now_s):
            commands.append(ChangeSpeed(round(wanted.speed_m_s, 2)))
            self._speed_before_m_s, self._speed_m_s, self._speed_s = self._speed_m_s, wanted.speed_m_s, now_s
        return commands

    def _is_due(
        self, setpoint: Setpoint, now_s: float, settings: GuidanceSettings, lasts_s: float, *, confirmed: bool | None
    ) -> bool:
        since_s, again_s = now_s - self._setpoint_s, AGAIN_SHARE * lasts_s
        match setpoint, self._setpoint:
            case GuidedPosition(), GuidedPosition() as last:
                moved_m = setpoint.point.distance_m(last.point)
                limit_s = settings.resend_s / 2.0 if confirmed is False else settings.resend_s
                return since_s >= limit_s or (moved_m > MOVED_M and since_s >= settings.change_after_s)
            case GuidedHeading(), GuidedHeading() as last:
                turned = abs(wrap_pi_rad(setpoint.heading_rad - last.heading_rad))
                return since_s >= min(settings.resend_s, again_s) or (turned > math.radians(5.0) and since_s >= 0.2)
            case GuidedVelocity(), GuidedVelocity() as last:
                return since_s >= min(VELOCITY_PERIOD_S, again_s) or setpoint != last
            case _:
                return True

    def _speed_is_due(self, speed_m_s: float, now_s: float) -> bool:
        since_s = now_s - self._speed_s
        changed = not abs(speed_m_s - self._speed_m_s) < 0.15
        return since_s >= SPEED_AGAIN_S or (changed and since_s >= SPEED_PERIOD_S)


class SetpointSender:
    """Sends commands to the autopilot."""

    def __init__(self, autopilot: AutopilotLink, settings: LiveSettings, notifier: TextSink) -> None:
        self._autopilot = autopilot
        self._settings = settings
        self._notifier = notifier
        self._sent = SentSetpoints()

    @property
    def placed_m_s(self) -> float:
        """See ``SentSetpoints.placed_m_s``."""
        return self._sent.placed_m_s

    def reset(self) -> None:
        """Forget what was sent: the next setpoint goes out at once."""
        self._sent.reset()

    def speak(self, command: ControlCommand | Command | None, now_s: float, lasts_s: float) -> None:
        """Of a control command the setpoint and its speed, if they are new or due again; any other command as it is.

        ``lasts_s``: see ``SentSetpoints.due``.
        """
        if isinstance(command, ControlCommand):
            settings, confirmed = self._settings.current.guidance, self._autopilot.target_confirmed
            for one in self._sent.due(command, now_s, settings, lasts_s, confirmed=confirmed):
                self.send(one, now_s)
        elif command is not None:
            self.send(command, now_s)

    def send(self, command: Command, now_s: float) -> None:
        """Send it; a command that cannot be encoded (degrees, while no origin is known) is replaced by a standstill."""
        try:
            self._autopilot.send(command, now_s)
        except EncodeError as error:
            self._notifier.tell(f"Stopping: {error}", Severity.WARNING)
            self._autopilot.send(STANDSTILL.setpoint, now_s)
