"""A ground station or companion for tests: talks to a simulator link with pymavlink, nothing of our own in between."""

from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.core.frames import GeoPoint
from sitl.sim_link import SimLink
from sitl.simulator import Simulator
from sitl.world.truth import SimStart
from sitl.world.world import World

HOME = GeoPoint(-35.3632613, 149.1652299)
READY_S = 43.2
POSITION_MASK, VELOCITY_MASK = 3580, 3559


def open_ground(heading_rad: float = 0.0, **options: Any) -> Simulator:
    """A rover without sensors or noise on open ground, at 0, 0."""
    options = {"sensors": "none", "noise": False, **options}
    return Simulator(World.open(), SimStart(0.0, 0.0, heading_rad, HOME), **options)


class Client:
    """One link with an identity; keeps everything received."""

    def __init__(self, simulator: Simulator, system: int = 1, component: int = 191) -> None:
        self.simulator = simulator
        self.link: SimLink = simulator.connect()
        self.packer = mavlink.MAVLink(None, system, component)
        self._parser = mavlink.MAVLink(None)
        self.received: list[Any] = []
        self.raw = b""

    def send(self, message: Any) -> None:
        self.link.receive(message.pack(self.packer))

    def command(self, number: int, *parameters: float) -> None:
        filled = [*parameters, *([0.0] * (7 - len(parameters)))]
        self.send(mavlink.MAVLink_command_long_message(1, 1, number, 0, *filled))

    def ask(self, number: int, *parameters: float) -> int:
        """Send a command, wait a little, give back the result of its acknowledgement."""
        self.command(number, *parameters)
        return self.result_of(number)

    def result_of(self, number: int) -> int:
        acks = [m for m in self.run_for(0.1) if m.get_type() == "COMMAND_ACK" and m.command == number]
        assert len(acks) == 1, acks
        return int(acks[0].result)

    def set_mode(self, mode: int) -> int:
        return self.ask(176, 1, mode)

    def arm(self) -> int:
        return self.ask(400, 1)

    def drive_to(self, north_m: float, east_m: float, frame: int = 1, mask: int = POSITION_MASK) -> None:
        self.send(
            mavlink.MAVLink_set_position_target_local_ned_message(0, 1, 1, frame, mask, north_m, east_m, *[0.0] * 9)
        )

    def drive_at(self, vn: float, ve: float = 0.0, mask: int = VELOCITY_MASK, yaw: float = 0.0, rate: float = 0.0,
                 frame: int = 1) -> None:  # fmt: skip
        self.send(
            mavlink.MAVLink_set_position_target_local_ned_message(
                0, 1, 1, frame, mask, 0, 0, 0, vn, ve, 0, 0, 0, 0, yaw, rate
            )
        )

    def run_to(self, time_s: float) -> list[Any]:
        self.simulator.advance_to_s(time_s)
        data = self.link.take()
        self.raw += data
        messages = self._parser.parse_buffer(data) or []
        self.received += messages
        return messages

    def run_for(self, seconds: float) -> list[Any]:
        return self.run_to(self.simulator.time_s + seconds)

    def texts(self) -> list[str]:
        return [m.text for m in self.received if m.get_type() == "STATUSTEXT"]

    def of(self, kind: str) -> list[Any]:
        return [m for m in self.received if m.get_type() == kind]


def ready(simulator: Simulator, **identity: int) -> Client:
    """A client of an armed rover in GUIDED."""
    simulator.advance_to_s(READY_S)
    client = Client(simulator, **identity)
    assert client.set_mode(15) == 0
    assert client.arm() == 0
    return client
