"""Reads telemetry logs by their own rule: eight bytes of time, then one packet. Independent of the code under test."""

from collections.abc import Iterator
from pathlib import Path

from pymavlink.dialects.v20 import ardupilotmega as mavlink


def raw_packets(path: Path) -> Iterator[bytes]:
    data = path.read_bytes()
    at = 8
    while at + 3 <= len(data):
        if data[at] == 0xFD:
            length = 12 + data[at + 1] + (13 if data[at + 2] & 1 else 0)
        else:
            length = 8 + data[at + 1]
        yield data[at : at + length]
        at += length + 8


def messages(data: bytes) -> list[mavlink.MAVLink_message]:
    """All messages in a stream, by pymavlink's own parser; fails on anything else."""
    return mavlink.MAVLink(None).parse_buffer(data) or []
