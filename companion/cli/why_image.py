"""A picture of one decision: the map as it was known, the ways that were weighed with their costs, and the one taken. North up."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from companion.cli.inputs import OutputError
from companion.cli.plan_image import OBSTACLE_COLOUR, SIDE_PIXELS, START_COLOUR, TARGET_COLOUR
from companion.core.grid import OBSTACLE
from companion.replay.explain import Candidate, Explanation, cost_text

UNSEEN_TINT = np.array([0.86, 0.9, 1.0])
UNSEEN_COLOUR = (160, 167, 185)
FREE_COLOUR = (185, 185, 185)
"""Of fields with the base weight."""
TAKEN_COLOUR, PAST_COLOUR = (214, 60, 50), (150, 120, 90)
CANDIDATE_COLOURS = ((40, 110, 200), (130, 60, 170), (20, 140, 140), (120, 200, 40), (240, 90, 190))
Line = NDArray[np.float64]
Entry = tuple[str, tuple[int, int, int]]


def save_why(file: Path, why: Explanation) -> None:
    """Draw and write the picture; the suffix tells the format. Raises OutputError."""
    try:
        draw(why).save(file)
    except OSError as error:
        raise OutputError(f"{file}: cannot be written: {error.strerror or error}") from error


def draw(why: Explanation) -> Image.Image:
    """Greys are weights as they were searched over (darker is dearer), bluish where nothing had been seen."""
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
    entries.append(("seen free (what is darker is dearer)", FREE_COLOUR))
    entries.append(("not seen yet (what is darker is dearer)", UNSEEN_COLOUR))
    line(np.array(why.state.past, np.float64), PAST_COLOUR, thick)
    # The one taken goes under the candidates and is broader, so that both are seen.
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
    """A triangle that points where the rover does."""
    grid, pose = why.weighed, why.pose
    x = (pose.east_m - grid.south_west.east_m) / grid.resolution_m * scale
    y = (grid.height - (pose.north_m - grid.south_west.north_m) / grid.resolution_m) * scale
    size = max(SIDE_PIXELS / 80.0, 1.2 * scale)
    corners = [(size, 0.0), (0.7 * size, 2.5), (0.7 * size, -2.5)]
    pen.polygon(
        [(x + r * math.sin(pose.heading_rad + turn), y - r * math.cos(pose.heading_rad + turn)) for r, turn in corners],
        START_COLOUR,
    )


def _page(picture: Image.Image, title: str, entries: list[Entry]) -> Image.Image:
    """The picture with a title above and a line for each colour below."""
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
