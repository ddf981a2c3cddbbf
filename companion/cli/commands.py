"""The commands of ``rover-companion``, put together with typer."""

from __future__ import annotations

from typing import Annotated

import typer

from companion.cli import mission
from companion.cli.bench import bench
from companion.cli.check_planner import check_planner
from companion.cli.compile import compile_kernels
from companion.cli.doctor import doctor
from companion.cli.guard import guard
from companion.cli.inputs import version_option
from companion.cli.lidar import lidar
from companion.cli.params import params
from companion.cli.plan import plan
from companion.cli.replay import replay
from companion.cli.report import report
from companion.cli.run import run

app = typer.Typer(
    name="rover-companion",
    help="Finds a rover's way to a mission's targets through unknown ground.",
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)

app.command()(run)
app.command()(doctor)
app.command("compile")(compile_kernels)
app.command()(params)
app.command()(guard)
app.command()(lidar)
app.command()(plan)
app.command()(replay)
app.command()(report)
app.command()(bench)
app.command()(check_planner)
app.add_typer(mission.app)


@app.callback()
def options(version: Annotated[bool, version_option("rover-companion")] = False) -> None:
    """Finds a rover's way to a mission's targets through unknown ground."""
