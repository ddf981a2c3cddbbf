"""The commands of ``rover-sitl``."""

from __future__ import annotations

import typer

from sitl.cli.drive import drive
from sitl.cli.experiment import experiment
from sitl.cli.serve import serve

app = typer.Typer(
    name="rover-sitl",
    help="A light rover simulator that speaks ArduRover's MAVLink.",
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


@app.callback()
def _commands() -> None:
    """Keeps ``serve`` a named command, however many there are."""


app.command()(drive)
app.command()(serve)
app.command()(experiment)
