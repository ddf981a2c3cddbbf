"""Listens to the line between companion and autopilot, and notes what the companion must never do (docs/safety.md).

It takes the bytes apart on its own, and knows of the companion only what it says.

Nouns: wire watch.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.autopilot.parameters import DEFAULTS
from sitl.campaign.range_bytes import RANGES, tells_ahead
from sitl.faults.plan import LinkEffect, LinkFault
from sitl.lockstep import Drive
from sitl.sim_link import HEAD_BYTES, MAGIC_2, packet_bytes

HOLD, AUTO, GUIDED, ARMED = 4, 10, 15, 128
AUTOPILOT = 1
HEARTBEAT = 0
LEG = 86
"""SET_POSITION_TARGET_GLOBAL_INT of the autopilot: a leg of AUTO is handed over, and it says so every second."""
LEG_S = 3.5
"""Two of these messages may be lost, and a heartbeat may follow a second later."""
DRIVES = (84, 86, 73, 82, 70, 69)
"""SET_POSITION_TARGET_LOCAL_NED, SET_POSITION_TARGET_GLOBAL_INT, MISSION_ITEM_INT, SET_ATTITUDE_TARGET,
RC_CHANNELS_OVERRIDE, MANUAL_CONTROL."""
SET_MODE = 11
COMMANDS = (75, 76)
"""COMMAND_INT, COMMAND_LONG."""
REPOSITION, DO_SET_MODE, ARM = 192, 176, 400
COMMAND_AT = slice(38, 40)
"""The bytes of both with the command's number."""
REACTS_S = 0.5
"""A tick, and until motors and wheels follow; the link's delay comes on top, each way."""
LOSSY_S = 1.0
"""More, where packets are lost or damaged meanwhile: a stop is sent five times a second."""
LOST = (LinkEffect.LOSS, LinkEffect.CORRUPT)
BRAKES = 0.7
"""The least share of the autopilot's limit with which a rover brakes that has been told to."""
ALIVE_S = 0.5
"""A line over which nothing comes for longer may be cut: then the companion cannot stop the rover."""
MOVES_M_S = 0.1


class WireWatch:
    """Of one drive; create it before the drive runs."""

    def __init__(self, run: Drive) -> None:
        self.against_pilot = 0
        """What was sent to move the rover, to set its mode or to arm it though a person or a failsafe had it.

        So the last heartbeat had told another mode than GUIDED, or disarmed. Before the rover was in GUIDED for the
        first time the companion may set it, and arm once, unless it was armed in another mode than HOLD: that is a
        person's.
        """
        self.blind_s = 0.0
        """So long the rover moved on without range data though it should have braked, or have stood."""
        self._run = run
        self._stale_s = run.settings.safety.stale_s
        self._late_s = self._extra_s = 0.0
        limits = run.scenario.parameters
        usual_m_s2 = limits.get("ATC_ACCEL_MAX", DEFAULTS["ATC_ACCEL_MAX"][0])
        self._brakes_m_s2 = BRAKES * (limits.get("ATC_DECEL_MAX", 0.0) or usual_m_s2)
        self._may_send = True
        self._mode: int | None = None
        self._may_take = True
        self._was_armed = False
        self._last_s = self._ranges_s = self._line_s = self._since_s = self._fastest_m_s = 0.0
        self._leg_s = -math.inf
        self._mav = mavlink.MAVLink(None)
        self._mav.robust_parsing = True
        run.clock.overhear = self._said
        run.clock.delivered = self._heard

    def _said(self, time_s: float, data: bytes) -> None:
        """``data``: of the companion."""
        if not self._may_send:
            self.against_pilot += sum(self._is_against(kind, packet) for kind, packet in _packets(data))

    def _is_against(self, kind: int, packet: bytes) -> bool:
        """Setpoints in every form that ``link.setpoint`` may choose; modes and arming once it was the companion's."""
        command = int.from_bytes(packet[COMMAND_AT], "little") if kind in COMMANDS else 0
        if kind == SET_MODE or command == DO_SET_MODE:
            return not self._may_take and self._mode != GUIDED
        return kind in DRIVES or command == REPOSITION or (command == ARM and self._was_armed)

    def _heard(self, time_s: float, data: bytes) -> None:
        """``data``: delivered to the companion."""
        faults = self._run.simulator.link_faults()
        cut = time_s - self._line_s >= ALIVE_S or any(fault.effect is LinkEffect.OUTAGE for fault in faults)
        for kind, packet in _packets(data):
            if kind in RANGES:
                if tells_ahead(kind, packet):
                    self._ranges_s = time_s
            elif kind == HEARTBEAT:
                self._take_mode(packet, time_s)
            elif kind == LEG:
                self._leg_s = time_s
        if cut or not self._may_send:
            self._since_s = time_s  # the companion cannot stop the rover, or must not
        if data:
            self._line_s = time_s
        silent_s = time_s - max(self._ranges_s, self._since_s)
        self._note_link(faults, time_s - self._last_s, silent=silent_s > self._stale_s)
        if self._ranges_s and self._moves_blind(silent_s):
            self.blind_s += time_s - self._last_s
        self._last_s = time_s

    def _take_mode(self, packet: bytes, time_s: float) -> None:
        for beat in self._mav.parse_buffer(packet) or []:
            if beat.get_type() == "HEARTBEAT" and beat.get_srcComponent() == AUTOPILOT:
                self._mode, armed = beat.custom_mode, bool(beat.base_mode & ARMED)
                leg = self._run.mission.in_auto and self._mode == AUTO and time_s - self._leg_s <= LEG_S
                self._may_send = armed and (self._mode == GUIDED or leg)
                self._may_take &= self._mode != GUIDED and (self._mode == HOLD or not armed)
                self._was_armed |= self._may_send

    def _note_link(self, faults: list[LinkFault], passed_s: float, *, silent: bool) -> None:
        """How much later the companion hears of it, and is heard, because of the link since the ranges fell silent.

        Packets keep their order, so what was late once holds up what is sent after it.
        """
        delay_s = math.fsum(fault.delay_s + fault.jitter_s for fault in faults)
        self._late_s = max(delay_s, self._late_s - passed_s)
        extra_s = 2.0 * self._late_s + (LOSSY_S if any(fault.effect in LOST for fault in faults) else 0.0)
        self._extra_s = max(extra_s, self._extra_s) if silent else extra_s

    def _moves_blind(self, silent_s: float) -> bool:
        """Whether it is faster than a rover that brakes once it has had time to react.

        ``silent_s``: so long there was no range data, and the companion could have stopped the rover.
        """
        if silent_s <= self._stale_s:
            self._fastest_m_s = 0.0
            return False
        speed_m_s = abs(self._run.simulator.truth.speed_m_s)
        braked_s = silent_s - self._stale_s - REACTS_S - 2.0 * self._run.late_s - self._extra_s
        if braked_s <= 0.0:
            self._fastest_m_s = max(self._fastest_m_s, speed_m_s)
            return False
        return speed_m_s > max(self._fastest_m_s - self._brakes_m_s2 * braked_s, MOVES_M_S)


def _packets(data: bytes) -> Iterator[tuple[int, bytes]]:
    """The numbers of the messages, each with its packet; what is no whole packet of MAVLink 2 is left out."""
    at, end = 0, len(data)
    while at + 10 <= end:
        if data[at] != MAGIC_2:
            at += 1
            continue
        after = at + packet_bytes(data[at : at + HEAD_BYTES], 0)
        if after <= end:
            yield int.from_bytes(data[at + 7 : at + 10], "little"), data[at:after]
        at = after
