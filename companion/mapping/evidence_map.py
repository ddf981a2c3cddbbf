"""The evidence map: range readings become log-odds on a fine raster of cells, and these become field weights.

The raster is finer than the fields, so that the free ground beside a thin post does not hide the post in the same
field. A field is an obstacle when something was seen in it, or when the rover standing in its middle would touch
something; for planned motions (``keeps`` "outline") when there is no place in it where the rover would not, if fields
are so small that no obstacle fits between two such places. Beside obstacles the mission's own weight is raised (soft
cost). What can be asked of the map is in ``map_queries``.

Nouns: evidence map, evidence.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from companion.core.frames import NedPoint, Pose
from companion.core.grid import Cell, Grid
from companion.core.scan import WIRED, RangeScan
from companion.mapping.cell_frame import CellFrame
from companion.mapping.evidence_kernels import (
    InverseSensorModel,
    ScanInCells,
    cast_scan,
    soften,
    weigh,
    weigh_roomy,
    written_box,
)
from companion.mapping.lazy_zeros import lazy_zeros
from companion.mapping.sensor_agreement import SensorAgreement
from companion.settings import MappingSettings

MAX_EVIDENCE_CELLS = 101_000_000
"""Room for a target 350 m away, on cells of 0.05 m. Cells that no scan has changed take no memory."""
BLIND_M = 0.3
"""Beyond the least range of a wired lidar: what was seen nearer than that may now be too near to give an echo."""
Window = tuple[slice, slice]
"""Rows and columns of a raster."""
NOTHING: Window = (slice(0, 0), slice(0, 0))
MAX_SOFT_WEIGHT = 0.9
"""Soft cost never makes a field look like an obstacle."""


@dataclass(frozen=True, eq=False)
class EvidenceMap:
    """What has been seen, on a raster of ``subdivisions`` cells along a field's side.

    ``log_odds``: shape (height * subdivisions, width * subdivisions), indexed [y, x]: 0 unknown, below 0 seen free,
    from ``settings.occupied_at`` on an obstacle. ``stamps``: of the scan that changed a cell last, 0 where none did: an
    unknown cell with a stamp was an obstacle that is forgotten. ``base`` holds the mission's own weights (obstacles in
    it are never forgotten: they are fences or prior knowledge), ``penalty`` what experience adds. The arrays belong to
    the map and are changed in place by ``integrate``; ``grid`` is always up to date.
    """

    base: Grid
    grid: Grid
    log_odds: NDArray[np.float32]
    stamps: NDArray[np.int32]
    penalty: NDArray[np.float32]
    subdivisions: int
    rover_radius_m: float
    settings: MappingSettings
    agreement: SensorAgreement = field(default_factory=SensorAgreement)

    @property
    def evidence_m(self) -> float:
        """Side of one evidence cell."""
        return self.base.resolution_m / self.subdivisions

    @cached_property
    def frame(self) -> CellFrame:
        """Where the evidence cells lie."""
        return CellFrame(self.base.south_west, self.evidence_m)


def new_map(base: Grid, rover_radius_m: float, settings: MappingSettings) -> EvidenceMap:
    """A map without evidence. On very large grids the evidence raster is coarser, to spare memory."""
    subdivisions = max(1, round(base.resolution_m / settings.evidence_m))
    while subdivisions > 1 and base.width * base.height * subdivisions**2 > MAX_EVIDENCE_CELLS:
        subdivisions -= 1
    shape = (base.height * subdivisions, base.width * subdivisions)
    evidence = EvidenceMap(
        base=base,
        grid=base.with_weights(base.weights.copy()),
        log_odds=lazy_zeros(shape, np.float32),
        stamps=lazy_zeros(shape, np.int32),
        penalty=np.zeros(base.weights.shape, np.float32),
        subdivisions=subdivisions,
        rover_radius_m=rover_radius_m,
        settings=settings,
    )
    _refresh_all(evidence, NOTHING)
    return evidence


def integrate(evidence: EvidenceMap, pose: Pose, scan: RangeScan, stamp: int) -> None:
    """Add one scan to the map; ``stamp`` must differ from scan to scan.

    A beam frees the cells it passed and hardens the one it ended in. In one scan a hit outweighs any number of
    passes, and each cell changes once. An empty ray of a wired lidar frees nothing if it begins before an obstacle,
    which may have come too near to be seen. A cell in which another sensor has just seen something is not freed. The
    ground under the rover is free.
    """
    settings, frame = evidence.settings, evidence.frame
    x, y = frame.xy(pose.point)
    begin, bearing_rad, range_m = _rays(pose, scan)
    if scan.sender == WIRED:
        range_m = _without_too_near(
            evidence, begin, pose.heading_rad + bearing_rad, range_m, scan.min_range_m + BLIND_M
        )
    kept_m = settings.narrow_kept_m if scan.is_narrow else 0.0
    turned = cast_scan(
        evidence.log_odds,
        evidence.stamps,
        np.int32(stamp),
        ScanInCells(
            *frame.xy(begin),
            pose.heading_rad,
            bearing_rad,
            range_m * frame.cells(1.0),
            frame.cells(scan.sight_m),
            scan.beam_width_rad,
        ),
        InverseSensorModel(
            settings.hit,
            settings.miss,
            settings.limit,
            settings.free_limit,
            frame.cells(settings.hit_depth_m),
            frame.cells(kept_m),
            settings.occupied_at,
        ),
        evidence.agreement.others(scan),
        (x, y, frame.cells(evidence.rover_radius_m)),
    )
    evidence.agreement.note(scan, partial(_hit_cells, evidence, pose, scan))
    left, low, right, high = (int(cell) // evidence.subdivisions for cell in turned)
    if left <= right:
        # Weights follow from which cells are obstacles: most scans change that of few.
        reach = _soft_reach(evidence) + 2
        _refresh(evidence, left - reach, low - reach, right + reach + 1, high + reach + 1)


def penalise(evidence: EvidenceMap, cell: Cell, amount: float) -> None:
    """Remember a field as costly, by this much more weight; from 1 on it counts as an obstacle."""
    if evidence.base.contains(cell):
        evidence.penalty[cell.y, cell.x] += amount
        reach = _soft_reach(evidence) + 1
        _refresh(evidence, cell.x - reach, cell.y - reach, cell.x + reach + 1, cell.y + reach + 1)


def forget(evidence: EvidenceMap) -> None:
    """Drop all that was seen (the local frame has moved under it); fences and prior knowledge stay."""
    evidence.log_odds[_written(evidence.log_odds)] = 0.0
    evidence.penalty.fill(0.0)
    evidence.agreement.clear()
    _refresh_all(evidence)


def move(evidence: EvidenceMap, north_m: float, east_m: float) -> tuple[float, float]:
    """Move all that was seen by whole cells; fences and prior knowledge stay. Returns how far, metres north and east.

    What leaves the grid is lost, and what comes in is unknown. Penalties belong to fields and move by whole ones.
    """
    side_m = evidence.evidence_m
    by = Cell(round(east_m / side_m), round(north_m / side_m))
    by_fields = Cell(round(by.x / evidence.subdivisions), round(by.y / evidence.subdivisions))
    for raster, shift in ((evidence.log_odds, by), (evidence.stamps, by), (evidence.penalty, by_fields)):
        window = _written(raster)
        seen = raster[window].copy()
        raster[window] = 0
        _put(seen, raster, Cell(window[1].start + shift.x, window[0].start + shift.y))
    evidence.agreement.clear()
    _refresh_all(evidence)
    return by.y * side_m, by.x * side_m


def shifted(raster: NDArray[Any], shape: tuple[int, ...], by: Cell) -> NDArray[Any]:
    """A raster on another one of this shape, moved by ``by`` to the east and north; zero where it says nothing."""
    result, window = lazy_zeros(shape, raster.dtype), _written(raster)
    _put(raster[window], result, Cell(window[1].start + by.x, window[0].start + by.y))
    return result


def _put(part: NDArray[Any], raster: NDArray[Any], at: Cell) -> None:
    """Write a part of a raster where its south-west cell is ``at``; what lies outside is lost."""
    rows, columns = part.shape
    y0, x0 = max(0, at.y), max(0, at.x)
    y1, x1 = min(raster.shape[0], at.y + rows), min(raster.shape[1], at.x + columns)
    if y0 < y1 and x0 < x1:
        raster[y0:y1, x0:x1] = part[y0 - at.y : y1 - at.y, x0 - at.x : x1 - at.x]


def _written(raster: NDArray[Any], step: int = 1) -> Window:
    """The rows and columns that hold all that is not zero, widened to whole multiples of ``step``.

    What is not looked at takes no memory, and large maps are mostly unseen.
    """
    left, low, right, high = (int(cell) for cell in written_box(raster))
    if right < left:
        return NOTHING
    return _steps(low, high, step), _steps(left, right, step)


def _steps(first: int, last: int, step: int) -> slice:
    return slice(first // step * step, (last // step + 1) * step)


def rebase(evidence: EvidenceMap, base: Grid) -> None:
    """Other weights of the mission's own (of a grid that lies as before); what was seen stays."""
    evidence.base.weights[:] = base.weights
    _refresh_all(evidence)


