"""Local station: a ground station within this program. The companion hears it as if it had spoken over the link.

Nouns: local station.
"""

from __future__ import annotations

from collections import deque
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.core.frames import GeoPoint
from companion.mavlink.framing import Framer, Packet
from companion.mavlink.requests import CONTINUE, KEEP_SPEED, PAUSE
from companion.mavlink.signing import Signer
from companion.vehicle.commands import AnswerRequest, Command
from companion.vehicle.events import Asker

ASKER = Asker(254, mavlink.MAV_COMP_ID_MISSIONPLANNER)
"""Not 255: the autopilot takes the heartbeats of that one for the pilot's ground station."""


class LocalStation:
    """Requests wait here for the companion's next look at its link, its answers for whoever asked.

    ``signer``: the companion's own, if it accepts signed packets only.
    """

    def __init__(self, signer: Signer | None = None) -> None:
        self._mav = mavlink.MAVLink(None, ASKER.system_id, ASKER.component_id)
        self._signer = signer
        if signer is not None:
            self._mav.signing.secret_key = signer.key
            self._mav.signing.sign_outgoing = True
        self._framer = Framer()
        self._said: deque[Any] = deque()
        self._answers: deque[AnswerRequest] = deque()

    def pause(self, pauses: bool) -> None:
        """Stand, or go on."""
        self._command(mavlink.MAV_CMD_DO_PAUSE_CONTINUE, PAUSE if pauses else CONTINUE)

    def skip_to(self, index: int) -> None:
        """Go on with this target, from 0."""
        self._command(mavlink.MAV_CMD_DO_SET_MISSION_CURRENT, float(index))

    def send_to(self, place: GeoPoint) -> None:
        """Drive there first."""
        where = round(place.lat_deg * 1e7), round(place.lon_deg * 1e7)
        values = (KEEP_SPEED, 0.0, 0.0, 0.0, *where, 0.0)
        frame, command = mavlink.MAV_FRAME_GLOBAL, mavlink.MAV_CMD_DO_REPOSITION
        self._said.append(mavlink.MAVLink_command_int_message(0, 0, frame, command, 0, 0, *values))

    def answers(self) -> list[AnswerRequest]:
        """The answers since the last call."""
        return [self._answers.popleft() for _ in range(len(self._answers))]

    def spoken(self, system_id: int, component_id: int) -> list[Packet]:
        """For the companion with these ids: what has been said since the last call."""
        raw = bytearray()
        while self._said:
            message = self._said.popleft()
            message.target_system, message.target_component = system_id, component_id
            if self._signer is not None:
                self._mav.signing.timestamp = self._signer.next_timestamp()
            raw += message.pack(self._mav)
            self._mav.seq = (self._mav.seq + 1) % 256
        return self._framer.feed(bytes(raw))

    def hear(self, command: Command) -> None:
        """What the companion sends; only answers to this station count."""
        if isinstance(command, AnswerRequest) and command.asker == ASKER:
            self._answers.append(command)

    def _command(self, command: int, value: float) -> None:
        self._said.append(mavlink.MAVLink_command_long_message(0, 0, command, 0, value, 0, 0, 0, 0, 0, 0))
