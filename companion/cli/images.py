"""Images of plans (``plan --image``) and of decisions (``replay --why``), north up, in metres of the map's frame."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from companion.cli.inputs import replaced
from companion.control.motion_controller import MotionChoice
from companion.control.motion_kernels import BLOCKED_S, MotionGround, way_of
from companion.core.frames import NedPoint
from companion.core.grid import OBSTACLE, Cell, Grid
from companion.planning.problem import Path as GridPath
from companion.replay.explain import Candidate, Explanation, cost_text
from companion.viewer.map_figure import Extent, MapFigure, Places, corners_of, extent_of, framed

Colour = tuple[int, int, int]

OBSTACLE_COLOUR = (40, 44, 52)
PATH_COLOUR, CURVE_COLOUR, TIGHT_COLOUR = (214, 60, 50), (40, 110, 200), (170, 0, 170)
START_COLOUR, TARGET_COLOUR = (30, 150, 80), (240, 140, 20)
HEADING_COLOUR = (0, 90, 40)
ARROW_SHARE = 12.0
"""The arrow of a heading is as long as one of so many parts of the longer side."""


def save_plan(
    file: Path,
    grid: Grid,
    ends: tuple[Cell, Cell],
    path: GridPath | None,
    tight: Places,
    title: str,
    heading: tuple[float, str] | None = None,
) -> None:
    """Write an image of a path from one end to the other; the suffix decides the format. Raises OutputError.

    The map in greys (darker is costlier), framed on the path. ``tight``: places in fields, shape (n, 2), where the
    rover could not follow it. ``heading``: of the rover at the start, in radians from east to north, and what to say of
    it.
    """
    start, target = (np.array([(end.x, end.y)], np.float64) for end in ends)
    cells = np.empty((0, 2)) if path is None else path.cell_array.astype(np.float64)
    lines = (start, target, cells, tight, *([] if path is None or path.curve is None else [path.curve]))
    seen = [grid.places_of(line) for line in lines]
    arrow = None if heading is None else _along(framed(*seen), seen[0], heading[0])
    figure = MapFigure(framed(*seen, *([] if arrow is None else [arrow])))
    _show(figure, _shaded(grid), extent_of(grid))
    ground = ((OBSTACLE_COLOUR, "obstacle"), (FREE_COLOUR, "free (darker is costlier)"))
    for colour, label in ((START_COLOUR, "start"), (TARGET_COLOUR, "target"), *ground):
        figure.key(_rgb(colour), label)
    if len(cells) > 1:
        _line(figure, grid.places_of(cells), PATH_COLOUR, 4.0)
        figure.key(_rgb(PATH_COLOUR), "path, field by field")
        if path is not None and path.curve is not None:
            _line(figure, grid.places_of(path.curve), CURVE_COLOUR, 2.0)
            figure.key(_rgb(CURVE_COLOUR), "its smooth curve")
    for end, colour in ((start, START_COLOUR), (target, TARGET_COLOUR)):
        _dots(figure, grid.places_of(end), colour)
    if heading is not None and arrow is not None:
        _arrow(figure, arrow, heading[1])
    if len(tight):
        _rings(figure, grid.places_of(tight), f"bends more sharply than the rover turns ({len(tight)})")
    with replaced(file) as new:
        figure.save(new, title)


UNSEEN_TINT = np.array([0.86, 0.9, 1.0])
UNSEEN_COLOUR = (160, 167, 185)
FREE_COLOUR = (185, 185, 185)
"""Of fields with the base weight."""
TAKEN_COLOUR, PAST_COLOUR = (214, 60, 50), (150, 120, 90)
CANDIDATE_COLOURS = ((40, 110, 200), (130, 60, 170), (20, 140, 140), (120, 200, 40), (240, 90, 190))
ROVER_SHARE = 40.0
"""The rover's triangle is as long as one of so many parts of the longer side, or as a field."""


def save_decision(file: Path, why: Explanation) -> None:
    """Write an image of a decision; the suffix decides the format. Raises OutputError.

    The searched weights in greys (darker is costlier), bluish where unseen; over them candidates and decision. Framed
    on what was seen and considered.
    """
    grid, decision = why.weighed, why.decision
    past, taken = (
        grid.places_of(np.array(cells, np.float64).reshape(-1, 2)) for cells in (why.state.past, decision.path)
    )
    candidates = [grid.places_of(_places(one)) for one in why.candidates]
    target, rover = grid.places_of(np.array([why.state.target], np.float64)), _row(why.pose.point)
    seen = corners_of(why.known, extent_of(grid))
    figure = MapFigure(framed(seen, past, taken, *candidates, target, rover))
    _show(figure, _shaded(grid, ~why.known), extent_of(grid))
    figure.key(_rgb(START_COLOUR), "rover")
    figure.key(_rgb(TARGET_COLOUR), "target")
    figure.key(_rgb(PAST_COLOUR), "past path")
    figure.key(_rgb(OBSTACLE_COLOUR), "obstacle")
    figure.key(_rgb(FREE_COLOUR), "seen free (darker is costlier)")
    figure.key(_rgb(UNSEEN_COLOUR), "not seen yet (darker is costlier)")
    _line(figure, past, PAST_COLOUR, 3.0)
    # The chosen path is drawn below the candidates and wider, so that both can be seen.
    _line(figure, taken, TAKEN_COLOUR, 8.0)
    figure.key(_rgb(TAKEN_COLOUR), f"taken: {decision.action}, part {decision.part}, {decision.reason}")
    for number, (candidate, line) in enumerate(zip(why.candidates, candidates, strict=True)):
        colour = CANDIDATE_COLOURS[number % len(CANDIDATE_COLOURS)]
        _line(figure, line, colour, 2.5)
        figure.key(_rgb(colour), f"{candidate.name}: {cost_text(candidate)}; {candidate.note}")
    _dots(figure, target, TARGET_COLOUR)
    _rover(figure, why)
    with replaced(file) as new:
        figure.save(new, f"decision {why.number} at {why.time_s:.2f} s, heading for {why.target}")


