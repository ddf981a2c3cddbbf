"""The option ``--lidar`` of several commands."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

import typer

from companion.lidar.spec import FORM, LidarError, LidarSpec, parsed

LidarOption = Annotated[
    list[str] | None,
    typer.Option("--lidar", metavar="SPEC", help=f"A lidar on a serial port of this computer: {FORM}; repeatable."),
]


def lidars_given(texts: Sequence[str] | None) -> list[LidarSpec]:
    """The lidars that are described. Raises LidarError, also if two are on one port."""
    specs = [parsed(text) for text in texts or ()]
    for number, spec in enumerate(specs):
        if any(spec.port == other.port for other in specs[:number]):
            raise LidarError(f"lidar '{spec.text}': {spec.port} is another lidar's port")
    return specs
