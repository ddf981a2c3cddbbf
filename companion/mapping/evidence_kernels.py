"""Compiled loops over the evidence raster: scans to log-odds, field weights (inflation by the rover's radius), lines.

All rasters are indexed [y, x], y north. Log-odds: 0 unknown, negative free, from ``occupied_at`` on an obstacle.
Lengths and places are in evidence cells; ``evidence_map`` and ``map_queries`` convert from metres.

Nouns: log-odds, inflation.
"""

# mypy: disable-error-code="no-untyped-def"

import math
from typing import Any, NamedTuple

import numpy as np
from numba import njit

DIAGONAL = math.sqrt(2.0)


class ScanInCells(NamedTuple):
    """One scan from a sensor at (x, y); headings clockwise from north. Lengths in evidence cells.

    ``bearing_rad`` and ``range_cells`` have shape (n,); a range of inf means nothing seen up to ``max_cells``, nan
    nothing known.
    """

    x: float
    y: float
    heading_rad: float
    bearing_rad: Any
    range_cells: Any
    max_cells: float
    beam_width_rad: float


class InverseSensorModel(NamedTuple):
    """How readings change the log-odds. Lengths in evidence cells.

    A beam ends ``depth_cells`` behind its range. The last ``kept_cells`` before a hit are not freed. From
    ``occupied_at`` on a cell is an obstacle. A hit is confirmed by an earlier one within ``confirm_cells``.
    """

    hit: float
    miss: float
    limit: float
    free_limit: float
    depth_cells: float
    kept_cells: float
    confirm_cells: float
    occupied_at: float


@njit(cache=True, nogil=True)
def _chord(scan, i, share):
    """How far a beam is free beside its middle, where the beam next to it ends nearer: to the line between both ends.

    ``share``: how far beside, in beam widths, clockwise positive. Along a wall seen at a grazing angle the ends of wide
    beams lie far apart, and the wall between them.
    """
    bearing_rad, range_cells, width_rad = scan.bearing_rad, scan.range_cells, scan.beam_width_rad
    for step in (1, -1):
        other = (i + step) % bearing_rad.size
        aside_rad = (bearing_rad[other] - bearing_rad[i] + math.pi) % (2.0 * math.pi) - math.pi
        if aside_rad * share > 0.0:
            break
    apart_rad = abs(aside_rad)
    own, its = min(range_cells[i], scan.max_cells), min(range_cells[other], scan.max_cells)
    if math.isnan(range_cells[other]) or its >= own or its <= 0.0:
        return math.inf
    if aside_rad * share <= 0.0 or abs(apart_rad - width_rad) > 0.25 * width_rad:
        return math.inf  # no beam next to it on this side
    aside_rad = abs(share) * apart_rad
    return own * its * math.sin(apart_rad) / (own * math.sin(aside_rad) + its * math.sin(apart_rad - aside_rad))


@njit(cache=True, nogil=True, inline="always")
def _enclose(box, x, y):
    """Make a box of cells (first x, first y, last x, last y) enclose one more."""
    box[0], box[1], box[2], box[3] = min(box[0], x), min(box[1], y), max(box[2], x), max(box[3], y)


@njit(cache=True, nogil=True)
def _free_cells(log_odds, stamps, stamp, ray, model, turned):
    """Free the cells along a ``ray``, that this scan has not touched: its beginning, its direction and its length.

    The box ``turned`` encloses those which were obstacles before.

    Inside the map whole numbers need no floor and places no check: most of the time of a scan is spent here.
    """
    height, width = log_odds.shape
    x0, y0, dx, dy, free = ray
    end_x, end_y = x0 + free * dx, y0 + free * dy
    inside = min(x0, end_x) >= 0.0 and min(y0, end_y) >= 0.0 and max(x0, end_x) < width and max(y0, end_y) < height
    d = 0.0
    while d < free:
        if inside:
            x, y = int(x0 + d * dx), int(y0 + d * dy)
        else:
            x, y = int(math.floor(x0 + d * dx)), int(math.floor(y0 + d * dy))
        d += 0.7
        if (inside or (0 <= x < width and 0 <= y < height)) and stamps[y, x] != stamp:
            stamps[y, x] = stamp
            before = log_odds[y, x]
            log_odds[y, x] = max(before - model.miss, -model.free_limit)
            if before >= model.occupied_at > log_odds[y, x]:
                _enclose(turned, x, y)