def restore(
    evidence: EvidenceMap,
    log_odds: NDArray[np.float32],
    penalty: NDArray[np.float32],
    *,
    obstacles_alone: bool = False,
) -> None:
    """Take over what an earlier run had seen, and what experience had added; shapes as in the map.

    ``obstacles_alone``: no ground counts as seen free, and obstacles keep the least evidence that still makes them
    obstacles.
    """
    settings = evidence.settings
    evidence.log_odds[_written(evidence.log_odds)] = 0.0
    window = _written(log_odds)
    seen = np.clip(log_odds[window], -settings.free_limit, settings.limit)
    if obstacles_alone:
        seen = np.where(seen >= settings.occupied_at, np.float32(settings.occupied_at), np.float32(0.0))
    evidence.log_odds[window] = seen
    np.maximum(penalty, 0.0, out=evidence.penalty)
    _refresh_all(evidence)


def forget_weak_evidence(evidence: EvidenceMap, point: NedPoint, reach_m: float) -> bool:
    """Forget, before giving up, what may be an error of sensor or position, so that it is looked at again.

    That is weak evidence of obstacles anywhere (below ``settings.sure_at``), any evidence of obstacles within
    ``reach_m`` of the place, and all penalties. Returns whether there was any.
    """
    window = _written(evidence.log_odds)
    seen = evidence.log_odds[window]
    occupied = seen >= evidence.settings.occupied_at
    doubtful = occupied & (seen < evidence.settings.sure_at)
    x, y = evidence.frame.xy(point)
    reach = evidence.frame.cells(reach_m)
    near = _round(y, reach, window[0].start), _round(x, reach, window[1].start)
    doubtful[near] |= occupied[near]
    found = bool(doubtful.any() or (evidence.penalty > 0.0).any())
    _forget_cells(evidence, window, doubtful)
    return found


