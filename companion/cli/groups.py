"""The top of both scripts: commands that are imported only when one is used, and ``--version``.

Importing all of them takes seconds on a small computer; most need a compiler or a library for pictures.
"""

from __future__ import annotations

import importlib
import importlib.metadata
import shutil
from collections.abc import Iterator, Mapping
from typing import Any, Literal

import typer
from typer.core import TyperGroup

NARROW_COLUMNS = 80


def group(name: str, text: str, places: Mapping[str, str]) -> typer.Typer:
    """The application ``name`` with the commands of ``places``: each with ``module:function`` or ``module:app``."""

    class Group(TyperGroup):
        def __init__(self, **attributes: Any) -> None:
            super().__init__(**{**attributes, "rich_markup_mode": _markup()})
            self.commands: Any = _Commands(places)

    app = typer.Typer(
        name=name,
        help=text,
        cls=Group,
        pretty_exceptions_enable=False,
        context_settings={"help_option_names": ["-h", "--help"]},
    )
    app.callback(help=text)(_options(name))
    return app


class _Commands(Mapping[str, Any]):
    """Commands by name, each imported when it is first asked for."""

    def __init__(self, places: Mapping[str, str]) -> None:
        self._places = dict(places)
        self._loaded: dict[str, Any] = {}

    def __getitem__(self, name: str) -> Any:
        if name not in self._loaded:
            self._loaded[name] = _loaded(name, self._places[name])
        return self._loaded[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._places)

    def __len__(self) -> int:
        return len(self._places)


def _loaded(name: str, place: str) -> Any:
    module, _, attribute = place.partition(":")
    found = getattr(importlib.import_module(module), attribute)
    if not isinstance(found, typer.Typer):
        app = typer.Typer(add_completion=False)
        app.command(name)(found)
        found = app
    found.rich_markup_mode = _markup()
    return typer.main.get_command(found)


def _markup() -> Literal["rich"] | None:
    """On a narrow terminal plain text, which is wrapped; the columns of a table would be cut there."""
    return "rich" if shutil.get_terminal_size().columns >= NARROW_COLUMNS else None


def _options(name: str) -> Any:
    def tell(asked: bool) -> None:
        if asked:
            typer.echo(f"{name} {importlib.metadata.version('rover-companion')}")
            raise typer.Exit

    def options(
        version: bool = typer.Option(
            False, "--version", callback=tell, is_eager=True, help="Show the version and exit."
        ),
    ) -> None:
        pass

    return options
