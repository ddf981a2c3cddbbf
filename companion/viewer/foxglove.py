"""Foxglove messages: values of its well-known schemas as JSON, which Foxglove and Lichtblick show as they are.

The frame ``map`` is east, north, up, in metres from the origin of the autopilot's local frame; ``rover`` is ahead,
left, up. Angles are radians, counter-clockwise.

Nouns: Foxglove message.
"""

from __future__ import annotations

import base64
import math
from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from companion.core.frames import GeoPoint, NedPoint, Pose
from companion.core.scan import RangeScan
from companion.viewer.even_rays import even_rays
from companion.viewer.foxglove_schemas import UNUSED

Json = dict[str, Any]
MAP, ROVER = "map", "rover"
UINT8 = 1
LINE_STRIP, DELETE_ALL = 0, 1
PATH_COLOUR = {"r": 0.15, "g": 0.4, "b": 0.9, "a": 1.0}
TARGET_COLOUR = {"r": 0.95, "g": 0.55, "b": 0.1, "a": 1.0}
PATH_PIXELS = 3.0
TARGET_M = 0.6
LEVELS = {"info": 2, "notice": 2, "warning": 3, "error": 4}


def stamp(unix_us: int) -> Json:
    """A time."""
    return {"sec": unix_us // 1_000_000, "nsec": unix_us % 1_000_000 * 1000}


def frame_transform(unix_us: int, pose: Pose) -> Json:
    """Where the frame ``rover`` lies."""
    placed = _pose(pose.point, pose.heading_rad)
    return {
        "timestamp": stamp(unix_us),
        "parent_frame_id": MAP,
        "child_frame_id": ROVER,
        "translation": placed["position"],
        "rotation": placed["orientation"],
    }


def pose_in_frame(unix_us: int, pose: Pose) -> Json:
    """The rover's pose on the map."""
    return {"timestamp": stamp(unix_us), "frame_id": MAP, "pose": _pose(pose.point, pose.heading_rad)}


def location_fix(unix_us: int, point: GeoPoint, altitude_m: float) -> Json:
    """The rover's latitude and longitude."""
    return {
        "timestamp": stamp(unix_us),
        "frame_id": ROVER,
        "latitude": round(point.lat_deg, 8),
        "longitude": round(point.lon_deg, 8),
        "altitude": altitude_m,
        "position_covariance": [0.0] * 9,
        "position_covariance_type": 0,
    }


def laser_scan(unix_us: int, scan: RangeScan) -> Json:
    """A scan as the rover sees it. A range of 0: no echo, or no reading (JSON has no infinity).

    A single beam becomes two readings, at the edges of its width: one reading has no direction for the viewers.
    """
    rays = even_rays(scan)
    ranges = np.where(np.isfinite(rays.range_m), rays.range_m, 0.0)
    first_rad, last_rad = -rays.first_rad, -(rays.first_rad + rays.step_rad * (len(ranges) - 1))
    if len(ranges) == 1:
        half_rad = 0.5 * scan.beam_width_rad
        first_rad, last_rad, ranges = first_rad + half_rad, last_rad - half_rad, np.repeat(ranges, 2)
    return {
        "timestamp": stamp(unix_us),
        "frame_id": ROVER,
        "pose": _pose(NedPoint(0.0, 0.0), math.pi / 2.0),
        "start_angle": round(first_rad, 5),
        "end_angle": round(last_rad, 5),
        "ranges": np.round(ranges, 3).tolist(),
        # Points are coloured by it, and all dark without.
        "intensities": np.round(ranges, 3).tolist(),
    }


def grid(unix_us: int, south_west: NedPoint, cell_m: float, colours: NDArray[np.uint8]) -> Json:
    """A picture of the ground. ``colours``: shape (rows from the south, columns, 4), red, green, blue, opacity."""
    return {
        "timestamp": stamp(unix_us),
        "frame_id": MAP,
        "pose": _pose(south_west, math.pi / 2.0, up_m=-0.02),
        "column_count": colours.shape[1],
        "cell_size": {"x": cell_m, "y": cell_m},
        "row_stride": 4 * colours.shape[1],
        "cell_stride": 4,
        "fields": [
            {"name": name, "offset": number, "type": UINT8}
            for number, name in enumerate(("red", "green", "blue", "alpha"))
        ],
        "data": base64.b64encode(np.ascontiguousarray(colours).tobytes()).decode(),
    }


def path_line(unix_us: int, places: NDArray[np.float64]) -> Json:
    """The path as a line. ``places``: rows north and east; none takes the line away."""
    points = [{"x": east, "y": north, "z": 0.05} for north, east in np.round(places, 3).tolist()]
    line = {
        "type": LINE_STRIP,
        "pose": _pose(NedPoint(0.0, 0.0), math.pi / 2.0),
        "thickness": PATH_PIXELS,
        "scale_invariant": True,
        "points": points,
        "color": PATH_COLOUR,
        "colors": [],
        "indices": [],
    }
    return _scene(unix_us, [_entity(unix_us, "path", lines=[line] if points else [])])


def targets(unix_us: int, places: Iterable[tuple[str, NedPoint]]) -> Json:
    """The targets as balls with their names."""
    entities = []
    for number, (name, point) in enumerate(places):
        ball = {
            "pose": _pose(point, math.pi / 2.0),
            "size": {"x": TARGET_M, "y": TARGET_M, "z": TARGET_M},
            "color": TARGET_COLOUR,
        }
        words = {
            "pose": _pose(point, math.pi / 2.0, up_m=1.0),
            "billboard": True,
            "font_size": 14.0,
            "scale_invariant": True,
            "color": TARGET_COLOUR,
            "text": name,
        }
        entities.append(_entity(unix_us, f"target {number + 1}", spheres=[ball], texts=[words]))
    # All those of an earlier, longer list go first.
    everything: Json = {"timestamp": stamp(unix_us), "type": DELETE_ALL, "id": ""}
    return {**_scene(unix_us, entities), "deletions": [everything]}


def log(unix_us: int, level: str, text: str, name: str) -> Json:
    """A text. ``level``: as in a viewer's news."""
    return {
        "timestamp": stamp(unix_us),
        "level": LEVELS[level],
        "message": text,
        "name": name,
        "file": "",
        "line": 0,
    }


def _pose(point: NedPoint, heading_rad: float, up_m: float = 0.0) -> Json:
    """A place on the map, with a heading clockwise from north."""
    half_rad = 0.5 * (math.pi / 2.0 - heading_rad)
    return {
        "position": {"x": round(point.east_m, 3), "y": round(point.north_m, 3), "z": up_m},
        "orientation": {"x": 0.0, "y": 0.0, "z": round(math.sin(half_rad), 6), "w": round(math.cos(half_rad), 6)},
    }


def _entity(unix_us: int, name: str, **shapes: list[Json]) -> Json:
    empty: Json = {kind: [] for kind in ("lines", "spheres", "texts", *UNUSED)}
    return {
        "timestamp": stamp(unix_us),
        "frame_id": MAP,
        "id": name,
        "lifetime": {"sec": 0, "nsec": 0},
        "frame_locked": False,
        **empty,
        **shapes,
    }


def _scene(unix_us: int, entities: list[Json]) -> Json:
    return {"deletions": [], "entities": entities}
