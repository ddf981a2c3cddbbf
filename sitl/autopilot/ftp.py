"""MAVLink FTP of a vehicle whose only folder is ``scripts``: files can be written there, and no file can be read.

A file is renamed only to a name that is free, as on the cards of boards (FAT).

A ground station that first asks for a file of parameters or missions (`@PARAM/param.pck`) then falls back to the list
at once, instead of repeating its request for ten seconds.
"""

from __future__ import annotations

import struct
import zlib
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.autopilot.channel import Channel
from sitl.autopilot.vehicle import Vehicle

HEADER = struct.Struct("<HBBBBBxI")
"""Sequence number, session, operation, size, operation that is answered, end of a burst, (padding), offset."""

PAYLOAD_BYTES = 251

TERMINATE, RESET, READ, CREATE, WRITE, REMOVE, RENAME, CHECKSUM, BURST = 1, 2, 5, 6, 7, 8, 13, 14, 15

OF_A_SESSION, OPERATIONS = {READ, WRITE, BURST}, range(1, 16)

ACK, NAK = 128, 129

INVALID_SESSION, UNKNOWN_COMMAND, FILE_EXISTS, FILE_NOT_FOUND, FULL = 4, 7, 8, 10, 1

SCRIPTS = "scripts/"

MOST_BYTES, MOST_FILES = 100_000, 8


def answer_file_request(vehicle: Vehicle, channel: Channel, message: Any) -> None:
    """Answer FILE_TRANSFER_PROTOCOL."""
    request = bytes(message.payload)
    number, session, operation, size, _, _, offset = HEADER.unpack_from(request)
    if operation in (ACK, NAK):
        return
    error, data = _done(vehicle, operation, request[HEADER.size : HEADER.size + size], offset)
    result, data = (ACK, data) if error == 0 else (NAK, bytes([error]))
    header = HEADER.pack((number + 1) & 0xFFFF, session, result, len(data), operation, 0, offset)
    payload = (header + data).ljust(PAYLOAD_BYTES, b"\0")
    channel.send(
        mavlink.MAVLink_file_transfer_protocol_message(0, message.get_srcSystem(), message.get_srcComponent(), payload)
    )


def _done(vehicle: Vehicle, operation: int, data: bytes, offset: int) -> tuple[int, bytes]:
    """Do it: an error code, 0 for none, and what is answered."""
    card = vehicle.storage
    path, other = f"{data.decode('ascii', 'replace')}\0\0".split("\0")[:2]
    if operation in (TERMINATE, RESET):
        card.open_file = ""
    elif operation == CREATE:
        if not path.startswith(SCRIPTS) or len(card.files) >= MOST_FILES:
            return FILE_NOT_FOUND, b""
        card.files[path], card.open_file = bytearray(), path
    elif operation == WRITE and card.open_file:
        file = card.files[card.open_file]
        if offset > len(file) or offset + len(data) > MOST_BYTES:
            return FULL, b""
        file[offset : offset + len(data)] = data
    elif operation == REMOVE and path in card.files:
        del card.files[path]
    elif operation == RENAME and path in card.files and other.startswith(SCRIPTS):
        if other in card.files:
            return FILE_EXISTS, b""
        card.files[other] = card.files.pop(path)
    elif operation == CHECKSUM and path in card.files:
        # ArduPilot's has none of the usual inversions.
        return 0, struct.pack("<I", zlib.crc32(card.files[path], 0xFFFFFFFF) ^ 0xFFFFFFFF)
    else:
        return _error(operation), b""
    return 0, b""


def _error(operation: int) -> int:
    """The error code: no such session is open, no such file exists."""
    if operation not in OPERATIONS:
        return UNKNOWN_COMMAND
    return INVALID_SESSION if operation in OF_A_SESSION else FILE_NOT_FOUND
