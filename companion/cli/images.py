"""Images of plans (``plan --image``) and of decisions (``replay --why``), north up."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from companion.cli.inputs import OutputError, written
from companion.control.motion_controller import MotionChoice
from companion.control.motion_kernels import BLOCKED_S, MotionGround, MotionProblem, way_of
from companion.core.grid import OBSTACLE, Cell, Grid
from companion.planning.problem import Path as GridPath
from companion.replay.explain import Candidate, Explanation, cost_text

SIDE_PIXELS = 1000
"""Small maps are enlarged, by a whole factor, to about this many pixels on the longer side."""

OBSTACLE_COLOUR = (40, 44, 52)
PATH_COLOUR, CURVE_COLOUR = (214, 60, 50), (40, 110, 200)
START_COLOUR, TARGET_COLOUR = (30, 150, 80), (240, 140, 20)


def save_plan(file: Path, grid: Grid, start: Cell, target: Cell, path: GridPath | None) -> None:
    """Write an image of a path; the suffix decides the format. Raises OutputError."""
    picture = draw_plan(grid, start, target, path)
    with written(file):
        picture.save(file)


def draw_plan(grid: Grid, start: Cell, target: Cell, path: GridPath | None) -> Image.Image:
    """The map in greys (darker is costlier), path red, its curve blue, start green, target orange; a legend below."""
    scale = max(1, SIDE_PIXELS // max(grid.width, grid.height))
    shade = (250.0 - 130.0 * np.clip(grid.weights, 0.0, 1.0)).astype(np.uint8)
    pixels = np.repeat(shade[:, :, None], 3, axis=2)
    pixels[grid.weights >= OBSTACLE] = OBSTACLE_COLOUR
    picture = Image.fromarray(np.ascontiguousarray(pixels[::-1]))
    picture = picture.resize((grid.width * scale, grid.height * scale), Image.Resampling.NEAREST)
    pen = ImageDraw.Draw(picture)

    def at(x: float, y: float) -> tuple[float, float]:
        """The pixel in the middle of a place in fields."""
        return (x + 0.5) * scale - 0.5, (grid.height - 0.5 - y) * scale - 0.5

    thick = max(1, scale // 4)
    if path is not None and len(path.cells) > 1:
        pen.line([at(cell.x, cell.y) for cell in path.cells], PATH_COLOUR, thick, "curve")
    if path is not None and path.curve is not None:
        pen.line([at(x, y) for x, y in path.curve.tolist()], CURVE_COLOUR, max(1, thick // 2), "curve")
    radius = max(SIDE_PIXELS / 200.0, scale * 0.6)
    for cell, colour in ((start, START_COLOUR), (target, TARGET_COLOUR)):
        x, y = at(cell.x, cell.y)
        pen.ellipse((x - radius, y - radius, x + radius, y + radius), colour)
    return _with_legend(picture, path)


def _with_legend(picture: Image.Image, path: GridPath | None) -> Image.Image:
    """The picture with a strip below that says what the colours mean."""
    entries = [("start", START_COLOUR), ("target", TARGET_COLOUR), ("obstacle", OBSTACLE_COLOUR)]
    if path is not None:
        entries.append(("path, field by field", PATH_COLOUR))
        if path.curve is not None:
            entries.append(("its smooth curve", CURVE_COLOUR))
    size = max(picture.width // 60, 10)
    font = ImageFont.load_default(size)
    page = Image.new("RGB", (picture.width, picture.height + 2 * size), "white")
    page.paste(picture)
    pen, x, y = ImageDraw.Draw(page), size // 2, picture.height + size // 2
    for name, colour in entries:
        pen.rectangle((x, y, x + size, y + size), colour)
        pen.text((x + 1.5 * size, y + size / 2), name, (20, 20, 20), font, anchor="lm")
        x += int(2.5 * size + pen.textlength(name, font))
    return page


UNSEEN_TINT = np.array([0.86, 0.9, 1.0])
UNSEEN_COLOUR = (160, 167, 185)
FREE_COLOUR = (185, 185, 185)
"""Of fields with the base weight."""
TAKEN_COLOUR, PAST_COLOUR = (214, 60, 50), (150, 120, 90)
CANDIDATE_COLOURS = ((40, 110, 200), (130, 60, 170), (20, 140, 140), (120, 200, 40), (240, 90, 190))
Line = NDArray[np.float64]
Entry = tuple[str, tuple[int, int, int]]


def save_decision(file: Path, why: Explanation) -> None:
    """Write an image of a decision; the suffix decides the format. Raises OutputError."""
    try:
        draw_decision(why).save(file)
    except OSError as error:
        raise OutputError(f"{file}: cannot be written: {error.strerror or error}") from error


def draw_decision(why: Explanation) -> Image.Image:
    """The searched weights in greys (darker is costlier), bluish where unseen; over them candidates and decision."""
    grid = why.weighed
    scale = max(1, SIDE_PIXELS // max(grid.width, grid.height))
    picture = _ground(why, scale)
    pen = ImageDraw.Draw(picture)
    thick = max(2, scale // 4)

    def line(places: Line, colour: tuple[int, int, int], width: int) -> None:
        if len(places) > 1:
            at = [((x + 0.5) * scale - 0.5, (grid.height - 0.5 - y) * scale - 0.5) for x, y in places.tolist()]
            pen.line(at, colour, width, "curve")

    entries: list[Entry] = [("past path", PAST_COLOUR), ("target", TARGET_COLOUR), ("obstacle", OBSTACLE_COLOUR)]
    entries.append(("seen free (darker is costlier)", FREE_COLOUR))
    entries.append(("not seen yet (darker is costlier)", UNSEEN_COLOUR))
    line(np.array(why.state.past, np.float64), PAST_COLOUR, thick)
    # The chosen path is drawn below the candidates and wider, so that both can be seen.
    taken = np.array(why.decision.path, np.float64).reshape(-1, 2)
    line(taken, TAKEN_COLOUR, 3 * thick)
    entries.append((f"taken: {why.decision.action}, part {why.decision.part}, {why.decision.reason}", TAKEN_COLOUR))
    for number, candidate in enumerate(why.candidates):
        colour = CANDIDATE_COLOURS[number % len(CANDIDATE_COLOURS)]
        line(_places(candidate), colour, thick)
        entries.append((f"{candidate.name}: {cost_text(candidate)}; {candidate.note}", colour))
    goal = why.state.target
    _dot(pen, ((goal.x + 0.5) * scale, (grid.height - 0.5 - goal.y) * scale), scale, TARGET_COLOUR)
    _rover(pen, why, scale)
    entries.append(("rover", START_COLOUR))
    title = f"decision {why.number} at {why.time_s:.2f} s, heading for {why.target}"
    return _page(picture, title, entries)


def _ground(why: Explanation, scale: int) -> Image.Image:
    weights = why.weighed.weights
    shade = 250.0 - 130.0 * np.clip(weights, 0.0, 1.0)
    pixels = np.repeat(shade[:, :, None], 3, axis=2)
    pixels[~why.known] *= UNSEEN_TINT
    pixels[weights >= OBSTACLE] = OBSTACLE_COLOUR
    picture = Image.fromarray(np.ascontiguousarray(pixels.astype(np.uint8)[::-1]))
    return picture.resize((weights.shape[1] * scale, weights.shape[0] * scale), Image.Resampling.NEAREST)


def _places(candidate: Candidate) -> Line:
    if candidate.path is None:
        return np.empty((0, 2))
    curve = candidate.path.curve
    return candidate.path.cell_array.astype(np.float64) if curve is None else curve


def _dot(pen: ImageDraw.ImageDraw, at: tuple[float, float], scale: int, colour: tuple[int, int, int]) -> None:
    radius = max(SIDE_PIXELS / 200.0, scale * 0.6)
    pen.ellipse((at[0] - radius, at[1] - radius, at[0] + radius, at[1] + radius), colour)


def _rover(pen: ImageDraw.ImageDraw, why: Explanation, scale: int) -> None:
    """A triangle that points along the rover's heading."""
    grid, pose = why.weighed, why.pose
    column, row = grid.in_fields(pose.point)
    x, y = (column + 0.5) * scale, (grid.height - row - 0.5) * scale
    size = max(SIDE_PIXELS / 80.0, 1.2 * scale)
    corners = [(size, 0.0), (0.7 * size, 2.5), (0.7 * size, -2.5)]
    pen.polygon(
        [(x + r * math.sin(pose.heading_rad + turn), y - r * math.cos(pose.heading_rad + turn)) for r, turn in corners],
        START_COLOUR,
    )


