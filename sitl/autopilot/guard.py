"""The guard script of rover-companion, as it runs on the autopilot: HOLD when the companion falls silent.

In the simulator it is there when SCR_ENABLE is 1 at boot, and SCR_USER1 is set or the script was uploaded. It does what
the script ``companion/vehicle/guard.lua`` does, which looks every 20 ms; but there is no mode switch here to look at.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.core.severity import Severity
from sitl.autopilot.state import Mode
from sitl.autopilot.vehicle import Vehicle

COMPANION = 191
SETPOINTS = {
    "MISSION_ITEM_INT",
    "COMMAND_INT",
    "SET_POSITION_TARGET_LOCAL_NED",
    "SET_POSITION_TARGET_GLOBAL_INT",
}
LIFE = {"HEARTBEAT", *SETPOINTS}
COMMANDS = {"COMMAND_INT", "COMMAND_LONG"}
OF_A_MODE = (mavlink.MAV_CMD_DO_SET_MODE, mavlink.MAV_CMD_DO_AUX_FUNCTION)
LOOK_US = 20_000
TELL_US = 500_000
USUAL_MS, LEAST_MS, MOST_MS = 300.0, 200.0, 3000.0
WATCHES = re.compile(rb"^local COMPANION = (\d+)$", re.MULTILINE)
"""In the script: the component that it watches."""


class Guard:
    """Watches the companion's packets from its first setpoint in GUIDED until the mode or arming changes."""

    def __init__(
        self, vehicle: Vehicle, set_mode: Callable[[Vehicle, int], bool], component_id: int = COMPANION
    ) -> None:
        self._vehicle = vehicle
        self._component_id = component_id
        self._set_mode = set_mode
        self._watches = self._acted = False
        self._heard_us = self._told_us = self._looked_us = 0

    @property
    def waits_us(self) -> float:
        """So long the companion may be silent."""
        wanted_ms = self._vehicle.parameters["SCR_USER1"] or USUAL_MS
        return 1e3 * min(max(wanted_ms, LEAST_MS), MOST_MS)

    def hear(self, message: Any) -> None:
        """One packet that has arrived."""
        vehicle = self._vehicle
        if message.get_srcSystem() != vehicle.system or message.get_srcComponent() != self._component_id:
            self._acted &= not _asks_for_mode(message)
            return
        if message.get_type() in LIFE:
            self._heard_us = vehicle.time_us
            self._watches |= self._is_guided() and message.get_type() in SETPOINTS

    def due_us(self) -> float:
        """When ``run`` is to be called next."""
        tells_us = self._told_us + TELL_US
        if not self._watches:
            return tells_us
        late_us = max(self._heard_us + self.waits_us, self._looked_us)
        looks_us = (int(late_us) // LOOK_US + 1) * LOOK_US
        return min(tells_us, max(looks_us, self._vehicle.time_us))

    def run(self) -> None:
        """Look, act, and tell."""
        vehicle = self._vehicle
        self._looked_us = vehicle.time_us
        self._watches &= self._is_guided()
        self._acted &= vehicle.armed and vehicle.mode == Mode.HOLD
        if self._watches and vehicle.time_us - self._heard_us > self.waits_us:
            self._act()
        if vehicle.time_us - self._told_us >= TELL_US:
            self._told_us = vehicle.time_us
            told_ms = (-1e-3 if self._acted else 1e-3) * self.waits_us
            name = b"CMPGRD%d" % self._component_id
            for channel in vehicle.channels.values():
                channel.send(mavlink.MAVLink_named_value_float_message(vehicle.time_us // 1000, name, told_ms))

    def _act(self) -> None:
        """HOLD; if it is refused, again 20 ms later."""
        if self._set_mode(self._vehicle, Mode.HOLD):
            self._watches, self._acted = False, True
            self._vehicle.say(Severity.WARNING, "Guard: companion silent, HOLD")

    def _is_guided(self) -> bool:
        return self._vehicle.armed and self._vehicle.mode == Mode.GUIDED


def _asks_for_mode(message: Any) -> bool:
    """Whether somebody wants a mode, or to turn an auxiliary switch, which may be one: HOLD is his from then on."""
    name = message.get_type()
    return name == "SET_MODE" or (name in COMMANDS and message.command in OF_A_MODE)


def guard_of(vehicle: Vehicle, set_mode: Callable[[Vehicle, int], bool]) -> Guard | None:
    """The guard of an autopilot that has just booted; None if it has none."""
    scripts = [file for path, file in vehicle.storage.files.items() if path.endswith(".lua")]
    found = next((found for file in scripts if (found := WATCHES.search(file))), None)
    there = vehicle.parameters["SCR_USER1"] > 0 or found is not None
    if not there or vehicle.parameters["SCR_ENABLE"] != 1:
        return None
    return Guard(vehicle, set_mode, COMPANION if found is None else int(found[1]))
