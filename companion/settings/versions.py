"""Versions and settings that a result was made with, so that it can be reproduced."""

from __future__ import annotations

import importlib.metadata
import platform

from companion.settings import Settings

PACKAGES = ("rover-companion", "numpy", "numba", "shapely", "pymavlink")


def versions() -> dict[str, str]:
    """Versions of Python, this program and the libraries that its results depend on."""
    return {"python": platform.python_version(), **{name: _version(name) for name in PACKAGES}}


def made_with(settings: Settings) -> dict[str, object]:
    """The keys of a JSON result that reproduce it together with seed and command."""
    return {"versions": versions(), "settings": settings.model_dump(mode="json")}


def _version(package: str) -> str:
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return "not installed"
