"""A rig with a ground station that also talks to the companion: places, missions, and its answers."""

from __future__ import annotations

import math
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.core.frames import GeoPoint, LocalFrame, NedPoint
from tests.support.rig import Rig

COMPANION = 191
NAN = math.nan


class Asker(Rig):
    """A rig whose person at the ground station sends places, and hears the answers."""

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self._ear = mavlink.MAVLink(None)
        self.answers: list[Any] = []
        self.said: list[str] = []
        self.requests: list[int] = []
        self.accepted = False
        take = self._pilot.take
        self._pilot.take = lambda: self._hear(take())  # type: ignore[method-assign]

    def _hear(self, data: bytes) -> bytes:
        for message in self._ear.parse_buffer(data) or []:
            if message.get_type() == "MISSION_REQUEST" and message.get_srcComponent() == 1:
                self.requests.append(message.seq)
            self.accepted |= message.get_type() == "MISSION_ACK" and message.get_srcComponent() == 1
            if message.get_srcComponent() != COMPANION:
                continue
            if message.get_type() in ("COMMAND_ACK", "MISSION_ACK"):
                self.answers.append(message)
            elif message.get_type() == "STATUSTEXT":
                self.said.append(message.text)
        return data

    def field(self, x: int, y: int) -> tuple[int, int]:
        """The middle of a field of the yard in 1e-7 degrees; home is field 2, 7."""
        return self.place(y - 7.0, x - 2.0)

    def place(self, north_m: float, east_m: float) -> tuple[int, int]:
        home = self.companion.vehicle.home
        assert home is not None
        point: GeoPoint = LocalFrame(home.point).to_geo(NedPoint(north_m, east_m))
        return round(point.lat_deg * 1e7), round(point.lon_deg * 1e7)

    def ask(self, message: Any) -> None:
        self._pilot.receive(message.pack(self._pilot_mav))

    def reposition(
        self, place: tuple[int, int], speed: float = -1.0, frame: int = 6, to: tuple[int, int] = (1, COMPANION)
    ) -> None:
        head = (*to, frame, 192, 0, 0)
        self.ask(mavlink.MAVLink_command_int_message(*head, speed, 1.0, 0.0, NAN, *place, NAN))

    def answered(self) -> int:
        """The one answer to what was asked last."""
        self.run_for(0.5)
        assert len(self.answers) == 1, self.answers
        answer = self.answers.pop()
        assert (answer.target_system, answer.target_component) == (255, 190)
        return int(answer.result if answer.get_type() == "COMMAND_ACK" else answer.type)

    def passed_m(self, x: int, y: int) -> float:
        north_m, east_m = y + 0.5, x + 0.5  # the world's own metres begin at its south-west corner
        return math.hypot(self.simulator.truth.north_m - north_m, self.simulator.truth.east_m - east_m)

    def upload(self, rows: list[tuple[int, tuple[float, ...], tuple[int, int]]]) -> None:
        """Store a mission in the autopilot: command, four parameters, place; home is added."""
        rows = [(16, (0.0,) * 4, self.place(0.0, 0.0)), *rows]
        self.ask(mavlink.MAVLink_mission_count_message(1, 1, len(rows), 0))
        self.requests.clear()
        self.accepted = False
        for _ in range(20 * len(rows)):
            self.run_for(0.05)
            for seq in self.requests:
                command, params, place = rows[seq]
                head = (1, 1, seq, 3, command, 0, 1)
                self.ask(mavlink.MAVLink_mission_item_int_message(*head, *params, *place, 0.0, 0))
            self.requests.clear()
            if self.accepted:
                return
        raise AssertionError("the mission was not taken")
