"""QGroundControl's and Mission Planner's files: which reader is for which suffix."""

from __future__ import annotations

from pathlib import Path

from companion.mission.mission import Mission
from companion.mission.plan_reader import load as load_plan
from companion.mission.waypoints_reader import load as load_wpl

SUFFIXES = (".plan", ".waypoints", ".txt", ".mission", ".wpl")


def load_qgc(path: Path) -> Mission:
    """Read a ``.plan`` (JSON) or, whatever its suffix, a QGC WPL file. There may be fences only, without any target.

    Raises MissionError: one line with file, place and reason.
    """
    if path.suffix.lower() == ".plan":
        return load_plan(path)
    return load_wpl(path)
