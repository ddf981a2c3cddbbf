"""The shapes of a world file's obstacles, and whether a rover would touch one where it starts.

The whole file is read by the simulator only; ``mission check`` looks at the start with what is here.
"""

from __future__ import annotations

import contextlib
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Literal

import shapely
from pydantic import Field
from shapely.geometry.base import BaseGeometry

from companion.core.footprint import Footprint
from companion.core.grid import Cell
from companion.mapping.map_files import MapError, load_map
from companion.mission.tables import Metres, Pair, Positive, Table

FINE_M = 0.1
"""The side of the fields that shapes are drawn into, where the file does not say."""


class ShapeTable(Table):
    """A polygon, a line with a width, or a circle."""

    polygon_m: Annotated[list[Pair], Field(min_length=3)] | None = None
    line_m: Annotated[list[Pair], Field(min_length=2)] | None = None
    width_m: Positive | None = None
    north_m: Metres | None = None
    east_m: Metres | None = None
    radius_m: Positive | None = None

    def shape(self) -> BaseGeometry:
        """The shape, x east, y north. Raises ValueError unless there is exactly one."""
        circle = (self.north_m, self.east_m, self.radius_m)
        if (self.line_m is None) != (self.width_m is None):
            raise ValueError("a line needs line_m and width_m")
        if any(part is None for part in circle) and any(part is not None for part in circle):
            raise ValueError("a circle needs north_m, east_m and radius_m")
        shapes: list[BaseGeometry] = []
        if self.polygon_m is not None:
            shapes.append(_polygon([(east, north) for north, east in self.polygon_m]))
        if self.line_m is not None and self.width_m is not None:
            line = shapely.LineString([(east, north) for north, east in self.line_m])
            shapes.append(line.buffer(self.width_m / 2.0, cap_style="flat", join_style="mitre"))
        if self.north_m is not None and self.east_m is not None and self.radius_m is not None:
            shapes.append(shapely.Point(self.east_m, self.north_m).buffer(self.radius_m))
        if len(shapes) != 1:
            raise ValueError(f"exactly one of polygon_m, line_m and circle is needed, not {len(shapes)}")
        return shapes[0]


class ObstacleTable(ShapeTable):
    """``[[obstacle]]``."""

    material: Literal["solid", "glass", "black"] = "solid"


def _polygon(corners: list[tuple[float, float]]) -> BaseGeometry:
    polygon = shapely.Polygon(corners)
    if not polygon.is_valid or polygon.area == 0.0:
        raise ValueError("polygon_m: not a simple polygon: its sides cross or touch")
    return polygon


def touches_obstacle(path: Path, content: Mapping[str, object], rover: Footprint, place_m: tuple[float, float]) -> bool:
    """Whether a rover at this place, metres north and east, touches what always stands in this world.

    In doubt it does not: walls are drawn into fields, and what has a mistake in it is left to the simulator.
    """
    if _on_base(path, content, place_m):
        return True
    reach_m = max(0.0, rover.inscribed_m - 0.5 * (_metres(content, "resolution_m") or FINE_M))
    obstacles = content.get("obstacle")
    for item in obstacles if isinstance(obstacles, list) else []:
        with contextlib.suppress(ValueError):  # of a wrong table, and of a wrong shape
            if ObstacleTable.model_validate(item).shape().distance(shapely.Point(place_m[::-1])) <= reach_m:
                return True
    return False


def _on_base(path: Path, content: Mapping[str, object], place_m: tuple[float, float]) -> bool:
    """Whether the map underneath has an obstacle there."""
    base = content.get("base")
    if not isinstance(base, str) or Path(base).suffix.lower() == ".toml":
        return False
    try:
        grid = load_map(path.parent / base, _metres(content, "base_resolution_m"))
    except MapError:
        return False
    north, east = (int(one_m / grid.resolution_m) for one_m in place_m)
    return grid.contains(Cell(east, north)) and grid.is_obstacle(Cell(east, north))


def _metres(content: Mapping[str, object], key: str) -> float | None:
    value = content.get(key)
    return float(value) if isinstance(value, int | float) and value > 0.0 else None
