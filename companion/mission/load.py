"""One door for all mission files."""

from __future__ import annotations

from pathlib import Path

from companion.mission.check import check_mission
from companion.mission.mission import Mission, MissionError
from companion.mission.qgc import SUFFIXES, load_qgc
from companion.mission.toml_reader import load as load_toml
from companion.storage.reading import why_no_file


def load_mission(path: Path, *, simulated: bool = True) -> Mission:
    """Read a mission, ready to be driven; the suffix tells the format. ``simulated``: also what only the simulator needs.

    ``.toml`` is ours, ``.plan`` QGroundControl's, ``.waypoints``, ``.txt``, ``.mission`` and ``.wpl`` are QGC WPL files.
    Raises MissionError: one line with file, place and reason.
    """
    suffix = path.suffix.lower()
    if fault := why_no_file(path):
        raise MissionError(f"{path}: {fault}")
    if suffix == ".toml":
        return load_toml(path, simulated=simulated)
    if suffix not in SUFFIXES:
        raise MissionError(f"{path}: suffix '{path.suffix}' is no mission format; known: .toml, {', '.join(SUFFIXES)}")
    mission = load_qgc(path)
    if not mission.targets and (mission.keep_out or mission.keep_in):
        raise MissionError(
            f'{path}: holds fences but no place to go to; a TOML mission takes them in by fence = "{path.name}"'
        )
    check_mission(mission)
    return mission
