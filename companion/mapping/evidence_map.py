"""The evidence map: range readings become log-odds on a fine raster of cells, and these become field weights.

The raster is finer than the fields, so that the free ground beside a thin post does not hide the post in the same
field. A field is an obstacle when something was seen in it, or when the rover standing in its middle would touch
something; for planned motions (``keeps`` "outline") when there is no place in it where the rover would not, if fields
are so small that no obstacle fits between two such places. Beside obstacles the mission's own weight is raised (soft
cost). What can be asked of the map is in ``map_queries``, what else is done to it in ``map_edits``.

Nouns: evidence map, evidence.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property

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
)
from companion.mapping.lazy_zeros import lazy_zeros
from companion.mapping.seen_rows import SeenRows
from companion.mapping.sensor_agreement import SensorAgreement
from companion.settings import MappingSettings

MAX_EVIDENCE_CELLS = 101_000_000
"""Room for a target 350 m away, on cells of 0.05 m. Cells that no scan has changed take no memory."""
STRIP_FIELDS = 16
"""Rows of fields that are weighed together."""
BLIND_M = 0.3
"""Beyond the least range of a wired lidar: what was seen nearer than that may now be too near to give an echo."""
MAX_SOFT_WEIGHT = 0.9
"""Soft cost never makes a field look like an obstacle."""


@dataclass(frozen=True, eq=False)
class EvidenceMap:
    """What has been seen, on a raster of ``subdivisions`` cells along a field's side.

    ``log_odds``: shape (height * subdivisions, width * subdivisions), indexed [y, x]: 0 unknown, below 0 seen free,
    from ``settings.occupied_at`` on an obstacle. ``stamps``: of the scan that changed a cell last, 0 where none did: an
    unknown cell with a stamp was an obstacle that is forgotten. ``seen``: where either is not 0. ``base`` holds the
    mission's own weights (obstacles in it are never forgotten: they are fences or prior knowledge), ``penalty`` what
    experience adds. The arrays belong to the map and are changed in place by ``integrate``; ``grid`` is always up to
    date.
    """

    base: Grid
    grid: Grid
    log_odds: NDArray[np.float32]
    stamps: NDArray[np.int32]
    penalty: NDArray[np.float32]
    subdivisions: int
    rover_radius_m: float
    settings: MappingSettings
    seen: SeenRows
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
        seen=SeenRows(*shape),
    )
    refresh_all(evidence)
    return evidence


def integrate(evidence: EvidenceMap, pose: Pose, scan: RangeScan, stamp: int) -> None:
    """Add one scan to the map; ``stamp`` must differ from scan to scan.

    A beam frees the cells it passed and hardens the one it ended in. In one scan a hit outweighs any number of passes,
    and each cell changes once. Of an edge on ground that was seen free a noisy sensor's readings end in different
    cells, each of which the next scans free again. So a reading near one of the newest second counts as on ground that
    was never seen, unless an obstacle is as near already: walls would grow thicker. An empty ray of a wired lidar frees
    nothing if it begins before an obstacle, which may have come too near to be seen. A cell in which another sensor has
    just seen something is not freed. The ground under the rover is free.
    """
    settings, frame = evidence.settings, evidence.frame
    x, y = frame.xy(pose.point)
    begin, bearing_rad, range_m = _rays(pose, scan)
    if scan.sender == WIRED:
        range_m = _without_too_near(
            evidence, begin, pose.heading_rad + bearing_rad, range_m, scan.min_range_m + BLIND_M
        )
    _note_seen(evidence, begin, scan, range_m)
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
            frame.cells(settings.confirm_m),
            settings.occupied_at,
        ),
        evidence.agreement.before(scan),
        evidence.agreement.others(scan),
        (x, y, frame.cells(evidence.rover_radius_m)),
    )
    evidence.agreement.note(scan, _hit_cells(evidence, pose, scan))
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


def _note_seen(evidence: EvidenceMap, begin: NedPoint, scan: RangeScan, range_m: NDArray[np.float64]) -> None:
    """What a scan may change: round where its rays begin, and under the rover, which is not far from there."""
    ends_m = np.where(np.isinf(range_m), scan.sight_m, range_m)
    far_m = float(np.nanmax(ends_m, initial=0.0)) + evidence.settings.hit_depth_m
    under_m = math.hypot(*scan.origin_m) + evidence.rover_radius_m
    reach = math.ceil(evidence.frame.cells(max(far_m, under_m))) + 2
    x, y = (math.floor(at) for at in evidence.frame.xy(begin))
    evidence.seen.add(x - reach, y - reach, x + reach, y + reach)


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


def refresh_all(evidence: EvidenceMap) -> None:
    """Recompute all weights. Evidence counts only near what was seen, and at the edges of the map."""
    weights = evidence.grid.weights
    np.add(evidence.base.weights, evidence.penalty, out=weights)
    is_closed = bool(weights.max() >= 1.0)
    np.minimum(weights, 1.0, out=weights)
    windows = tuple(_weighed_windows(evidence))
    for window in windows:
        _weigh(evidence, window)
    for window in ((0, 0, evidence.base.width, evidence.base.height),) if is_closed else windows:
        _soften(evidence, window)


def _weighed_windows(evidence: EvidenceMap) -> Iterator[tuple[int, int, int, int]]:
    """Windows of fields (x0, y0, x1, y1), none twice: the map's edge, and all that what was seen bears on."""
    width, height, s = evidence.base.width, evidence.base.height, evidence.subdivisions
    reach = _soft_reach(evidence) + 2
    for y0 in range(0, height, STRIP_FIELDS):
        y1 = min(y0 + STRIP_FIELDS, height)
        if y0 < reach or y1 > height - reach or width <= 2 * reach:
            yield 0, y0, width, y1
            continue
        yield 0, y0, reach, y1
        yield width - reach, y0, width, y1
        first, end = evidence.seen.span((y0 - reach) * s, (y1 + reach) * s)
        if first < end:
            x0, x1 = max(first // s - reach, reach), min(-(-end // s) + reach, width - reach)
            if x0 < x1:
                yield x0, y0, x1, y1


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
