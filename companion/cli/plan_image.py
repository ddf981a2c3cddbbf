"""A picture of a map and a path over it, north up."""

from __future__ import annotations

from pathlib import Path as FilePath

import numpy as np
from PIL import Image, ImageDraw

from companion.grid import OBSTACLE, Cell, Grid
from companion.planning.problem import Path

SIDE_PIXELS = 1000
"""Small maps are enlarged, by a whole factor, to about so many pixels on the longer side."""

OBSTACLE_COLOUR = (40, 44, 52)
PATH_COLOUR, CURVE_COLOUR = (214, 60, 50), (40, 110, 200)
START_COLOUR, TARGET_COLOUR = (30, 150, 80), (240, 140, 20)


class ImageError(Exception):
    """A picture that cannot be written; the text is one line with file and reason."""


def save_image(file: FilePath, grid: Grid, start: Cell, target: Cell, path: Path | None) -> None:
    """Draw and write a picture; the suffix tells the format. Raises ImageError."""
    picture = draw(grid, start, target, path)
    try:
        picture.save(file)
    except OSError as error:
        raise ImageError(f"{file}: cannot be written: {error.strerror or error}") from error
    except ValueError as error:
        raise ImageError(f"{file}: not a suffix of a picture format, use .png") from error


def draw(grid: Grid, start: Cell, target: Cell, path: Path | None) -> Image.Image:
    """Map in greys (costly ground is darker), path red, its curve blue, start green and target orange."""
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
    return picture
