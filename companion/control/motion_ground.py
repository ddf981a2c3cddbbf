"""The ground round the rover as motions are judged by it: distances to what stands and what is unseen, and time to go.

Made from the map's evidence cells in a window round the rover and the next metres of its path.

Nouns: window.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from companion.control.motion_kernels import Body, MotionGround, long_m
from companion.control.reference_path import STEP_M, ReferencePath
from companion.core.frames import NedPoint
from companion.mapping.cost_to_go import cost_to_go
from companion.mapping.distance_field import distance_field
from companion.mapping.evidence_map import EvidenceMap

Floats = NDArray[np.float64]

AHEAD_M = 12.0
"""The place of the path so far ahead is where the time to go counts to."""
AROUND_M = 3.0
"""Ground looked at round the rover, the place where it would come to stand, and the path up to there."""
ROOMY_M = 0.5
"""With so much room beside it the rover drives at full speed."""
SLOWEST_SHARE = 0.25
"""Of full speed, where there is no room at all."""
TIGHT_M, TIGHT = 0.1, 4.0
"""With less room than the first it takes longer, up to by the second as a factor more. There motions cost so much that
else no way through a gap would seem worth it, and the rover would wait before it."""
IN_LINE = 6.0
"""Where a long rover cannot turn it takes longer, up to by this as a factor more: so the fastest way to a gap comes
straight on, and the rover lines up before it, where it still can turn."""
UNSEEN_FACTOR = 1.3
"""Unseen ground takes so much longer."""
NEAR_M = 0.3
"""A rover that stands too near to something finds its way from so far away."""
NEARER_M = 1.0
"""A path that is closed farther ahead is followed at least so far, or it counts as closed here."""
UNDER_M = 0.1
"""Round a rover that came from elsewhere with open eyes ground counts as seen, so much beyond what it can turn on. It
saw what is farther aside before it came beside it, or something hides it: the end of a wall, seen from neither side."""
BESIDE_FIRST, UNDER_FIRST_M = 1.42, 0.05
"""Round one that begins, or begins anew, to so many times its half width, or so much beyond what it can turn on. So
much a lidar of 90 degrees needs to drive on; with a narrower one the rover turns first."""
COMES_M, COMES = 0.2, 4.0
"""It came from elsewhere after so much more than twice what it can turn on, or so many times its half width: with a
lidar that looks 60 degrees wide it has passed by then what is beside it where it begins."""
COARSE = 2
"""Evidence cells along the side of a cell that has a time to go."""


@dataclass(frozen=True, eq=False, slots=True)
class Window:
    """The rasters, and where their south-west corner lies. ``is_known``: something is known there."""

    ground: MotionGround
    corner: NedPoint
    is_known: bool

    def place(self, point: NedPoint) -> tuple[float, float]:
        """Metres east and north of the corner."""
        return point.east_m - self.corner.east_m, point.north_m - self.corner.north_m


def look_round(
    evidence: EvidenceMap,
    here: NedPoint,
    path: ReferencePath,
    body: Body,
    fastest_m_s: float,
    *,
    stops_at: NedPoint | None = None,
    came_here: bool = True,
) -> Window:
    """The window as the map is now: round the path, the rover, and the place where it would come to stand.

    ``stops_at``: that place; None where the rover is. The ground that the rover can turn on where it stands counts as
    seen: no sensor sees it. Not so where an obstacle was seen and forgotten. ``came_here``: it came from elsewhere with
    open eyes.
    """
    ahead = path.points[path.progress : path.progress + round(AHEAD_M / STEP_M) + 1]
    stops = stops_at or here
    places = np.vstack((ahead, (here.north_m, here.east_m), (stops.north_m, stops.east_m)))
    (left, low), (right, high) = _window(evidence, places)
    log_odds = evidence.log_odds[low:high, left:right]
    cell_m, unseen = evidence.evidence_m, log_odds == 0.0
    closed, costly = _closed(evidence, (left, low), (right, high), body.radius_m)
    if costly.any():
        # Fields that experience closed may lie under the rover: those do not keep it there.
        costly &= ~_under(evidence, here, (left, low), costly.shape, body.around_m)
    blocked = (log_odds >= evidence.settings.occupied_at) | closed | costly
    _close_edge(blocked, (left, low), evidence)
    # To the surface: the map marks what lies a little behind it.
    never_seen = unseen & (evidence.stamps[low:high, left:right] == 0)
    behind_m = np.float32(max(0.5 * cell_m, evidence.settings.hit_depth_m))
    unseen_to = unseen_to_m(body, came_here) + float(behind_m)
    under = never_seen & _under(evidence, here, (left, low), unseen.shape, unseen_to)
    outside = (unseen & ~under) | blocked
    for edge in (outside[0, :], outside[-1, :], outside[:, 0], outside[:, -1]):
        edge[:] = True  # nothing is known here of what lies beyond the window
    gap_m = distance_field(blocked) * np.float32(cell_m) - behind_m
    seen_m = distance_field(outside) * np.float32(cell_m) - behind_m
    parts = [(row, column) for row in range(COARSE) for column in range(COARSE)]
    # The roomiest place of each counts: the mean would close gaps that are only just wide enough.
    room_m = np.maximum.reduce([gap_m[row::COARSE, column::COARSE] for row, column in parts]).astype(np.float64)
    pace = _pace(room_m - body.radius_m, COARSE * cell_m, fastest_m_s)
    if long_m(body) > 0.0:
        pace *= 1.0 + IN_LINE * np.clip(1.0 - room_m / body.around_m, 0.0, 1.0)
    pace[np.logical_or.reduce([unseen[row::COARSE, column::COARSE] for row, column in parts])] *= UNSEEN_FACTOR
    cells = np.floor((evidence.frame.xys(ahead) - (left, low)) / COARSE).astype(np.int64)
    ends = path.progress + len(ahead) >= len(path.points)
    around = _around(evidence, here, (left, low), pace)
    togo_s = cost_to_go(pace, cells[-1:])
    if len(around) and not np.isfinite(togo_s[around[:, 1], around[:, 0]]).any():
        # The path leads on farther ahead only for a coarser look. Go as near to that place as possible, and see.
        last = _farthest(cells, cost_to_go(pace, around))
        if last * STEP_M >= NEARER_M:
            togo_s, ends = cost_to_go(pace, cells[last : last + 1]), False
    ground = MotionGround(gap_m, seen_m, cell_m, togo_s, COARSE * cell_m, ends)
    return Window(ground, evidence.frame.point(left, low), not unseen.all())


def _around(evidence: EvidenceMap, here: NedPoint, first: tuple[int, int], pace: Floats) -> NDArray[np.int64]:
    """Coarse cells, x and y, beside the rover where its middle can be."""
    middle = np.floor((evidence.frame.xy(here) - np.array(first)) / COARSE).astype(np.int64)
    reach = round(NEAR_M / (COARSE * evidence.evidence_m))
    lows = np.maximum(middle - reach, 0)
    near = pace[lows[1] : middle[1] + reach + 1, lows[0] : middle[0] + reach + 1]
    return np.argwhere(np.isfinite(near))[:, ::-1] + lows


def _farthest(cells: NDArray[np.int64], times_s: Floats) -> int:
    """The number of the last of these cells that can be come to; 0 if there is none."""
    height, width = times_s.shape
    x, y = np.clip(cells[:, 0], 0, width - 1), np.clip(cells[:, 1], 0, height - 1)
    reached = np.flatnonzero(np.isfinite(times_s[y, x]))
    return int(reached[-1]) if len(reached) else 0


def _window(evidence: EvidenceMap, places: Floats) -> tuple[tuple[int, int], tuple[int, int]]:
    """From which evidence cell (x, y) to which: round the places, whole coarse cells, on the map."""
    cells, margin = evidence.frame.xys(places), evidence.frame.cells(AROUND_M)
    height, width = evidence.log_odds.shape
    low = np.maximum(np.floor(cells.min(axis=0) - margin), 0.0).astype(np.int64) // COARSE * COARSE
    high = np.minimum(np.ceil(cells.max(axis=0) + margin), (width, height)).astype(np.int64)
    low = np.minimum(low, np.array((width, height)) // COARSE * COARSE - COARSE)
    high = low + np.maximum((high - low) // COARSE, 1) * COARSE
    return (int(low[0]), int(low[1])), (int(high[0]), int(high[1]))


def _closed(
    evidence: EvidenceMap, first: tuple[int, int], last: tuple[int, int], body_radius_m: float
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Evidence cells of fields closed to the rover's outline: by the mission or a fence, and those by experience.

    What the mission closes has grown by the rover's radius, for its middle, at worst by half a field less. Here its
    outline keeps the distance, so a strip as wide as that is taken off again: else the rover would keep it twice.
    """
    s = evidence.subdivisions
    fields = np.s_[first[1] // s : -(-last[1] // s), first[0] // s : -(-last[0] // s)]
    base, penalty = evidence.base.weights[fields], evidence.penalty[fields]
    here = np.s_[first[1] % s : first[1] % s + last[1] - first[1], first[0] % s : first[0] % s + last[0] - first[0]]

    def cells(closed: NDArray[np.bool_]) -> NDArray[np.bool_]:
        fine: NDArray[np.bool_] = closed.repeat(s, axis=0).repeat(s, axis=1)[here]
        return fine

    closed = cells(base >= 1.0)
    if closed.any():
        deep_m = distance_field(~closed) * evidence.evidence_m
        closed = deep_m > max(body_radius_m - 0.5 * evidence.base.resolution_m, 0.0)
    return closed, cells((base + penalty >= 1.0) & (base < 1.0))


def unseen_to_m(body: Body, came_here: bool) -> float:
    """So far from the rover's place ground counts as seen that no sensor saw. ``came_here``: see ``look_round``."""
    if came_here:
        return body.around_m + UNDER_M
    return max(body.around_m, BESIDE_FIRST * body.radius_m) + UNDER_FIRST_M


def comes_from_m(body: Body) -> float:
    """After so long a way forwards a rover has come from elsewhere: see ``look_round``."""
    return max(2.0 * body.around_m, COMES * body.radius_m) + COMES_M


def _under(
    evidence: EvidenceMap, here: NedPoint, first: tuple[int, int], shape: tuple[int, ...], reach_m: float
) -> NDArray[np.bool_]:
    """The evidence cells within reach of the rover's place."""
    (x, y), reach = np.array(evidence.frame.xy(here)) - first, evidence.frame.cells(reach_m)
    beside, along = np.arange(shape[1]) + 0.5 - x, np.arange(shape[0]) + 0.5 - y
    under: NDArray[np.bool_] = along[:, None] ** 2 + beside**2 <= reach**2
    return under


def _close_edge(blocked: NDArray[np.bool_], first: tuple[int, int], evidence: EvidenceMap) -> None:
    """The edge of the map is no ground to drive over: nothing is known beyond it.

    A window of whole coarse cells may end a little before it.
    """
    height, width = evidence.log_odds.shape
    blocked[0, :] |= first[1] == 0
    blocked[:, 0] |= first[0] == 0
    blocked[-1, :] |= first[1] + blocked.shape[0] > height - COARSE
    blocked[:, -1] |= first[0] + blocked.shape[1] > width - COARSE


def _pace(room_m: Floats, cell_m: float, fastest_m_s: float) -> Floats:
    """Seconds to cross a cell: slower where it is narrow; inf where the rover's middle cannot be."""
    share = SLOWEST_SHARE + (1.0 - SLOWEST_SHARE) * np.clip(room_m / ROOMY_M, 0.0, 1.0)
    longer = 1.0 + TIGHT * np.clip(1.0 - room_m / TIGHT_M, 0.0, 1.0)
    return np.where(room_m > 0.0, cell_m * longer / (fastest_m_s * share), np.inf)
