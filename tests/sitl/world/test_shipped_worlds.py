"""The shipped missions and worlds: what they promise holds."""

import runpy
from pathlib import Path

import numpy as np
import pytest
from scipy import ndimage

from companion.core.frames import GeoPoint, LocalFrame, NedPoint
from companion.core.grid import OBSTACLE, Cell, inflated
from companion.mapping.map_files import load_map
from companion.mission.load import load_mission
from companion.mission.mission import OnBlocked
from companion.mission.resolve import resolve
from sitl.world.world_file import load_world

MISSIONS = Path(__file__).resolve().parents[3] / "missions"
MAPS = MISSIONS / "maps"
WORLDS = sorted(path.stem for path in MAPS.glob("*.png"))
START, TARGET = (24, 0), (24, 98)
EIGHT = np.ones((3, 3), dtype=bool)


def world(name: str) -> np.ndarray:
    """Obstacles, indexed [y, x]."""
    return load_map(MAPS / f"{name}.png").weights >= OBSTACLE


def joined(free: np.ndarray, a: tuple[int, int], b: tuple[int, int]) -> bool:
    """Whether one can step from a to b, never diagonally."""
    labels, _ = ndimage.label(free)
    return bool(labels[a] != 0 and labels[a] == labels[b])


def opened(mask: np.ndarray, size: int) -> np.ndarray:
    """What a square of so many fields can sweep over without leaving the mask; ground beyond the map belongs to it."""
    padded = np.pad(mask, size, constant_values=True)
    swept = ndimage.binary_opening(padded, np.ones((size, size), dtype=bool))
    return swept[size:-size, size:-size]


def test_the_worlds_that_are_promised_are_there() -> None:
    expected = {"one-obstacle", "clutter", "rooms", "complex", "dead-end", "sealed", "crossing", "ackermann"}
    assert set(WORLDS) == expected | {f"known-{i}" for i in range(1, 5)}
    assert all(world(name).shape == (50, 100) for name in WORLDS)


@pytest.mark.parametrize("name", WORLDS)
def test_there_is_a_way_wide_enough_unless_sealed(name: str) -> None:
    obstacles = world(name)
    assert joined(~obstacles, START, TARGET) == (name != "sealed")
    # Room for the middle of a square of 3 x 3 fields: every passage on the way is three fields wide.
    roomy = ~ndimage.binary_dilation(obstacles, EIGHT)
    assert joined(roomy, START, (24, 97 if name in ("known-4", "sealed") else 98)) == (name != "sealed")


@pytest.mark.parametrize("name", WORLDS)
def test_no_slits_of_one_field_and_no_walls_that_meet_at_a_corner_only(name: str) -> None:
    obstacles = world(name)
    assert (opened(~obstacles, 2) == ~obstacles).all()
    a, b, c, d = obstacles[:-1, :-1], obstacles[1:, 1:], obstacles[:-1, 1:], obstacles[1:, :-1]
    assert not ((a & b & ~c & ~d) | (c & d & ~a & ~b)).any()


@pytest.mark.parametrize("name", WORLDS)
def test_start_and_target_stand_free(name: str) -> None:
    obstacles = world(name)
    for y, x in (START, TARGET):
        ring = obstacles[y - 1 : y + 2, max(0, x - 1) : x + 2]
        assert ring[:, : 2 if x == 98 and name in ("sealed", "known-4") else 3].sum() == 0


def test_inflation_by_the_rovers_radius_closes_nothing() -> None:
    for name in WORLDS:
        weights = load_map(MAPS / f"{name}.png").weights
        assert (inflated(weights, 0.35) == weights).all()
        closed = inflated(weights, 0.99) >= OBSTACLE
        assert joined(~closed, START, (24, 97)) == (name != "sealed")


def test_clutter_has_22_simple_obstacles_and_complex_18() -> None:
    labels, count = ndimage.label(world("clutter"), EIGHT)
    assert count == 22
    for piece in ndimage.find_objects(labels):
        assert (labels[piece] > 0).all()
    assert ndimage.label(world("complex"), EIGHT)[1] == 18
    assert ndimage.label(world("one-obstacle"), EIGHT)[1] == 1


def test_the_dead_end_winds_and_is_deeper_than_the_rover_sees() -> None:
    obstacles = world("dead-end")
    assert not obstacles[24, :42].any() and obstacles[24, 70]
    walls = obstacles[12, 30:72].all() and obstacles[36, 30:72].all() and obstacles[12:37, 71].all()
    assert walls and not obstacles[14:35, 30:42].any()
    # From its inmost part the only way out is the way in: with the mouth closed nothing outside is reached.
    stopped = ~obstacles
    stopped[14:35, 30] = False
    assert joined(~obstacles, (24, 68), (24, 98))
    assert not joined(stopped, (24, 68), (24, 98))
    # Each baffle makes it wind: in steps along rows and columns the way out is far longer than the 38 to the mouth.
    reached = np.zeros_like(obstacles)
    reached[24, 68] = True
    steps = 0
    while not reached[14:35, 30].any():
        reached = ndimage.binary_dilation(reached) & ~obstacles
        steps += 1
    assert steps > 50


