"""Targets that are far from home, and places whose latitude and longitude seem swapped."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.core.frames import GeoPoint, LocalFrame, NedPoint
from companion.core.grid import Cell
from companion.mission.doubtful_places import FAR_M, distance_text, doubtful_places, great_circle_m, home_at_edge
from companion.mission.load import load_mission
from companion.mission.mission import GridSpec, HomePoint, Mission, MissionError, Place, RoverSpec, Target

HOME = GeoPoint(53.1325, 23.1688)
NEAR = LocalFrame(HOME).to_geo(NedPoint(60.0, 30.0))


def lines(*places: Place, planned: GeoPoint | None = HOME, home: GeoPoint | None = None) -> list[str]:
    targets = tuple(Target(f"t{number}", place) for number, place in enumerate(places, 1))
    return doubtful_places(Mission("m", targets, planned_home=planned), home)


def test_near_targets_are_not_doubted() -> None:
    assert lines(NEAR, HomePoint(0.0, 0.9 * FAR_M), LocalFrame(HOME).to_geo(NedPoint(0.95 * FAR_M, 0.0))) == []


def test_a_swapped_target_is_told_with_both_distances() -> None:
    (line,) = lines(NEAR, GeoPoint(NEAR.lon_deg, NEAR.lat_deg))
    assert line == (
        "target 2 't2' is 4177 km from home; latitude and longitude seem swapped "
        "(the other way round it is 67 m away), is that meant?"
    )


@pytest.mark.parametrize(
    ("place", "far"),
    [(LocalFrame(HOME).to_geo(NedPoint(11_200.0, 0.0)), "11.2 km"), (HomePoint(3000.0, 4000.0), "5.0 km")],
)
def test_a_far_target_is_told_with_its_distance(place: Place, far: str) -> None:
    assert lines(place) == [f"target 1 't1' is {far} from home; is that meant?"]


def test_the_autopilots_home_counts_before_the_files_own() -> None:
    elsewhere = LocalFrame(HOME).to_geo(NedPoint(0.0, 20_000.0))
    assert lines(NEAR) == [] and lines(NEAR, home=HOME) == []
    (line,) = lines(NEAR, home=elsewhere)
    assert "is 19.9 km from home" in line


def test_without_a_home_targets_are_compared_with_the_first() -> None:
    assert lines(NEAR, HOME, planned=None) == []
    (line,) = lines(NEAR, GeoPoint(NEAR.lon_deg, NEAR.lat_deg), planned=None)
    assert "from the first target in degrees" in line and "seem swapped" in line


def test_all_that_is_swapped_alike_shows_from_the_autopilots_home() -> None:
    turned = [GeoPoint(place.lon_deg, place.lat_deg) for place in (NEAR, HOME)]
    assert lines(*turned, planned=None) == []
    assert len(lines(*turned, planned=None, home=HOME)) == 2


@pytest.mark.parametrize(
    "text",
    [
        "[[target]]\nlat_deg = 149.1\nlon_deg = -35.3\n",
        "[[target]]\nnorth_m = 5\neast_m = 5\n[[keep_out]]\npolygon_deg = [[149, -35], [149, -36], [148, -35]]\n",
        "[[target]]\nnorth_m = 5\neast_m = 5\n[[keep_out]]\nlat_deg = 149.0\nlon_deg = -35.0\nradius_m = 4\n",
    ],
)
def test_a_latitude_that_cannot_be_is_refused_with_the_hint(tmp_path: Path, text: str) -> None:
    path = tmp_path / "m.toml"
    path.write_text(text)
    with pytest.raises(MissionError, match="is not a latitude and longitude; latitude and longitude seem swapped") as e:
        load_mission(path)
    assert "\n" not in str(e.value)


def test_a_place_that_nobody_told(tmp_path: Path) -> None:
    path = tmp_path / "m.toml"
    path.write_text("[[target]]\nlat_deg = 0.0\nlon_deg = 0.0\n")
    assert doubtful_places(load_mission(path)) == [
        "target 1 'target 1' is at latitude 0, longitude 0, in the sea; is that meant?"
    ]


def test_what_is_wrong_either_way_gets_no_hint(tmp_path: Path) -> None:
    path = tmp_path / "m.toml"
    path.write_text("[[target]]\nlat_deg = 149.1\nlon_deg = 120.0\n")
    with pytest.raises(MissionError, match="lat_deg") as e:
        load_mission(path)
    assert "swapped" not in str(e.value)


@given(st.floats(-80.0, 80.0), st.floats(-180.0, 180.0), st.floats(-900.0, 900.0), st.floats(-900.0, 900.0))
def test_on_short_ways_the_distance_is_that_of_the_local_frame(
    lat_deg: float, lon_deg: float, north_m: float, east_m: float
) -> None:
    here = GeoPoint(lat_deg, lon_deg)
    there = LocalFrame(here).to_geo(NedPoint(north_m, east_m))
    far_m = NedPoint(north_m, east_m).distance_m(NedPoint(0.0, 0.0))
    assert great_circle_m(here, there) == pytest.approx(far_m, rel=0.01, abs=0.1)


@pytest.mark.parametrize(
    ("distance_m", "text"),
    [(0.4, "0 m"), (994.0, "994 m"), (1000.0, "1.0 km"), (99_940.0, "99.9 km"), (1e6, "1000 km")],
)
def test_distances_in_words(distance_m: float, text: str) -> None:
    assert distance_text(distance_m) == text


@pytest.mark.parametrize(
    ("home", "says"), [((0, 24), True), ((1, 24), False), ((50, 49), True), ((99, 24), True), ((50, 24), False)]
)
def test_a_rover_that_reaches_over_the_edge_of_its_grid_is_told_of(home: tuple[int, int], says: bool) -> None:
    grid = GridSpec(1.0, (100, 50), Cell(*home))
    told = home_at_edge(Mission("m", (), grid, RoverSpec(0.67)))
    assert ["0.5 m from the edge" in line for line in told] == [True] * says
    assert home_at_edge(Mission("m", (), GridSpec(), RoverSpec(0.67))) == []
