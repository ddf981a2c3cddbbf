"""Reader of ground stations' mission files, by suffix: QGroundControl's ``.plan``, otherwise QGC WPL."""

from __future__ import annotations

from pathlib import Path

from companion.mission.mission import Mission
from companion.mission.plan_reader import load as load_plan
from companion.mission.waypoints_reader import load as load_wpl

SUFFIXES = (".plan", ".waypoints", ".txt", ".mission", ".wpl")


def load_ground_station_file(path: Path) -> Mission:
    """Read a ``.plan`` (JSON) or, with any other suffix, a QGC WPL file. A file may hold fences without any target.

    Raises MissionError: one line with file, place and reason.
    """
    if path.suffix.lower() == ".plan":
        return load_plan(path)
    return load_wpl(path)
