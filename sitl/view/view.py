"""The screen of ``--view``: map, rover and figures as a rich renderable; a pure function of the state.

Two dots, one above the other, make one character: with colours an upper half block on a background, without colours a
sign per kind.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import groupby
from operator import itemgetter
from typing import NamedTuple

from rich.console import Group, RenderableType
from rich.layout import Layout
from rich.panel import Panel
from rich.table import Table
from rich.text import Text

from sitl.view.sketch import Dots, Frame, Kind, PlaceState, Scene, frame_for, paint

PANEL_COLUMNS = (32, 44)
"""Smallest and largest width; between them a third of the terminal."""
NAME_COLUMNS = 11
SMALLEST = (60, 16)
"""Smallest number of columns and rows for a picture."""
LEGEND_SHARE = 4
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
    Kind.HIDDEN: Look("#4a4d55", "░", "not seen yet"),
    Kind.CLOSED: Look("#8f6d45", "▒", "fence, known"),
    Kind.BLACK: Look("#800080", "b", "black"),
    Kind.GLASS: Look("#00afaf", "g", "glass"),
    Kind.DOOR: Look("#ff8700", "+", "door closed"),
    Kind.WALL: Look("#d7d7d7", "█", "obstacle"),
    Kind.MOVER: Look("#d75fd7", "o", "moving"),
}


@dataclass(frozen=True, slots=True)
class Fact:
    """One line of the panel; ``alarm``: highlighted."""

    name: str
    value: str
    alarm: bool = False


@dataclass(frozen=True, slots=True)
class Section:
    """Facts under a heading."""

    title: str
    facts: tuple[Fact, ...]


@dataclass(frozen=True, eq=False, slots=True)
class View:
    """The state that is shown. ``events``: texts, the newest last."""

    title: str
    scene: Scene
    sections: tuple[Section, ...]
    events: tuple[str, ...] = ()


def render(view: View, columns: int, rows: int, *, colour: bool) -> RenderableType:
    """The whole screen, with this many columns and rows of characters."""
    if columns < SMALLEST[0] or rows < SMALLEST[1]:
        small = f"{columns} x {rows} characters are too few for a picture (at least {SMALLEST[0]} x {SMALLEST[1]})"
        return Group(Text(small), *(_line(fact, columns) for section in view.sections for fact in section.facts))
    layout = Layout()
    beside = min(max(PANEL_COLUMNS[0], columns // 3), PANEL_COLUMNS[1])
    layout.split_row(Layout(name="map"), Layout(name="panel", size=beside))
    layout["map"].update(_map_panel(view, columns - beside - 2, rows - 3, colour=colour))
    layout["panel"].update(Panel(_facts(view, beside - 4, rows - 2), border_style="dim"))
    return layout


def _map_panel(view: View, columns: int, rows: int, *, colour: bool) -> Panel:
    """The map with its legend below, with this many characters inside the border."""
    frame = frame_for(view.scene, 2 * rows, columns)
    dots = paint(view.scene, frame)
    legend = _legend(view.scene, frame, dots, columns, colour=colour)[: max(1, rows // LEGEND_SHARE)]
    if len(legend) > 1:  # its further lines are taken from the map
        frame = frame_for(view.scene, 2 * (rows + 1 - len(legend)), columns)
        dots = paint(view.scene, frame)
    lines = map_lines(view.scene, frame, dots, colour=colour)
    title = Text(f"{view.title}{_size(view.scene)}", overflow="ellipsis", no_wrap=True)
    return Panel(Group(*lines, *legend), title=title, title_align="left", border_style="dim", padding=0)


def _size(scene: Scene) -> str:
    """The world's size as text; empty for open ground."""
    if scene.bounds_m is None:
        return ""
    south_m, west_m, north_m, east_m = scene.bounds_m
    return f": {east_m - west_m:.0f} x {north_m - south_m:.0f} m"


