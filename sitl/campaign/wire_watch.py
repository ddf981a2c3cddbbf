"""Listens to the line between companion and autopilot, and notes what the companion must never do (docs/safety.md).

It takes the bytes apart on its own, and knows of the companion only what it says.

Nouns: wire watch.
"""

from __future__ import annotations

from collections.abc import Iterator

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.lockstep import Drive
from sitl.sim_link import HEAD_BYTES, MAGIC_2, packet_bytes

GUIDED, AUTO, ARMED = 15, 10, 128
AUTOPILOT = 1
HEARTBEAT = 0
RANGES = (132, 330, 11037)
"""DISTANCE_SENSOR, OBSTACLE_DISTANCE, OBSTACLE_DISTANCE_3D."""
SETPOINTS = (84, 86, 73)
"""SET_POSITION_TARGET_LOCAL_NED, SET_POSITION_TARGET_GLOBAL_INT, MISSION_ITEM_INT."""
COMMAND_INT, REPOSITION = 75, 192
COMMAND_AT = slice(38, 40)
"""The bytes of a COMMAND_INT with the command's number."""
STOPPING_S = 4.0
"""From the moment at which range data counts as stale: a tick, the line, and braking from 2 m/s."""
ALIVE_S = 0.5
"""A line over which nothing comes for longer may be cut: then the companion cannot stop the rover."""
MOVES_M_S = 0.1


class WireWatch:
    """Of one drive; create it before the drive runs."""

    def __init__(self, run: Drive) -> None:
        self.against_pilot = 0
        """Setpoints that were sent though the last heartbeat had told another mode than GUIDED, or disarmed."""
        self.blind_s = 0.0
        """So long the rover moved on without range data."""
        self._run = run
        self._stale_s = run.settings.safety.stale_s
        self._may_send = True
        self._last_s = self._ranges_s = self._line_s = 0.0
        self._mav = mavlink.MAVLink(None)
        self._mav.robust_parsing = True
        run.clock.overhear = self._said
        run.clock.delivered = self._heard

    def _said(self, time_s: float, data: bytes) -> None:
        """``data``: of the companion."""
        if not self._may_send:
            self.against_pilot += sum(_is_setpoint(kind, packet) for kind, packet in _packets(data))

    def _heard(self, time_s: float, data: bytes) -> None:
        """``data``: delivered to the companion."""
        for kind, packet in _packets(data):
            if kind in RANGES:
                self._ranges_s = time_s
            elif kind == HEARTBEAT:
                self._take_mode(packet)
        if data:
            self._line_s = time_s
        if self._ranges_s and self._moves_blind(time_s):
            self.blind_s += time_s - self._last_s
        self._last_s = time_s

    def _take_mode(self, packet: bytes) -> None:
        for beat in self._mav.parse_buffer(packet) or []:
            if beat.get_type() == "HEARTBEAT" and beat.get_srcComponent() == AUTOPILOT:
                self._may_send = beat.custom_mode in (GUIDED, AUTO) and bool(beat.base_mode & ARMED)

    def _moves_blind(self, time_s: float) -> bool:
        silent_s = time_s - self._ranges_s
        return (
            silent_s > self._stale_s + STOPPING_S
            and time_s - self._line_s < ALIVE_S
            and self._may_send
            and abs(self._run.simulator.truth.speed_m_s) > MOVES_M_S
        )


def _is_setpoint(kind: int, packet: bytes) -> bool:
    """In every form that ``link.setpoint`` may choose."""
    command = int.from_bytes(packet[COMMAND_AT], "little") if kind == COMMAND_INT else 0
    return kind in SETPOINTS or command == REPOSITION


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
