"""The option ``--lidar`` of several commands."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

import typer

from companion.lidar.spec import FORM, LidarError, LidarSpec, parsed
from companion.mavlink.port_users import same_device
from companion.mavlink.transport import device_of

SPACED = FORM.replace(",", ", ")
"""With places where a narrow terminal may begin a new line."""
LidarOption = Annotated[
    list[str] | None,
    typer.Option("--lidar", metavar="SPEC", help=f"A lidar on a serial port of this computer: {SPACED}; repeatable."),
]


def lidars_given(texts: Sequence[str] | None, connect: str = "") -> list[LidarSpec]:
    """The lidars that are described. ``connect``: the link to the autopilot.

    Raises LidarError, also if two are on one port, or one on the autopilot's, under whatever names.
    """
    specs, autopilots = [parsed(text) for text in texts or ()], device_of(connect)
    for number, spec in enumerate(specs):
        for other in specs[:number]:
            if same_device(spec.port, other.port):
                is_it = f"{_the_same(spec.port, other.port)} another lidar's port ('{other.text}')"
                raise LidarError(f"lidar '{spec.text}': {is_it}; each has its own")
        if autopilots is not None and same_device(spec.port, autopilots):
            is_it = f"{_the_same(spec.port, autopilots)} the autopilot's port (--connect {connect})"
            raise LidarError(f"lidar '{spec.text}': {is_it}; give the lidar's own, see `ls -l /dev/serial/by-id`")
    return specs


def _the_same(port: str, other: str) -> str:
    return f"{port} is" if port == other else f"{port} and {other} are one device:"
