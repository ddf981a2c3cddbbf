"""The map on the terminal: dots as characters with signs on them, and a legend below.

Two dots, one above the other, make one character: with colours an upper half block on a background, without colours a
sign per kind.

Nouns: legend.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import groupby
from operator import itemgetter
from typing import NamedTuple

from rich.console import Group
from rich.panel import Panel
from rich.text import Text

from companion.viewer.terminal.sketch import Dots, Kind, PlaceState, Sketch, Viewport, paint, viewport_for

LEGEND_SHARE = 3
"""The legend takes at most one of this many rows of the map."""

ARROWS = "↑↗→↘↓↙←↖"


class PlaceLook(NamedTuple):
    """How a place looks: its sign, its name in the legend, its style."""

    sign: str
    name: str
    style: str


PLACE_LOOKS = {
    PlaceState.PENDING: PlaceLook("◎", "target", "bold #ff5f5f"),
    PlaceState.REACHED: PlaceLook("✓", "reached", "bold #5fd75f"),
    PlaceState.LOST: PlaceLook("✗", "given up", "bold #ffaf00"),
    PlaceState.START: PlaceLook("⌂", "start", "bold #5fd75f"),
}
ROVER_STYLE = "bold #000000 on #ffd700"


@dataclass(frozen=True, slots=True)
class Look:
    """How a kind of dot looks: its colour, its sign without colours, and its name in the legend."""

    colour: str
    sign: str
    name: str


LOOKS = {
    Kind.NOTHING: Look("#14161a", " ", ""),
    Kind.SEEN: Look("#2c4034", "·", "seen free"),
    Kind.ROUGH: Look("#6b5a2e", ":", "rough"),
    Kind.SLIPPERY: Look("#2d5f8a", "~", "slippery"),
    Kind.OPEN_DOOR: Look("#8a5a1e", "'", "door open"),
    Kind.TRACK: Look("#5fafff", "•", "way"),
    Kind.PATH: Look("#ffd75f", "*", "path"),
    Kind.HIDDEN: Look("#4a4d55", "░", "not seen yet"),
    Kind.CLOSED: Look("#8f6d45", "▒", "fence, known"),
    Kind.BLACK: Look("#800080", "b", "black"),
    Kind.GLASS: Look("#00afaf", "g", "glass"),
    Kind.DOOR: Look("#ff8700", "+", "door closed"),
    Kind.WALL: Look("#d7d7d7", "█", "obstacle"),
    Kind.MOVER: Look("#d75fd7", "o", "moving"),
}


def map_panel(title: str, sketch: Sketch, columns: int, rows: int, *, colour: bool) -> Panel:
    """The map with its legend below, with this many characters inside the border."""
    viewport = viewport_for(sketch, 2 * rows, columns)
    dots = paint(sketch, viewport)
    legend = _legend(sketch, viewport, dots, columns, colour=colour)[: max(1, rows // LEGEND_SHARE)]
    if len(legend) > 1:  # its further lines are taken from the map
        viewport = viewport_for(sketch, 2 * (rows + 1 - len(legend)), columns)
        dots = paint(sketch, viewport)
    lines = map_lines(sketch, viewport, dots, colour=colour)
    heading = Text(f"{title}{_size(sketch)}", overflow="ellipsis", no_wrap=True)
    return Panel(Group(*lines, *legend), title=heading, title_align="left", border_style="dim", padding=0)


def _size(sketch: Sketch) -> str:
    """The world's size as text; empty for open ground."""
    if sketch.bounds_m is None:
        return ""
    south_m, west_m, north_m, east_m = sketch.bounds_m
    return f": {east_m - west_m:.0f} x {north_m - south_m:.0f} m"


def map_lines(sketch: Sketch, viewport: Viewport, dots: Dots, *, colour: bool) -> list[Text]:
    """The map, one text per row of characters; ``viewport.rows`` is even."""
    marks = _marks(sketch, viewport)
    lines = []
    for row in range(0, viewport.rows, 2):
        pairs = zip(dots[row].tolist(), dots[row + 1].tolist(), strict=True)
        characters = [_character(Kind(upper), Kind(lower), colour=colour) for upper, lower in pairs]
        for column, (sign, style) in marks.get(row // 2, {}).items():
            # A mark keeps the background of its dot, unless that is a line's, or its style has its own.
            kind = Kind(int(dots[row, column]))
            behind = LOOKS[Kind.NOTHING if kind in (Kind.TRACK, Kind.PATH) else kind].colour
            ground = "" if " on " in style or not colour else f" on {behind}"
            characters[column] = (sign, style + ground)
        line = Text(no_wrap=True, overflow="crop")
        for style, run in groupby(characters, itemgetter(1)):
            line.append("".join(sign for sign, _ in run), style)
        lines.append(line)
    return lines


def _character(upper: Kind, lower: Kind, *, colour: bool) -> tuple[str, str]:
    """Two dots as one character and its style."""
    if colour:
        if upper == lower:
            return " ", f"on {LOOKS[upper].colour}"
        return "▀", f"{LOOKS[upper].colour} on {LOOKS[lower].colour}"
    if Kind.WALL in (upper, lower) and upper != lower and Kind.MOVER not in (upper, lower):
        return ("▀" if upper == Kind.WALL else "▄"), ""
    return LOOKS[max(upper, lower)].sign, ""


def _marks(sketch: Sketch, viewport: Viewport) -> dict[int, dict[int, tuple[str, str]]]:
    """Signs of places and rover with their styles, by row and column of characters; the rover is on top."""
    marks: dict[int, dict[int, tuple[str, str]]] = {}
    signs = [(one.north_m, one.east_m, *PLACE_LOOKS[one.state][::2]) for one in sketch.places]
    if sketch.rover is not None:
        signs.append((sketch.rover.north_m, sketch.rover.east_m, arrow(sketch.heading_rad), ROVER_STYLE))
    for north_m, east_m, sign, style in signs:
        where = viewport.dot(north_m, east_m)
        if where is not None:
            marks.setdefault(where[0] // 2, {})[where[1]] = (sign, style)
    return marks


def arrow(heading_rad: float) -> str:
    """The arrow nearest to a heading, clockwise from north."""
    return ARROWS[round(heading_rad / (math.pi / 4.0)) % 8]


def _legend(sketch: Sketch, viewport: Viewport, dots: Dots, columns: int, *, colour: bool) -> list[Text]:
    """Meaning of the signs and colours on the map, the most important first."""
    entries = [Text(f"{look.sign} {look.name}", no_wrap=True) for look in _places_shown(sketch, viewport)]
    there = set(dots.ravel().tolist())
    for kind, look in sorted(LOOKS.items(), reverse=True):
        if look.name and kind in there:
            half = "▀▄" if kind is Kind.WALL and not colour else ""
            entry = Text(no_wrap=True).append("■ " if colour else f"{look.sign}{half} ", look.colour if colour else "")
            entries.append(entry.append(look.name))
    lines: list[Text] = []
    for entry in entries:
        if lines and len(lines[-1]) + 2 + len(entry) <= columns:
            lines[-1].append("  ").append_text(entry)
        else:
            entry.truncate(columns, overflow="ellipsis")
            lines.append(entry)
    return lines or [Text()]


def _places_shown(sketch: Sketch, viewport: Viewport) -> list[PlaceLook]:
    """The looks of the places in sight."""
    there = {one.state for one in sketch.places if viewport.dot(one.north_m, one.east_m) is not None}
    return [look for state, look in PLACE_LOOKS.items() if state in there]
