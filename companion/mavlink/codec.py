"""Codec between MAVLink packets and the companion's events and commands.

Nouns: codec.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from companion.core.frames import GeoPoint
from companion.core.tick_marks import Mark
from companion.mavlink.decode import MISSION_ACK_COMMAND, Decoder
from companion.mavlink.encode import EncodeError, Encoder, command_number
from companion.mavlink.framing import AUTOPILOT, MAGIC_V2, SIGNED, Framer, Packet
from companion.mavlink.points import Band
from companion.mavlink.signing import Recorded, Refused, Signer, trouble
from companion.settings import LinkSettings
from companion.vehicle.commands import Command
from companion.vehicle.events import Event

__all__ = ["MISSION_ACK_COMMAND", "Codec", "EncodeError", "LinkCounters", "Packet", "command_number"]


@dataclass(frozen=True, slots=True)
class LinkCounters:
    """Counters of the link's quality, from the start."""

    bad_bytes: int
    """Bytes that belonged to no valid packet."""
    unknown: int
    """Packets of messages that are not in the dialect."""
    other_systems: int
    """Packets of other vehicles and ground stations, or before the vehicle was known."""
    lost: int
    """Lost packets of the autopilot, by sequence numbers."""
    refused: Refused
    """Packets refused because of a wrong or missing signature."""


STRANGE_BYTES = 2048
"""Kept of what comes before the first packet: to tell what else is on the line."""


class Codec:
    """Decodes packets of the vehicle and encodes commands to it.

    The vehicle is the first ArduPilot rover or boat whose heartbeat is heard (component 1); until then ``system_id`` is
    a guess. The companion uses the vehicle's system id. Any bytes are accepted; none raise.
    """

    def __init__(
        self,
        settings: LinkSettings,
        system_id: int = 1,
        signer: Signer | None = None,
        recorded: Recorded | None = None,
        companion: int | None = None,
    ) -> None:
        """``companion``: the component whose guard is listened for; None: this one itself."""
        self._framer = Framer()
        band = Band(settings.points_above_m, settings.points_below_m)
        self._decoder = Decoder(system_id, settings.component_id, band, companion)
        self._encoder = Encoder(settings.setpoint, settings.component_id, signer)
        self._signer = signer
        self._recorded = recorded
        self._signed_heard = False
        self._packet_heard = False
        self._strange = b""

    @property
    def strange(self) -> bytes:
        """The newest bytes of a link on which no packet has come yet; empty once one has."""
        return self._strange

    @property
    def system_id(self) -> int:
        """The system id of the vehicle and the companion."""
        return self._decoder.system_id

    @property
    def vehicle_known(self) -> bool:
        """Whether a rover's heartbeat has been heard."""
        return self._decoder.vehicle_known

    @property
    def refused_type(self) -> int | None:
        """MAV_TYPE of an autopilot that was heard but is not an ArduPilot rover; None once a rover was heard."""
        return self._decoder.refused_type

    @property
    def impostor_type(self) -> int | None:
        """MAV_TYPE of another vehicle whose heartbeats use the rover's ids, and are ignored; None if there is none."""
        return self._decoder.impostor_type

    @property
    def origin(self) -> GeoPoint | None:
        """The EKF origin; None until known, and after a restart of the autopilot."""
        return self._decoder.origin

    @property
    def boot_s(self) -> float:
        """The autopilot's time since boot in its newest message, in seconds."""
        return self._decoder.boot_ms / 1000.0

    @property
    def message_counts(self) -> Mapping[int, int]:
        """How many messages of each id the autopilot has sent."""
        return self._decoder.message_counts

    def is_own(self, packet: Packet) -> bool:
        """Whether a packet has the companion's own system and component id."""
        own = (self._decoder.system_id, self._decoder.component_id)
        return self.vehicle_known and (packet.system_id, packet.component_id) == own

    @property
    def counters(self) -> LinkCounters:
        """The counters of the link's quality."""
        decoder = self._decoder
        refused = Refused() if self._signer is None else self._signer.refused
        return LinkCounters(self._framer.bad_bytes, self._framer.unknown, decoder.other_systems, decoder.lost, refused)

    @property
    def signing_trouble(self) -> str:
        """What is wrong with signatures, in words; empty for nothing."""
        if self._recorded is not None and self._recorded.signed:
            return trouble(self._recorded.refused, self.vehicle_known)
        if self._signer is None:
            if not self._signed_heard:
                return ""
            return "The autopilot signs: without --signing-key it ignores us, but on its first port"
        return trouble(self._signer.refused, self.vehicle_known)

    @property
    def marks(self) -> Mark:
        """What a record keeps about signatures."""
        return Mark(0) if self._signer is None else Mark.SIGNED | self._signer.refused.marks

    def accepts(self, packet: Packet) -> bool:
        """Whether to accept a packet: with a key, only if it is signed with it and newer than those before."""
        if self._signer is not None:
            return self._signer.accepts(packet)
        signed = packet.raw[0] == MAGIC_V2 and bool(packet.raw[2] & SIGNED)
        self._signed_heard |= signed and (packet.system_id, packet.component_id) == (self.system_id, AUTOPILOT)
        return True

    def decode(self, data: bytes, time_s: float) -> list[Event]:
        """The events in these bytes; incomplete packets are kept for the next call.

        ``time_s``: by the companion's clock.
        """
        return [
            event
            for packet in self.packets(data)
            if self.accepts(packet)
            for event in self.decode_packet(packet, time_s)
        ]

    def packets(self, data: bytes) -> list[Packet]:
        """The complete packets in these bytes, of all senders."""
        found = self._framer.feed(data)
        self._packet_heard |= bool(found)
        self._strange = b"" if self._packet_heard else (self._strange + data)[-STRANGE_BYTES:]
        return found

    def decode_packet(self, packet: Packet, time_s: float) -> list[Event]:
        """The events of one packet."""
        return self._decoder.decode(packet, time_s)

    def encode(self, command: Command, confirmation: int = 0) -> bytes:
        """A command as bytes. Raises EncodeError for a position in degrees while the EKF origin is unknown."""
        return b"".join(self.encode_packets(command, confirmation))

    def encode_packets(self, command: Command, confirmation: int = 0) -> list[bytes]:
        """The packets of a command; a long text has several."""
        decoder = self._decoder
        return self._encoder.encode(command, decoder.system_id, decoder.boot_ms, decoder.origin, confirmation)