def _round(place: float, reach: float, first: int) -> slice:
    """The cells within reach of a place along one axis, counted from the ``first`` of a window."""
    return slice(max(0, int(place - reach) - first), max(0, int(place + reach) + 1 - first))


def look_again(evidence: EvidenceMap, since_stamp: int) -> None:
    """Forget obstacles that no scan has touched since then, and all penalties: what stood there may have opened.

    The ground becomes unknown, not free: whoever goes there looks first. What the mission itself closed stays.
    """
    window = _written(evidence.log_odds)
    occupied = evidence.log_odds[window] >= evidence.settings.occupied_at
    _forget_cells(evidence, window, occupied & (evidence.stamps[window] < since_stamp))


def _forget_cells(evidence: EvidenceMap, window: Window, cells: NDArray[np.bool_]) -> None:
    """These cells of a window are unknown again, and remembered as once seen; all penalties are dropped.

    As once seen count also those that an earlier run saw.
    """
    evidence.log_odds[window][cells] = 0.0
    stamps = evidence.stamps[window]
    stamps[cells] = np.maximum(stamps[cells], 1)
    evidence.penalty.fill(0.0)
    _refresh_all(evidence)


def known_fields(evidence: EvidenceMap) -> NDArray[np.bool_]:
    """Shape (height, width): True where at least one evidence cell of the field has been seen."""
    return _fields_where(evidence, lambda log_odds: log_odds != 0.0)


