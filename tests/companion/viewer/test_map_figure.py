"""The ground that a picture shows, and pictures of drives on grounds that are much larger than the drive."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.text import Text
from PIL import Image
from typer.testing import CliRunner

from companion.viewer.map_figure import LEAST_M, NARROWEST, WIDEST, Extent, MapFigure, corners_of, framed
from sitl.cli.commands import app

METRES = st.floats(-1000.0, 1000.0)


@given(st.lists(st.tuples(METRES, METRES), min_size=1, max_size=5))
def test_all_places_are_on_it_and_it_is_neither_tiny_nor_a_ribbon(places: list[tuple[float, float]]) -> None:
    ground = framed(np.array(places), np.empty((0, 2)))
    assert all(ground.south_m < north_m < ground.north_m for north_m, _ in places)
    assert all(ground.west_m < east_m < ground.east_m for _, east_m in places)
    assert min(ground.width_m, ground.height_m) >= LEAST_M - 1e-9
    assert NARROWEST - 1e-9 <= ground.width_m / ground.height_m <= WIDEST + 1e-9


def test_the_corners_of_fields_are_their_outer_edges() -> None:
    fields = np.zeros((10, 20), dtype=np.bool_)
    assert corners_of(fields, Extent(0.0, 10.0, 0.0, 5.0)).shape == (0, 2)
    fields[3, 4:9] = True
    assert corners_of(fields, Extent(100.0, 110.0, 50.0, 55.0)).tolist() == [[51.5, 102.0], [52.0, 104.5]]


@pytest.mark.parametrize("size", [(100.0, 8.0), (8.0, 100.0), (20.0, 20.0)])
def test_the_ground_fills_the_page(tmp_path: Path, size: tuple[float, float]) -> None:
    width_m, height_m = size
    figure = MapFigure(framed(np.array([(0.0, 0.0), (height_m, width_m)])))
    figure.axes.imshow([[[10, 200, 10]]], extent=figure.ground)
    figure.key("red", "something with a long name that says what it is, and how much of it there is: a lot " * 2)
    figure.save(tmp_path / "a.png", "Title of 測試")  # a warning would be an error here
    assert (figure.axes.get_xlabel(), figure.axes.get_ylabel()) == ("east, m", "north, m")
    scale = next(text for text in figure.axes.findobj(Text) if text.get_text() in ("2 m", "5 m", "10 m", "20 m"))
    assert float(scale.get_text().split()[0]) > 0.05 * figure.ground.width_m
    pixels = np.array(Image.open(tmp_path / "a.png").convert("RGB"))
    assert pixels.shape[1] >= 900
    green = (pixels == (10, 200, 10)).all(axis=2)
    assert green.mean() > 0.6
    rows, columns = np.flatnonzero(green.any(axis=1)), np.flatnonzero(green.any(axis=0))
    ratio = figure.ground.width_m / figure.ground.height_m
    assert np.ptp(columns) / np.ptp(rows) == pytest.approx(ratio, rel=0.02), "a metre is as long both ways"


@pytest.mark.thorough
def test_a_short_drive_on_a_large_map_fills_its_picture(tmp_path: Path) -> None:
    (tmp_path / "m.toml").write_text(
        '[grid]\nsize = [400, 300]\nhome = [10, 10]\n[[target]]\nfield = [14, 12]\n[sitl]\nsensors = "lidar-360"\n'
    )
    result = CliRunner().invoke(app, ["drive", str(tmp_path / "m.toml"), "--image", str(tmp_path / "m.png")])
    assert result.exit_code == 0, result.output
    pixels = np.array(Image.open(tmp_path / "m.png").convert("RGB")).astype(int)
    free = (pixels[..., 1] > pixels[..., 0] + 8) & (pixels[..., 1] > pixels[..., 2] + 8)
    assert free.mean() > 0.35
