"""The cache of compiled kernels: where numba keeps them, and how long one is valid.

A kernel is valid while the text of its own file, and of all project files whose kernels and constants it uses, is
unchanged. The times of files, the folder of the project and all other files do not matter. numba itself looks at the
kernel's own file only. ``use_cache`` replaces that rule by ``Locator``, through numba's hook
``NUMBA_CACHE_LOCATOR_CLASSES``; child processes inherit it.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import shutil
import stat
import tempfile
from collections import defaultdict
from collections.abc import Callable, MutableMapping
from functools import cache
from pathlib import Path
from typing import Any

from companion.cli.source_names import SourceNames

PLACE, LOCATORS = "NUMBA_CACHE_DIR", "NUMBA_CACHE_LOCATOR_CLASSES"
ROOT = Path(__file__).resolve().parents[2]
"""The directory of the packages."""
PACKAGES = ("companion", "sitl")
KEPT = 4
"""Versions of a file whose kernels are kept; several, because all copies of the program share a cache."""


def use_cache(environment: MutableMapping[str, str]) -> Path:
    """Tell numba where the kernels are kept and when they are valid. Call it before numba is imported.

    The place is what the user has set (``NUMBA_CACHE_DIR``), or the first of these that can be written: systemd's
    cache directory, systemd's state directory, the user's cache directory (XDG), a directory of the user's own among
    the temporary files, a new temporary directory.

    Raises:
        OSError: nothing can be written, not even a temporary directory.
    """
    environment.setdefault(LOCATORS, f"{__name__}.Locator,UserProvidedCacheLocator")
    if not environment.get(PLACE):
        writable = (place for base in _bases(environment) if _is_writable(place := base / "kernels"))
        environment[PLACE] = str(next(writable, None) or _temporary())
    # The library of the pictures keeps a list of fonts there, and not in the user's own settings.
    environment.setdefault("MPLCONFIGDIR", str(Path(environment[PLACE]) / "matplotlib"))
    return Path(environment[PLACE])


class Locator:
    """numba's cache locator for kernels of this project: a directory for each version of a file with kernels.

    The methods are those of numba's own locators in ``numba.core.caching``.
    """

    def __init__(self, file: Path, line: int) -> None:
        self._py_file = str(file)  # numba's name for it
        self._line = line
        self._digest = kernel_digest(file)
        self._directory = Path(os.environ[PLACE]) / f"{_module_of(file)}-{self._digest[:16]}"

    @classmethod
    def from_function(cls, py_func: Callable[..., Any], py_file: str) -> Locator | None:
        """None for functions of other projects."""
        file = Path(py_file).resolve()
        if not any(file.is_relative_to(ROOT / package) for package in PACKAGES):
            return None
        locator = cls(file, py_func.__code__.co_firstlineno)
        locator.ensure_cache_path()
        return locator

    def ensure_cache_path(self) -> None:
        """Make the directory and remove old ones. A cache that cannot be written is still read."""
        with contextlib.suppress(OSError):
            if not self._directory.exists():
                self._directory.mkdir(parents=True, exist_ok=True)
                _remove_old(self._directory)
            os.utime(self._directory)

    def get_cache_path(self) -> str:
        """The directory of this version of the file."""
        return str(self._directory)

    def get_source_stamp(self) -> str:
        """Kernels with another stamp are not used."""
        return self._digest

    def get_disambiguator(self) -> str:
        """Tells functions of the same name in one file apart."""
        return str(self._line)


@cache
def kernel_digest(file: Path) -> str:
    """SHA-256 of a file with kernels and of all project files that these kernels depend on.

    If a file was edited while this process ran, its older form may be loaded: then no other process has this digest.
    """
    at_first, digest = _times_at_first(), hashlib.sha256()
    for path in sorted(_files_used_by(file)):
        digest.update(f"{path.relative_to(ROOT)}\0".encode() + path.read_bytes() + b"\0")
        if at_first.get(path) != path.stat().st_mtime_ns:
            digest.update(f"edited {os.getpid()}\0".encode())
    return digest.hexdigest()


@cache
def _times_at_first() -> dict[Path, int]:
    """When each file was changed, as it was when this process loaded its first kernel."""
    files = (file for package in PACKAGES for file in (ROOT / package).rglob("*.py"))
    return {file: file.stat().st_mtime_ns for file in files}


def _files_used_by(file: Path) -> set[Path]:
    """The file itself and all that define a name which its decorated functions use, directly or through others."""
    waiting = [(file, name) for name in _source(file).decorated]
    seen = set(waiting)
    while waiting:
        found = _used_by(*waiting.pop()) - seen
        waiting += found
        seen |= found
    return {file} | {path for path, _ in seen}


def _used_by(file: Path, name: str) -> set[tuple[Path, str]]:
    """What a name at the top level of a file is made from: files, each with a name there."""
    base, _, attribute = name.partition(".")
    found = {(file, used) for used in _source(file).uses.get(base, ())}
    for path, imported in _imports(file).get(base, ()):
        wanted = imported or attribute
        found |= {(path, one) for one in (_source(path).uses if wanted in ("", "*") else (wanted,))}
    return found


@cache
def _source(file: Path) -> SourceNames:
    return SourceNames.kept(file.read_bytes(), Path(os.environ[PLACE]) / "names", _module_of(file))


@cache
def _imports(file: Path) -> dict[str, set[tuple[Path, str]]]:
    """What an imported name stands for: a file, and a name there: "" for the module, "*" for all names."""
    found = defaultdict[str, set[tuple[Path, str]]](set)
    for name, module, wanted in _source(file).imports:
        if wanted == "*" and (path := _file_of(module)):
            found[name].add((path, "*"))
        elif package := _file_of(module):
            whole = _file_of(f"{module}.{wanted}")
            found[name].add((whole, "") if whole else (package, wanted))
    return found


def _module_of(file: Path) -> str:
    return ".".join(file.relative_to(ROOT).with_suffix("").parts)


def _file_of(module: str) -> Path | None:
    """The file of a module of this project; None for others."""
    if module.partition(".")[0] not in PACKAGES:
        return None
    path = ROOT.joinpath(*module.split("."))
    return next((file for file in (path.with_suffix(".py"), path / "__init__.py") if file.exists()), None)


def _bases(environment: MutableMapping[str, str]) -> list[Path]:
    """What systemd has made for the service, then the user's own directory for caches (XDG)."""
    bases = [
        Path(environment[key].split(":")[0]) for key in ("CACHE_DIRECTORY", "STATE_DIRECTORY") if environment.get(key)
    ]
    given = environment.get("XDG_CACHE_HOME", "")
    home = Path(environment.get("HOME") or "/")
    return [*bases, (Path(given) if given.startswith("/") else home / ".cache") / "rover-companion"]


def _temporary() -> Path:
    """The user's own directory among the temporary files: the next start finds its kernels there.

    Compiled kernels are code. Where the directory is not the user's alone, a new one is made. Raises OSError.
    """
    own = Path(tempfile.gettempdir()) / f"rover-companion-kernels-{os.getuid()}"
    if _is_writable(own):
        state = own.lstat()
        if stat.S_ISDIR(state.st_mode) and state.st_uid == os.getuid() and state.st_mode & 0o077 == 0:
            return own
    return Path(tempfile.mkdtemp(prefix="rover-companion-kernels-"))


def _is_writable(directory: Path) -> bool:
    """Tries it: ``os.access`` is wrong on read-only file systems and for root."""
    try:
        directory.mkdir(mode=0o700, parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=directory).close()
    except OSError:
        return False
    return True


def _remove_old(newest: Path) -> None:
    """Of the versions of a file's kernels, leave the ones used last."""
    module = newest.name.rpartition("-")[0]
    others = [path for path in newest.parent.glob(f"{module}-*") if path != newest]
    for path in sorted(others, key=lambda path: path.stat().st_mtime)[: -(KEPT - 1)]:
        shutil.rmtree(path, ignore_errors=True)
