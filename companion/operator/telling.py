"""What people at the ground station are told, and that the companion keeps a record of it."""

from __future__ import annotations

from companion.core.clock import Clock
from companion.mavlink.autopilot_link import AutopilotLink
from companion.operator.reporting import Reporter
from companion.vehicle.commands import StatusText

WARNING = 4
NOT_FOLLOWED_S = 5.0
"""People are told when the autopilot's read-back has shown another target for so long."""


class Teller:
    """Says texts; the reporter keeps them."""

    def __init__(self, autopilot: AutopilotLink, clock: Clock, reporter: Reporter) -> None:
        self._autopilot = autopilot
        self._clock = clock
        self._reporter = reporter
        self._followed_s = clock.now_s()

    def tell(self, text: str, severity: int) -> None:
        """Say it, not twice in a row."""
        if self._reporter.say(text, severity):
            self._autopilot.send(StatusText(severity, text), self._clock.now_s())

    def once(self, text: str) -> None:
        """Say what goes on being so only the first time."""
        if text not in self._reporter.said:
            self.tell(text, WARNING)

    def of_faults(self, now_s: float, problem: str, *, heard: bool, underway: bool, ours: bool) -> None:
        """What a person should know though it stops nothing, once each.

        ``problem``: of record or state; ``heard``: an autopilot has been; ``ours``: we have the rover now.
        """
        if heard and self._autopilot.signing_trouble:
            self.once(self._autopilot.signing_trouble)
        if not underway:
            return
        if intruder := self._autopilot.intruder(now_s):
            self.once(intruder)
        if not ours or self._autopilot.target_confirmed is not False:
            self._followed_s = now_s
        elif now_s - self._followed_s > NOT_FOLLOWED_S:
            self.once("The autopilot follows another target than the one sent")
        for text in self._reporter.faults(self._autopilot.rate_faults, problem, now_s):
            self.once(text)
