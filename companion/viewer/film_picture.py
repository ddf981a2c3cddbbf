"""The film picture: one moment of a report, drawn: map, track, path, rover, and what it does as one line.

Nouns: film picture.
"""

from __future__ import annotations

import base64
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from companion.executive.mission_progress import TargetStatus
from companion.viewer.film_names import film_names
from companion.viewer.map_colours import CELL_COLOURS, UNKNOWN_COLOUR
from companion.viewer.map_tiles import TILE, cells_of
from companion.viewer.tile_kernels import UNKNOWN
from companion.viewer.wire import tiles_in

SIDE_PIXELS = 640
"""Of the longer side of the map."""
LEAST_PIXELS = 240
"""Of the shorter one, so that the line of text has room."""
MARGIN_M = 4.0
FINER = 2
"""Drawn so many times larger, so that lines are smooth."""
BAR_PIXELS, TEXT_PIXELS, NAME_PIXELS = 30, 15, 13
LEAST_ROVER_PIXELS = 7.0
ARROW = ((12.0, 0.0), (-8.0, 8.0), (-4.0, 0.0), (-8.0, -8.0))
"""Ahead and to the right, in pixels."""
INK, HALO, ROVER, PATH = (13, 19, 25), (255, 255, 255), (204, 66, 0), (204, 66, 0)
TRACK, BORDER, GOAL, REACHED = (31, 122, 148), (142, 42, 107), (224, 140, 0), (0, 102, 90)
CONTACT, MOVER = (168, 32, 13), (106, 63, 192)
MARKS: dict[str, tuple[int, int, int]] = {TargetStatus.REACHED: REACHED, TargetStatus.UNREACHABLE: CONTACT}
"""Colours of targets by what has become of them; GOAL for all others."""
STATES = {
    "driving": ((10, 86, 163), HALO),
    "waiting": ((255, 197, 49), (22, 16, 0)),
    "stopped": ((168, 31, 11), HALO),
}
OTHERWISE = ((51, 65, 78), HALO)
"""Background and text of the line, by what the rover does."""
FIXED = (
    *(colour for pair in (*STATES.values(), OTHERWISE) for colour in pair),
    *(INK, ROVER, TRACK, BORDER, GOAL, REACHED, CONTACT, MOVER, UNKNOWN_COLOUR),
)
"""Colours that a palette must not lose."""
Json = dict[str, Any]
Places = Sequence[Sequence[float]]
Point = tuple[float, float]
Colour = tuple[int, int, int]


@dataclass(frozen=True, slots=True)
class Section:
    """The cells of the map that a film shows, and how large they are drawn. ``width``, ``height``: of the picture."""

    x0: int
    y0: int
    x1: int
    y1: int
    width: int
    height: int

    @property
    def scale(self) -> float:
        """Pixels to a cell."""
        return self.width / (self.x1 - self.x0)


def section_of(scene: Json, places: Iterable[Sequence[float]]) -> Section:
    """Round these places [north, east], of which there is one at least; all cells are whole."""
    ground = scene["map"]
    cell_m = ground["cell_m"]
    cells = np.array([((e - ground["west_m"]) / cell_m, (n - ground["south_m"]) / cell_m) for n, e in places])
    margin = MARGIN_M / cell_m
    low, high = np.floor(cells.min(axis=0) - margin), np.ceil(cells.max(axis=0) + margin)
    longer = float((high - low).max())
    short = np.maximum(0.0, longer * LEAST_PIXELS / SIDE_PIXELS - (high - low))
    low, high = low - np.ceil(short / 2.0), high + np.ceil(short / 2.0)
    width, height = (high - low).astype(int).tolist()
    scale = SIDE_PIXELS / max(width, height)
    # Encoders of films want even numbers.
    across, down = (2 * max(1, round(side * scale / 2.0)) for side in (width, height))
    return Section(int(low[0]), int(low[1]), int(high[0]), int(high[1]), across, down)


