"""One MAVLink channel of the vehicle: its bytes in and out, its own sequence numbers and stream rates."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

AUTOPILOT = 1


def new_codec(component: int, system: int = 1) -> Any:
    """A MAVLink 2 packer and parser that never raises on garbage."""
    codec = mavlink.MAVLink(None, srcSystem=system, srcComponent=component)
    codec.robust_parsing = True
    return codec


@dataclass
class Channel:
    """A connection of the vehicle. ``due_us``: next time of each streamed message, ``interval_us``: how often."""

    number: int
    codec: Any
    parser: Any
    interval_us: dict[int, int] = field(default_factory=dict)
    due_us: dict[int, float] = field(default_factory=dict)
    outbox: bytearray = field(default_factory=bytearray)
    requested: list[int] = field(default_factory=list)
    parameter_queue: list[str] = field(default_factory=list)
    spoken: bool = False
    text_id: int = 0

    def parse(self, data: bytes) -> list[Any]:
        """Whole messages in the bytes so far; noise on the line is dropped."""
        try:
            messages = self.parser.parse_buffer(data) or []
        except Exception:  # a parser upset by hostile bytes starts anew, the link stays up
            self.parser = new_codec(AUTOPILOT)
            return []
        return [message for message in messages if message.get_msgId() >= 0]

    def send(self, message: Any) -> None:
        """Queue one message of the autopilot."""
        self.outbox += message.pack(self.codec)

    def take(self) -> bytes:
        """Everything queued, and forget it."""
        data = bytes(self.outbox)
        self.outbox.clear()
        return data


def new_channel(number: int, system: int) -> Channel:
    """A channel with nothing streamed yet."""
    return Channel(number, new_codec(AUTOPILOT, system), new_codec(AUTOPILOT, system))


class Router:
    """Who was heard on which channel; decides where a packet goes, as the autopilot's router does."""

    def __init__(self) -> None:
        """Nobody heard yet."""
        self._routes: dict[tuple[int, int], int] = {}

    def learn(self, system: int, component: int, channel: int) -> None:
        """Remember the last channel on which a component was heard."""
        self._routes[(system, component)] = channel

    def forget(self, channel: int) -> None:
        """A channel was closed."""
        self._routes = {who: where for who, where in self._routes.items() if where != channel}

    def is_for_autopilot(self, system: int, target_system: int, target_component: int, source: int) -> bool:
        """Whether the autopilot answers: broadcasts, its own address, and components of its system nobody has heard."""
        if target_system == 0:
            return True
        if target_system != system:
            return False
        if target_component in (0, AUTOPILOT):
            return True
        return (system, target_component) not in self._routes

    def forward_to(self, system: int, target_system: int, target_component: int, source: int) -> set[int]:
        """Channels that get a copy of a packet which arrived on channel ``source``."""
        if target_system == system and target_component == AUTOPILOT:
            return set()
        channels = {
            channel
            for (known_system, known_component), channel in self._routes.items()
            if target_system in (0, known_system) and target_component in (0, known_component)
        }
        return channels - {source}
