"""The mission laid out on the ground, and laid out again whenever the autopilot moves the origin of its local frame.

Nouns: mission layout.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from companion.core.frames import GeoPoint, LocalFrame, NedPoint, Pose
from companion.core.grid import OBSTACLE, Grid, inflated
from companion.executive.command_progress import carried as carried_commands
from companion.executive.mission_progress import MissionProgress, relaid
from companion.mapping.evidence_map import EvidenceMap, new_map
from companion.mapping.map_edits import rebase
from companion.mapping.map_queries import known_fields, occupied_fields
from companion.mission.autopilot_fence import NO_FENCE, AutopilotFence
from companion.mission.bounds import Bounds
from companion.mission.check import MAX_GRID_FIELDS
from companion.mission.field_size import FieldSize, field_size, finer_evidence, map_radius_m
from companion.mission.mission import Mission, OnBlocked
from companion.mission.resolve import ResolvedMission, ResolvedTarget, resolve
from companion.settings import MappingSettings


@dataclass(frozen=True, eq=False, slots=True)
class MissionPlaces:
    """Where the mission lies, without its map. Its metres and fields count from ``home``."""

    origin: GeoPoint
    home: GeoPoint
    targets: tuple[ResolvedTarget, ...]
    bounds: Bounds


@dataclass(frozen=True, eq=False, slots=True)
class MissionLayout(MissionPlaces):
    """The same with its map. Home is as it was when the mission began."""

    start: ResolvedTarget
    """Where the rover was when the mission began: it returns there when it has to."""
    obstacles: NDArray[np.bool_]
    """Those that were known beforehand, in fields; they have their own size."""
    evidence: EvidenceMap
    fence: AutopilotFence
    refused: Mapping[int, str]
    """What is wrong with targets behind the autopilot's fence, by their number from 0."""

    @property
    def places(self) -> MissionPlaces:
        """The same without the map, which may be large."""
        return MissionPlaces(self.origin, self.home, self.targets, self.bounds)


def lay(
    mission: Mission,
    settings: MappingSettings,
    origin: GeoPoint,
    home: GeoPoint,
    pose: Pose,
    fence: AutopilotFence = NO_FENCE,
    *,
    narrow_sight: bool = False,
) -> MissionLayout:
    """Lay the mission out; the rover returns to ``pose`` when it has to. Raises MissionError."""
    resolved, evidence = _laid(mission, settings, LocalFrame(origin), home, fence, narrow_sight)
    start = _start(pose.point, resolved.ground)
    return MissionLayout(
        origin, home, resolved.targets, resolved.bounds, start, _obstacles(resolved), evidence, fence, resolved.refused
    )


def lay_again(
    layout: MissionLayout,
    progress: MissionProgress,
    mission: Mission,
    settings: MappingSettings,
    origin: GeoPoint,
    *,
    narrow_sight: bool = False,
) -> tuple[MissionLayout, MissionProgress]:
    """The same places on earth in a local frame with another origin, and an empty map. Raises MissionError."""
    frame = LocalFrame(origin)
    resolved, evidence = _laid(mission, settings, frame, layout.home, layout.fence, narrow_sight)
    before = LocalFrame(layout.origin)
    back = _start(frame.to_ned(before.to_geo(progress.home.point)), resolved.ground)
    start = _start(frame.to_ned(before.to_geo(layout.start.point)), resolved.ground)
    requested = progress.requested
    if requested is not None:
        point = frame.to_ned(before.to_geo(requested.point))
        requested = replace(requested, point=point, cell=resolved.ground.cell_at(point))
    again = replace(
        layout, origin=origin, targets=resolved.targets, start=start, obstacles=_obstacles(resolved), evidence=evidence,
        bounds=resolved.bounds, refused=resolved.refused,
    )  # fmt: skip
    commands = carried_commands(progress.commands, lambda point: frame.to_ned(before.to_geo(point)))
    return again, relaid(replace(progress, commands=commands), resolved.targets, back, requested)


