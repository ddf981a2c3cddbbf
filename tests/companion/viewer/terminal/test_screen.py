"""The terminal view as text."""

import io
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.console import Console

from companion.viewer.terminal.facts import Fact, Section
from companion.viewer.terminal.map_panel import LOOKS, PLACE_LOOKS, arrow
from companion.viewer.terminal.screen import View, render
from companion.viewer.terminal.sketch import COARSEST_M, Disc, Kind, Layer, Place, Sketch, paint, viewport_for


def sketch(fields: list[str], rover: tuple[float, float] = (0.5, 0.5), heading_deg: float = 0.0, **more: Any) -> Sketch:
    """Fields of 1 m, the first line in the north; # is a wall."""
    where = np.array([[sign == "#" for sign in line] for line in reversed(fields)])
    height, width = where.shape
    options = {"track": np.empty((0, 2)), "bounds_m": (0.0, 0.0, float(height), float(width)), **more}
    return Sketch((Layer(Kind.WALL, where, 1.0, 0.0, 0.0),), Disc(*rover, 0.3), math.radians(heading_deg), **options)


def screen(view: View, columns: int = 80, rows: int = 24, colour: bool = False) -> list[str]:
    console = Console(file=io.StringIO(), width=columns, height=rows, color_system="truecolor" if colour else None)
    console.print(render(view, columns, rows, colour=colour), height=rows)
    assert isinstance(console.file, io.StringIO)
    return console.file.getvalue().rstrip("\n").split("\n")


def a_view(one: Sketch, **more: Any) -> View:
    return View("Test", one, (Section("Rover", (Fact("mode", "GUIDED, armed"),)),), **more)


ROOM = ["########", "#      #", "#   #  #", "########"]


def test_the_picture_is_north_up_and_the_rover_points_where_it_goes() -> None:
    one = sketch(ROOM, (1.5, 1.5), 90.0, places=(Place("t", 2.5, 6.5),), movers=(Disc(1.5, 5.5, 0.4),))
    frame = viewport_for(one, 4, 8)
    assert (frame.dot_m, frame.north_m, frame.west_m) == (1.0, 4.0, 0.0)
    dots = paint(one, frame)
    assert dots[2, 4] == Kind.WALL and dots[1, 4] == Kind.NOTHING and dots[2, 5] == Kind.MOVER
    text = "\n".join(screen(a_view(one)))
    assert "→" in text and "◎" in text and "█▀▄ obstacle" in text and "o moving" in text


@pytest.mark.parametrize(
    ("degrees", "sign"), [(0, "↑"), (44, "↗"), (90, "→"), (135, "↘"), (180, "↓"), (-91, "←"), (-20, "↑"), (300, "↖")]
)
def test_arrows(degrees: float, sign: str) -> None:
    assert arrow(math.radians(degrees)) == sign


@pytest.mark.parametrize(("columns", "rows"), [(80, 24), (100, 30), (200, 60), (60, 16), (59, 30), (20, 5), (1, 1)])
@pytest.mark.parametrize("colour", [True, False])
def test_it_fits_into_any_terminal(columns: int, rows: int, colour: bool) -> None:
    events = tuple(f"{n} s: something that takes more than one line to tell" for n in range(40))
    lines = screen(a_view(sketch(ROOM), events=events), columns, rows, colour=colour)
    assert len(lines) <= rows or columns < 60
    if not colour:
        assert max(map(len, lines)) <= columns
    if columns >= 60:
        assert "GUIDED, armed" in "\n".join(lines) and "39 s" in "\n".join(lines)


@pytest.mark.parametrize(("columns", "rows"), [(80, 24), (120, 40)])
@pytest.mark.parametrize("colour", [True, False])
def test_everything_in_sight_is_in_the_legend(columns: int, rows: int, colour: bool) -> None:
    whole = np.ones((1, 2), dtype=np.bool_)
    layers = tuple(Layer(kind, whole, 1.0, 2.0 * number, 0.0) for number, kind in enumerate(Kind))
    places = tuple(
        Place(state.name, 5.0, east_m, state) for east_m, state in zip((5.0, 9.0, 13.0, 17.0), PLACE_LOOKS, strict=True)
    )
    one = Sketch(layers, Disc(1.0, 5.0, 0.3), 0.0, np.empty((0, 2)), places=places, bounds_m=(0.0, 0.0, 28.0, 28.0))
    lines = screen(a_view(one), columns, rows, colour=colour)
    told = " ".join(line.split("│")[1] for line in lines if line.count("│") > 3) if not colour else "\n".join(lines)
    for look in LOOKS.values():
        assert look.name in told
    for place in PLACE_LOOKS.values():
        assert f"{place.sign} {place.name}" in told
    assert colour or "█▀▄ obstacle" in told
    assert len(lines) <= rows


