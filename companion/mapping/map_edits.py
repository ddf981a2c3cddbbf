"""Map edits: what is done to a map besides adding scans: forgetting, moving, taking over what another run has seen.

They look at what was seen alone: large maps are mostly unseen.

Nouns: map edit.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from companion.core.frames import NedPoint
from companion.core.grid import Cell, Grid
from companion.mapping.evidence_map import EvidenceMap, refresh_all
from companion.mapping.lazy_zeros import lazy_zeros
from companion.mapping.seen_rows import SeenRows, Window


def forget(evidence: EvidenceMap) -> None:
    """Drop all that was seen (the local frame has moved under it); fences and prior knowledge stay."""
    for window in evidence.seen.windows():
        evidence.log_odds[window] = 0.0
    evidence.penalty.fill(0.0)
    evidence.agreement.clear()
    refresh_all(evidence)


def move(evidence: EvidenceMap, north_m: float, east_m: float) -> tuple[float, float]:
    """Move all that was seen by whole cells; fences and prior knowledge stay. Returns how far, metres north and east.

    What leaves the grid is lost, and what comes in is unknown. Penalties belong to fields and move by whole ones.
    """
    side_m = evidence.evidence_m
    by = Cell(round(east_m / side_m), round(north_m / side_m))
    by_fields = Cell(round(by.x / evidence.subdivisions), round(by.y / evidence.subdivisions))
    for raster in (evidence.log_odds, evidence.stamps):
        parts = [(window, raster[window].copy()) for window in evidence.seen.windows()]
        for window, _ in parts:
            raster[window] = 0
        for window, part in parts:
            _put(part, raster, window, by)
    evidence.seen.move(by)
    evidence.penalty[:] = shifted(evidence.penalty, evidence.penalty.shape, by_fields)
    evidence.agreement.clear()
    refresh_all(evidence)
    return by.y * side_m, by.x * side_m


def shifted(raster: NDArray[Any], shape: tuple[int, ...], by: Cell) -> NDArray[Any]:
    """A raster on another one of this shape, moved by ``by`` to the east and north; zero where it says nothing."""
    result = lazy_zeros(shape, raster.dtype)
    for window in SeenRows.of(raster).windows():
        _put(raster[window], result, window, by)
    return result


def _put(part: NDArray[Any], raster: NDArray[Any], window: Window, by: Cell) -> None:
    """Write what was in a window, and is not 0, elsewhere; what lies outside is lost."""
    rows, columns = part.shape
    y, x = window[0].start + by.y, window[1].start + by.x
    y0, x0 = max(0, y), max(0, x)
    y1, x1 = min(raster.shape[0], y + rows), min(raster.shape[1], x + columns)
    if y0 < y1 and x0 < x1:
        part = part[y0 - y : y1 - y, x0 - x : x1 - x]
        np.copyto(raster[y0:y1, x0:x1], part, where=part != 0)


def rebase(evidence: EvidenceMap, base: Grid) -> None:
    """Other weights of the mission's own (of a grid that lies as before); what was seen stays."""
    evidence.base.weights[:] = base.weights
    refresh_all(evidence)


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
    for window in evidence.seen.windows():
        evidence.log_odds[window] = 0.0
    for window in SeenRows.of(log_odds).windows():
        seen = np.clip(log_odds[window], -settings.free_limit, settings.limit)
        if obstacles_alone:
            seen = np.where(seen >= settings.occupied_at, np.float32(settings.occupied_at), np.float32(0.0))
        evidence.log_odds[window] = seen
        evidence.seen.add(window[1].start, window[0].start, window[1].stop, window[0].stop)
    np.maximum(penalty, 0.0, out=evidence.penalty)
    refresh_all(evidence)


def forget_weak_evidence(evidence: EvidenceMap, point: NedPoint, reach_m: float) -> bool:
    """Forget, before giving up, what may be an error of sensor or position, so that it is looked at again.

    That is weak evidence of obstacles anywhere (below ``settings.sure_at``), any evidence of obstacles within
    ``reach_m`` of the place, and all penalties. Returns whether there was any.
    """
    settings, (x, y) = evidence.settings, evidence.frame.xy(point)
    reach, found = evidence.frame.cells(reach_m), bool((evidence.penalty > 0.0).any())
    for window in evidence.seen.windows():
        seen = evidence.log_odds[window]
        occupied = seen >= settings.occupied_at
        doubtful = occupied & (seen < settings.sure_at)
        near = _round(y, reach, window[0].start), _round(x, reach, window[1].start)
        doubtful[near] |= occupied[near]
        found |= bool(doubtful.any())
        _forget_cells(evidence, window, doubtful)
    _forget_penalties(evidence)
    return found


def _round(place: float, reach: float, first: int) -> slice:
    """The cells within reach of a place along one axis, counted from the ``first`` of a window."""
    return slice(max(0, int(place - reach) - first), max(0, int(place + reach) + 1 - first))


def look_again(evidence: EvidenceMap, since_stamp: int) -> None:
    """Forget obstacles that no scan has touched since then, and all penalties: what stood there may have opened.

    The ground becomes unknown, not free: whoever goes there looks first. What the mission itself closed stays.
    """
    for window in evidence.seen.windows():
        occupied = evidence.log_odds[window] >= evidence.settings.occupied_at
        _forget_cells(evidence, window, occupied & (evidence.stamps[window] < since_stamp))
    _forget_penalties(evidence)


def _forget_cells(evidence: EvidenceMap, window: Window, cells: NDArray[np.bool_]) -> None:
    """These of a window are unknown again, and remembered as once seen, also those that an earlier run saw."""
    evidence.log_odds[window][cells] = 0.0
    stamps = evidence.stamps[window]
    stamps[cells] = np.maximum(stamps[cells], 1)


def _forget_penalties(evidence: EvidenceMap) -> None:
    evidence.penalty.fill(0.0)
    refresh_all(evidence)
