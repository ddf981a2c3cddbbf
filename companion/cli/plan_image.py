"""A picture of a map and a path over it, north up."""

from __future__ import annotations

from pathlib import Path as FilePath

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from companion.cli.inputs import written
from companion.core.grid import OBSTACLE, Cell, Grid
from companion.planning.problem import Path

SIDE_PIXELS = 1000
"""Small maps are enlarged, by a whole factor, to about so many pixels on the longer side."""

OBSTACLE_COLOUR = (40, 44, 52)
PATH_COLOUR, CURVE_COLOUR = (214, 60, 50), (40, 110, 200)
START_COLOUR, TARGET_COLOUR = (30, 150, 80), (240, 140, 20)


def save_image(file: FilePath, grid: Grid, start: Cell, target: Cell, path: Path | None) -> None:
    """Draw and write a picture; the suffix tells the format. Raises OutputError."""
    picture = draw(grid, start, target, path)
    with written(file):
        picture.save(file)


def draw(grid: Grid, start: Cell, target: Cell, path: Path | None) -> Image.Image:
    """Map in greys (costly ground is darker), path red, its curve blue, start green and target orange; a legend below."""
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


def _with_legend(picture: Image.Image, path: Path | None) -> Image.Image:
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
