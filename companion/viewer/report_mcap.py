"""A record as an MCAP file, for Foxglove and Lichtblick: pose, map, path, scans, texts and figures, as JSON messages.

Nouns: MCAP report.
"""

from __future__ import annotations

import json
import math
from importlib.util import find_spec
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from companion.app import Companion
from companion.core.extras import not_installed
from companion.core.frames import LocalFrame, NedPoint
from companion.mapping.evidence_map import EvidenceMap
from companion.navigation.field_step import Decision
from companion.recording.record_clock import RecordClock
from companion.replay.replay import ReplayObserver
from companion.vehicle.mode_names import mode_name
from companion.viewer import foxglove
from companion.viewer.foxglove_schemas import SCHEMAS
from companion.viewer.frame import news_of
from companion.viewer.map_colours import CELL_COLOURS
from companion.viewer.map_tiles import cell_classes
from companion.viewer.tile_kernels import FREE, SEEN_OBSTACLE

MAP_S, PATH_S = 2.0, 0.5
"""So often each is written, if it has changed."""
MAP_BYTES_A_SECOND = 1e6
"""A large map is written less often, so that it takes no more than this on average."""
OPAQUE = 255
"""Unknown ground, too: what shines through from behind has any colour, that of obstacles as well."""
TOPICS = {
    "/tf": "FrameTransform",
    "/pose": "PoseInFrame",
    "/fix": "LocationFix",
    "/scan": "LaserScan",
    "/map": "Grid",
    "/path": "SceneUpdate",
    "/targets": "SceneUpdate",
    "/log": "Log",
}
OWN: dict[str, dict[str, str]] = {
    "/state": {
        "doing": "string",
        "mode": "string",
        "armed": "boolean",
        "speed_m_s": "number",
        "turn_rate_rad_s": "number",
        "battery_v": "number",
    },
    "/decision": {
        "number": "integer",
        "target": "string",
        "action": "string",
        "part": "string",
        "reason": "string",
        "path_fields": "integer",
        "searches": "array",
    },
}
"""Topics with a schema of our own: fields and their types. A value that is not known is null all the same: readers of
such files want one type a field."""
Json = dict[str, Any]


class McapError(Exception):
    """The file cannot be made; the text is one line with the remedy."""


def check_mcap() -> None:
    """Raises McapError if the library is not installed."""
    if find_spec("mcap") is None:
        raise McapError(not_installed("--mcap", "mcap", "mcap"))


