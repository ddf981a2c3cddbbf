"""MAVLink FTP of a vehicle without files: every request is answered, and no file is ever found.

A ground station that first asks for a file of parameters or missions (`@PARAM/param.pck`) then falls back to the list
at once, instead of repeating its request for ten seconds.
"""

from __future__ import annotations

import struct
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.autopilot.channel import Channel
from sitl.autopilot.vehicle import Vehicle

HEADER = struct.Struct("<HBBBBBxI")
"""Sequence number, session, operation, size, operation that is answered, end of a burst, (padding), offset."""

PAYLOAD_BYTES = 251

TERMINATE, RESET, READ, WRITE, BURST = 1, 2, 5, 7, 15

OF_A_SESSION, OPERATIONS = {READ, WRITE, BURST}, range(1, 16)

ACK, NAK = 128, 129

INVALID_SESSION, UNKNOWN_COMMAND, FILE_NOT_FOUND = 4, 7, 10


def answer_file_request(vehicle: Vehicle, channel: Channel, message: Any) -> None:
    """Answer FILE_TRANSFER_PROTOCOL: ending a session succeeds, opening a file does not."""
    number, session, operation, *_ = HEADER.unpack_from(bytes(message.payload))
    if operation in (ACK, NAK):
        return
    if operation in (TERMINATE, RESET):
        result, data = ACK, b""
    else:
        result, data = NAK, bytes([_error(operation)])
    header = HEADER.pack((number + 1) & 0xFFFF, session, result, len(data), operation, 0, 0)
    payload = (header + data).ljust(PAYLOAD_BYTES, b"\0")
    channel.send(
        mavlink.MAVLink_file_transfer_protocol_message(0, message.get_srcSystem(), message.get_srcComponent(), payload)
    )


def _error(operation: int) -> int:
    """The error code: no session is ever open, no file exists."""
    if operation not in OPERATIONS:
        return UNKNOWN_COMMAND
    return INVALID_SESSION if operation in OF_A_SESSION else FILE_NOT_FOUND
