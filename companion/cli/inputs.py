"""Options that commands share, and their checks: usable settings, writable files."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Annotated

import typer

from companion.core.own_parts import OwnPartError
from companion.executive.controller_choice import check_controller
from companion.planning.registry import PLANNERS, UnknownPlannerError, make_planner
from companion.settings import Settings, SettingsError, load_settings
from companion.storage.files import beside, refuse_pipe, whole_file

EXIT_BAD_INPUT = 2
"""Of every command: it has not begun, since a file or an option cannot be used."""


SkipUnknown = Annotated[
    bool,
    typer.Option(
        "--skip-unknown", help="Leave out what no rover can do in a ground station's mission; drive the rest."
    ),
]
Laps = Annotated[
    int | None, typer.Option(min=1, help="End a patrol after so many laps; any mission may be driven several times.")
]


PlannerName = Annotated[
    str | None,
    typer.Option("--planner", help=f"{', '.join(PLANNERS)}, or one's own as module:name; default: the settings'."),
]


EXIT_NOT_WRITTEN = 5
"""The command has done its work, and could not write a file about it."""


class OutputError(Exception):
    """A file that cannot be written; the text is one line with file, reason and remedy."""


def usable_settings(path: Path | None, planner: str | None = None) -> Settings:
    """The settings of a file (None: the defaults), with a planner and a controller that exist.

    ``planner`` is used instead of theirs. Raises SettingsError.
    """
    settings = load_settings(path)
    if planner is not None:
        navigator = settings.navigator.model_copy(update={"planner": planner})
        settings = settings.model_copy(update={"navigator": navigator})
    try:
        make_planner(settings.navigator.planner, settings.planner)
    except UnknownPlannerError as error:
        place = f"{path}: navigator.planner" if planner is None else "--planner"
        raise SettingsError(f"{place}: {error}") from error
    try:
        check_controller(settings.guidance.controller)
    except OwnPartError as error:
        raise SettingsError(f"{path}: guidance.controller: {error}") from error
    return settings


PICTURES = (".png", ".jpg", ".jpeg")


def picture(path: Path | None) -> None:
    """Like ``writable``, for an image, whose suffix decides its format. Raises OutputError."""
    if path is not None and (os.path.isdir(path) or path.name in ("", "..")):  # Path.is_dir may raise
        raise OutputError(f"{path}: is a folder, not a file; add a file's name, like {path / 'picture.png'}")
    if path is not None and not path.suffix:
        raise OutputError(f"{path}: the name says no picture format; write {path}.png")
    if path is not None and path.suffix.lower() not in PICTURES:
        raise OutputError(f"{path}: suffix '{path.suffix}' is no picture format; known: {', '.join(PICTURES)}")
    writable(path)


def writable(path: Path | None, suffix: str = "") -> None:
    """Create the directory of an output file and try to write the file, before the work. Raises OutputError."""
    if path is None:
        return
    if path.name in ("", ".."):
        raise OutputError(f"{path}: is a folder, not a file; add a file's name")
    path = path.with_name(path.name + suffix)
    with written(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        refuse_pipe(path)
        for file in dict.fromkeys(reversed(beside(path))):
            existed = os.path.exists(file)  # Path.exists raises where a folder may not be entered
            with file.open("ab"):
                pass
            if not existed:
                file.unlink()


def in_folder(path: Path) -> None:
    """Like ``writable``, for a file that goes elsewhere afterwards: its folder must be there already, else the name of
    a mounted card may have a slip in it. Raises OutputError.
    """
    if not path.parent.is_dir():
        raise OutputError(f"{path}: there is no folder {path.parent}; make it, or name another one")
    writable(path)


def apart(outputs: Iterable[Path | None], inputs: Iterable[Path | None]) -> None:
    """No output is a file that is read, or another output: nothing is lost. Raises OutputError."""
    used = {os.path.realpath(path) for path in inputs if path is not None}
    for path in outputs:
        if path is None:
            continue
        place = os.path.realpath(path)
        if place in used:
            raise OutputError(f"{path}: is another file of this command; choose another name")
        used.add(place)


@contextlib.contextmanager
def written(path: Path) -> Iterator[None]:
    """A context in which ``path`` (a file or folder) is written; an OSError in it becomes OutputError."""
    try:
        refuse_pipe(path)
        yield
    except OSError as error:
        place = error.filename if os.path.isdir(path) and error.filename else path
        raise OutputError(f"{place}: cannot be written: {error.strerror or error}; choose another place") from error


@contextlib.contextmanager
def replaced(path: Path) -> Iterator[Path]:
    """A context in which a file is written under the name that it gives; whole, it takes the place of ``path``.

    After an error the old file is as it was; an OSError becomes OutputError.
    """
    with written(path), whole_file(path) as new:
        yield new