@pytest.mark.parametrize(("columns", "rows"), [(80, 24), (140, 30), (70, 50)])
def test_the_title_gives_the_worlds_size_whatever_the_window(columns: int, rows: int) -> None:
    assert "Test: 8 x 4 m" in screen(a_view(sketch(ROOM)), columns, rows)[0]
    assert "Test ─" in screen(a_view(sketch(ROOM, bounds_m=None)), columns, rows)[0]


def test_kinds_can_be_told_apart_without_colours() -> None:
    whole = np.ones((2, 2), dtype=np.bool_)
    kinds = [kind for kind in Kind if kind is not Kind.MOVER]
    layers = tuple(Layer(kind, whole, 1.0, 0.0, 2.0 * number) for number, kind in enumerate(kinds))
    one = Sketch(layers, Disc(-5.0, 0.0, 0.3), 0.0, np.empty((0, 2)), bounds_m=(0.0, 0.0, 2.0, 2.0 * len(kinds)))
    rows = [line for line in screen(a_view(one), 100, 24) if "█" in line and "obstacle" not in line]
    signs = set(rows[0][1:].split("│")[0])
    assert len(signs) == len(kinds)


def test_with_colours_two_dots_share_a_character() -> None:
    lines = screen(a_view(sketch(["#", " "] * 8)), colour=True)
    assert "▀" in "".join(lines) and "\x1b[38;2;" in "".join(lines)


PLACES_M = st.integers(-5000, 5000).map(lambda tenths: tenths / 10.0 + 0.05)


@given(PLACES_M, PLACES_M, st.integers(2, 120), st.integers(1, 300), st.sampled_from([0.05, 0.3, 1.0, 7.0]))
def test_every_wall_in_sight_is_painted(north_m: float, east_m: float, rows: int, columns: int, field_m: float) -> None:
    where = np.zeros((60, 80), dtype=np.bool_)
    where[37, 11] = True
    one = Sketch((Layer(Kind.WALL, where, field_m, -3.0, 5.0),), Disc(north_m, east_m, 0.3), 0.0, np.empty((0, 2)))
    frame = viewport_for(one, rows, columns)
    dots = paint(one, frame)
    assert dots.shape == (rows, columns)
    assert frame.dot(north_m, east_m) is not None
    here = frame.dot(-3.0 + 37.5 * field_m, 5.0 + 11.5 * field_m)
    if here is not None and 0 < here[0] < rows - 1 and 0 < here[1] < columns - 1:
        # A field's middle may lie on the edge between two dots.
        row, column = here
        assert (dots[row - 1 : row + 2, column - 1 : column + 2] == Kind.WALL).any()
    side = math.ceil(field_m / frame.dot_m) + 1
    assert (dots == Kind.WALL).sum() <= side * side


def test_a_large_world_is_shown_round_the_rover_and_not_beyond_its_edges() -> None:
    fields = [" " * 900] * 700
    frame = viewport_for(sketch(fields, (350.5, 450.5)), 40, 60)
    assert frame.dot_m < COARSEST_M
    where = frame.dot(350.5, 450.5)
    assert where is not None and abs(where[0] - 20) <= 1 and abs(where[1] - 30) <= 1
    corner = viewport_for(sketch(fields, (1.5, 1.5)), 40, 60)
    assert (corner.west_m, corner.north_m) == (0.0, 40.0)


def test_the_track_has_no_gaps() -> None:
    one = sketch([" " * 40] * 20, track=np.array([[1.5, 1.5], [18.5, 38.5]]))
    dots = paint(one, viewport_for(one, 20, 40))
    assert (dots == Kind.TRACK).any(axis=0).sum() == 38