MOTIONS_M = 6.0
"""So far round the rover the picture of motions reaches."""
TOUCHING_COLOUR, CHEAP_COLOUR, DEAR_COLOUR = (235, 160, 155), (40, 110, 200), (190, 215, 240)


def save_motions(file: Path, choice: MotionChoice, title: str) -> None:
    """Write an image of the motions that were judged; the suffix decides the format. Raises OutputError."""
    try:
        draw_motions(choice, title).save(file)
    except OSError as error:
        raise OutputError(f"{file}: cannot be written: {error.strerror or error}") from error


def draw_motions(choice: MotionChoice, title: str) -> Image.Image:
    """The ground round the rover; the motions from dear to cheap, those that touch something below; the chosen one."""
    problem, costs_s = choice.problem, choice.found.costs_s
    ground, start = problem.ground, problem.start
    scale = SIDE_PIXELS / (2.0 * MOTIONS_M)
    picture = _round(ground, start.x_m, start.y_m)
    pen = ImageDraw.Draw(picture)

    def line(motion: Line, colour: tuple[int, int, int], width: int) -> None:
        way = way_of(motion, problem) - (start.x_m, start.y_m)
        pen.line([(SIDE_PIXELS / 2 + x * scale, SIDE_PIXELS / 2 - y * scale) for x, y in way.tolist()], colour, width)

    order = np.argsort(costs_s)[::-1]
    free = order[costs_s[order] < BLOCKED_S]
    for one in order[costs_s[order] >= BLOCKED_S]:
        line(choice.found.judged[one], TOUCHING_COLOUR, 2)
    for share, one in zip(np.linspace(0.0, 1.0, len(free)), free, strict=True):
        dear, cheap = np.array(DEAR_COLOUR), np.array(CHEAP_COLOUR)
        red, green, blue = (dear + share**3 * (cheap - dear)).astype(int).tolist()
        line(choice.found.judged[one], (red, green, blue), 3)
    line(choice.found.motion, TAKEN_COLOUR, 7)
    _body(pen, problem, scale)
    entries: list[Entry] = [(f"chosen: cost {choice.found.cost_s:.2f} s", TAKEN_COLOUR), ("cheap", CHEAP_COLOUR)]
    entries += [("dear", DEAR_COLOUR), ("touches something", TOUCHING_COLOUR), ("rover", START_COLOUR)]
    entries += [("obstacle", OBSTACLE_COLOUR), ("not seen yet, or off the ground looked at", UNSEEN_COLOUR)]
    return _page(picture, f"{title}: {2.0 * MOTIONS_M:g} m, {len(order)} motions of {problem.horizon_s:g} s", entries)


