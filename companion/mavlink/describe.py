"""Packets and their differences in words."""

from __future__ import annotations

from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

MOST_FIELDS = 4


def packet_name(raw: bytes) -> str:
    """The message's name, with the number of a command."""
    message = _decoded(raw)
    if message is None:
        return f"{len(raw)} bytes"
    command = getattr(message, "command", None)
    return str(message.get_type()) + ("" if command is None else f" {command}")


def packet_difference(there: bytes, here: bytes) -> str:
    """The difference of two packets: their names, or the first fields with other values."""
    was, now = _decoded(there), _decoded(here)
    if was is None or now is None or was.get_type() != now.get_type():
        return f"{packet_name(here)} instead of {packet_name(there)}"
    before, after = was.to_dict(), now.to_dict()
    fields = [f"{key} {after[key]} instead of {before[key]}" for key in before if before[key] != after.get(key)]
    if not fields:
        fields = [f"header or signature {here.hex()} instead of {there.hex()}"]
    more = f" and {len(fields) - MOST_FIELDS} more" if len(fields) > MOST_FIELDS else ""
    return f"{packet_name(here)}: {', '.join(fields[:MOST_FIELDS])}{more}"


def _decoded(raw: bytes) -> Any:
    try:
        return mavlink.MAVLink(None).decode(bytearray(raw))
    except mavlink.MAVError:
        return None
