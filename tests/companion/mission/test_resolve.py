"""Missions laid out on the ground: where the grid lies, what is closed, what is refused."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import shapely

from companion.core.frames import GeoPoint, LocalFrame, NedPoint
from companion.core.grid import BASE_WEIGHT, OBSTACLE, Cell, Grid, empty_grid
from companion.mapping.map_files import save_ros_map
from companion.mission.areas import covered, touched
from companion.mission.field_size import FieldSize
from companion.mission.mission import (
    Area,
    GridSpec,
    HomePoint,
    Mission,
    MissionError,
    Place,
    RoverSpec,
    Target,
    WeightedArea,
)
from companion.mission.prior_map import stamp_prior
from companion.mission.resolve import ResolvedMission, resolve

FRAME = LocalFrame(GeoPoint(53.1325, 23.1688))
HOME = NedPoint(3.0, -4.0)
FIXED = GridSpec(1.0, (100, 50), Cell(0, 24))
POINT = RoverSpec(radius_m=0.0)


def mission(*places: Place, **fields: object) -> Mission:
    targets = tuple(Target(f"t{i}", place) for i, place in enumerate(places))
    return replace(Mission("m", targets), **fields)  # type: ignore[arg-type]


def laid(wanted: Mission, home: NedPoint = HOME) -> ResolvedMission:
    return resolve(wanted, FRAME, home)


def obstacles(result: ResolvedMission) -> set[tuple[int, int]]:
    return {(int(x), int(y)) for y, x in np.argwhere(result.grid.weights >= OBSTACLE)}


def refusal(wanted: Mission, home: NedPoint = HOME) -> str:
    with pytest.raises(MissionError) as caught:
        laid(wanted, home)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_a_fixed_grid_has_home_in_the_middle_of_its_field() -> None:
    result = laid(mission(Cell(98, 24), grid=FIXED))
    assert (result.grid.width, result.grid.height) == (100, 50)
    assert result.grid.centre_of(Cell(0, 24)) == HOME
    assert result.home_cell == Cell(0, 24)
    target = result.targets[0]
    assert target.cell == Cell(98, 24)
    assert target.point == NedPoint(HOME.north_m, HOME.east_m + 98.0)


def test_half_metre_fields() -> None:
    result = laid(mission(Cell(3, 0), HomePoint(0.3, 0.0), grid=GridSpec(0.5, (4, 4), Cell(1, 1))))
    assert result.targets[0].point == NedPoint(HOME.north_m - 0.5, HOME.east_m + 1.0)
    assert result.targets[1].cell == Cell(1, 2)


def test_a_laid_grid_holds_everything_with_its_margin_and_home_in_the_middle_of_a_field() -> None:
    fence = Area((HomePoint(-30.0, 0.0),), radius_m=10.0)
    result = laid(mission(HomePoint(10.2, 5.1), keep_out=(fence,)))
    grid = result.grid
    assert grid.centre_of(result.home_cell) == pytest.approx(HOME)
    top = grid.south_west.north_m + grid.height
    assert grid.south_west.north_m <= HOME.north_m - 40.0 - 25.0
    assert HOME.north_m + 10.2 + 25.0 <= top <= HOME.north_m + 10.2 + 28.0
    assert grid.contains(result.targets[0].cell)


def test_the_margin_grows_with_the_mission_and_can_be_given() -> None:
    far = laid(mission(HomePoint(0.0, 200.0))).grid
    assert 400 <= far.width <= 404 and 200 <= far.height <= 203
    near = laid(mission(HomePoint(0.0, 200.0), grid=GridSpec(margin_m=2.0))).grid
    assert 204 <= near.width <= 207 and 4 <= near.height <= 7


FINE = FieldSize(0.25, 1_000_000)


def test_fields_that_the_mission_says_nothing_of_may_be_small_but_not_too_many() -> None:
    unsaid, said = mission(HomePoint(0.0, 20.0)), mission(HomePoint(0.0, 20.0), grid=GridSpec())
    assert resolve(unsaid, FRAME, HOME, size=FINE).grid.resolution_m == 0.25
    assert resolve(said, FRAME, HOME, size=FINE).grid.resolution_m == 1.0
    assert resolve(unsaid, FRAME, HOME).grid.resolution_m == 1.0
    grids = [resolve(mission(HomePoint(0.0, far_m)), FRAME, HOME, size=FINE).grid for far_m in (400.0, 1300.0)]
    assert 0.25 < grids[0].resolution_m < 1.0 and grids[0].width * grids[0].height < 1_100_000
    assert grids[1].resolution_m == 1.0


def test_geo_targets_lie_where_the_autopilot_puts_them() -> None:
    place = FRAME.to_geo(NedPoint(40.0, 10.0))
    result = laid(mission(place))
    assert result.targets[0].point.distance_m(NedPoint(40.0, 10.0)) < 1e-6
    assert result.grid.cell_at(NedPoint(40.0, 10.0)) == result.targets[0].cell


def test_keep_out_in_fields_closes_its_corner_fields_and_all_between() -> None:
    area = Area((Cell(10, 10), Cell(12, 10), Cell(12, 11), Cell(10, 11)))
    result = laid(mission(Cell(98, 24), grid=FIXED, keep_out=(area,)))
    assert obstacles(result) == {(x, y) for x in (10, 11, 12) for y in (10, 11)}


def test_keep_out_along_field_edges_does_not_close_the_neighbours() -> None:
    corners = tuple(HomePoint(north, east) for north, east in ((0.5, 9.5), (2.5, 9.5), (2.5, 11.5), (0.5, 11.5)))
    result = laid(mission(Cell(98, 24), grid=FIXED, rover=POINT, keep_out=(Area(corners),)))
    assert obstacles(result) == {(10, 25), (10, 26), (11, 25), (11, 26)}


def test_keep_out_closes_a_field_it_only_touches() -> None:
    area = Area((HomePoint(0.0, 10.0),), radius_m=0.6)
    result = laid(mission(Cell(98, 24), grid=FIXED, rover=POINT, keep_out=(area,)))
    assert obstacles(result) == {(10, 24), (9, 24), (11, 24), (10, 23), (10, 25)}


def test_keep_in_closes_what_is_not_wholly_inside_all_areas() -> None:
    def box(south: float, west: float, north: float, east: float) -> Area:
        return Area(
            tuple(HomePoint(*corner) for corner in ((south, west), (south, east), (north, east), (north, west)))
        )

    areas = (box(-3.2, -0.5, 3.2, 20.0), box(-0.9, -5.0, 9.0, 9.9))
    result = laid(mission(Cell(5, 24), grid=FIXED, rover=POINT, keep_in=areas))
    free = {(x, y) for x in range(100) for y in range(50)} - obstacles(result)
    assert free == {(x, y) for x in range(0, 10) for y in (24, 25, 26)}


def test_keep_in_given_in_fields_holds_its_corner_fields() -> None:
    area = Area((Cell(0, 20), Cell(9, 20), Cell(9, 29), Cell(0, 29)))
    result = laid(mission(Cell(9, 29), grid=FIXED, keep_in=(area,)))
    assert len(obstacles(result)) == 5000 - 100


def test_corridors_set_weights_but_never_open_a_fence() -> None:
    line = WeightedArea(Area((Cell(0, 24), Cell(98, 24)), width_m=0.5), 0.1)
    area = Area((Cell(50, 20), Cell(52, 20), Cell(52, 30), Cell(50, 30)))
    grid = laid(mission(Cell(98, 24), grid=FIXED, weighted=(line,), keep_out=(area,))).grid
    assert grid.weights[24, 10] == 0.1
    assert grid.weights[25, 10] == BASE_WEIGHT
    assert grid.weights[24, 51] == OBSTACLE


@pytest.mark.parametrize("north_m", [0.0, 0.2])
def test_places_behind_fences_are_refused(north_m: float) -> None:
    fence = Area((HomePoint(north_m, 50.0),), radius_m=3.0)
    assert "target 1 't0': lies in (or within a field of) keep_out 1" in refusal(
        mission(Cell(50, 24), grid=FIXED, keep_out=(fence,))
    )
    ring = Area((HomePoint(north_m, 50.0),), radius_m=20.0)
    assert "home (where the rover begins): lies outside" in refusal(mission(Cell(50, 24), grid=FIXED, keep_in=(ring,)))


def test_a_target_outside_a_fixed_grid_is_refused() -> None:
    text = refusal(mission(FRAME.to_geo(NedPoint(500.0, 0.0)), grid=FIXED))
    assert "target 1 't0': 497.0 m north, 4.0 m east of home is outside the grid of 100 x 50 fields" in text


def test_a_mission_on_the_other_side_of_the_world_is_refused_with_a_remedy() -> None:
    text = refusal(mission(GeoPoint(-35.36, 149.16)))
    assert " km is more ground than a rover can keep a map of; target 1 't0' is 1" in text
    assert text.endswith(" km from home; is that meant? Check the coordinates") and "resolution_m" not in text
    nearer = refusal(mission(HomePoint(2000.0, 0.0), HomePoint(0.0, 90_000.0)))
    assert nearer.endswith("target 2 't1' is 90.0 km from home; is that meant? If it is, drive it in parts")
    assert "resolution_m = " in refusal(mission(HomePoint(1500.0, 1500.0)))


def test_the_suggested_resolution_is_enough() -> None:
    text = refusal(mission(HomePoint(1500.0, 1500.0)))
    resolution_m = float(text.split("resolution_m = ")[1].split()[0])
    result = laid(mission(HomePoint(1500.0, 1500.0), grid=GridSpec(resolution_m)))
    assert result.grid.weights.size <= 4_000_000


def test_a_mission_without_targets_is_refused() -> None:
    assert "target: there is none" in refusal(mission())


# --- known maps ------------------------------------------------------------------------------------------------------


def known(folder: Path, *cells: tuple[int, int], resolution_m: float = 1.0, corner: NedPoint = HOME) -> Path:
    weights = np.full((20, 30), BASE_WEIGHT)
    for x, y in cells:
        weights[y, x] = OBSTACLE
    save_ros_map(Grid(weights, resolution_m, corner), folder / "known")
    return folder / "known.yaml"


def test_a_ros_map_lies_where_it_says_from_home(tmp_path: Path) -> None:
    path = known(tmp_path, (4, 6), corner=NedPoint(-10.5, 9.5))
    result = laid(mission(Cell(98, 24), grid=FIXED, prior_map=path))
    # The map's field (0, 0) is 10 m south and 10 m east of home: field (10, 14) of the grid.
    assert obstacles(result) == {(14, 20)}


def test_a_finer_map_closes_every_field_it_reaches_into(tmp_path: Path) -> None:
    path = known(tmp_path, (9, 0), (12, 3), resolution_m=0.1, corner=NedPoint(-0.5, 4.55))
    result = laid(mission(Cell(98, 24), grid=FIXED, prior_map=path))
    # 9 * 0.1 + 4.55 = 5.45 .. 5.55: over the edge between fields 5 and 6.
    assert obstacles(result) == {(5, 24), (6, 24)}


def test_a_coarser_map_closes_all_fields_below_it() -> None:
    prior = Grid(np.array([[BASE_WEIGHT, OBSTACLE]]), 2.0, NedPoint(0.0, 0.0))
    assert (stamp_prior(empty_grid(5, 3), prior).weights >= OBSTACLE).tolist() == [
        [False, False, True, True, False],
        [False, False, True, True, False],
        [False] * 5,
    ]


def test_a_map_that_lies_apart_changes_nothing() -> None:
    prior = Grid(np.full((3, 3), OBSTACLE), 1.0, NedPoint(50.0, 50.0))
    assert (stamp_prior(empty_grid(5, 5), prior).weights == BASE_WEIGHT).all()
    before = Grid(np.full((3, 3), OBSTACLE), 1.0, NedPoint(-3.0, 0.0))
    assert (stamp_prior(empty_grid(5, 5), before).weights == BASE_WEIGHT).all()


def test_costs_of_the_map_are_taken_over() -> None:
    prior = Grid(np.full((2, 2), 0.8), 1.0, NedPoint(1.0, 1.0))
    weights = stamp_prior(empty_grid(4, 4), prior).weights
    assert weights[1:3, 1:3].tolist() == [[0.8, 0.8], [0.8, 0.8]]
    assert weights.sum() == pytest.approx(4 * 0.8 + 12 * BASE_WEIGHT)


def test_a_picture_lies_on_the_missions_grid_and_needs_one(tmp_path: Path) -> None:
    path = tmp_path / "known.map"
    path.write_text("type octile\nheight 2\nwidth 3\nmap\n...\n.@.\n")
    assert obstacles(laid(mission(Cell(98, 24), grid=FIXED, prior_map=path))) == {(1, 0)}
    assert "prior_map: known.map" in refusal(mission(HomePoint(1.0, 1.0), prior_map=path))


def test_a_bad_known_map_is_a_mission_error(tmp_path: Path) -> None:
    path = tmp_path / "known.map"
    path.write_text("type octile\n")
    assert "header" in refusal(mission(Cell(98, 24), grid=FIXED, prior_map=path))


def test_a_laid_grid_holds_the_known_map(tmp_path: Path) -> None:
    path = known(tmp_path, (29, 19), resolution_m=4.0, corner=NedPoint(0.0, 0.0))
    result = laid(mission(HomePoint(1.0, 1.0), prior_map=path))
    assert len(obstacles(result)) in (16, 20, 25)


# --- rasters ---------------------------------------------------------------------------------------------------------


def test_rasters_agree_with_asking_field_by_field() -> None:
    grid = empty_grid(40, 30, 0.5, NedPoint(-3.0, -4.0))
    shape = shapely.Polygon([(0, 0), (9, 1), (14, 9), (6, 6), (-2, 9)])
    squares = [[shapely.box(-4 + x / 2, -3 + y / 2, -3.5 + x / 2, -2.5 + y / 2) for x in range(40)] for y in range(30)]
    touching = [[shape.intersection(square).area > 1e-9 for square in row] for row in squares]
    inside = [[shape.covers(square) for square in row] for row in squares]
    assert touched(grid, shape).tolist() == touching
    assert covered(grid, shape).tolist() == inside
