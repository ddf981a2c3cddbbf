"""One MAVLink channel of the vehicle: bytes in and out, protocol version, signatures, sequence numbers, rates."""

from __future__ import annotations

import struct
from dataclasses import dataclass, field
from typing import Any

from pymavlink.dialects.v10 import ardupilotmega as mavlink_1
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.autopilot.framing import HEADER_1, MAGIC_1, MAGIC_2, SIGNED, Framer
from sitl.autopilot.routing import AUTOPILOT
from sitl.autopilot.signing import SECURE_PORT, Signing

LONGEST_SIGNING_TIME = (1 << 48) - 1


def new_codec(component: int, system: int = 1) -> Any:
    """A new packer with its own sequence numbers."""
    return mavlink.MAVLink(None, srcSystem=system, srcComponent=component)


def packed(message: Any, codec: Any, version_1: bool = False) -> bytes:
    """A message as bytes, with the sender's next sequence number; empty if MAVLink 1 does not know it."""
    if codec.signing.timestamp > LONGEST_SIGNING_TIME:
        codec.signing.timestamp = 0
    data = _packed_1(message, codec) if version_1 else bytes(message.pack(codec))
    if data:
        codec.seq = (codec.seq + 1) & 0xFF
    return data


def _packed_1(message: Any, codec: Any) -> bytes:
    """Pack for MAVLink 1, which has no message ids above 255 and no extension fields."""
    known = mavlink_1.mavlink_map.get(message.get_msgId())
    if known is None:
        return b""
    payload = bytes(message.pack(codec, force_mavlink1=True))[HEADER_1 : HEADER_1 + known.unpacker.size]
    head = bytes([len(payload), codec.seq, codec.srcSystem, codec.srcComponent, message.get_msgId()])
    checksum = int(mavlink.x25crc(head + payload + bytes([known.crc_extra])).crc)
    return bytes([MAGIC_1]) + head + payload + checksum.to_bytes(2, "little")


@dataclass
class Channel:
    """A connection of the vehicle through its serial port ``port``.

    ``codec`` packs and signs, ``reader`` unpacks. ``due_us`` and ``interval_us``: next time and interval of each
    streamed message. ``spoken``: a packet was received here.
    """

    number: int
    codec: Any
    signing: Signing
    port: int = SECURE_PORT
    version_1: bool = False
    framer: Framer = field(default_factory=Framer)
    reader: Any = field(default_factory=lambda: new_codec(AUTOPILOT))
    interval_us: dict[int, int] = field(default_factory=dict)
    due_us: dict[int, float] = field(default_factory=dict)
    outbox: bytearray = field(default_factory=bytearray)
    requested: list[int] = field(default_factory=list)
    parameter_queue: list[str] = field(default_factory=list)
    spoken: bool = False
    text_id: int = 0

    def parse(self, data: bytes) -> list[Any]:
        """The messages completed by these bytes; those with a wrong checksum or signature are dropped."""
        found = (self._message(packet) for packet in self.framer.feed(data))
        return [message for message in found if message is not None]

    def _message(self, packet: bytes) -> Any:
        try:
            message = self.reader.decode(bytearray(packet))
        except (mavlink.MAVError, struct.error):  # a wrong checksum
            return None
        if message.get_msgId() < 0:  # unknown, so its checksum cannot be verified
            return None
        identity = (message.get_srcSystem(), message.get_srcComponent(), message.get_msgId())
        signed = packet[0] == MAGIC_2 and bool(packet[2] & SIGNED)
        secure = self.port == SECURE_PORT
        return message if self.signing.accepts(self.codec, packet, identity, signed, secure) else None

    def send(self, message: Any) -> None:
        """Queue one message of the autopilot."""
        self.outbox += packed(message, self.codec, self.version_1)

    def take(self) -> bytes:
        """Return everything that is queued, and clear the queue."""
        data = bytes(self.outbox)
        self.outbox.clear()
        return data


def new_channel(
    number: int, system: int, signing: Signing, port: int = SECURE_PORT, version_1: bool = False
) -> Channel:
    """A channel without streams. A port set to MAVLink 1 starts without signing, even with a key."""
    channel = Channel(number, new_codec(AUTOPILOT, system), signing, port, version_1)
    if not version_1:
        signing.prepare(channel.codec, number)
    return channel
