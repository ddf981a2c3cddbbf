"""What a result was made with, so that it can be made again."""

from __future__ import annotations

import importlib.metadata
import platform

from companion.settings import Settings

PACKAGES = ("rover-companion", "numpy", "numba", "shapely", "pymavlink")


def versions() -> dict[str, str]:
    """Of Python, of this program and of the libraries that its results depend on."""
    return {"python": platform.python_version(), **{name: _version(name) for name in PACKAGES}}


def made_with(settings: Settings) -> dict[str, object]:
    """The part of a JSON result that says what else than seed and command it follows from."""
    return {"versions": versions(), "settings": settings.model_dump(mode="json")}


def _version(package: str) -> str:
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return "not installed"
