"""``rover-sitl missions``: where the shipped missions are, and a copy of them to change."""

from __future__ import annotations

import shutil
import tomllib
from pathlib import Path
from typing import Annotated

import typer

from companion.cli.inputs import EXIT_BAD_INPUT
from companion.storage.shipped import ONE, shipped

LISTED = ("*.toml", "first-drive/*.toml", "*.plan", "*.waypoints")


def missions(
    copy: Annotated[Path | None, typer.Option(help="Copy them, with all that they need, to this new folder.")] = None,
) -> None:
    """List the shipped missions, or copy them. Exit code 2: they are not there, or cannot be copied."""
    folder = shipped()
    if folder is None:
        typer.echo("the shipped missions are not installed; they are in the folder missions of the sources", err=True)
        raise typer.Exit(EXIT_BAD_INPUT)
    if copy is not None:
        _copy(folder, copy)
        return
    typer.echo(f"in {folder}:")
    for file in sorted(file for pattern in LISTED for file in folder.glob(pattern)):
        if file.suffix != ".toml" or "target" in tomllib.loads(file.read_text(encoding="utf-8")):
            typer.echo(f"  {file.relative_to(folder)}")
    typer.echo(f"rover-sitl drive {folder / ONE} drives one")


def _copy(folder: Path, place: Path) -> None:
    try:
        shutil.copytree(folder, place, ignore=shutil.ignore_patterns("*.py", "__pycache__"))
    except (OSError, shutil.Error) as error:
        # Of a shutil.Error the first file that failed tells enough.
        many = isinstance(error, shutil.Error) and bool(error.args) and isinstance(error.args[0], list)
        what = str(error.args[0][0][2]) if many else (error.strerror or str(error))
        remedy = "make room, and delete it first" if many else "name a folder that is not there yet"
        typer.echo(f"{place}: cannot be made: {what}; {remedy}", err=True)
        raise typer.Exit(EXIT_BAD_INPUT) from error
    typer.echo(f"copied to {place}; rover-sitl drive {place / ONE} drives one")
