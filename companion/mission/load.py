"""Loads and checks a mission file; its suffix decides the reader."""

from __future__ import annotations

from pathlib import Path

from companion.mission.check import check_mission
from companion.mission.ground_station_reader import SUFFIXES, load_ground_station_file
from companion.mission.mission import Mission, MissionError
from companion.mission.toml_reader import load as load_toml
from companion.storage.files import why_no_file

MISSIONS = Path("missions")
"""Where the missions lie that ship with the source."""


def load_mission(path: Path, *, simulated: bool = True, skip_unknown: bool = False) -> Mission:
    """Read and check a mission. ``simulated``: also what only the simulator needs.

    ``skip_unknown``: without the items of a ground station's file that this rover cannot do.

    ``.toml`` is this project's format, ``.plan`` QGroundControl's, ``.waypoints``, ``.txt``, ``.mission`` and ``.wpl``
    are QGC WPL files. Raises MissionError: one line with file, place and reason.
    """
    suffix = path.suffix.lower()
    if fault := why_no_file(path):
        raise MissionError(f"{path}: {fault}{_meant(path)}")
    if suffix == ".toml":
        return load_toml(path, simulated=simulated)
    if suffix not in SUFFIXES:
        raise MissionError(f"{path}: suffix '{path.suffix}' is no mission format; known: .toml, {', '.join(SUFFIXES)}")
    mission = load_ground_station_file(path, skip_unknown=skip_unknown)
    if not mission.targets and (mission.keep_out or mission.keep_in):
        raise MissionError(
            f'{path}: holds fences but no place to go to; a TOML mission takes them in by fence = "{path.name}"'
        )
    check_mission(mission)
    return mission


def _meant(path: Path) -> str:
    """What a name without suffix or folder may have meant, for people; empty if no such file is there."""
    if path.exists() or path.suffix:
        return ""
    for place in (path.with_name(f"{path.name}.toml"), MISSIONS / f"{path.name}.toml"):
        if path.name and place.is_file():
            return f" ({place} is there)"
    return ""
