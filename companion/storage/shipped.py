"""Where the shipped missions and maps are: beside the sources, or where a wheel has put them."""

from __future__ import annotations

import contextlib
import importlib.metadata
from collections.abc import Iterator
from pathlib import Path

SOURCE = Path(__file__).resolve().parents[2] / "missions"
PACKAGE, ONE = "rover-companion", "rooms.toml"


def shipped() -> Path | None:
    """The folder of the shipped missions: beside the sources, or where a wheel has put it; None if there is none."""
    return next((file.parent for file in _places() if file.is_file()), None)


def _places() -> Iterator[Path]:
    yield SOURCE / ONE
    with contextlib.suppress(importlib.metadata.PackageNotFoundError):
        for file in importlib.metadata.files(PACKAGE) or ():
            if file.name == ONE:
                yield Path(str(file.locate())).resolve()