class FilmPicture:
    """Draws moments of one report, in the order of time."""

    def __init__(self, scene: Json, section: Section) -> None:
        self._scene = scene
        self._section = section
        shape = (section.y1 - section.y0, section.x1 - section.x0)
        self._cells: NDArray[np.uint8] = np.full(shape, UNKNOWN, np.uint8)
        self._ground: Image.Image | None = None
        self._shift: tuple[int, int] | None = (0, 0)
        """Where the map's cells begin, counted from those of the scene's map."""
        self._font, self._small = (ImageFont.truetype(_font_file(), size) for size in (TEXT_PIXELS, NAME_PIXELS))

    @property
    def size(self) -> tuple[int, int]:
        """Of each picture, in pixels."""
        return self._section.width, self._section.height + BAR_PIXELS

    def begin_map(self, ground: Json | None) -> None:
        """From now on the tiles are those of another map. One with cells of another size is not shown."""
        self._cells.fill(UNKNOWN)
        self._ground, scene = None, self._scene["map"]
        self._shift = None
        if ground is not None and ground["cell_m"] == scene["cell_m"]:
            cell_m = scene["cell_m"]
            self._shift = (
                round((ground["west_m"] - scene["west_m"]) / cell_m),
                round((ground["south_m"] - scene["south_m"]) / cell_m),
            )

    def take_tiles(self, message: str) -> None:
        """Tiles of the map that have changed, as the report has them."""
        if self._shift is None:
            return
        across, up = self._shift[0] - self._section.x0, self._shift[1] - self._section.y0
        for (column, row), runs in tiles_in(base64.b64decode(message)):
            tile = cells_of(runs).reshape(TILE, TILE)
            x, y = column * TILE + across, row * TILE + up
            height, width = self._cells.shape
            x0, x1, y0, y1 = max(x, 0), min(x + TILE, width), max(y, 0), min(y + TILE, height)
            if x0 < x1 and y0 < y1:
                self._cells[y0:y1, x0:x1] = tile[y0 - y : y1 - y, x0 - x : x1 - x]
                self._ground = None

    def drawn(self, frame: Json, track: Places, contacts: Iterable[Json]) -> Image.Image:
        """The picture of a frame. ``track``: where the rover was until then; ``contacts``: those until then."""
        section = self._section
        if self._ground is None:
            self._ground = self._drawn_ground()
        fine = self._ground.copy()
        pen = ImageDraw.Draw(fine)
        for border in self._scene["borders"]:
            self._line(pen, [*border["corners"], *border["corners"][:1]], BORDER, 2.0)
        self._line(pen, track, TRACK, 2.5)
        if frame["pose"] is not None:
            self._line(pen, _ahead(frame["pose"][:2], frame["path"]), PATH, 1.5)
        self._targets(pen, frame["statuses"])
        for mover in frame["movers"]:
            self._disc(pen, mover["place"], self._pixels(mover["radius_m"]), MOVER)
        if frame["pose"] is not None:
            self._rover(pen, frame["pose"])
        for contact in contacts:
            self._cross(pen, contact["place"])
        picture = Image.new("RGB", self.size, UNKNOWN_COLOUR)
        picture.paste(fine.reduce(FINER), (0, 0))
        self._names(ImageDraw.Draw(picture))
        self._bar(ImageDraw.Draw(picture), frame, section.height)
        return picture

    def _drawn_ground(self) -> Image.Image:
        size = (FINER * self._section.width, FINER * self._section.height)
        picture = Image.fromarray(CELL_COLOURS[self._cells[::-1]])
        # Thin obstacles must not be lost where cells are smaller than pixels.
        small = size[0] < picture.width
        return picture.resize(size, Image.Resampling.BOX if small else Image.Resampling.NEAREST)

    def _at(self, place: Sequence[float]) -> Point:
        """A place [north, east] in pixels of the finer picture."""
        ground, section = self._scene["map"], self._section
        x = (place[1] - ground["west_m"]) / ground["cell_m"] - section.x0
        y = (place[0] - ground["south_m"]) / ground["cell_m"] - section.y0
        across = FINER * section.width / (section.x1 - section.x0)
        down = FINER * section.height / (section.y1 - section.y0)
        return x * across, FINER * section.height - y * down

    def _pixels(self, length_m: float) -> float:
        """A length in pixels of the picture."""
        return float(length_m / self._scene["map"]["cell_m"] * self._section.scale)

    def _line(self, pen: ImageDraw.ImageDraw, places: Places, colour: Colour, width: float) -> None:
        if len(places) > 1:
            pen.line([self._at(place) for place in places], colour, round(FINER * width), "curve")

    def _disc(self, pen: ImageDraw.ImageDraw, place: Sequence[float], radius: float, colour: Colour) -> None:
        (x, y), r = self._at(place), FINER * radius
        pen.ellipse((x - r, y - r, x + r, y + r), colour, HALO, FINER)

    def _cross(
        self,
        pen: ImageDraw.ImageDraw,
        place: Sequence[float],
        radius: float = 7.0,
        strokes: Sequence[tuple[Colour, int]] = ((HALO, 5), (CONTACT, 3)),
    ) -> None:
        """``radius``, and ``strokes``: colours and widths, the lowest first; in pixels of the picture."""
        (x, y), r = self._at(place), FINER * radius
        for colour, width in strokes:
            for way in (1.0, -1.0):
                pen.line([(x - r, y - way * r), (x + r, y + way * r)], colour, FINER * width)

    def _targets(self, pen: ImageDraw.ImageDraw, statuses: Sequence[str]) -> None:
        for number, target in enumerate(self._scene["targets"]):
            status = statuses[number] if number < len(statuses) else ""
            self._disc(pen, target["place"], 6.0, MARKS.get(status, GOAL))
            if status == TargetStatus.UNREACHABLE:
                self._cross(pen, target["place"], 3.0, ((HALO, 2),))

    def _names(self, pen: ImageDraw.ImageDraw) -> None:
        """The targets' names."""
        targets = [
            (target["name"], *(value / FINER for value in self._at(target["place"])))
            for target in self._scene["targets"]
        ]
        size = (self._section.width, self._section.height)
        for name in film_names(targets, lambda text: pen.textlength(text, self._small), size):
            pen.text((name.x, name.y), name.text, INK, self._small, anchor="mm", stroke_width=2, stroke_fill=HALO)

    def _rover(self, pen: ImageDraw.ImageDraw, pose: Sequence[float]) -> None:
        """Its outline, or an arrow where that would be too small to see."""
        (x, y), heading_rad = self._at(pose), pose[2]
        outline = [(self._pixels(ahead), self._pixels(right)) for ahead, right in self._scene["rover"]["outline"]]
        longest = max(math.hypot(*corner) for corner in outline)
        if longest < LEAST_ROVER_PIXELS:
            self._body(pen, (x, y), heading_rad, ARROW)
            return
        self._body(pen, (x, y), heading_rad, outline)
        pen.line([(x, y), self._turned((x, y), heading_rad, (longest, 0.0))], HALO, 2 * FINER)

    def _body(self, pen: ImageDraw.ImageDraw, at: Point, heading_rad: float, outline: Iterable[Point]) -> None:
        corners = [self._turned(at, heading_rad, corner) for corner in outline]
        pen.polygon(corners, ROVER, HALO, FINER)

    def _turned(self, at: Point, heading_rad: float, corner: Point) -> Point:
        """A corner [ahead, right] in pixels, at a place and a heading."""
        ahead, right = FINER * corner[0], FINER * corner[1]
        sin, cos = math.sin(heading_rad), math.cos(heading_rad)
        return at[0] + ahead * sin + right * cos, at[1] - ahead * cos + right * sin

    def _bar(self, pen: ImageDraw.ImageDraw, frame: Json, top: int) -> None:
        """What the rover does, its speed, and the time since the start."""
        back, ink = STATES.get(frame["state"], OTHERWISE)
        width = self._section.width
        pen.rectangle((0, top, width, top + BAR_PIXELS), back)
        whole_s = int(frame["t"])
        speed = "-" if frame["speed"] is None else f"{abs(frame['speed']):.1f}"
        figures = f"{speed} m/s   {whole_s // 60}:{whole_s % 60:02d}"
        middle = top + BAR_PIXELS / 2.0
        pen.text((width - 10, middle), figures, ink, self._font, anchor="rm")
        room = width - 30 - pen.textlength(figures, self._font)
        line = frame["line"][:1].upper() + frame["line"][1:]
        if pen.textlength(line, self._font) > room:
            while line and pen.textlength(f"{line}...", self._font) > room:
                line = line[:-1]
            line = f"{line.rstrip()}..."
        pen.text((10, middle), line, ink, self._font, anchor="lm")


def _font_file() -> Path:
    """A font with the letters of most of Europe; Pillow's own has those of English."""
    found = find_spec("matplotlib")
    assert found is not None and found.origin is not None
    return Path(found.origin).parent / "mpl-data" / "fonts" / "ttf" / "DejaVuSans.ttf"


def _ahead(rover: Sequence[float], path: Places) -> Places:
    """The path from the rover on: a report has it only now and then, and the rover has gone on since."""
    if not path:
        return []
    far = [math.hypot(place[0] - rover[0], place[1] - rover[1]) for place in path]
    return [rover, *path[far.index(min(far)) + 1 :]]
