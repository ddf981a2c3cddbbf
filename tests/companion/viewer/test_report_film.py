"""Films are short, however long the drive was."""

from __future__ import annotations

import base64
from typing import Any

import pytest
from PIL import Image, ImageFont

from companion.viewer.film_picture import (
    CONTACT,
    GOAL,
    HALO,
    REACHED,
    SIDE_PIXELS,
    FilmPicture,
    _font_file,
    section_of,
)
from companion.viewer.map_colours import CELL_COLOURS, UNKNOWN_COLOUR
from companion.viewer.map_tiles import MOST_RUN, TILE
from companion.viewer.report_film import MOST_PICTURES, Film, FilmError
from companion.viewer.tile_kernels import FREE
from companion.viewer.wire import tile_message

GROUND = {"south_m": -50.0, "west_m": -50.0, "cell_m": 0.25, "columns": 400, "rows": 400, "tile": 64}
SCENE: dict[str, Any] = {
    "cut": False,
    "map": GROUND,
    "targets": [{"name": "a very long name that must stay within the picture", "place": [0.0, 30.0]}],
    "borders": [],
    "rover": {"outline": [[0.3, 0.2], [-0.3, 0.2], [-0.3, -0.2], [0.3, -0.2]]},
}


def film(count: int) -> Film:
    """Waits for a tenth of its frames, then drives east."""
    first = {"speed": 0.0, "path": [], "statuses": ["pending"], "movers": [], "line": "waiting", "state": "waiting"}
    frames = [{**first, "t": 0.0, "pose": [0.0, 0.0, 1.57]}]
    frames += [{"t": 0.4 * number, "pose": [0.0, 30.0 * number / count, 1.57]} for number in range(1, count)]
    frames[count // 10].update(state="driving", line="driving to " + "far " * 50)
    frames[count // 2].update(speed=None)  # the autopilot is silent from then on
    return Film({"scene": SCENE, "frames": frames, "tiles": [], "contacts": []})


@pytest.mark.parametrize(("count", "shown"), [(20, 20), (100, 95), (50_000, MOST_PICTURES)])
def test_a_film_begins_when_the_rover_is_driven_and_has_few_pictures(count: int, shown: int) -> None:
    moments = film(count).moments()
    assert len(moments) == shown
    assert moments[0]["t"] == pytest.approx(max(0.0, 0.4 * (count // 10) - 2.0), abs=0.41)
    assert moments[-1]["t"] == pytest.approx(0.4 * (count - 1))


def test_every_picture_has_the_same_even_size() -> None:
    made = film(12)
    pictures = list(made.pictures())
    assert {one.size for one in pictures} == {made.size} and len(pictures) == 12
    assert made.size[0] == SIDE_PIXELS and made.size[1] % 2 == 0


def test_the_mark_of_a_target_shows_what_has_become_of_it() -> None:
    scene = {**SCENE, "targets": [{"name": "", "place": [0.0, 10.0]}]}
    section = section_of(scene, [(0.0, 0.0), (0.0, 10.0)])
    frame = {"pose": None, "path": [], "movers": [], "line": "", "state": "ended", "speed": 0.0, "t": 0.0}
    x = round(((10.0 + 50.0) / 0.25 - section.x0) * section.scale)
    y = round(section.height - (50.0 / 0.25 - section.y0) * section.scale)

    def spots(status: str) -> list[object]:
        """Colours in the middle of the mark, and above it within the disc."""
        picture = FilmPicture(scene, section).drawn({**frame, "statuses": [status]}, [], [])
        return [picture.getpixel((x, y)), picture.getpixel((x, y - 4))]

    assert spots("reached") == [REACHED] * 2 and spots("pending") == spots("skipped") == [GOAL] * 2
    assert spots("unreachable") == [HALO, CONTACT], "a cross on a disc"


def test_a_map_that_is_begun_anew_begins_empty_and_where_it_lies() -> None:
    """From the second map on the ground of the first is gone, and its own tiles lie 16 m farther east."""
    frames = [
        {"t": float(t), "pose": [0.0, 0.0, 0.0], "speed": 1.0, "path": [], "statuses": ["pending"], "movers": [],
         "line": "driving", "state": "driving"}
        for t in range(4)
    ]  # fmt: skip
    free = base64.b64encode(
        tile_message([((3, 3), bytes([FREE << 5 | MOST_RUN - 1]) * (TILE**2 // MOST_RUN))])
    ).decode()
    moved = {**GROUND, "west_m": GROUND["west_m"] + 0.25 * TILE}
    tiles, maps = [(1.0, free), (3.0, free)], [(1.0, GROUND), (2.0, moved)]
    made = Film({"scene": SCENE, "frames": frames, "tiles": tiles, "contacts": [], "maps": maps})
    section = section_of(SCENE, [(0.0, 0.0)] * 4 + [(0.0, 30.0)])

    def ground(picture: Image.Image, east_m: float) -> object:
        x = round(((east_m + 50.0) / 0.25 - section.x0) * section.scale)
        y = round(section.height - ((6.0 + 50.0) / 0.25 - section.y0) * section.scale)
        return picture.getpixel((x, y))

    seen = [[ground(one, east_m) for east_m in (6.0, 22.0)] for one in made.pictures()]
    known, unknown = tuple(CELL_COLOURS[FREE]), UNKNOWN_COLOUR
    assert seen == [[unknown] * 2, [known, unknown], [unknown] * 2, [unknown, known]]


@pytest.mark.parametrize("places", [[(0.0, 0.0)], [(0.0, 0.0), (90.0, 1.0)], [(-300.0, 5.0), (10.0, 400.0)]])
def test_any_drive_fits_into_the_picture(places: list[tuple[float, float]]) -> None:
    section = section_of(SCENE, places)
    assert 200 <= min(section.width, section.height) <= max(section.width, section.height) <= SIDE_PIXELS + 2
    for north, east in places:
        assert section.x0 < (east + 50.0) / 0.25 < section.x1 and section.y0 < (north + 50.0) / 0.25 < section.y1


def test_without_a_map_there_is_no_film() -> None:
    with pytest.raises(FilmError, match="the mission had not begun"):
        Film({"scene": {}, "frames": [{"pose": None, "t": 0.0}], "tiles": [], "contacts": []})


def test_names_with_the_letters_of_europe_can_be_written() -> None:
    font = ImageFont.truetype(_font_file(), 15)
    shapes = {letter: bytes(font.getmask(letter)) for letter in "üßéłžя"}
    assert bytes(font.getmask("\uffff")) not in shapes.values() and len(set(shapes.values())) == len(shapes)
