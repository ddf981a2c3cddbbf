"""``--version``, the same for both scripts."""

from __future__ import annotations

import importlib.metadata
from typing import Any

import typer


def version_option(name: str) -> Any:
    """The option for a script's callback: prints its name and the installed version, and ends."""

    def show(asked: bool) -> None:
        if asked:
            typer.echo(f"{name} {importlib.metadata.version('rover-companion')}")
            raise typer.Exit

    return typer.Option("--version", callback=show, is_eager=True, help="Show the version and exit.")
