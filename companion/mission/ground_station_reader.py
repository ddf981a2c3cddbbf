"""Reader of ground stations' mission files, by suffix: QGroundControl's ``.plan``, otherwise QGC WPL."""

from __future__ import annotations

from pathlib import Path

from companion.mission.mission import Mission
from companion.mission.plan_reader import load as load_plan
from companion.mission.waypoints_reader import load as load_wpl

SUFFIXES = (".plan", ".waypoints", ".txt", ".mission", ".wpl")


def load_ground_station_file(path: Path, *, skip_unknown: bool = False) -> Mission:
    """Read a ``.plan`` (JSON) or, with any other suffix, a QGC WPL file. A file may hold fences without any target.

    ``skip_unknown``: without the items that this rover cannot do. Raises MissionError: one line with file, place and
    reason.
    """
    if path.suffix.lower() == ".plan":
        return load_plan(path, skip_unknown=skip_unknown)
    return load_wpl(path, skip_unknown=skip_unknown)