def occupied_fields(evidence: EvidenceMap) -> NDArray[np.bool_]:
    """Shape (height, width): True where something was seen in the field itself, however wide the rover is."""
    return _fields_where(evidence, lambda log_odds: log_odds >= evidence.settings.occupied_at)


def _fields_where(
    evidence: EvidenceMap, holds: Callable[[NDArray[np.float32]], NDArray[np.bool_]]
) -> NDArray[np.bool_]:
    # Rows of cells first, then every s-th column: ten times as fast as both at once.
    s = evidence.subdivisions
    rows, columns = _written(evidence.log_odds, s)
    fields = np.zeros((evidence.base.height, evidence.base.width), np.bool_)
    cells = holds(evidence.log_odds[rows, columns])
    if cells.size:
        of_rows = np.logical_or.reduce(cells.reshape(cells.shape[0] // s, s, -1), axis=1)
        within = fields[rows.start // s : rows.stop // s, columns.start // s : columns.stop // s]
        within[:] = np.logical_or.reduce([of_rows[:, column::s] for column in range(s)])
    return fields


def _hit_cells(evidence: EvidenceMap, pose: Pose, scan: RangeScan) -> NDArray[np.int64]:
    """The evidence cells of the map in which its readings ended, shape (n, 2): x and y."""
    hit = np.isfinite(scan.range_m)
    angle_rad, end_m = pose.heading_rad + scan.bearing_rad[hit], scan.range_m[hit] + evidence.settings.hit_depth_m
    ends = np.column_stack((pose.north_m + end_m * np.cos(angle_rad), pose.east_m + end_m * np.sin(angle_rad)))
    cells = np.floor(evidence.frame.xys(ends)).astype(np.int64)
    height, width = evidence.log_odds.shape
    return cells[np.all((cells >= 0) & (cells < (width, height)), axis=1)]


def _rays(pose: Pose, scan: RangeScan) -> tuple[NedPoint, NDArray[np.float64], NDArray[np.float64]]:
    """Where the rays of a scan begin, and bearings and ranges from there; of rays without an end the bearing stays."""
    forward_m, right_m = scan.origin_m
    if scan.origin_m == (0.0, 0.0):
        return pose.point, scan.bearing_rad, scan.range_m
    place = pose.point.moved(pose.heading_rad, forward_m).moved(pose.heading_rad + 0.5 * math.pi, right_m)
    hit = np.isfinite(scan.range_m)
    seen_m = np.where(hit, scan.range_m, 0.0)
    ahead_m = seen_m * np.cos(scan.bearing_rad) - forward_m
    aside_m = seen_m * np.sin(scan.bearing_rad) - right_m
    bearing_rad = np.where(hit, np.arctan2(aside_m, ahead_m), scan.bearing_rad)
    return place, bearing_rad, np.where(hit, np.hypot(ahead_m, aside_m), scan.range_m)


def _without_too_near(
    evidence: EvidenceMap,
    begin: NedPoint,
    heading_rad: NDArray[np.float64],
    range_m: NDArray[np.float64],
    near_m: float,
) -> NDArray[np.float64]:
    """The ranges; nan instead of inf where the map has an obstacle within ``near_m`` of where the rays begin."""
    x, y = evidence.frame.xy(begin)
    near = evidence.frame.cells(near_m)
    x0, y0 = max(0, math.floor(x - near)), max(0, math.floor(y - near))
    window = evidence.log_odds[y0 : max(math.floor(y + near) + 1, 0), x0 : max(math.floor(x + near) + 1, 0)]
    rows, columns = np.nonzero(window >= evidence.settings.occupied_at)
    empty = np.flatnonzero(np.isinf(range_m))
    if not len(rows) or not len(empty):
        return range_m
    east, north = columns + 0.5 + x0 - x, rows + 0.5 + y0 - y
    away = np.hypot(east, north)
    # As seen from there a cell is no wider than its diagonal.
    half_rad = np.arctan2(math.sqrt(0.5), np.maximum(away - math.sqrt(0.5), 0.0))
    bearing_rad = np.arctan2(east, north)
    aside_rad = (heading_rad[empty, None] - bearing_rad + np.pi) % (2.0 * np.pi) - np.pi
    hidden = np.any((np.abs(aside_rad) <= half_rad) & (away <= near + math.sqrt(0.5)), axis=1)
    result = range_m.copy()
    result[empty[hidden]] = np.nan
    return result


def _soft_reach(evidence: EvidenceMap) -> int:
    return math.ceil(evidence.base.fields(evidence.settings.soft_reach_m + evidence.rover_radius_m))


def _refresh(evidence: EvidenceMap, x0: int, y0: int, x1: int, y1: int) -> None:
    """Recompute the weights of the fields x0 <= x < x1, y0 <= y < y1 from the evidence."""
    base = evidence.base
    window = max(x0, 0), max(y0, 0), min(x1, base.width), min(y1, base.height)
    _weigh(evidence, window)
    _soften(evidence, window)


def _refresh_all(evidence: EvidenceMap, seen: Window | None = None) -> None:
    """Recompute all weights. Evidence counts only near what was ``seen``, and at the edges of the map."""
    base, s = evidence.base, evidence.subdivisions
    np.minimum(base.weights + evidence.penalty, 1.0, out=evidence.grid.weights)
    reach = math.ceil(evidence.rover_radius_m / base.resolution_m) + 1
    width, height, rim = base.width, base.height, min(reach, base.width, base.height)
    for window in (
        (0, 0, width, rim),
        (0, height - rim, width, height),
        (0, 0, rim, height),
        (width - rim, 0, width, height),
    ):
        _weigh(evidence, window)
    rows, columns = _written(evidence.log_odds, s) if seen is None else seen
    if rows.start < rows.stop:
        x0, y0 = max(columns.start // s - reach, 0), max(rows.start // s - reach, 0)
        _weigh(evidence, (x0, y0, min(columns.stop // s + reach, width), min(rows.stop // s + reach, height)))
    _soften(evidence, (0, 0, width, height))


def _weigh(evidence: EvidenceMap, window: tuple[int, int, int, int]) -> None:
    """The weights of the fields x0 <= x < x1, y0 <= y < y1 without soft cost."""
    if window[0] >= window[2] or window[1] >= window[3]:
        return  # the rover is off the map, and sees nothing of it
    settings = evidence.settings
    radius = evidence.rover_radius_m / evidence.evidence_m
    roomy = settings.keeps == "outline" and evidence.subdivisions * math.sqrt(2.0) <= radius
    weighs = weigh_roomy if roomy else weigh
    weighs(
        evidence.log_odds, evidence.base.weights, evidence.penalty, evidence.grid.weights, window,
        settings.occupied_at, radius,
    )  # fmt: skip


def _soften(evidence: EvidenceMap, window: tuple[int, int, int, int]) -> None:
    if window[0] < window[2] and window[1] < window[3]:
        settings = evidence.settings
        reach = evidence.base.fields(settings.soft_reach_m)
        soften(evidence.grid.weights, window, reach, settings.soft_cost, MAX_SOFT_WEIGHT)
