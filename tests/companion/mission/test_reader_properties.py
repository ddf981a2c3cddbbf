"""Round trips of maps, and files full of nonsense: one line or a mission, never anything else."""

import json
import tempfile
from pathlib import Path

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from companion.core.frames import GeoPoint, LocalFrame, NedPoint
from companion.core.grid import BASE_WEIGHT, OBSTACLE, Cell, Grid
from companion.mapping.map_files import MapError, load_map, save_ros_map
from companion.mission.load import load_mission
from companion.mission.mission import GridSpec, HomePoint, Mission, MissionError, Target
from companion.mission.resolve import resolve
from tests.support.quick import examples

MISSIONS = Path(__file__).resolve().parents[3] / "missions"
metres = st.floats(-1e5, 1e5)
masks = arrays.arrays(np.bool_, arrays.array_shapes(min_dims=2, max_dims=2, max_side=20))


@given(masks, st.floats(0.001, 100.0), metres, metres, st.booleans())
@settings(max_examples=examples(60), deadline=None)
def test_a_saved_map_loads_as_it_was(
    blocked: np.ndarray, resolution_m: float, north_m: float, east_m: float, all_known: bool
) -> None:
    grid = Grid(np.where(blocked, OBSTACLE, BASE_WEIGHT), resolution_m, NedPoint(north_m, east_m))
    with tempfile.TemporaryDirectory() as folder:
        save_ros_map(grid, Path(folder) / "map", None if all_known else ~blocked[::-1])
        again = load_map(Path(folder) / "map.yaml")
    assert np.array_equal(again.weights, grid.weights)
    assert (again.resolution_m, again.south_west) == (grid.resolution_m, grid.south_west)


@given(
    st.tuples(st.integers(0, 40), st.integers(0, 40)), st.floats(0.05, 20.0), metres, metres,
    st.lists(st.tuples(st.integers(0, 40), st.integers(0, 40)), min_size=1, max_size=5),
)  # fmt: skip
@settings(max_examples=examples(60), deadline=None)
def test_fields_come_back_as_the_same_fields(
    home: tuple[int, int], resolution_m: float, north_m: float, east_m: float, fields: list[tuple[int, int]]
) -> None:
    targets = tuple(Target(f"{i}", Cell(*field)) for i, field in enumerate(fields))
    mission = Mission("m", targets, GridSpec(resolution_m, (41, 41), Cell(*home)))
    result = resolve(mission, LocalFrame(GeoPoint(53.0, 23.0)), NedPoint(north_m, east_m))
    assert [target.cell for target in result.targets] == [Cell(*field) for field in fields]
    assert result.home_cell == Cell(*home)


@given(st.lists(st.tuples(st.floats(-300.0, 300.0), st.floats(-300.0, 300.0)), min_size=1, max_size=4), metres, metres)
@settings(max_examples=40, deadline=None)
def test_a_laid_grid_holds_all_targets_with_a_margin(
    places: list[tuple[float, float]], north_m: float, east_m: float
) -> None:
    home = NedPoint(north_m, east_m)
    mission = Mission("m", tuple(Target("t", HomePoint(*place)) for place in places))
    result = resolve(mission, LocalFrame(GeoPoint(53.0, 23.0)), home)
    assert result.grid.centre_of(result.home_cell).distance_m(home) < 1e-6
    for target in result.targets:
        assert 24 <= target.cell.x < result.grid.width - 24
        assert 24 <= target.cell.y < result.grid.height - 24
        assert result.grid.cell_at(target.point) == target.cell


def assert_fine_or_one_line(name: str, data: bytes) -> None:
    """Loading and laying out either works or says why in one line."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / name
        path.write_bytes(data)
        try:
            if name.startswith("map"):
                assert load_map(path).weights.ndim == 2
            else:
                mission = load_mission(path)
                assert mission.targets
                resolve(mission, LocalFrame(mission.planned_home or GeoPoint(53.0, 23.0)), NedPoint(0.0, 0.0))
        except (MissionError, MapError) as error:
            assert "\n" not in str(error)
            assert str(path) in str(error)


NAMES = ["m.toml", "m.plan", "m.waypoints", "map.yaml", "map.pgm", "map.map", "map.png"]
HEADS = [
    b"",
    b"QGC WPL 110\n",
    b"P2\n2 2\n255\n",
    b"P5\n2 2\n255\n",
    b"type octile\nheight 1\nwidth 3\nmap\n",
    b"\x89PNG\r\n\x1a\n",
]


@given(st.sampled_from(NAMES), st.sampled_from(HEADS), st.binary(max_size=200))
@settings(max_examples=examples(200), deadline=None)
def test_nonsense(name: str, head: bytes, data: bytes) -> None:
    assert_fine_or_one_line(name, head + data)


SEEDS = {
    "m.toml": (MISSIONS / "open.toml").read_bytes(),
    "m.plan": (MISSIONS / "field.plan").read_bytes(),
    "m.waypoints": (MISSIONS / "field.waypoints").read_bytes(),
    "map.png": (MISSIONS / "maps" / "rooms.png").read_bytes(),
    "map.yaml": b"image: map.pgm\nresolution: 0.5\norigin: [1.0, -2.0, 0.0]\nnegate: 0\n",
    "map.pgm": b"P2\n# grey\n3 2\n255\n0 0 255\n254 205 0\n",
    "map.map": b"type octile\nheight 2\nwidth 3\nmap\n.@.\nTS.\n",
}
edits = st.lists(st.tuples(st.floats(0.0, 1.0), st.integers(0, 6), st.binary(max_size=6)), min_size=1, max_size=4)


@given(st.sampled_from(NAMES), edits)
@settings(max_examples=examples(300), deadline=None)
def test_damaged_files(name: str, changes: list[tuple[float, int, bytes]]) -> None:
    data = SEEDS[name]
    for where, cut, put in changes:
        at = int(where * len(data))
        data = data[:at] + put + data[at + cut :]
    assert_fine_or_one_line(name, data)


json_values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
    max_leaves=6,
)


@given(st.data(), json_values)
@settings(max_examples=examples(150), deadline=None)
def test_plans_with_one_value_replaced(data: st.DataObject, value: object) -> None:
    plan = json.loads(SEEDS["m.plan"])
    places: list[tuple[object, object]] = []

    def collect(node: object) -> None:
        entries = node.items() if isinstance(node, dict) else enumerate(node) if isinstance(node, list) else ()
        for key, inner in entries:
            places.append((node, key))
            collect(inner)

    collect(plan)
    node, key = data.draw(st.sampled_from(places))
    node[key] = value  # type: ignore[index]
    assert_fine_or_one_line("m.plan", json.dumps(plan).encode())
