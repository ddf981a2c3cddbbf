"""Made worlds: from a seed, with a way, within their parameters; and what makes them difficult."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from pydantic import ValidationError
from typer.testing import CliRunner

from companion.mission.load import load_mission
from sitl.cli.commands import app
from sitl.generators.canvas import EAST_M, FINE_M, NORTH_M, disc, empty
from sitl.generators.kinds import KINDS, Forest, GroundKind, Maze, Rooms, Yard
from sitl.generators.made_ground import ACROSS_M, MadeGround, NoWayError, made
from sitl.generators.shortest_way import BODY_M
from sitl.scenario import scenario_from_mission
from sitl.world.world import World


@pytest.mark.parametrize("kind", list(GroundKind))
def test_a_seed_gives_one_world_with_a_way(kind: GroundKind) -> None:
    one, again, other = made(kind, 3), made(kind, 3), made(kind, 4)
    assert np.array_equal(one.world.obstacles, again.world.obstacles) and one.start_m == again.start_m
    assert not np.array_equal(one.world.obstacles, other.world.obstacles)
    norths, easts = np.nonzero(one.world.obstacles)
    places_m = np.column_stack((norths, easts)) * FINE_M + 0.5 * FINE_M
    for place in one.way_m[::5]:
        assert np.hypot(*(places_m - place).T).min() >= BODY_M
    assert np.hypot(*(one.way_m[0] - one.start_m)) < 0.3 and np.hypot(*(one.way_m[-1] - one.goal_m)) < 0.3
    assert np.hypot(*np.diff(one.way_m, axis=0).T).max() < 0.3


@pytest.mark.parametrize("kind", list(GroundKind))
def test_a_target_may_lie_nearer_on_the_same_ground(kind: GroundKind) -> None:
    for seed in range(3):
        far, near = made(kind, seed), made(kind, seed, target_east_m=10.0)
        assert near.goal_m[1] - near.start_m[1] == 10.0 and abs(near.goal_m[0] - near.start_m[0]) <= 10.0 + 1e-9
        assert np.hypot(*(near.way_m[-1] - near.goal_m)) < 0.3
        assert far.goal_m == made(kind, seed, target_east_m=ACROSS_M).goal_m


def test_parameters_change_what_they_say() -> None:
    grounds = [made(GroundKind.FOREST, 1, Forest(per_100_m2=trees)).world.obstacles for trees in (2.0, 12.0)]
    few, many = (solid[1:-1, 1:-1].sum() for solid in grounds)
    assert many > 3 * few
    wide, narrow = (made(GroundKind.MAZE, 1, Maze(corridor_m=m)).difficulty.characteristic_m for m in (5.0, 2.0))
    assert wide > 1.5 * narrow
    with pytest.raises(ValidationError, match=r"most_door_m 1.5 is less than least_door_m 3"):
        Rooms(least_door_m=3.0, most_door_m=1.5)


def test_a_yard_has_a_house_and_hedges_where_they_are_asked_for_and_its_gates_stay() -> None:
    plain = made(GroundKind.YARD, 0).world.obstacles
    house = made(GroundKind.YARD, 0, Yard(house=1)).world.obstacles
    norths, easts = np.nonzero(house & ~plain)
    assert house[norths.min() : norths.max() + 1, easts.min() : easts.max() + 1].all(), "no door, and a container less"
    assert (np.ptp(norths) + 1) * FINE_M == pytest.approx(8.0) and (np.ptp(easts) + 1) * FINE_M == pytest.approx(4.5)
    hedged = made(GroundKind.YARD, 0, Yard(hedges=2, hedge_m=0.6)).world.obstacles
    assert (hedged & ~plain).any(axis=0).sum() == 12, "columns of two hedges"
    fences = np.flatnonzero(plain[1:-1, 1:-1].mean(axis=0) > 0.7) + 1
    beside = [column for column in fences if (hedged & ~plain)[:, column + 1].any()]
    assert len(beside) == 2
    for column in beside:
        assert np.array_equal(hedged[1:-1, column + 6], plain[1:-1, column]), "open where the fence is"


def test_ground_without_a_way_is_not_looked_for_for_ever(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sitl.generators.made_ground.MOST_DRAWN", 3)
    with pytest.raises(NoWayError, match="make it less dense"):
        made(GroundKind.FOREST, 0, Forest(per_100_m2=30.0, least_radius_m=0.9, most_radius_m=1.0))


def test_the_measures_are_those_of_a_corridor() -> None:
    solid = empty()
    solid[: round(15.0 / FINE_M)] = True
    solid[round(17.0 / FINE_M) :] = True
    way_m = np.column_stack((np.full(150, 16.0), np.linspace(12.0, 32.0, 150)))
    found = MadeGround(GroundKind.MAZE, World(solid, FINE_M), (16.0, 12.0), (16.0, 32.0), way_m).difficulty
    assert found.closest_wall_m == pytest.approx(1.0, abs=0.1)
    assert found.characteristic_m == pytest.approx(2.0, abs=0.2)
    bearings = np.arange(16) * np.pi / 8.0
    rays_m = np.minimum(8.0, 1.0 / np.maximum(np.abs(np.cos(bearings)), 1e-9))
    assert found.visibility_m == pytest.approx(rays_m.mean(), abs=0.1), "1 m to both sides, 8 m ahead and behind"
    assert found.tortuosity == pytest.approx(1.0)
    assert found.dispersion == pytest.approx(4.0), "free ahead and behind, shut on both sides"


def test_on_empty_ground_the_way_is_straight() -> None:
    grounds = [made(GroundKind.FOREST, seed, Forest(per_100_m2=0.0)) for seed in range(4)]
    assert max(abs(one.goal_m[0] - one.start_m[0]) for one in grounds) > 5.0, "not along a row of fields"
    assert max(one.difficulty.tortuosity for one in grounds) < 1.005


def test_a_disc_is_round_and_stays_on_the_ground() -> None:
    solid = empty()
    disc(solid, 10.0, 20.0, 1.5)
    assert solid.sum() * FINE_M**2 == pytest.approx(np.pi * 1.5**2, rel=0.02)
    disc(solid, 0.0, EAST_M, 2.0)
    disc(solid, NORTH_M, 0.0, 2.0)
    assert solid.shape == empty().shape


def test_the_command_writes_a_mission_that_is_driven_in_that_world(tmp_path: Path) -> None:
    arguments = ["world", "make", "warehouse", "--seed", "2", "--set", "pallets=3", "--movers", "2"]
    result = CliRunner().invoke(app, [*arguments, "--out", str(tmp_path), "--image", str(tmp_path / "w.jpg")])
    assert result.exit_code == 0, result.output
    with Image.open(tmp_path / "w.jpg") as drawn:
        assert "tortuosity" in result.output and drawn.size[0] > 600
    mission = load_mission(tmp_path / "warehouse-2.toml")
    scenario = scenario_from_mission(mission)
    ground = made(GroundKind.WAREHOUSE, 2, KINDS[GroundKind.WAREHOUSE](pallets=3), 2)  # type: ignore[call-arg]
    assert np.array_equal(scenario.world.obstacles, ground.world.obstacles)
    assert scenario.start.north_m == pytest.approx(ground.start_m[0], abs=FINE_M)
    assert len(scenario.world.movers) == 2
    for one, two in zip(scenario.world.movers, ground.world.movers, strict=True):
        assert one.track == pytest.approx(two.track, abs=FINE_M)


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["maze", "--set", "corridor_m"], "give a parameter as NAME=VALUE, like corridor_m=3"),
        (["maze", "--set", "corridor_m=2", "--set", "corridor_m=3"], "--set corridor_m=3: corridor_m is given twice"),
        (["maze", "--set", "corridor=3"], "did you mean 'corridor_m'"),
        (["maze", "--set", "corridor_m=0.5"], "maze: corridor_m: must be 1.6 or more"),
        (["maze", "--image", "maze"], "the name says no picture format"),
    ],
)
def test_what_cannot_be_made_is_one_line(tmp_path: Path, arguments: list[str], says: str) -> None:
    result = CliRunner().invoke(app, ["world", "make", *arguments, "--out", str(tmp_path)])
    assert result.exit_code == 2 and says in result.output and len(result.output.strip().splitlines()) == 1


def parameter_rows() -> list[str]:
    """The table of the page."""
    rows = []
    for kind, model in KINDS.items():
        for name, field in model.model_fields.items():
            bounds = {side: getattr(one, side) for one in field.metadata for side in ("ge", "le") if hasattr(one, side)}
            least, most = bounds["ge"], bounds["le"]
            rows.append(f"| `{kind}` | `{name}` | {field.default:g} | {least:g} to {most:g} | {field.description} |")
    return rows


def test_the_page_has_every_parameter() -> None:
    page = (Path(__file__).resolve().parents[3] / "docs" / "worlds.md").read_text(encoding="utf-8")
    assert [row for row in parameter_rows() if row not in page] == []