def map_lines(scene: Scene, frame: Frame, dots: Dots, *, colour: bool) -> list[Text]:
    """The map, one text per row of characters; ``frame.rows`` is even."""
    marks = _marks(scene, frame)
    lines = []
    for row in range(0, frame.rows, 2):
        pairs = zip(dots[row].tolist(), dots[row + 1].tolist(), strict=True)
        characters = [_character(Kind(upper), Kind(lower), colour=colour) for upper, lower in pairs]
        for column, (sign, style) in marks.get(row // 2, {}).items():
            # A mark keeps the background of its dot, unless its style has its own.
            ground = "" if " on " in style or not colour else f" on {LOOKS[Kind(int(dots[row, column]))].colour}"
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


def _marks(scene: Scene, frame: Frame) -> dict[int, dict[int, tuple[str, str]]]:
    """Signs of places and rover with their styles, by row and column of characters; the rover is on top."""
    marks: dict[int, dict[int, tuple[str, str]]] = {}
    signs = [(one.north_m, one.east_m, *PLACE_LOOKS[one.state][::2]) for one in scene.places]
    signs.append((scene.rover.north_m, scene.rover.east_m, arrow(scene.heading_rad), ROVER_STYLE))
    for north_m, east_m, sign, style in signs:
        where = frame.dot(north_m, east_m)
        if where is not None:
            marks.setdefault(where[0] // 2, {})[where[1]] = (sign, style)
    return marks


def arrow(heading_rad: float) -> str:
    """The arrow nearest to a heading, clockwise from north."""
    return ARROWS[round(heading_rad / (math.pi / 4.0)) % 8]


def _legend(scene: Scene, frame: Frame, dots: Dots, columns: int, *, colour: bool) -> list[Text]:
    """Meaning of the signs and colours on the map, the most important first."""
    entries = [Text(f"{look.sign} {look.name}", no_wrap=True) for look in _places_shown(scene, frame)]
    there = set(dots.ravel().tolist())
    for kind, look in sorted(LOOKS.items(), reverse=True):
        if look.name and kind in there:
            half = "▀▄" if kind is Kind.WALL and not colour else ""
            entry = Text("■ " if colour else f"{look.sign}{half} ", look.colour if colour else "", no_wrap=True)
            entries.append(entry.append(look.name))
    lines: list[Text] = []
    for entry in entries:
        if lines and len(lines[-1]) + 2 + len(entry) <= columns:
            lines[-1].append("  ").append_text(entry)
        else:
            entry.truncate(columns, overflow="ellipsis")
            lines.append(entry)
    return lines or [Text()]


def _places_shown(scene: Scene, frame: Frame) -> list[PlaceLook]:
    """The looks of the places in sight."""
    there = {one.state for one in scene.places if frame.dot(one.north_m, one.east_m) is not None}
    return [look for state, look in PLACE_LOOKS.items() if state in there]


def _facts(view: View, columns: int, rows: int) -> Table:
    """All sections, with long facts on several lines if there is room, then the events that still fit."""
    table = Table.grid()
    table.add_column(width=columns, no_wrap=True, overflow="ellipsis")
    room = rows
    spare = rows - sum(1 + len(section.facts) for section in view.sections)
    for section in view.sections:
        lines = [Text(section.title, "bold")]
        for fact in section.facts:
            lines_of_fact = _fact_lines(fact, columns, max(spare, 0) + 1)
            spare -= len(lines_of_fact) - 1
            lines += lines_of_fact
        for line in lines[: max(room, 0)]:
            table.add_row(line)
        room -= len(lines)
    if room > 1 and view.events:
        table.add_row(Text("Events", "bold"))
        for text in _newest(view.events, columns, room - 1):
            table.add_row(text)
    return table


def _line(fact: Fact, columns: int) -> Text:
    return _fact_lines(fact, columns, 1)[0]


def _fact_lines(fact: Fact, columns: int, most: int) -> list[Text]:
    """A fact in at most ``most`` lines; text that does not fit is cut with an ellipsis."""
    style = "bold not dim #ff5f5f" if fact.alarm else "not dim"
    values = _broken(fact.value, max(columns - NAME_COLUMNS, 1))
    if len(values) > most:
        values[most - 1 :] = [f"{values[most - 1]} {values[most]}"]  # which is too long, and cut below
    lines = []
    for number, value in enumerate(values):
        line = Text((fact.name if number == 0 else "").ljust(NAME_COLUMNS), "dim", no_wrap=True)
        line.append(value, style)
        line.truncate(columns, overflow="ellipsis")
        lines.append(line)
    return lines


def _newest(events: Iterable[str], columns: int, rows: int) -> list[Text]:
    """The newest texts that fit, wrapped; a text that does not fit completely is left out."""
    lines: list[Text] = []
    for text in reversed(tuple(events)):
        wrapped = _wrapped(text, columns)
        if len(lines) + len(wrapped) > rows:
            return lines
        lines = [*wrapped, *lines]
    return lines


def _wrapped(text: str, columns: int) -> list[Text]:
    """Lines of a text; all but the first are indented by a space."""
    return [Text(line, no_wrap=True) for line in _broken(text, columns, " ")]


def _broken(text: str, columns: int, indent: str = "") -> list[str]:
    """A text in lines of at most ``columns`` characters, at least one; longer words are split."""
    lines = [""]
    for word in text.split():
        if lines[-1].strip() and len(lines[-1]) + 1 + len(word) > columns:
            lines.append(indent)
        lines[-1] += word if not lines[-1].strip() else f" {word}"
        while len(lines[-1]) > columns:
            lines[-1:] = [lines[-1][:columns], indent + lines[-1][columns:]]
    return lines