def fenced_again(layout: MissionLayout, mission: Mission, fence: AutopilotFence) -> MissionLayout:
    """The same ground and all that has been seen of it, with another fence of the autopilot. Raises MissionError."""
    frame = LocalFrame(layout.origin)
    same = FieldSize(layout.evidence.base.resolution_m, MAX_GRID_FIELDS)
    resolved = resolve(mission, frame, frame.to_ned(layout.home), fence, same)
    rebase(layout.evidence, _base(mission, resolved))
    return replace(layout, fence=fence, bounds=resolved.bounds, refused=resolved.refused)


def carried(place: ResolvedTarget, north_m: float, east_m: float, grid: Grid) -> ResolvedTarget:
    """The same place on the ground, after the position has stepped by so much."""
    point = NedPoint(place.point.north_m + north_m, place.point.east_m + east_m)
    return replace(place, point=point, cell=grid.cell_at(point))


def from_home(layout: MissionLayout) -> NedPoint:
    """The south-west corner of the map in metres from home."""
    home, corner = LocalFrame(layout.origin).to_ned(layout.home), layout.evidence.base.south_west
    return NedPoint(corner.north_m - home.north_m, corner.east_m - home.east_m)


def seen_ground(layout: MissionLayout) -> tuple[Grid, NDArray[np.bool_]]:
    """What ``prior_map`` expects of a saved map, and which of its fields are known; cut to those.

    Obstacles have their own size: whoever reads the map adds the rover's radius. Fences are the mission's.
    """
    evidence, corner = layout.evidence, from_home(layout)
    obstacles = occupied_fields(evidence) | layout.obstacles
    known = known_fields(evidence) | obstacles
    rows, columns = (np.flatnonzero(known.any(axis=axis)) for axis in (1, 0))
    kept = np.s_[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1] if len(rows) else np.s_[:, :]
    low_y, low_x = (rows[0], columns[0]) if len(rows) else (0, 0)
    side_m = evidence.base.resolution_m
    south_west = NedPoint(corner.north_m + side_m * float(low_y), corner.east_m + side_m * float(low_x))
    weights = np.where(obstacles, OBSTACLE, 0.0).astype(evidence.base.weights.dtype)
    return Grid(weights[kept], side_m, south_west), known[kept]


def apart_m(here: GeoPoint, there: GeoPoint) -> float:
    """Metres between two places that are near each other."""
    return LocalFrame(here).to_ned(there).distance_m(NedPoint(0.0, 0.0))


def _obstacles(resolved: ResolvedMission) -> NDArray[np.bool_]:
    known: NDArray[np.bool_] = resolved.ground.weights >= OBSTACLE
    return known


def _start(point: NedPoint, grid: Grid) -> ResolvedTarget:
    return ResolvedTarget("start", point, grid.cell_at(point), 0.0, OnBlocked.HOLD, None)


def _laid(
    mission: Mission, settings: MappingSettings, frame: LocalFrame, home: GeoPoint, fence: AutopilotFence, narrow: bool
) -> tuple[ResolvedMission, EvidenceMap]:
    """The mission in a frame, and an empty map of its ground. ``narrow``: the rover sees with single thin beams."""
    rover = mission.rover
    size = field_size(rover, settings, narrow_sight=narrow)
    resolved = resolve(mission, frame, frame.to_ned(home), fence, size)
    if mission.grid.by_footprint or settings.keeps == "circle":
        settings = finer_evidence(settings, resolved.ground.resolution_m)
    return resolved, new_map(_base(mission, resolved), map_radius_m(rover, settings), settings)


def _base(mission: Mission, resolved: ResolvedMission) -> Grid:
    """Known ground and fences in fields grow by the rover's radius, which the other fences have in them already."""
    ground = resolved.ground
    weights = inflated(ground.weights, ground.fields(mission.rover.radius_m))
    weights[resolved.closed] = OBSTACLE
    return ground.with_weights(weights)
