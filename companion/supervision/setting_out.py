"""Everything before the first metre: who has the rover, what is awaited, what is asked for meanwhile, and what people are told of it."""

from __future__ import annotations

from collections.abc import Callable

from companion.executive.mission_layout import MissionLayout
from companion.mavlink.autopilot_link import AutopilotLink
from companion.operator.reporting import Reporter
from companion.operator.telling import Teller
from companion.safety.mode_latch import Control
from companion.supervision.mission_limits import MissionLimits
from companion.supervision.startup import StartUp, overruled
from companion.vehicle.commands import Arm, Command, SetMode
from companion.vehicle.events import RoverMode
from companion.vehicle.state import VehicleState

WARNING = 4
TWIN = "waiting for another companion with the same component id to fall silent"


class SettingOut:
    """Asked every tick until the rover may be driven. ``send`` is for commands; ``end`` ends the run, for a reason in words."""

    def __init__(
        self,
        start_up: StartUp,
        autopilot: AutopilotLink,
        oversight: MissionLimits,
        reporter: Reporter,
        teller: Teller,
        send: Callable[[Command, float], None],
        end: Callable[[float, str], None],
    ) -> None:
        self._start_up = start_up
        self._autopilot = autopilot
        self._oversight = oversight
        self._reporter = reporter
        self._teller = teller
        self._send = send
        self._end = end

    def step(self, vehicle: VehicleState, control: Control, now_s: float) -> MissionLayout | None:
        """The mission on the ground once the rover may be driven; until then all is done that brings it there."""
        if self._autopilot.twin_heard(now_s):
            self._reporter.doing = TWIN
            return None
        taken = overruled(self._autopilot.last_ack(SetMode(RoverMode.GUIDED)), vehicle.heartbeat)
        out = self._start_up.out(vehicle)
        if out and (reason := self._oversight.emptied(now_s)):
            self._end(now_s, reason)
            return None
        fence, hindrance = self._oversight.before_driving(now_s, out=out)
        control = Control.PERSON if taken else control
        layout, command = self._start_up.step(vehicle, control, now_s, fence, hindrance)
        if command is not None:
            self._send(command, now_s)
        if command == SetMode(RoverMode.HOLD):
            self._teller.tell(f"HOLD: {self._start_up.held}", WARNING)
        if layout is None:
            self._tell_what_is_missing(heard=vehicle.heartbeat is not None)
        return layout

    def _tell_what_is_missing(self, *, heard: bool) -> None:
        refused = self._autopilot.last_ack(Arm())
        if refused is not None and refused.result != 0 and self._start_up.missing == "arming":
            self._teller.once(f"The autopilot refuses to arm (result {refused.result})")
        self._reporter.doing = f"waiting for {self._start_up.missing}{'' if heard else self._autopilot.trouble}"
