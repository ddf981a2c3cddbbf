"""The end of a run: a rover that is ours is stopped and put into HOLD, and there is time to see that it has been."""

from __future__ import annotations

import math
from collections.abc import Callable

from companion.control.controller import STANDSTILL
from companion.mavlink.autopilot_link import AutopilotLink
from companion.safety.mode_latch import Control
from companion.vehicle.commands import Command, SetMode
from companion.vehicle.events.vehicle import RoverMode
from companion.vehicle.state import VehicleState

HAND_OVER_S = 0.7
"""So long the companion stays, after its last command, to see that the rover is in HOLD: with all else it does, it is gone within a second."""
AGAIN_S = 0.2
"""HOLD is asked for this often until then."""


class Shutdown:
    """Begun once, by whatever ends the run. ``send`` gives the autopilot a command at a time."""

    def __init__(self, autopilot: AutopilotLink, send: Callable[[Command, float], None]) -> None:
        self._autopilot = autopilot
        self._send = send
        self._leave_at_s: float | None = None
        self._again_s = math.inf
        self.ours = False
        """Whether it is a rover of ours that has been stopped."""

    @property
    def begun(self) -> bool:
        """Whether the run is ending."""
        return self._leave_at_s is not None

    def begin(self, vehicle: VehicleState, control: Control, now_s: float, *, driven: bool) -> bool:
        """Stop the rover and ask for HOLD; False, and nothing is sent, if the rover is not ours.

        ``driven``: whether this run has driven it at all; if not, it may be another companion's.
        """
        self._leave_at_s = now_s
        heartbeat = vehicle.heartbeat
        if heartbeat is None or not vehicle.is_ours or control is not Control.COMPANION:
            return False
        if not driven and self._autopilot.twin_heard(now_s):
            return False
        self._leave_at_s = now_s + HAND_OVER_S
        if heartbeat.armed:
            self._send(STANDSTILL.setpoint, now_s)
        self._send(SetMode(RoverMode.HOLD), now_s)
        self._again_s = now_s + AGAIN_S
        self.ours = True
        return True

    def is_over(self, vehicle: VehicleState, now_s: float) -> bool:
        """Whether the rover is no longer ours, or has said that it will, or time is up."""
        assert self._leave_at_s is not None
        ack = self._autopilot.last_ack(SetMode(RoverMode.HOLD))
        answered = ack is not None and ack.result == 0 and ack.time_s > self._leave_at_s - HAND_OVER_S
        left = vehicle.heartbeat is not None and not vehicle.is_ours
        over = answered or left or now_s >= self._leave_at_s
        if not over and now_s >= self._again_s:
            self._again_s = now_s + AGAIN_S
            self._send(SetMode(RoverMode.HOLD), now_s)
        return over