@njit(cache=True, nogil=True)
def _is_confirmed(log_odds, x, y, earlier, model):
    """Whether one of the ``earlier`` hits ended near a cell. Not where an obstacle is as near: that is what was hit."""
    if model.confirm_cells <= 0.0:
        return False
    height, width = log_odds.shape
    near, reach = model.confirm_cells * model.confirm_cells, int(math.ceil(model.confirm_cells))
    for row in range(max(0, y - reach), min(height, y + reach + 1)):
        for column in range(max(0, x - reach), min(width, x + reach + 1)):
            beside = (column - x) * (column - x) + (row - y) * (row - y) <= near
            if beside and log_odds[row, column] >= model.occupied_at:
                return False
    for i in range(earlier.shape[0]):
        aside, ahead = earlier[i, 0] - x, earlier[i, 1] - y
        if aside * aside + ahead * ahead <= near:
            return True
    return False


@njit(cache=True, nogil=True)
def _count_hits(log_odds, stamps, stamp, scan, model, earlier, turned):
    """Harden the cells in which the beams of a scan end. The box ``turned`` encloses those that become obstacles."""
    height, width = log_odds.shape
    for i in range(scan.bearing_rad.size):
        r = scan.range_cells[i]
        if not np.isfinite(r):
            continue
        angle = scan.heading_rad + scan.bearing_rad[i]
        x = int(math.floor(scan.x + (r + model.depth_cells) * math.sin(angle)))
        y = int(math.floor(scan.y + (r + model.depth_cells) * math.cos(angle)))
        if 0 <= x < width and 0 <= y < height and stamps[y, x] != stamp:
            stamps[y, x] = stamp
            before = log_odds[y, x]
            log_odds[y, x] = min(before + model.hit, model.limit)
            if log_odds[y, x] < model.occupied_at and _is_confirmed(log_odds, x, y, earlier, model):
                log_odds[y, x] = min(model.hit, model.limit)
            if before < model.occupied_at <= log_odds[y, x]:
                _enclose(turned, x, y)


@njit(cache=True, nogil=True)
def cast_scan(log_odds, stamps, stamp, scan, model, earlier, protected, stands):
    """Add one scan to the evidence, and free the cells where the rover ``stands``: its place, x and y, and its radius.

    ``earlier``: the cells in which readings of earlier scans ended; a hit that one of them confirms counts as on ground
    that was never seen. The cells ``protected`` are not freed. Both have shape (n, 2), x and y, all of them on the map.
    Returns the box (first x, first y, last x, last y) of cells that have become obstacles or are none any more; the
    last before the first for none.
    """
    height, width = log_odds.shape
    turned = np.array((width, height, -1, -1))
    x0, y0, heading_rad, width_rad = scan.x, scan.y, scan.heading_rad, scan.beam_width_rad
    bearing_rad, range_cells = scan.bearing_rad, scan.range_cells
    # Hits first: a cell stamped by a hit cannot be freed by another beam of the same scan.
    _count_hits(log_odds, stamps, stamp, scan, model, earlier, turned)
    for i in range(protected.shape[0]):
        stamps[protected[i, 1], protected[i, 0]] = stamp
    for i in range(bearing_rad.size):
        r = range_cells[i]
        if math.isnan(r):
            continue
        reach = scan.max_cells if math.isinf(r) else r - 0.5 - model.kept_cells
        rays = max(1, int(math.ceil(reach * width_rad)))
        for k in range(rays):
            share = (k + 0.5) / rays - 0.5
            angle = heading_rad + bearing_rad[i] + width_rad * share
            dx = math.sin(angle)
            dy = math.cos(angle)
            free = min(reach, _chord(scan, i, share) - 0.5)
            _free_cells(log_odds, stamps, stamp, (x0, y0, dx, dy, free), model, turned)
    x0, y0, radius_cells = stands
    r = int(math.ceil(radius_cells))
    for y in range(max(0, int(y0) - r), min(height, int(y0) + r + 1)):
        for x in range(max(0, int(x0) - r), min(width, int(x0) + r + 1)):
            if math.hypot(x + 0.5 - x0, y + 0.5 - y0) <= radius_cells:
                if log_odds[y, x] >= model.occupied_at:
                    _enclose(turned, x, y)
                log_odds[y, x] = -model.free_limit
    return turned