def _round(ground: MotionGround, x_m: float, y_m: float) -> Image.Image:
    """The ground round a place, north up: obstacles, unseen, free."""
    height, width = ground.gap_m.shape
    side = np.linspace(-MOTIONS_M, MOTIONS_M, SIDE_PIXELS, endpoint=False) + MOTIONS_M / SIDE_PIXELS
    columns = np.floor((x_m + side) / ground.cell_m).astype(int)
    rows = np.floor((y_m + side[::-1]) / ground.cell_m).astype(int)
    inside = ((rows >= 0) & (rows < height))[:, None] & ((columns >= 0) & (columns < width))[None, :]
    at = np.ix_(np.clip(rows, 0, height - 1), np.clip(columns, 0, width - 1))
    pixels = np.full((SIDE_PIXELS, SIDE_PIXELS, 3), 250, np.uint8)
    pixels[(ground.seen_m[at] <= 0.0) | ~inside] = UNSEEN_COLOUR
    pixels[(ground.gap_m[at] <= 0.0) & inside] = OBSTACLE_COLOUR
    return Image.fromarray(pixels)


def _body(pen: ImageDraw.ImageDraw, problem: MotionProblem, scale: float) -> None:
    """The discs that cover the rover's outline, and where it points."""
    body, heading_rad = problem.body, problem.start.heading_rad
    radius = body.radius_m * scale
    for ahead_m in body.ahead_m.tolist():
        x = SIDE_PIXELS / 2 + ahead_m * math.sin(heading_rad) * scale
        y = SIDE_PIXELS / 2 - ahead_m * math.cos(heading_rad) * scale
        pen.ellipse((x - radius, y - radius, x + radius, y + radius), None, START_COLOUR, 3)
    nose = body.around_m * scale
    tip = (SIDE_PIXELS / 2 + nose * math.sin(heading_rad), SIDE_PIXELS / 2 - nose * math.cos(heading_rad))
    pen.line([(SIDE_PIXELS / 2, SIDE_PIXELS / 2), tip], START_COLOUR, 5)


def _page(picture: Image.Image, title: str, entries: list[Entry]) -> Image.Image:
    """The image with a title above and a legend below."""
    size = max(SIDE_PIXELS // 65, 12)
    font = ImageFont.load_default(size)
    height = picture.height + int(1.5 * size) * (len(entries) + 1) + size
    width = max(
        picture.width, *(int(font.getlength(text)) + 4 * size for text in (title, *(name for name, _ in entries)))
    )
    page = Image.new("RGB", (width, height), "white")
    pen = ImageDraw.Draw(page)
    pen.text((size, size), title, (20, 20, 20), font, anchor="lm")
    page.paste(picture, (0, 2 * size))
    y = picture.height + 2 * size + size // 2
    for name, colour in entries:
        pen.rectangle((size, y, 2 * size, y + size), colour)
        pen.text((2.5 * size, y + size / 2), name, (20, 20, 20), font, anchor="lm")
        y += int(1.5 * size)
    return page
