"""Speaking to the autopilot: of what guidance wants the commands that are due, and whatever else it is to do."""

from __future__ import annotations

from collections.abc import Callable

from companion.control.controller import STANDSTILL, ControlCommand
from companion.executive.outbox import Outbox
from companion.mavlink.autopilot_link import AutopilotLink
from companion.mavlink.codec import EncodeError
from companion.vehicle.commands import Command

WARNING = 4


class Speaker:
    """Sends commands. ``tell`` says a text with its severity to the people."""

    def __init__(self, autopilot: AutopilotLink, outbox: Outbox, tell: Callable[[str, int], None]) -> None:
        self._autopilot = autopilot
        self._outbox = outbox
        self._tell = tell

    def guide(self, guide: ControlCommand, now_s: float) -> None:
        """A setpoint and its speed, as far as they are new or due again."""
        for command in self._outbox.due(guide, now_s, self._autopilot.target_confirmed):
            self.send(command, now_s)

    def send(self, command: Command, now_s: float) -> None:
        """Say it; what cannot be said (degrees, while the autopilot has no origin) leaves the rover standing instead."""
        try:
            self._autopilot.send(command, now_s)
        except EncodeError as error:
            self._tell(f"Stopping: {error}", WARNING)
            self._autopilot.send(STANDSTILL.setpoint, now_s)
