"""Somebody on one of several links of a simulated vehicle; real bytes, packed and taken apart by pymavlink alone."""

from __future__ import annotations

from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.sim_link import SimLink
from sitl.simulator import Simulator
from tests.support.sitl_client import open_ground

KEY = bytes(range(32))
TIME = 40_000_000_000_000
REQUEST_MESSAGE, SET_MODE, ARM, REBOOT, AUTOPILOT_VERSION = 512, 176, 400, 246, 148
HOLD = 4


def booted() -> Simulator:
    """A rover that may be armed."""
    simulator = open_ground()
    simulator.advance_to_s(45.0)
    return simulator


class Party:
    """Anybody on a link: packs with pymavlink's own code, signs if told to, keeps every packet that arrives."""

    def __init__(self, simulator: Simulator, system: int, component: int, port: int = 0) -> None:
        self.simulator = simulator
        self.port = port
        self.link: SimLink = simulator.connect(port)
        self.mav = mavlink.MAVLink(None, system, component)
        self.version_1 = False

    def pack(self, message: Any) -> bytes:
        data = bytes(message.pack(self.mav, force_mavlink1=self.version_1))
        self.mav.seq = (self.mav.seq + 1) % 256
        return data

    def send(self, message: Any) -> bytes:
        data = self.pack(message)
        self.link.receive(data)
        return data

    def beat(self, kind: int = 6) -> bytes:
        return self.send(mavlink.MAVLink_heartbeat_message(kind, 8, 0, 0, 4, 3))

    def command(self, number: int, *parameters: float, to: tuple[int, int] = (1, 1)) -> bytes:
        return self.send(
            mavlink.MAVLink_command_long_message(*to, number, 0, *parameters, *[0.0] * (7 - len(parameters)))
        )

    def sign(self, key: bytes = KEY, timestamp: int = TIME, link: int = 7) -> None:
        signing = self.mav.signing
        signing.secret_key, signing.timestamp, signing.link_id, signing.sign_outgoing = key, timestamp, link, True

    def set_up(self, key: bytes = KEY, timestamp: int = TIME) -> None:
        self.send(mavlink.MAVLink_setup_signing_message(1, 1, list(key), timestamp))

    def reconnect(self) -> None:
        self.link = self.simulator.connect(self.port)

    def raw(self, seconds: float = 0.1) -> bytes:
        self.simulator.advance_to_s(self.simulator.time_s + seconds)
        return self.link.take()

    def heard(self, seconds: float = 0.1) -> list[Any]:
        return mavlink.MAVLink(None).parse_buffer(self.raw(seconds)) or []

    def acks(self, seconds: float = 0.1) -> list[int]:
        return [m.result for m in self.heard(seconds) if m.get_type() == "COMMAND_ACK"]


def split(data: bytes) -> list[bytes]:
    """Packets by the lengths in their headers."""
    packets, at = [], 0
    while at < len(data):
        size = data[at + 1] + (8 if data[at] == 0xFE else 12 + 13 * (data[at + 2] & 1))
        packets.append(data[at : at + size])
        at += size
    return packets
