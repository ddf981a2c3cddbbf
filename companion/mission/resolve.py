"""Resolves a mission in the autopilot's local frame: targets as points and fields, grid with fences and prior map."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from companion.core.frames import LocalFrame, NedPoint
from companion.core.grid import OBSTACLE, Cell, Grid, empty_grid
from companion.mapping.map_files import MapError, load_map
from companion.mission.areas import Mask, Places, shape_of, touched
from companion.mission.autopilot_fence import NO_FENCE, AutopilotFence
from companion.mission.bounds import Bound, Bounds, autopilot_bounds, mission_bounds
from companion.mission.check import MAX_GRID_FIELDS
from companion.mission.do_commands import DoCommand
from companion.mission.doubtful_places import distance_text, most_doubtful
from companion.mission.field_size import FieldSize
from companion.mission.mission import GridTooLargeError, Here, Mission, MissionError, OnBlocked
from companion.mission.prior_map import stamp_prior

MIN_MARGIN_M = 25.0
COARSEST_M = 5.0
"""With larger fields no rover finds its way round anything: to ask for them is no remedy."""
UNLIKELY_M = 100_000.0
"""A place farther from home than this is a slip in its coordinates."""


@dataclass(frozen=True, slots=True)
class ResolvedTarget:
    """A target in the local frame, and its field of the grid.

    ``here``: it is reached wherever the rover is when its turn comes; ``point`` is then only the place before.
    """

    name: str
    point: NedPoint
    cell: Cell
    hold_s: float
    on_blocked: OnBlocked
    speed_m_s: float | None
    commands: tuple[DoCommand, ...] = ()
    here: bool = False


@dataclass(frozen=True, eq=False, slots=True)
class ResolvedMission:
    """The ground as known before the rover moves, and the targets in order. ``home_cell``: the field of home.

    ``ground``: weights with known obstacles, not inflated, and fences given in fields. ``closed``: the fields that the
    rover's middle must not enter, because of its radius and the autopilot's margin. ``refused``: reasons why targets
    behind the autopilot's fence are refused, by number from 0.
    """

    ground: Grid
    closed: Mask
    bounds: Bounds
    targets: tuple[ResolvedTarget, ...]
    home_cell: Cell
    refused: Mapping[int, str]

    @property
    def grid(self) -> Grid:
        """The ground with all fences."""
        weights = self.ground.weights.copy()
        weights[self.closed] = OBSTACLE
        return self.ground.with_weights(weights)


@dataclass(frozen=True, eq=False, slots=True)
class _Shut:
    """A border and the fields that it closes."""

    bound: Bound
    fields: Mask


def resolve(
    mission: Mission,
    frame: LocalFrame,
    home: NedPoint,
    fence: AutopilotFence = NO_FENCE,
    size: FieldSize | None = None,
) -> ResolvedMission:
    """Resolve the mission. ``home``: the origin of its metres, in the autopilot's local frame.

    ``size``: of fields where the mission does not say; None: its default.

    A grid with a size is placed with the middle of the field ``grid.home`` on home. Otherwise it encloses home,
    targets, fences and prior map, with home in the middle of a field. Weights, by precedence: fences, obstacles of
    the prior map, weighted areas, prior map, base.

    A field is closed if any part of it is nearer to a keep-out area than the rover's radius, or nearer than that to the
    edge of a keep-in area, or outside it. Keep-out areas given in fields close the fields that they touch; keep-in
    areas given in fields leave those open whose middle they contain. The autopilot's fence closes fields likewise, with
    its margin. Targets that it closes are listed in ``refused``: the fence may change during the drive. Raises
    MissionError: file, place, reason.
    """
    try:
        return _resolved(mission, frame, home, fence, size)
    except (MissionError, MapError) as error:
        kind = type(error) if isinstance(error, MissionError) else MissionError
        raise kind(f"{mission.source or mission.name}: {error}") from error


def _resolved(
    mission: Mission, frame: LocalFrame, home: NedPoint, fence: AutopilotFence, size: FieldSize | None
) -> ResolvedMission:
    if not mission.targets:
        raise MissionError("target: there is none to go to")
    prior = _prior_map(mission, home)
    grid = _fixed_grid(mission, home)
    fixed = grid is not None
    places = Places(frame, home, _no_fields if grid is None else grid.centre_of)
    points: list[NedPoint] = []
    for target in mission.targets:
        here = isinstance(target.place, Here)
        points.append(points[-1] if here and points else places.point(target.place))
    if grid is None:
        grid = _enclosing_grid(mission, places, points, prior, size)
    if prior is not None:
        grid = stamp_prior(grid, prior)
    weights = grid.weights.copy()
    for weighted in mission.weighted:
        mask = touched(grid, shape_of(weighted.area, places))
        weights[mask & (weights < OBSTACLE)] = weighted.weight
    bounds = [*mission_bounds(mission, places), *autopilot_bounds(fence, frame, mission.rover.radius_m)]
    shut = [_Shut(bound, bound.closed(grid)) for bound in bounds]
    targets, refused = [], {}
    for i, (target, point) in enumerate(zip(mission.targets, points, strict=True)):
        cell = grid.cell_at(point)
        what = f"target {i + 1} '{target.name}'"
        if fixed and not grid.contains(cell):
            raise MissionError(
                f"{what}: {_away(home, point)} is outside the grid of {grid.width} x {grid.height} fields"
            )
        if not isinstance(target.place, Here) and (reason := _refusal(what, cell, shut)):
            refused[i] = reason
        here = isinstance(target.place, Here)
        targets.append(
            ResolvedTarget(
                target.name, point, cell, target.hold_s, target.on_blocked, target.speed_m_s, target.commands, here
            )
        )
    home_cell = grid.cell_at(home)
    _refusal("home (where the rover begins)", home_cell, shut)
    closed = np.zeros(weights.shape, np.bool_)
    for one in shut:
        if one.bound.in_fields:
            weights[one.fields] = OBSTACLE
        else:
            closed |= one.fields
    return ResolvedMission(
        grid.with_weights(weights), closed, Bounds(bounds, grid.resolution_m), tuple(targets), home_cell, refused
    )


def _no_fields(cell: Cell) -> NedPoint:
    raise MissionError(f"field {cell.x}, {cell.y}: fields need [grid] size and home")


def _away(home: NedPoint, point: NedPoint) -> str:
    return f"{point.north_m - home.north_m:.1f} m north, {point.east_m - home.east_m:.1f} m east of home"


# --- the grid --------------------------------------------------------------------------------------------------------


def _south_west(home: NedPoint, home_cell: Cell, resolution_m: float) -> NedPoint:
    """The south-west corner of a grid with the middle of ``home_cell`` on home."""
    return NedPoint(
        home.north_m - (home_cell.y + 0.5) * resolution_m,
        home.east_m - (home_cell.x + 0.5) * resolution_m,
    )


def _fixed_grid(mission: Mission, home: NedPoint) -> Grid | None:
    spec = mission.grid
    if spec.size is None or spec.home is None:
        return None
    width, height = spec.size
    _refuse_large(width, height, spec.resolution_m, mission)
    return empty_grid(width, height, spec.resolution_m, _south_west(home, spec.home, spec.resolution_m))


def _enclosing_grid(
    mission: Mission, places: Places, points: list[NedPoint], prior: Grid | None, size: FieldSize | None
) -> Grid:
    """A grid that encloses everything in the mission, with a margin."""
    home, size_m = places.home, mission.grid.resolution_m
    corners = [(point.east_m, point.north_m) for point in (home, *points)]
    areas = (*mission.keep_out, *mission.keep_in, *(weighted.area for weighted in mission.weighted))
    for area in areas:
        west_m, south_m, east_m, north_m = shape_of(area, places).bounds
        corners += [(west_m, south_m), (east_m, north_m)]
    if prior is not None:
        corner = prior.south_west
        far = (corner.east_m + prior.width * prior.resolution_m, corner.north_m + prior.height * prior.resolution_m)
        corners += [(corner.east_m, corner.north_m), far]
    low, high = np.min(corners, axis=0), np.max(corners, axis=0)
    margin_m = mission.grid.margin_m
    if margin_m is None:
        margin_m = max(MIN_MARGIN_M, float(np.max(high - low)) / 2.0)
    if size is not None and mission.grid.by_footprint:
        size_m = size.side_m(float(np.prod(high - low + 2.0 * margin_m)), size_m)
    west, south = (
        math.ceil((at - edge + margin_m) / size_m) for at, edge in zip((home.east_m, home.north_m), low, strict=True)
    )
    east, north = (
        math.ceil((edge - at + margin_m) / size_m) for at, edge in zip((home.east_m, home.north_m), high, strict=True)
    )
    width, height = west + east + 1, south + north + 1
    far_m = max(math.hypot(east_m - home.east_m, north_m - home.north_m) for east_m, north_m in corners)
    _refuse_large(width, height, size_m, mission, most_doubtful(mission, places.frame.to_geo(home)), far_m)
    return empty_grid(width, height, size_m, _south_west(home, Cell(west, south), size_m))


def _refuse_large(
    width: int, height: int, resolution_m: float, mission: Mission, doubtful: str = "", far_m: float = 0.0
) -> None:
    """Raises MissionError for too many fields.

    ``doubtful``: what is to be said of a place that may be wrong; ``far_m``: how far from home the farthest place is.
    """
    if width * height > MAX_GRID_FIELDS:
        enough_m = math.ceil(10.0 * resolution_m * math.sqrt(width * height / MAX_GRID_FIELDS)) / 10.0
        of_ours = not mission.stored and (mission.source is None or mission.source.suffix.lower() == ".toml")
        coarser = f"{'resolution_m =' if of_ours else '--resolution-m'} {enough_m:g} or larger"
        remedy = f"use {coarser}, or a smaller margin_m" if of_ours else f"use {coarser}"
        near = f"{doubtful} If it is" if doubtful else "are all places near home? If they are"
        if enough_m > COARSEST_M:
            across = " x ".join(distance_text(fields * resolution_m) for fields in (width, height))
            why = doubtful or "are all places, fences and margin_m meant so?"
            says = f"{across} is more ground than a rover can keep a map of; {why}"
            remedy = "Check the coordinates" if far_m > UNLIKELY_M else "If it is, drive it in parts"
            raise GridTooLargeError(f"grid: {says} {remedy}")
        raise GridTooLargeError(
            f"grid: {width} x {height} fields of {resolution_m:g} m are more than {MAX_GRID_FIELDS}; {near}, {remedy}"
        )


def _prior_map(mission: Mission, home: NedPoint) -> Grid | None:
    """The prior map in the local frame. A ROS yaml holds its place from home; other maps lie on the mission's grid."""
    path = mission.prior_map
    if path is None:
        return None
    prior = load_map(path, mission.prior_resolution_m or mission.grid.resolution_m)
    if mission.prior_corner is not None:
        place = mission.prior_corner
        corner = NedPoint(home.north_m + place.north_m, home.east_m + place.east_m)
    elif path.suffix.lower() in (".yaml", ".yml"):
        corner = prior.south_west
        corner = NedPoint(home.north_m + corner.north_m, home.east_m + corner.east_m)
    elif mission.grid.home is not None:
        corner = _south_west(home, mission.grid.home, prior.resolution_m)
    else:
        raise MissionError(f"prior_map: {path.name} says not where it lies; give [grid] home and size, or a ROS yaml")
    return Grid(prior.weights, prior.resolution_m, corner)


# --- fences ----------------------------------------------------------------------------------------------------------


def _refusal(what: str, cell: Cell, shut: list[_Shut]) -> str:
    """Why a place behind the autopilot's fence is refused; empty if it is open.

    Raises MissionError for the mission's own fences.
    """
    for one in shut:
        if one.fields[cell.y, cell.x]:
            bound = one.bound
            where = "outside (or within a field of the edge of)" if bound.keeps_in else "in (or within a field of)"
            margin = f", {bound.keep_m:g} m kept to it" if bound.keep_m > 0.0 else ""
            text = f"{what}: lies {where} {bound.name}{margin}"
            if not bound.of_autopilot:
                raise MissionError(text)
            return text
    return ""
