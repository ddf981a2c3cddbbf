"""Shutdown: at the end of a run a rover that is ours is stopped and put into HOLD, and HOLD is confirmed.

Nouns: shutdown.
"""

from __future__ import annotations

import math

from companion.control.controller import STANDSTILL
from companion.core.clock import Clock
from companion.core.severity import Severity, TextSink
from companion.executive.mission_run import MissionRun
from companion.mavlink.autopilot_link import AutopilotLink
from companion.safety.mode_latch import Control
from companion.safety.reasons import EndReason, Parting, Reason
from companion.settings.live_settings import LiveSettings
from companion.vehicle.commands import SetMode
from companion.vehicle.events import RoverMode
from companion.vehicle.mode_names import mode_name
from companion.vehicle.state import fold

CONFIRM_S = 0.7
"""How long the companion stays after its last command to see the rover in HOLD; it ends within a second in all."""
AGAIN_S = 0.2
"""HOLD is asked for this often until then."""


class Shutdown:
    """Begun once, by whatever ends the run."""

    def __init__(self, run: MissionRun, autopilot: AutopilotLink, settings: LiveSettings, notifier: TextSink) -> None:
        self._run = run
        self._autopilot = autopilot
        self._settings = settings
        self._notifier = notifier
        self._leave_at_s = math.inf
        self._again_s = math.inf
        self.stopped_ours = False
        """Whether it is a rover of ours that has been stopped."""

    def begin(self, why: Reason[EndReason], now_s: float) -> None:
        """The run ends: stop the rover and ask for HOLD, and say so; nothing is sent if the rover is not ours."""
        self._run.end = why
        self._leave_at_s = now_s
        if not self._is_ours(now_s):
            return
        self._leave_at_s = now_s + CONFIRM_S
        sender, heartbeat = self._run.sender, self._run.vehicle.heartbeat
        if heartbeat is not None and heartbeat.armed:
            sender.send(STANDSTILL.setpoint, now_s)
        sender.send(SetMode(RoverMode.HOLD), now_s)
        self._again_s = now_s + AGAIN_S
        self.stopped_ours = True
        if why.kind is not EndReason.DONE:
            hold = "HOLD asked for, but the autopilot is silent" if self._is_silent(now_s) else "HOLD"
            self._notifier.tell(f"Companion: {why}, {hold}", Severity.WARNING)

    def is_over(self, now_s: float) -> bool:
        """Whether the rover is no longer ours, or has said that it will be in HOLD, or time is up."""
        vehicle = self._run.vehicle
        left = vehicle.heartbeat is not None and not vehicle.is_ours
        over = self._answered or left or now_s >= self._leave_at_s
        if not over and now_s >= self._again_s:
            self._again_s = now_s + AGAIN_S
            self._run.sender.send(SetMode(RoverMode.HOLD), now_s)
        return over

    def wait(self, clock: Clock, now_s: float) -> float:
        """Nothing else goes on any more: listen and ask for HOLD until it is over. Returns the time."""
        while not self.is_over(now_s):
            now_s += 1.0 / self._settings.current.link.tick_hz
            clock.sleep_until_s(now_s)
            for event in self._autopilot.poll(now_s):
                self._run.vehicle = fold(self._run.vehicle, event)
            self._autopilot.service(now_s)
        return now_s

    def parting(self, now_s: float) -> Reason[Parting] | None:
        """How the rover is left; None where it is disarmed, or was never heard."""
        vehicle = self._run.vehicle
        if vehicle.heartbeat is None:
            return None
        if self._is_silent(now_s):
            return Reason(Parting.SILENT)
        if not vehicle.heartbeat.armed:
            return None
        if self.stopped_ours and vehicle.is_ours:
            return Reason(Parting.ARMED, (RoverMode.HOLD.name,)) if self._answered else Reason(Parting.NOT_HELD)
        return Reason(Parting.ARMED, (mode_name(vehicle),))

    @property
    def _answered(self) -> bool:
        """Whether the autopilot has taken the HOLD of this end."""
        ack = self._autopilot.last_ack(SetMode(RoverMode.HOLD))
        return ack is not None and ack.result == 0 and ack.time_s > self._leave_at_s - CONFIRM_S

    def _is_silent(self, now_s: float) -> bool:
        heartbeat = self._run.vehicle.heartbeat
        return heartbeat is not None and now_s - heartbeat.time_s > self._settings.current.safety.heartbeat_s

    def _is_ours(self, now_s: float) -> bool:
        """A rover that this run has not driven may be another companion's."""
        if not self._run.vehicle.is_ours or self._run.latch.control is not Control.COMPANION:
            return False
        return self._run.executor is not None or not self._autopilot.twin_heard(now_s)
