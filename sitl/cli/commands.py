"""The commands of ``rover-sitl``."""

from __future__ import annotations

from typing import Annotated

import typer

from companion.cli.inputs import version_option
from sitl.cli.campaign import campaign
from sitl.cli.compare import compare
from sitl.cli.drive import drive
from sitl.cli.experiment import experiment
from sitl.cli.missions import missions
from sitl.cli.physics import physics
from sitl.cli.serve import serve
from sitl.cli.world import app as world

app = typer.Typer(
    name="rover-sitl",
    help="A light rover simulator that speaks ArduRover's MAVLink.",
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


@app.callback()
def options(version: Annotated[bool, version_option("rover-sitl")] = False) -> None:
    """A light rover simulator that speaks ArduRover's MAVLink."""


app.command()(drive)
app.command()(serve)
app.command()(physics)
app.command()(missions)
app.command()(experiment)
app.command()(campaign)
app.command()(compare)
app.add_typer(world)
