"""The contacts of a simulated drive, which it leaves in its record: a companion knows no more of them by itself."""

from __future__ import annotations

from pathlib import Path

from pydantic import TypeAdapter
from typing_extensions import TypedDict

from companion.storage.files import read_at_most

COLLISIONS, MOST_BYTES = "collisions.json", 1_000_000
Contact = TypedDict("Contact", {"time_s": float, "north_m": float, "east_m": float, "speed_m_s": float, "with": str})
"""Times are the simulator's, places count from the start."""


def contacts_of(directory: Path) -> list[Contact]:
    """Those in the record of a drive. Raises OSError or ValueError if the file cannot be used."""
    file = directory / COLLISIONS
    if not file.exists():
        return []
    return TypeAdapter(list[Contact]).validate_json(read_at_most(file, MOST_BYTES), strict=True)
