"""A ground station beside a ``Rig`` that uploads fences and rally points and sets parameters, as bytes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.simulator import Simulator
from sitl.world import geodesy
from tests.support import mission_client
from tests.support.mission_client import FENCE, RALLY, Row
from tests.support.rig import Rig
from tests.support.sitl_client import Client

KEEP_IN, KEEP_OUT, CIRCLE_IN, CIRCLE_OUT, RALLY_POINT = 5001, 5002, 5003, 5004, 5100
Corners = list[tuple[float, float]]
POLYGONS = {"FENCE_ENABLE": 1.0, "FENCE_TYPE": 4.0}


def box(
    command: int, south_m: float, west_m: float, north_m: float, east_m: float
) -> list[tuple[int, float, float, float]]:
    """A rectangle, metres from home."""
    corners = ((south_m, west_m), (south_m, east_m), (north_m, east_m), (north_m, west_m))
    return [(command, *corner, 4.0) for corner in corners]


def rows(simulator: Simulator, items: list[tuple[int, float, float, float]]) -> list[Row]:
    """Items by command, metres north and east of home, and first parameter."""
    found = []
    for command, north_m, east_m, first in items:
        lat, lon = geodesy.moved(simulator._vehicle.home, north_m, east_m)
        found.append((command, 3, (first, 0.0, 0.0, 0.0), lat, lon, 0.0))
    return found


def stored(
    fence: list[tuple[int, float, float, float]] | None = None,
    rally: list[tuple[float, float]] | None = None,
    **parameters: float,
) -> Callable[[Simulator], None]:
    """What a person has left in the autopilot before the companion comes."""

    def prepare(simulator: Simulator) -> None:
        client = Client(simulator, 255, 190)
        client.run_to(12.0)
        if fence is not None:
            assert mission_client.upload(client, rows(simulator, fence), FENCE) == 0
        if rally is not None:
            points = rows(simulator, [(RALLY_POINT, *point, 0.0) for point in rally])
            assert mission_client.upload(client, points, RALLY) == 0
        for name, value in parameters.items():
            client.send(mavlink.MAVLink_param_set_message(1, 1, name.encode(), value, 9))
        client.run_for(0.5)

    return prepare


class Person:
    """One more link to the rig's vehicle, served while the companion ticks."""

    def __init__(self, rig: Rig) -> None:
        self.rig = rig
        self._link = rig.simulator.connect()
        self._mav = mavlink.MAVLink(None, 255, 190)
        self.heard: list[Any] = []

    def send(self, message: Any) -> None:
        self._link.receive(message.pack(self._mav))

    def tick(self) -> list[Any]:
        self.rig.companion.tick()
        messages = list(self._mav.parse_buffer(self._link.take()) or [])
        self.heard += messages
        return messages

    def set(self, name: str, value: float) -> None:
        self.send(mavlink.MAVLink_param_set_message(1, 1, name.encode(), value, 9))

    def upload(self, items: list[tuple[int, float, float, float]], kind: int = FENCE) -> None:
        """A whole list, item by item, as fast as it is asked for."""
        wanted = rows(self.rig.simulator, items)
        self.send(mavlink.MAVLink_mission_count_message(1, 1, len(wanted), kind))
        for _ in range(20 * len(wanted) + 40):
            for message in self.tick():
                if message.get_type() == "MISSION_REQUEST" and message.mission_type == kind:
                    self.send(mission_client.item(message.seq, wanted[message.seq], kind))
                elif message.get_type() == "MISSION_ACK" and message.mission_type == kind:
                    assert message.type == 0
                    return
        raise AssertionError("no MISSION_ACK")
