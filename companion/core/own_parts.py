"""Parts from other packages: planners, controllers and worlds, by ``module:name`` or registered as entry points.

The groups of entry points are ``rover_companion.planners``, ``.controllers`` and ``.worlds``.

Nouns: own part.
"""

from __future__ import annotations

import importlib
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from enum import StrEnum
from importlib.metadata import entry_points
from pathlib import Path
from traceback import extract_tb
from typing import Any

from companion.core.interrupts import is_interrupt


class OwnKind(StrEnum):
    """What may come from elsewhere."""

    PLANNER = "planner"
    CONTROLLER = "controller"
    WORLD = "world"

    @property
    def group(self) -> str:
        """The entry points' group."""
        return f"rover_companion.{self}s"


class OwnPartError(ValueError):
    """A part of one's own that cannot be used; the text is one line."""


def registered(kind: OwnKind) -> tuple[str, ...]:
    """The names that installed packages have registered."""
    return tuple(sorted({one.name for one in entry_points(group=kind.group)}))


def looks_own(kind: OwnKind, name: str) -> bool:
    """Whether this is ``module:name``, or a name that a package has registered. Nothing is loaded."""
    return ":" in name or name in registered(kind)


def own_part(kind: OwnKind, name: str) -> Any:
    """The class or function that makes the part; None for a name that is neither form.

    ``module:name`` is looked for beside the installed packages in the present folder, too. Raises OwnPartError.
    """
    try:
        if ":" in name:
            module, _, attribute = name.partition(":")
            found = getattr(_imported(module), attribute)
        else:
            points = tuple(entry_points(group=kind.group, name=name))
            if not points:
                return None
            found = points[0].load()
    except (Exception, SystemExit) as error:
        if is_interrupt(error):
            raise
        raise OwnPartError(f"{kind} {name!r:.80} cannot be loaded: {_reason(error)}{_remedy(name, error)}") from error
    if not callable(found):
        raise OwnPartError(f"{kind} {name!r:.80} is no class or function that makes a {kind}")
    return found


def made_by(kind: OwnKind, name: str, needs: tuple[str, ...], *given: object) -> Any:
    """What an own part makes of ``given``; it must have all of ``needs``. Raises OwnPartError."""
    factory = own_part(kind, name)
    try:
        made = factory(*given)
    except (Exception, SystemExit) as error:
        if is_interrupt(error):
            raise
        raise OwnPartError(f"{kind} {name!r:.80} cannot be made: {raised(kind, name, error)}") from error
    missing = [part for part in needs if not hasattr(made, part)]
    if missing:
        raise OwnPartError(f"{kind} {name!r:.80} has no {missing[0]}; docs/planners.md shows one")
    return made


@contextmanager
def blamed(kind: OwnKind, name: str) -> Iterator[None]:
    """A context in which this part works: if it is one's own, what goes wrong is its own fault. Raises OwnPartError."""
    try:
        yield
    except (Exception, SystemExit) as error:  # one that ends the program would end a drive without a word
        if is_interrupt(error) or not looks_own(kind, name):
            raise
        raise OwnPartError(f"{kind} {name!r:.80} fails: {raised(kind, name, error)}") from error


def source_of(kind: OwnKind, name: str) -> Path | None:
    """The file that an own part comes from, for those who must know when it changes; None for others."""
    part = own_part(kind, name)
    if part is None:
        return None
    module = name.partition(":")[0] if ":" in name else getattr(part, "__module__", "")
    file = getattr(sys.modules.get(module), "__file__", None)
    return None if file is None else Path(file)


def sources_of(kind: OwnKind, name: str) -> tuple[Path, ...]:
    """The file that an own part comes from, and those that it may import: all of its package, or those beside it.

    Of a module that is installed without a package only its own file.
    """
    file = source_of(kind, name)
    if file is None:
        return ()
    folder, is_package = file.parent, (file.parent / "__init__.py").exists()
    if not is_package and folder.name in ("site-packages", "dist-packages"):
        return (file,)
    while is_package and (folder.parent / "__init__.py").exists():
        folder = folder.parent
    return tuple(sorted({file, *(folder.rglob("*.py") if is_package else folder.glob("*.py"))}))


def raised(kind: OwnKind, name: str, error: BaseException) -> str:
    """An error in one line, with the last line of the own part's file that led to it, where there is one."""
    try:
        file = source_of(kind, name) if looks_own(kind, name) else None
    except OwnPartError:
        file = None
    lines = [one.lineno for one in extract_tb(error.__traceback__) if file is not None and Path(one.filename) == file]
    return _reason(error) + (f" ({file.name}, line {lines[-1]})" if file is not None and lines else "")


def _reason(error: BaseException) -> str:
    return " ".join(f"{type(error).__name__}: {error}".split())[:200]


def _remedy(name: str, error: BaseException) -> str:
    missing = isinstance(error, ModuleNotFoundError) and error.name == name.partition(":")[0]
    return "; it is looked for among the installed packages and in this folder" if missing else ""


def _imported(module: str) -> object:
    """The module; the present folder comes last, and only while it is imported."""
    before = list(sys.path)
    sys.path.append(str(Path.cwd()))
    try:
        return importlib.import_module(module)
    finally:
        sys.path[:] = before
