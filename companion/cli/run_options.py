"""The options of ``rover-companion run`` and their help texts."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

Connect = Annotated[
    str,
    typer.Option(
        help="The autopilot: udpin:HOST:PORT, udpout:HOST:PORT, tcp:HOST:PORT, tcpin:HOST:PORT or serial:DEVICE:BAUD."
    ),
]
MissionFile = Annotated[
    Path | None, typer.Argument(metavar="MISSION", help="TOML, .plan or .waypoints file.", show_default=False)
]
FromAutopilot = Annotated[
    bool, typer.Option("--from-autopilot", help="Drive the mission that the autopilot has stored.")
]
Arm = Annotated[bool, typer.Option("--arm", help="Arm the motors; otherwise wait for a person to do it.")]
SettingsFile = Annotated[Path | None, typer.Option("--settings", help="TOML file, see docs/settings.md.")]
Seed = Annotated[int, typer.Option(min=0, help="Of planners that draw random numbers.")]
Record = Annotated[Path | None, typer.Option(help="Directory for the record and the map of this run.")]
State = Annotated[Path | None, typer.Option(help="Directory where this rover's state is kept.")]
Resume = Annotated[bool, typer.Option("--resume", help="Go on where the run that kept its state there ended.")]
SigningKey = Annotated[Path | None, typer.Option(help="File with the passphrase, or 64 hexadecimal digits.")]
