"""What several commands check before anything moves: settings that can be used, files that can be written."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path

from companion.planning.registry import UnknownPlannerError, make_planner
from companion.settings import Settings, SettingsError, load_settings
from companion.storage.reading import refuse_pipe


class OutputError(Exception):
    """A file that cannot be written; the text is one line with file, reason and remedy."""


def usable_settings(path: Path | None) -> Settings:
    """The settings of a file (None: the defaults), with a planner that exists. Raises SettingsError."""
    settings = load_settings(path)
    try:
        make_planner(settings.navigator.planner, settings.planner)
    except UnknownPlannerError as error:
        raise SettingsError(f"{path}: navigator.planner: {error}") from error
    return settings


PICTURES = (".png", ".jpg", ".jpeg")


def picture(path: Path | None) -> None:
    """Like ``writable``, for a picture, whose suffix tells its format. Raises OutputError."""
    if path is not None and path.suffix.lower() not in PICTURES:
        raise OutputError(f"{path}: suffix '{path.suffix}' is no picture format; known: {', '.join(PICTURES)}")
    writable(path)


def writable(path: Path | None, suffix: str = "") -> None:
    """Make the directory of an output file and try the file itself, before hours are driven. Raises OutputError."""
    if path is None:
        return
    if path.name in ("", ".."):
        raise OutputError(f"{path}: is a folder, not a file; add a file's name")
    path = path.with_name(path.name + suffix)
    with written(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        refuse_pipe(path)
        existed = path.exists()
        with path.open("ab"):
            pass
        if not existed:
            path.unlink()


@contextlib.contextmanager
def written(path: Path) -> Iterator[None]:
    """Whatever goes wrong in here went wrong while ``path`` (a file, or the folder of several) was written: raises OutputError."""
    try:
        refuse_pipe(path)
        yield
    except OSError as error:
        place = error.filename if path.is_dir() and error.filename else path
        raise OutputError(f"{place}: cannot be written: {error.strerror or error}; choose another place") from error
