"""``rover-companion guard``: the script for the autopilot that stops the rover when the companion falls silent."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from companion.cli.inputs import EXIT_BAD_INPUT, OutputError, usable_settings, writable, written
from companion.settings import SettingsError
from companion.vehicle.guard import FILE, script


def guard(
    write: Annotated[Path | None, typer.Option(help=f"Write it to this file or folder, there as {FILE}.")] = None,
    settings_file: Annotated[Path | None, typer.Option("--settings", help="TOML file, see docs/settings.md.")] = None,
) -> None:
    """Print the Lua script that guards the rover on the autopilot, or write it to a file. Exit code 2: bad input."""
    try:
        text = script(usable_settings(settings_file).link.component_id)
        if write is None:
            typer.echo(text, nl=False)
            return
        place = write / FILE if write.is_dir() else write
        writable(place)
        with written(place):
            place.write_text(text, encoding="utf-8")
    except (SettingsError, OutputError) as error:
        typer.echo(str(error), err=True)
        raise typer.Exit(EXIT_BAD_INPUT) from error
    typer.echo(
        f"wrote {place}\ncopy it to the autopilot's SD card, folder APM/scripts; set SCR_ENABLE to 1 and SCR_USER1 to "
        "300 (milliseconds); restart the autopilot; `rover-companion doctor` shows whether it is there"
    )
