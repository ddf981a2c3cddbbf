"""The files that a mission was read from: its own, its fence, its prior map, and those of the simulator."""

from __future__ import annotations

import tomllib
from pathlib import Path

import yaml

from companion.mission.mission import Mission, SitlSpec
from companion.storage.files import read_at_most

MAX_BYTES = 5_000_000
NAMES_ANOTHER = {".yaml": "image", ".yml": "image", ".toml": "base"}
"""Map and world files that name an image or map, and the key under which they do."""


def source_files(mission: Mission) -> tuple[Path, ...]:
    """The files that exist, each once; the mission's own first."""
    sitl = mission.sitl or SitlSpec()
    named = (mission.source, *mission.also_read, mission.prior_map, sitl.world, sitl.parameters)
    found: dict[Path, None] = {}
    for first in named:
        path = first
        while path is not None and path not in found and path.is_file():
            found[path] = None
            path = _named_in(path) if path != mission.source else None
    return tuple(found)


def _named_in(path: Path) -> Path | None:
    """The file that a map or world names; None if there is none or it cannot be read (its reader reports that)."""
    key = NAMES_ANOTHER.get(path.suffix.lower())
    if key is None:
        return None
    try:
        text = read_at_most(path, MAX_BYTES).decode("utf-8")
        content = tomllib.loads(text) if path.suffix.lower() == ".toml" else yaml.safe_load(text)
    except (OSError, ValueError, yaml.YAMLError, RecursionError):
        return None
    name = content.get(key) if isinstance(content, dict) else None
    return path.parent / name if isinstance(name, str) and name and "\0" not in name else None