class McapReport(ReplayObserver):
    """Writes the file while a record is run again. Opening and ``close`` raise OSError."""

    def __init__(self, file: Path, clock: RecordClock) -> None:
        """Needs what ``check_mcap`` looks for."""
        from mcap.writer import Writer

        self._clock = clock
        self._opened: IO[bytes] = file.open("wb")
        self._writer = Writer(self._opened)
        self._writer.start(library="rover-companion")
        schemas = {
            name: self._writer.register_schema(f"foxglove.{name}", "jsonschema", json.dumps(schema).encode())
            for name, schema in SCHEMAS.items()
        }
        own = {
            topic: self._writer.register_schema(f"rover_companion.{topic[1:].title()}", "jsonschema", _own(topic))
            for topic in OWN
        }
        topics = {**{topic: schemas[name] for topic, name in TOPICS.items()}, **own}
        self._channels = {topic: self._writer.register_channel(topic, "json", which) for topic, which in topics.items()}
        self._position_s = self._scan_s = self._map_s = self._path_s = -math.inf
        self._map: bytes = b""
        self._path: NDArray[np.float64] | None = None
        self._targets: list[tuple[str, NedPoint]] = []

    def close(self) -> None:
        """Write what is left."""
        try:
            self._writer.finish()
        finally:
            self._opened.close()

    def decided(self, companion: Companion, number: int, time_s: float, target: str, decision: Decision) -> None:
        """See ``ReplayObserver``."""
        value = {
            "number": number,
            "target": target,
            "action": str(decision.action),
            "part": str(decision.part),
            "reason": str(decision.reason),
            "path_fields": len(decision.path),
            "searches": [str(kind) for kind in decision.searches],
        }
        self._put("/decision", time_s, value)

    def ticked(self, companion: Companion, time_s: float) -> None:
        """See ``ReplayObserver``."""
        at_us = self._at_us(time_s)
        for one in news_of(companion.status()):
            who = "companion" if one["own"] else "autopilot"
            self._put("/log", time_s, foxglove.log(at_us, one["level"], one["text"], who))
        self._put_pose(companion, time_s, at_us)
        seen = companion.vehicle.scan
        if seen is not None and seen.time_s != self._scan_s and len(seen.scan.bearing_rad):
            self._scan_s = seen.time_s
            self._put("/scan", time_s, foxglove.laser_scan(at_us, seen.scan))
        self._put_plan(companion, time_s, at_us)

    def _put_pose(self, companion: Companion, time_s: float, at_us: int) -> None:
        """Pose and figures, as often as a position is heard."""
        vehicle, status = companion.vehicle, companion.status()
        if vehicle.position is None or vehicle.position.time_s == self._position_s or status.pose is None:
            return
        self._position_s = vehicle.position.time_s
        self._put("/tf", time_s, foxglove.frame_transform(at_us, status.pose))
        self._put("/pose", time_s, foxglove.pose_in_frame(at_us, status.pose))
        if vehicle.origin is not None:
            seen = vehicle.global_position
            altitude_m = 0.0 if seen is None or seen.altitude_m is None else seen.altitude_m
            point = LocalFrame(vehicle.origin.point).to_geo(status.pose.point)
            self._put("/fix", time_s, foxglove.location_fix(at_us, point, altitude_m))
        battery = vehicle.battery
        state = {
            "doing": status.doing,
            "mode": mode_name(vehicle),
            "armed": None if vehicle.heartbeat is None else vehicle.heartbeat.armed,
            "speed_m_s": round(vehicle.forward_m_s, 3),
            "turn_rate_rad_s": None if vehicle.attitude is None else round(vehicle.attitude.yaw_rate_rad_s, 4),
            "battery_v": None if battery is None else battery.volts,
        }
        self._put("/state", time_s, state)

    def _put_plan(self, companion: Companion, time_s: float, at_us: int) -> None:
        """Map, path and targets, if they have changed."""
        executor = companion.executor
        if executor is None:
            return
        if time_s >= self._map_s - 1e-6 or companion.done:
            size = self._put_map(executor.evidence, time_s, at_us)
            self._map_s = time_s + max(MAP_S, size / MAP_BYTES_A_SECOND)
        if time_s - self._path_s >= PATH_S - 1e-6 or companion.done:
            path = executor.driver.path
            places = np.empty((0, 2)) if path is None else path.points[path.progress :]
            if self._path is None or not np.array_equal(places, self._path):
                self._path_s, self._path = time_s, places
                self._put("/path", time_s, foxglove.path_line(at_us, places))
        targets = [(one.name, one.point) for one in executor.layout.targets]
        if targets != self._targets:
            self._targets = targets
            self._put("/targets", time_s, foxglove.targets(at_us, targets))

    def _put_map(self, evidence: EvidenceMap, time_s: float, at_us: int) -> int:
        """What is known of the ground, cut to what was seen. Returns the bytes that it takes."""
        height, width = evidence.log_odds.shape
        cells = cell_classes(evidence, 0, 0, width, height)
        known = (cells == FREE) | (cells == SEEN_OBSTACLE)
        if self._map == cells.tobytes() or not known.any():
            return 0
        self._map = cells.tobytes()
        rows, columns = (np.flatnonzero(known.any(axis=axis)) for axis in (1, 0))
        kept = cells[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
        opacity = np.full(kept.shape, OPAQUE, np.uint8)
        colours = np.dstack((CELL_COLOURS[kept], opacity))
        corner, cell_m = evidence.base.south_west, evidence.evidence_m
        south_west = NedPoint(corner.north_m + rows[0] * cell_m, corner.east_m + columns[0] * cell_m)
        self._put("/map", time_s, foxglove.grid(at_us, south_west, cell_m, colours))
        return colours.nbytes

    def _at_us(self, time_s: float) -> int:
        """Microseconds since 1970; the format has no time before that."""
        return max(self._clock.unix_us(time_s), 0)

    def _put(self, topic: str, time_s: float, value: Json) -> None:
        at_ns = 1000 * self._at_us(time_s)
        data = json.dumps(value, allow_nan=False, separators=(",", ":")).encode()
        self._writer.add_message(self._channels[topic], at_ns, data, at_ns)


def _own(topic: str) -> bytes:
    """The schema of a topic of our own."""
    kinds = {"array": {"type": "array", "items": {"type": "string"}}}
    fields = {name: kinds.get(kind, {"type": kind}) for name, kind in OWN[topic].items()}
    schema = {"title": f"rover_companion.{topic[1:].title()}", "type": "object", "properties": fields}
    return json.dumps(schema, separators=(",", ":")).encode()
