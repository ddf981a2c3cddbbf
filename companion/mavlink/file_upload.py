"""Uploads one file to the autopilot by MAVLink FTP, and compares its checksum.

It is written beside the file that it replaces, and takes its name when it is whole: an upload that ends on the way
leaves the old one as it was. The card of a board renames no file to a name that is taken, so the old one goes first.

The protocol is in the MAVLink guide, "File Transfer Protocol (FTP)"; the checksum as ArduPilot computes it.

Nouns: file upload.
"""

from __future__ import annotations

import math
import struct
import zlib
from collections.abc import Sequence
from enum import StrEnum
from typing import Any, NamedTuple

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.mavlink.byte_link import ByteLink
from companion.mavlink.codec import Codec
from companion.mavlink.framing import AUTOPILOT, Packet
from companion.settings import LinkSettings
from companion.vehicle.commands import FileRequest
from companion.vehicle.events import HeartbeatSeen

HEADER = struct.Struct("<HBBBBBxI")
"""Number, session, operation, size, operation that is answered, end of a burst, (padding), offset."""
TERMINATE, RESET, CREATE, WRITE, REMOVE, RENAME, CHECKSUM = 1, 2, 6, 7, 8, 13, 14
ACK, NAK = 128, 129
UNKNOWN_COMMAND = 7
BESIDE = ".new"
"""Behind the name while it is written. The autopilot starts only scripts whose names end with .lua."""
PIECE_BYTES = 200
OTHER_COMPONENT = 192
"""A running companion must not see a twin."""
AGAIN_S, TRIES = 0.5, 12
"""An unanswered request is repeated so often."""


class UploadEnd(StrEnum):
    """How an upload ended."""

    DONE = "done"
    NO_ROVER = "no rover was heard"
    ARMED = "the rover is armed"
    SILENT = "the autopilot does not answer file requests"
    NO_FOLDER = "the autopilot has no such folder, or no SD card"
    NOT_WRITTEN = "the autopilot could not write the file"
    NOT_RENAMED = "the autopilot cannot rename files"
    DIFFERS = "the file is not on the autopilot as it was sent"


class _Step(NamedTuple):
    operation: int
    offset: int
    data: bytes


class FileUpload:
    """Call ``step`` some twenty times a second. ``places``: paths on the autopilot, tried in turn."""

    def __init__(self, link: ByteLink, settings: LinkSettings, places: Sequence[str], data: bytes) -> None:
        self._link = link
        other = settings.model_copy(update={"component_id": OTHER_COMPONENT})
        self._codec = Codec(other)
        self._mav: Any = mavlink.MAVLink(None)
        self._places = list(places)
        self._data = data
        self._number = self._session = 0
        self._sent_s, self._tries = -math.inf, 0
        self._step = _Step(RESET, 0, b"")
        self.end: UploadEnd | None = None
        """None while it goes on."""
        self.removed = False
        """Whether the file that was there may be gone."""

    @property
    def place(self) -> str:
        """The path that the file gets."""
        return self._places[0] if self._places else ""

    @property
    def heard(self) -> bool:
        """Whether the rover has been heard."""
        return self._codec.vehicle_known

    def give_up(self) -> None:
        """The time is over."""
        self.end = self.end or (UploadEnd.SILENT if self.heard else UploadEnd.NO_ROVER)

    def step(self, now_s: float) -> None:
        """Take answers, and send the request that is due."""
        for packet in self._codec.packets(self._link.read()):
            if not self._codec.accepts(packet):
                continue
            for event in self._codec.decode_packet(packet, now_s):
                if isinstance(event, HeartbeatSeen) and event.armed and self.end is None:
                    self.end = UploadEnd.ARMED
            if packet.message_id == mavlink.MAVLINK_MSG_ID_FILE_TRANSFER_PROTOCOL:
                self._take(packet)
        if self.end is None and self._codec.vehicle_known and now_s - self._sent_s >= AGAIN_S:
            self._send(now_s)

    def _send(self, now_s: float) -> None:
        if self._tries >= TRIES:
            self.end = UploadEnd.SILENT
            return
        self._sent_s, self._tries = now_s, self._tries + 1
        operation, offset, data = self._step
        self.removed |= operation == REMOVE
        header = HEADER.pack(self._number, self._session, operation, len(data), 0, 0, offset)
        for raw in self._codec.encode_packets(FileRequest(header + data)):
            self._link.write(raw)

    def _take(self, packet: Packet) -> None:
        """An answer to the request under way; others are of earlier ones that were repeated."""
        if (packet.system_id, packet.component_id) != (self._codec.system_id, AUTOPILOT) or self.end is not None:
            return
        payload = bytes(self._mav.decode(bytearray(packet.raw)).payload)
        number, session, result, size, answered, _, _ = HEADER.unpack_from(payload)
        if number != (self._number + 1) % 65536 or answered != self._step.operation or result not in (ACK, NAK):
            return
        if answered == CREATE:
            # Some autopilots give a session of their own.
            self._session = session
        following = self._after(payload[HEADER.size : HEADER.size + size], refused=result == NAK)
        if isinstance(following, UploadEnd):
            self.end = following
        else:
            self._step, self._number = following, (self._number + 2) % 65536
            self._sent_s, self._tries = -math.inf, 0

    def _after(self, answer: bytes, *, refused: bool) -> _Step | UploadEnd:
        """What follows the request under way."""
        operation, offset, data = self._step
        if operation == RESET:
            return self._create()
        if operation == CREATE:
            if not refused:
                return self._write(0)
            self._places.pop(0)
            return self._create() if self._places else UploadEnd.NO_FOLDER
        if operation == WRITE:
            return UploadEnd.NOT_WRITTEN if refused else self._write(offset + len(data))
        if operation == TERMINATE:
            return self._checksum(self.place + BESIDE)
        if operation == REMOVE:
            return self._rename()
        if operation == RENAME:
            unknown = refused and answer[:1] == bytes([UNKNOWN_COMMAND])
            return UploadEnd.NOT_RENAMED if unknown else self._checksum(self.place)
        return self._compared(answer, refused=refused)

    def _compared(self, answer: bytes, *, refused: bool) -> _Step | UploadEnd:
        """What follows a checksum. A repeated request may be refused that was done: what is there counts."""
        same = not refused and len(answer) >= 4 and struct.unpack_from("<I", answer)[0] == checksum(self._data)
        if self._step.data == self._checksum(self.place).data:
            if same:
                return UploadEnd.DONE
            return UploadEnd.DIFFERS if self.removed else _Step(REMOVE, 0, self.place.encode())
        return self._rename() if same else UploadEnd.DIFFERS

    def _create(self) -> _Step:
        return _Step(CREATE, 0, (self.place + BESIDE).encode() + b"\0")

    def _checksum(self, path: str) -> _Step:
        return _Step(CHECKSUM, 0, path.encode() + b"\0")

    def _rename(self) -> _Step:
        return _Step(RENAME, 0, (self.place + BESIDE).encode() + b"\0" + self.place.encode())

    def _write(self, offset: int) -> _Step:
        piece = self._data[offset : offset + PIECE_BYTES]
        return _Step(WRITE, offset, piece) if piece else _Step(TERMINATE, 0, b"")


def checksum(data: bytes) -> int:
    """CRC-32 without the usual inversions, as ArduPilot's CalcFileCRC32 gives it."""
    return zlib.crc32(data, 0xFFFFFFFF) ^ 0xFFFFFFFF
