"""The vehicle's file service: there are no files, and that is said at once."""

from __future__ import annotations

import struct

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from tests.support.sitl_client import Client, open_ground

ACK, NAK = 128, 129
PATH = b"@PARAM/param.pck"


def request(client: Client, operation: int, data: bytes = PATH, number: int = 65535) -> list[tuple[int, ...]]:
    """Answers: (number, operation, operation that is answered, size, first byte of data)."""
    payload = struct.pack("<HBBBBBxI", number, 3, operation, len(data), 0, 0, 0) + data
    client.received.clear()
    client.send(mavlink.MAVLink_file_transfer_protocol_message(0, 1, 1, payload.ljust(251, b"\0")))
    client.run_for(0.1)
    found = []
    for message in client.of("FILE_TRANSFER_PROTOCOL"):
        assert (message.target_system, message.target_component) == (255, 230)
        number, session, kind, size, answered, _, _ = struct.unpack_from("<HBBBBBxI", bytes(message.payload))
        assert session == 3
        found.append((number, kind, answered, size, message.payload[12]))
    return found


@pytest.mark.parametrize(
    ("operation", "answer"),
    [
        (1, (ACK, 0, 0)),  # end a session
        (2, (ACK, 0, 0)),  # end all
        (3, (NAK, 1, 10)),  # list a folder
        (4, (NAK, 1, 10)),  # open for reading
        (5, (NAK, 1, 4)),  # read
        (15, (NAK, 1, 4)),  # read all
        (99, (NAK, 1, 7)),
    ],
)
def test_every_request_is_answered(operation: int, answer: tuple[int, int, int]) -> None:
    client = Client(open_ground(), system=255, component=230)
    kind, size, first = answer
    assert request(client, operation) == [(0, kind, operation, size, first)]


@pytest.mark.parametrize("operation", [ACK, NAK])
def test_answers_are_not_answered(operation: int) -> None:
    """Two vehicles would talk to each other for ever."""
    assert request(Client(open_ground(), system=255, component=230), operation) == []