def test_the_straight_way_is_blocked_wherever_something_is_to_be_avoided() -> None:
    for name in WORLDS:
        assert world(name)[24, :99].any()


def test_drawing_again_gives_the_same_pictures(tmp_path: Path) -> None:
    drawing = runpy.run_path(str(MAPS / "draw.py"))
    assert set(drawing["WORLDS"]) == set(WORLDS)
    for name, draw in drawing["WORLDS"].items():
        assert np.array_equal(draw(), world(name))
    save, rooms = drawing["save"], drawing["rooms"]
    save(rooms(), tmp_path / "a.png")
    save(rooms(), tmp_path / "b.png")
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()


DRAWN = [path for path in sorted(MISSIONS.glob("*.toml")) if path.stem != "depot"]


@pytest.mark.parametrize("path", DRAWN, ids=lambda path: path.stem)
def test_toml_missions_lie_on_their_worlds(path: Path) -> None:
    mission = load_mission(path)
    assert mission.sitl is not None and mission.sitl.start in (None, mission.grid.home)
    result = resolve(mission, LocalFrame(GeoPoint(53.0, 23.0)), NedPoint(0.0, 0.0))
    assert (result.grid.width, result.grid.height, result.home_cell) == (100, 50, Cell(0, 24))
    if mission.sitl.world is not None:
        ground = load_map(mission.sitl.world)
        assert all(not ground.is_obstacle(target.cell) for target in result.targets)
        assert mission.sitl.world.stem == path.stem
    assert Cell(98, 24) in [target.cell for target in result.targets]


def test_the_depot_keeps_out_of_what_no_lidar_sees_and_can_be_driven_once_its_gate_is_open() -> None:
    mission = load_mission(MISSIONS / "depot.toml")
    result = resolve(mission, LocalFrame(GeoPoint(53.0, 23.0)), NedPoint(0.0, 0.0))
    depot = load_world(MISSIONS / "worlds" / "depot.toml")
    assert depot.glass is not None and depot.black is not None
    closed = np.kron(result.grid.weights >= OBSTACLE, np.ones((5, 5), dtype=bool))
    assert closed.shape == depot.obstacles.shape
    assert closed[depot.glass].all() and closed[depot.black].all()
    (target,) = result.targets
    start, end = ((cell.y * 5 + 2, cell.x * 5 + 2) for cell in (result.home_cell, target.cell))
    solid = {time_s: depot.layers(time_s).solid.fields for time_s in (0.0, 60.0, 81.0)}
    rover = ndimage.distance_transform_edt
    ways = {time_s: joined(rover(~there) > 4.0, start, end) for time_s, there in solid.items()}
    assert ways == {0.0: False, 60.0: False, 81.0: True}


def test_what_is_special_about_single_missions() -> None:
    missions = {path.stem: load_mission(path) for path in MISSIONS.glob("*.toml")}
    assert missions["rooms"].sitl is not None and missions["rooms"].sitl.sensors == "lidar-90"
    assert missions["sealed"].targets[0].on_blocked is OnBlocked.RETURN
    assert len(missions["open"].targets) == 3
    assert any(target.hold_s > 0.0 for target in missions["open"].targets)


def test_field_plan_and_field_waypoints_are_one_mission() -> None:
    plan, waypoints = load_mission(MISSIONS / "field.plan"), load_mission(MISSIONS / "field.waypoints")
    assert plan.targets == waypoints.targets
    assert plan.keep_out == waypoints.keep_out
    assert plan.planned_home == waypoints.planned_home
    assert plan.planned_home is not None and len(plan.keep_out) == 1
    assert [target.hold_s for target in plan.targets] == [0.0, 5.0, 0.0, 0.0]
    assert [target.speed_m_s for target in plan.targets] == [None, None, 1.0, 1.0]


def test_the_fence_of_the_field_mission_lies_across_the_straight_way() -> None:
    mission = load_mission(MISSIONS / "field.plan")
    assert mission.planned_home is not None
    result = resolve(mission, LocalFrame(mission.planned_home), NedPoint(0.0, 0.0))
    second, third = result.targets[1].point, result.targets[2].point
    ends = ((second.north_m, third.north_m), (second.east_m, third.east_m))
    steps = [NedPoint(*(a + t / 100 * (b - a) for a, b in ends)) for t in range(101)]
    assert any(result.grid.is_obstacle(result.grid.cell_at(step)) for step in steps)
    assert all(point.distance_m(NedPoint(0.0, 0.0)) < 100.0 for point in (second, third))