MOTIONS_M = 6.0
"""So far round the rover the picture of motions reaches."""
DISC_COLOUR = (120, 150, 120)
DISC_LINE: Mapping[str, Any] = {"edgecolor": tuple(part / 255.0 for part in DISC_COLOUR), "linewidth": 1.0,
                                "linestyle": ":"}  # fmt: skip
TOUCHING_COLOUR, CHEAP_COLOUR, DEAR_COLOUR = (235, 160, 155), (40, 110, 200), (190, 215, 240)


def save_motions(file: Path, choice: MotionChoice, title: str) -> None:
    """Write an image of the motions that were judged; the suffix decides the format. Raises OutputError.

    The ground round the rover; the motions from dear to cheap, those that touch something below; the chosen one.
    """
    problem, costs_s, corner = choice.problem, choice.found.costs_s, choice.corner
    at = NedPoint(corner.north_m + problem.start.y_m, corner.east_m + problem.start.x_m)
    figure = MapFigure(
        Extent(at.east_m - MOTIONS_M, at.east_m + MOTIONS_M, at.north_m - MOTIONS_M, at.north_m + MOTIONS_M)
    )
    _show_round(figure, problem.ground, corner)

    def line(motion: NDArray[np.float64], colour: Colour, width: float) -> None:
        _line(figure, _row(corner) + way_of(motion, problem)[:, ::-1], colour, width)

    order = np.argsort(costs_s)[::-1]
    free = order[costs_s[order] < BLOCKED_S]
    for one in order[costs_s[order] >= BLOCKED_S]:
        line(choice.found.judged[one], TOUCHING_COLOUR, 1.2)
    for share, one in zip(np.linspace(0.0, 1.0, len(free)), free, strict=True):
        dear, cheap = np.array(DEAR_COLOUR), np.array(CHEAP_COLOUR)
        red, green, blue = (dear + share**3 * (cheap - dear)).astype(int).tolist()
        line(choice.found.judged[one], (red, green, blue), 1.8)
    line(choice.found.motion, TAKEN_COLOUR, 4.5)
    _body(figure, choice, at)
    figure.key(_rgb(TAKEN_COLOUR), f"chosen: cost {choice.found.cost_s:.2f} s")
    figure.key(_rgb(CHEAP_COLOUR), "cheap")
    figure.key(_rgb(DEAR_COLOUR), "dear")
    if len(free) < len(order):
        figure.key(_rgb(TOUCHING_COLOUR), "touches something")
    figure.key(_rgb(START_COLOUR), "rover, its front filled")
    if not choice.outline.is_circle:
        figure.key(_rgb(DISC_COLOUR), "discs that stand for it")
    figure.key(_rgb(OBSTACLE_COLOUR), "obstacle")
    figure.key(_rgb(UNSEEN_COLOUR), "not seen yet, or not looked at")
    with replaced(file) as new:
        figure.save(new, f"{title}: {len(order)} motions of {problem.horizon_s:g} s")


def _rgb(colour: Colour) -> tuple[float, float, float]:
    return colour[0] / 255.0, colour[1] / 255.0, colour[2] / 255.0


def _row(point: NedPoint) -> Places:
    return np.array([(point.north_m, point.east_m)])


def _show(figure: MapFigure, pixels: NDArray[np.uint8], where: Extent) -> None:
    """A picture of ground, its first row in the south."""
    figure.axes.imshow(pixels, origin="lower", extent=where, interpolation="nearest")


def _line(figure: MapFigure, places: Places, colour: Colour, width: float) -> None:
    figure.axes.plot(places[:, 1], places[:, 0], color=_rgb(colour), linewidth=width, solid_joinstyle="round")


def _dots(figure: MapFigure, places: Places, colour: Colour) -> None:
    figure.axes.plot(places[:, 1], places[:, 0], "o", color=_rgb(colour), markersize=10, zorder=5)


def _along(ground: Extent, place: Places, heading_rad: float) -> Places:
    """From a place along a heading, counted from east to north; long enough to be seen."""
    long_m = max(ground.width_m, ground.height_m) / ARROW_SHARE
    tip = place + long_m * np.array([(math.sin(heading_rad), math.cos(heading_rad))])
    return np.concatenate((place, tip))


