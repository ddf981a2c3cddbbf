"""Where compiled kernels are kept: chosen before the compiler is imported, which looks for a place only once."""

from __future__ import annotations

import contextlib
import hashlib
import os
import shutil
import tempfile
from collections.abc import Iterable, MutableMapping
from pathlib import Path

VARIABLE = "NUMBA_CACHE_DIR"
KEPT = 2
"""So many versions of the program keep their kernels; older ones' are removed."""


def choose_place(environment: MutableMapping[str, str], packages: Iterable[Path]) -> Path | None:
    """Set where kernels are kept, unless the user has (``NUMBA_CACHE_DIR``); None: beside the sources, as the compiler does by itself.

    Beside the sources only in a working copy that can be written. Elsewhere there is a directory for every state of the sources: the compiler looks only
    at the file a kernel is in, not at the files it calls into, and would take an older version's kernels for those of a newer one.
    ``packages``: the directories of all packages with kernels.
    """
    packages = tuple(packages)
    if environment.get(VARIABLE):
        return Path(environment[VARIABLE])
    if all((package.parent / "pyproject.toml").exists() and _is_writable(package) for package in packages):
        return None
    name = f"kernels-{_digest(packages)}"
    for base in _bases(environment):
        place = base / name
        try:
            place.mkdir(mode=0o700, parents=True, exist_ok=True)
        except OSError:
            continue
        if _is_writable(place):
            os.utime(place)
            _remove_old(base, place)
            environment[VARIABLE] = str(place)
            return place
    environment[VARIABLE] = tempfile.mkdtemp(prefix="rover-companion-kernels-")
    return Path(environment[VARIABLE])


def _bases(environment: MutableMapping[str, str]) -> list[Path]:
    """What systemd has made for the service, then the user's own place for caches (XDG)."""
    bases = [
        Path(environment[key].split(":")[0]) for key in ("CACHE_DIRECTORY", "STATE_DIRECTORY") if environment.get(key)
    ]
    given = environment.get("XDG_CACHE_HOME", "")
    home = Path(environment.get("HOME") or "/")
    return [*bases, (Path(given) if given.startswith("/") else home / ".cache") / "rover-companion"]


def _is_writable(directory: Path) -> bool:
    """Tried, not asked: the answer of ``os.access`` is wrong on file systems that are mounted read-only or belong to root."""
    try:
        tempfile.TemporaryFile(dir=directory).close()
    except OSError:
        return False
    return True


def _digest(packages: Iterable[Path]) -> str:
    """Of all sources: two milliseconds."""
    digest = hashlib.sha256()
    for package in packages:
        for path in sorted(package.rglob("*.py")):
            digest.update(str(path).encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()[:16]


def _remove_old(base: Path, newest: Path) -> None:
    others = [path for path in base.glob("kernels-*") if path != newest]
    with contextlib.suppress(OSError):  # another run is just doing the same
        for path in sorted(others, key=lambda path: path.stat().st_mtime)[: -(KEPT - 1)]:
            shutil.rmtree(path, ignore_errors=True)
