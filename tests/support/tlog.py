"""Reads telemetry logs by their own rule: eight bytes of time, then one packet. Independent of the code under test."""

from collections.abc import Iterator
from pathlib import Path

from pymavlink.dialects.v20 import ardupilotmega as mavlink


def raw_packets(path: Path) -> Iterator[bytes]:
    data = path.read_bytes()
    at = 8
    while at + 3 <= len(data):
        version_2 = data[at] == 0xFD
        signed = version_2 and data[at + 2] & 1
        length = data[at + 1] + (12 if version_2 else 8) + (13 if signed else 0)
        yield data[at : at + length]
        at += length + 8


def messages(data: bytes) -> list[mavlink.MAVLink_message]:
    """All messages in a stream, by pymavlink's own parser; fails on anything else."""
    return mavlink.MAVLink(None).parse_buffer(data) or []