def _arrow(figure: MapFigure, ends: Places, label: str) -> None:
    tail, tip = ((east_m, north_m) for north_m, east_m in ends.tolist())
    style = {"arrowstyle": "-|>,head_width=0.5,head_length=0.9", "color": _rgb(HEADING_COLOUR), "linewidth": 3.0}
    figure.axes.annotate("", tip, tail, arrowprops={**style, "shrinkA": 0, "shrinkB": 0}, zorder=7)
    figure.key(_rgb(HEADING_COLOUR), label)


def _rings(figure: MapFigure, places: Places, label: str) -> None:
    axes, colour = figure.axes, _rgb(TIGHT_COLOUR)
    axes.plot(
        places[:, 1], places[:, 0], "o", color=colour, fillstyle="none", markersize=16, markeredgewidth=2.5,
        zorder=6, label=label,
    )  # fmt: skip


def _shaded(grid: Grid, unseen: NDArray[np.bool_] | None = None) -> NDArray[np.uint8]:
    """Weights as greys, the first row in the south."""
    shade = 250.0 - 130.0 * np.clip(grid.weights, 0.0, 1.0)
    pixels = np.repeat(shade[:, :, None], 3, axis=2)
    if unseen is not None:
        pixels[unseen] *= UNSEEN_TINT
    pixels[grid.weights >= OBSTACLE] = OBSTACLE_COLOUR
    return pixels.astype(np.uint8)


def _places(candidate: Candidate) -> NDArray[np.float64]:
    if candidate.path is None:
        return np.empty((0, 2))
    curve = candidate.path.curve
    return candidate.path.cell_array.astype(np.float64) if curve is None else curve


def _rover(figure: MapFigure, why: Explanation) -> None:
    """A triangle that points along the rover's heading."""
    from matplotlib.patches import Polygon

    point, heading_rad = why.pose.point, why.pose.heading_rad
    size_m = max(max(figure.ground.width_m, figure.ground.height_m) / ROVER_SHARE, why.weighed.resolution_m)
    corners = [(size_m, 0.0), (0.7 * size_m, 2.5), (0.7 * size_m, -2.5)]
    places = [
        (point.east_m + far_m * math.sin(heading_rad + turn), point.north_m + far_m * math.cos(heading_rad + turn))
        for far_m, turn in corners
    ]
    figure.axes.add_patch(Polygon(places, facecolor=_rgb(START_COLOUR), zorder=6))


def _show_round(figure: MapFigure, ground: MotionGround, corner: NedPoint) -> None:
    """The ground round a place: obstacles, unseen, free."""
    height, width = ground.gap_m.shape
    pixels = np.full((height, width, 3), 250, np.uint8)
    pixels[ground.seen_m <= 0.0] = UNSEEN_COLOUR
    pixels[ground.gap_m <= 0.0] = OBSTACLE_COLOUR
    figure.axes.set_facecolor(_rgb(UNSEEN_COLOUR))
    east_m, north_m = corner.east_m + width * ground.cell_m, corner.north_m + height * ground.cell_m
    _show(figure, pixels, Extent(corner.east_m, east_m, corner.north_m, north_m))


def _body(figure: MapFigure, choice: MotionChoice, at: NedPoint) -> None:
    """The rover's outline with its front filled, and the discs by which its motions are judged."""
    from matplotlib.patches import Circle, Polygon

    body, outline, heading_rad = choice.problem.body, choice.outline, choice.problem.start.heading_rad
    ahead = np.array((math.cos(heading_rad), math.sin(heading_rad)))
    right = np.array((-math.sin(heading_rad), math.cos(heading_rad)))

    def place(ahead_m: float, right_m: float) -> tuple[float, float]:
        north_m, east_m = _row(at)[0] + ahead_m * ahead + right_m * right
        return float(east_m), float(north_m)

    for ahead_m in body.ahead_m.tolist():
        own = {"edgecolor": _rgb(START_COLOUR), "linewidth": 2.5} if outline.is_circle else DISC_LINE
        figure.axes.add_patch(Circle(place(ahead_m, 0.0), body.radius_m, fill=False, zorder=6, **own))
    half_m = outline.half_width_m
    if not outline.is_circle:
        corners = [(outline.front_m, half_m), (outline.front_m, -half_m), (-outline.rear_m, -half_m),
                   (-outline.rear_m, half_m)]  # fmt: skip
        ends = [place(*corner) for corner in corners]
        figure.axes.add_patch(Polygon(ends, fill=False, edgecolor=_rgb(START_COLOUR), linewidth=2.5, zorder=7))
    wide_m = 0.7 * half_m
    nose = [place(outline.front_m, 0.0), place(0.4 * outline.front_m, wide_m), place(0.4 * outline.front_m, -wide_m)]
    figure.axes.add_patch(Polygon(nose, facecolor=_rgb(START_COLOUR), edgecolor="none", zorder=7))