@njit(cache=True, nogil=True)
def weigh(log_odds, base, penalty, weights, window, occupied_at, radius_cells):
    """Weights of the fields x0 <= x < x1, y0 <= y < y1 of a window (x0, y0, x1, y1); obstacles among them."""
    height, width = base.shape
    x0, y0, x1, y1 = window
    s = log_odds.shape[0] // height  # evidence cells along the side of a field
    for fy in range(y0, y1):
        for fx in range(x0, x1):
            weights[fy, fx] = min(base[fy, fx] + penalty[fy, fx], 1.0)
    reach = int(math.ceil(radius_cells))
    for y in range(max(0, y0 * s - reach), min(height * s, y1 * s + reach)):
        for x in range(max(0, x0 * s - reach), min(width * s, x1 * s + reach)):
            if log_odds[y, x] >= occupied_at:
                _close_round(weights, window, s, x, y, radius_cells)


@njit(cache=True, nogil=True)
def _close_round(weights, window, s, x, y, radius_cells):
    """Close the field of a cell, and those of the window whose middle lies nearer to the cell's than the radius."""
    x0, y0, x1, y1 = window
    fx, fy = x // s, y // s
    if x0 <= fx < x1 and y0 <= fy < y1:
        weights[fy, fx] = 1.0
    # Squares, not roots: most fields of the box are compared in vain.
    cx, cy, square = x + 0.5, y + 0.5, radius_cells * radius_cells
    reach = int(math.ceil(radius_cells))
    last_y, last_x = min(y1, (y + reach) // s + 1), min(x1, (x + reach) // s + 1)
    for fy in range(max(y0, (y - reach) // s), last_y):
        aside = cy - (fy + 0.5) * s
        for fx in range(max(x0, (x - reach) // s), last_x):
            ahead = cx - (fx + 0.5) * s
            if ahead * ahead + aside * aside < square:
                weights[fy, fx] = 1.0


@njit(cache=True, nogil=True)
def weigh_roomy(log_odds, base, penalty, weights, window, occupied_at, radius_cells):
    """As ``weigh``, but a field is free if the rover keeps the radius anywhere in it, not only in its middle.

    It keeps it from the edge of the map, too: nothing is known beyond.
    """
    height = base.shape[0]
    x0, y0, x1, y1 = window
    s = log_odds.shape[0] // height
    near = _near_obstacles(log_odds, (x0 * s, y0 * s, x1 * s, y1 * s), occupied_at, radius_cells)
    for fy in range(y0, y1):
        for fx in range(x0, x1):
            weights[fy, fx] = 1.0
    for y in range(near.shape[0]):
        for x in range(near.shape[1]):
            if not near[y, x]:
                fy, fx = y0 + y // s, x0 + x // s
                weights[fy, fx] = min(base[fy, fx] + penalty[fy, fx], 1.0)


@njit(cache=True, nogil=True)
def _near_obstacles(log_odds, cells, occupied_at, radius_cells):
    """Which of the cells x0 <= x < x1, y0 <= y < y1 lie nearer than the radius to an obstacle or to the map's edge."""
    x0, y0, x1, y1 = cells
    height, width = log_odds.shape
    reach = int(math.ceil(radius_cells))
    near = np.zeros((y1 - y0, x1 - x0), np.bool_)
    near[: max(reach - y0, 0)] = True
    near[:, : max(reach - x0, 0)] = True
    near[max(height - reach - y0, 0) :] = True
    near[:, max(width - reach - x0, 0) :] = True
    for y in range(max(0, y0 - reach), min(height, y1 + reach)):
        for x in range(max(0, x0 - reach), min(width, x1 + reach)):
            if log_odds[y, x] < occupied_at:
                continue
            for row in range(max(y - reach, y0), min(y + reach + 1, y1)):
                half = radius_cells * radius_cells - (row - y) * (row - y)
                if half > 0.0:
                    aside = int(math.ceil(math.sqrt(half))) - 1
                    near[row - y0, max(x - aside - x0, 0) : max(min(x + aside + 1, x1) - x0, 0)] = True
    return near


@njit(cache=True, nogil=True)
def soften(weights, window, soft_reach, soft_cost, max_soft):
    """Raise the weights of free fields near obstacles in a window (x0, y0, x1, y1) as in ``weigh``; reach in fields.

    Two sweeps of a chamfer mask give the distances; beyond the window the present weights count.
    """
    height, width = weights.shape
    x0, y0, x1, y1 = window
    n = int(math.ceil(soft_reach))
    left = max(0, x0 - n)
    low = max(0, y0 - n)
    right = min(width, x1 + n)
    high = min(height, y1 + n)
    gap = np.full((high - low + 2, right - left + 2), soft_reach + 1.0)
    for y in range(low, high):
        for x in range(left, right):
            if weights[y, x] >= 1.0:
                gap[y - low + 1, x - left + 1] = 0.0
    for y in range(1, gap.shape[0] - 1):
        _nearer(gap[y], gap[y - 1])
        for x in range(1, gap.shape[1] - 1):
            gap[y, x] = min(gap[y, x], gap[y, x - 1] + 1.0)
    for y in range(gap.shape[0] - 2, 0, -1):
        _nearer(gap[y], gap[y + 1])
        for x in range(gap.shape[1] - 2, 0, -1):
            gap[y, x] = min(gap[y, x], gap[y, x + 1] + 1.0)
    for fy in range(y0, y1):
        for fx in range(x0, x1):
            nearest = gap[fy - low + 1, fx - left + 1]
            if weights[fy, fx] < 1.0 and nearest <= soft_reach:
                extra = soft_cost * (1.0 - (nearest - 1.0) / soft_reach)
                weights[fy, fx] = max(weights[fy, fx], min(weights[fy, fx] + extra, max_soft))


@njit(cache=True, nogil=True)
def _nearer(row, beside):
    """Distances of a row from those of the one beside it. No step needs the one before: the compiler does several."""
    own, left, middle, right = row[1:-1], beside[:-2], beside[1:-1], beside[2:]
    for x in range(own.size):
        own[x] = min(own[x], middle[x] + 1.0, min(left[x], right[x]) + DIAGONAL)


@njit(cache=True, nogil=True)
def look(log_odds, base, penalty, start, end, half_width, radius, occupied_at):
    """How far a disc of this half width can go from start (x, y) towards end, and how far the line has been seen."""
    length, seen = look_at_line(log_odds, base, penalty, start, end)
    return look_beside(log_odds, start, end, length, half_width, radius, occupied_at), seen


@njit(cache=True, nogil=True)
def look_at_line(log_odds, base, penalty, start, end):
    """How far a line from start (x, y) towards end is open by mission and penalty, and how far it has been seen."""
    height, width = log_odds.shape
    s = height // base.shape[0]  # evidence cells along the side of a field
    share = 1.0 / s
    x0, y0 = start
    x1, y1 = end
    length = math.hypot(x1 - x0, y1 - y0)
    if length < 1e-9:
        return 0.0, 0.0
    dx = (x1 - x0) / length
    dy = (y1 - y0) / length
    seen = length
    d = 0.0
    while d < length:
        x = int(math.floor(x0 + d * dx))
        y = int(math.floor(y0 + d * dy))
        if not (0 <= x < width and 0 <= y < height):
            length = min(d, seen)
            break
        fx, fy = int((x + 0.5) * share), int((y + 0.5) * share)  # a division takes as long as all the rest
        if base[fy, fx] + penalty[fy, fx] >= 1.0 and d > s * 0.75:
            length = d
            break
        if log_odds[y, x] == 0.0 and d < seen:
            seen = d
        d += 0.5
    return length, min(seen, length)


@njit(cache=True, nogil=True)
def look_beside(log_odds, start, end, length, half_width, radius, occupied_at):
    """How far of this length a disc of this half width can go from start (x, y) towards end: to the first obstacle."""
    height, width = log_odds.shape
    x0, y0 = start
    apart = math.hypot(end[0] - x0, end[1] - y0)
    if apart < 1e-9:
        return 0.0
    dx = (end[0] - x0) / apart
    dy = (end[1] - y0) / apart
    # An obstacle may fill its whole evidence cell, not only the middle.
    half_width += 0.5
    radius = min(radius + 0.5, half_width)
    clear = length
    r = int(math.ceil(half_width)) + 1
    left = max(0, int(min(x0, x0 + dx * length)) - r)
    right = min(width, int(max(x0, x0 + dx * length)) + r + 1)
    low = max(0, int(min(y0, y0 + dy * length)) - r)
    high = min(height, int(max(y0, y0 + dy * length)) + r + 1)
    for y in range(low, high):
        py = y + 0.5 - y0
        first, last = left, right
        if abs(dy) > 0.01:  # of a slanting line's box only the cells beside the line, and one more on each side
            middle, aside = x0 + py * dx / dy, half_width / abs(dy) + 2.0
            first, last = max(left, int(middle - aside)), min(right, int(middle + aside) + 1)
        for x in range(first, last):
            if log_odds[y, x] < occupied_at:
                continue
            px = x + 0.5 - x0
            along = px * dx + py * dy
            across = abs(px * dy - py * dx)
            # An obstacle nearer than the wanted room must not come nearer still (so the rover can leave a wall), and
            # nothing may come within its radius.
            room = max(min(half_width, math.hypot(px, py) - 0.1), radius)
            if across >= room or along <= 0.0:
                continue
            # The rover is a disc: it touches before its middle is level with the obstacle.
            contact = along - math.sqrt(room * room - across * across)
            if contact < clear:
                clear = max(contact, 0.0)
    return clear


@njit(cache=True, nogil=True)
def nearest(log_odds, x0, y0, reach, occupied_at):
    """Distance from (x0, y0) to the nearest evidence of an obstacle, at most ``reach``."""
    height, width = log_odds.shape
    best = reach
    r = int(math.ceil(reach + 0.5))
    for y in range(max(0, int(y0) - r), min(height, int(y0) + r + 1)):
        for x in range(max(0, int(x0) - r), min(width, int(x0) + r + 1)):
            if log_odds[y, x] >= occupied_at:
                best = min(best, max(math.hypot(x + 0.5 - x0, y + 0.5 - y0) - 0.5, 0.0))
    return best


@njit(cache=True, nogil=True)
def first_unseen(log_odds, start, end, offset, near):
    """The nearest unseen place on the two lines ``offset`` beside a line, from distance ``near`` on.

    Returns its distance along the line and its place (x, y); the length of the line and its end when all has been seen.
    """
    height, width = log_odds.shape
    x0, y0 = start
    x1, y1 = end
    length = math.hypot(x1 - x0, y1 - y0)
    if length < 1e-9:
        return 0.0, x1, y1
    dx = (x1 - x0) / length
    dy = (y1 - y0) / length
    d = near
    while d < length:
        for side in (-1.0, 1.0):
            px = x0 + d * dx - side * offset * dy
            py = y0 + d * dy + side * offset * dx
            x = int(math.floor(px))
            y = int(math.floor(py))
            if 0 <= x < width and 0 <= y < height and log_odds[y, x] == 0.0:
                return d, px, py
        d += 0.5
    return length, x1, y1
