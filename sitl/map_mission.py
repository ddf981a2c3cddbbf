"""Missions on any map, for ``drive --world``: from one field to another, on a grid with suitable fields."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

from companion.core.grid import Cell, Grid
from companion.mission.mission import GridSpec, HomePoint, Mission, MissionError, SitlSpec, Target

FINE_FIELD_M = 0.25
"""Smallest field for planning; fields of finer maps are combined."""
COARSE_FIELD_M = 0.6
"""From this size on fields are divided by three, so that a passage of one field stays open despite sensor errors."""
MAX_FIELDS = 1_000_000


def field_at(ground: Grid, text: str, option: str, *, top_left: bool) -> Cell:
    """The field given as X,Y. Raises MissionError if it is malformed, outside the map, or an obstacle."""
    try:
        x, y = (int(part) for part in text.split(","))
    except ValueError:
        raise MissionError(f"{option} {text}: not two integers X,Y") from None
    cell = Cell(x, ground.height - 1 - y if top_left else y)
    if not ground.contains(cell):
        raise MissionError(f"{option} {text}: outside the map of {ground.width} x {ground.height} fields")
    if ground.is_obstacle(cell):
        raise MissionError(
            f"{option} {text}: this field of the map is an obstacle or unknown (fields of {ground.resolution_m:g} m)"
        )
    return cell


def mission_on_map(path: Path, ground: Grid, start: Cell, target: Cell, *, prior: bool) -> Mission:
    """A mission from the centre of one field of the map to the centre of another.

    The companion's fields are a third of large map fields, or several small ones; its grid covers the map. With
    ``prior`` it knows the map from the start.
    """
    scale = _planning_scale(ground)
    resolution_m = ground.resolution_m * scale
    home = Cell(math.floor((start.x + 0.5) / scale), math.floor((start.y + 0.5) / scale))
    size = (math.ceil(ground.width / scale), math.ceil(ground.height / scale))
    place = HomePoint((target.y - start.y) * ground.resolution_m, (target.x - start.x) * ground.resolution_m)
    corner = HomePoint(-(start.y + 0.5) * ground.resolution_m, -(start.x + 0.5) * ground.resolution_m)
    return Mission(
        name=path.stem,
        targets=(Target("target", place),),
        grid=GridSpec(resolution_m, (size[0] + 1, size[1] + 1), home),
        prior_map=path if prior else None,
        prior_resolution_m=ground.resolution_m,
        prior_corner=corner,
        sitl=SitlSpec(world=path, resolution_m=ground.resolution_m, start=start),
    )


def mission_in_world(mission: Mission, path: Path, ground: Grid, start: Cell | None, *, prior: bool) -> Mission:
    """A mission in this world; its home is at the centre of ``start``.

    Without ``start`` that is the mission's own start field, or else the middle of the map.
    """
    sitl = mission.sitl or SitlSpec()
    begin = start or sitl.start or mission.grid.home or Cell(ground.width // 2, ground.height // 2)
    if not ground.contains(begin) or ground.is_obstacle(begin):
        raise MissionError(
            f"{path}: field {begin.x},{begin.y} is not free to start from; give --start X,Y of a free field"
        )
    sitl = replace(sitl, world=path, resolution_m=ground.resolution_m, start=begin)
    corner = HomePoint(-(begin.y + 0.5) * ground.resolution_m, -(begin.x + 0.5) * ground.resolution_m)
    known = replace(mission, prior_map=path, prior_resolution_m=ground.resolution_m, prior_corner=corner)
    return replace(known if prior else mission, sitl=sitl)


def _planning_scale(ground: Grid) -> float:
    """Side of the companion's fields, in fields of the map."""
    if ground.resolution_m < FINE_FIELD_M:
        return float(math.ceil(FINE_FIELD_M / ground.resolution_m))
    if ground.resolution_m >= COARSE_FIELD_M and 9 * ground.width * ground.height <= MAX_FIELDS:
        return 1.0 / 3.0
    return 1.0
