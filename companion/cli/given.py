"""Options for missions whose file cannot say how large fields and rover are, and how fast it drives."""

from __future__ import annotations

from typing import Annotated

import typer

ResolutionM = Annotated[
    float | None,
    typer.Option(min=0.05, max=100.0, help="Side of a field, for a file that cannot say it; default: by the rover."),
]
RadiusM = Annotated[
    float | None,
    typer.Option(min=0.05, max=20.0, help="Everything within it stays clear, for a file that cannot say it."),
]
SpeedMS = Annotated[
    float | None,
    typer.Option("--speed", metavar="M/S", min=0.05, max=50.0, help="Cruise speed, for a file that cannot say it."),
]
