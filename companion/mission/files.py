"""Every file that a mission was made of: itself, its fence, its known map, and what the simulator reads."""

from __future__ import annotations

import tomllib
from pathlib import Path

import yaml

from companion.mission.mission import Mission, SitlSpec
from companion.storage.reading import read_at_most

MAX_BYTES = 5_000_000
NAMES_ANOTHER = {".yaml": "image", ".yml": "image", ".toml": "base"}
"""Map and world files that name a picture or map beside them, and under which key."""


def files_of(mission: Mission) -> tuple[Path, ...]:
    """The files there are, each once; the mission's own first."""
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
    """The file that a map or world names; None if there is none, or the file is not what it seems (its reader will say so)."""
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
