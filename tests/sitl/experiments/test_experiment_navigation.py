"""The experiments that compare planners on the way: field by field, and driven."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from companion.core.grid import Cell, empty_grid
from companion.executive.mission_progress import TargetStatus
from sitl.cli.commands import app
from sitl.experiments import navigation
from sitl.experiments.driving import Series, shortfalls
from sitl.experiments.driving_courses import CourseDrive
from sitl.experiments.field_level import FieldRun, Outcome
from sitl.lockstep import DriveOutcome, Report

MAP = """type octile
height 6
width 9
map
.........
....@....
....@....
....@....
....@....
....@....
"""
SCENARIOS = """version 1
0\tslit.map\t9\t6\t0\t5\t8\t5\t13.656854
0\tslit.map\t9\t6\t8\t5\t0\t2\t12.071068
"""


@pytest.fixture
def world(tmp_path: Path) -> Path:
    (tmp_path / "slit.map.scen").write_text(SCENARIOS, encoding="ascii")
    file = tmp_path / "slit.map"
    file.write_text(MAP, encoding="ascii")
    return file


def figures_of(world: Path, name: str) -> dict[tuple[str, str], dict[str, object]]:
    file = world.with_name(name)
    arguments = ["experiment", "navigation", "--runs", "2", "--planners", "hybrid,dstar-lite", "--world", str(world)]
    result = CliRunner().invoke(app, [*arguments, "--json", str(file)])
    assert result.exit_code == 0, result.output
    return {(one["planner"], one["map"]): one for one in json.loads(file.read_text())["results"]}


@pytest.mark.thorough
def test_navigation_drives_each_planner_through_given_maps(world: Path) -> None:
    once, again = figures_of(world, "one.json"), figures_of(world, "two.json")
    maps, kinds = ("one-obstacle", "clutter", "rooms", "complex", "slit"), [f"made {kind}" for kind in navigation.KINDS]
    assert set(once) == {(p, m) for p in ("hybrid", "dstar-lite") for m in (*maps, *kinds)}
    for (planner, name), series in once.items():
        runs = 2 if name in kinds else (2 if planner == "hybrid" else 1) * (2 if name == "slit" else 1)
        assert series["outcomes"] == ["reached"] * runs
        assert all(over >= 1.0 for over in series["steps_over_best"])  # type: ignore[attr-defined]
        for key in ("steps", "return_steps", "searches"):
            assert series[key] == again[planner, name][key]


def test_a_map_without_scenarios_is_one_line(tmp_path: Path) -> None:
    file = tmp_path / "bare.map"
    file.write_text(MAP, encoding="ascii")
    result = CliRunner().invoke(app, ["experiment", "navigation", "--world", str(file)])
    assert result.exit_code == 2 and "bare.map.scen" in result.stderr and len(result.stderr.splitlines()) == 1


def driven(
    planner: str, mission: str, time_s: float, steps: int, outcome: DriveOutcome = DriveOutcome.REACHED
) -> Series:
    return Series(planner, mission, (CourseDrive(Report(0, outcome, steps=steps, driving_time_s=time_s)),))


def test_every_shortfall_of_driving_is_said() -> None:
    good = (driven("hybrid", "a", 9.0, 105), driven("theta-star", "a", 9.5, 90))
    text = shortfalls((*good, driven("dstar-lite", "a", 8.0, 100)))
    assert text.count("reached") == 3 and "not reached" not in text
    bad = (
        driven("hybrid", "b", 11.0, 120),
        driven("hybrid", "c", 11.0, 120, DriveOutcome.TIME_LIMIT),
        driven("theta-star", "b", 10.0, 90),
        driven("dstar-lite", "b", 8.0, 100),
    )
    text = shortfalls((*good, *bad))
    assert "not reached: b (1.100)" in text and "not reached: b (1.200)" in text and "1 missed" in text
    assert shortfalls(good[1:]) == ""


def test_a_target_missed_counts_in_a_drive_with_a_collision_too() -> None:
    report = Report(
        0, DriveOutcome.COLLISION, [("gate", TargetStatus.REACHED), ("home", TargetStatus.UNREACHABLE)], collisions=1
    )
    assert Series("hybrid", "a", (CourseDrive(report),)).missed == 1
    report = Report(0, DriveOutcome.COLLISION, [("gate", TargetStatus.REACHED)], collisions=1)
    assert Series("hybrid", "a", (CourseDrive(report),)).missed == 0


def test_every_shortfall_of_navigation_is_said() -> None:
    def series(planner: str, name: str, *steps: int) -> navigation.Series:
        ground = navigation.Ground(name, empty_grid(3, 3), Cell(0, 0), Cell(2, 2), 100)
        runs = tuple(FieldRun(0, Outcome.REACHED, steps=each) for each in steps)
        return navigation.Series(planner, name, runs, (ground,) * len(runs))

    ours = [series("hybrid", "a", 100, 104), series("hybrid", "b", 120, 130, 110)]
    other = [series("dstar-lite", name, 100) for name in ("a", "b")]
    assert "not reached: b (1.200)" in navigation.shortfalls((*ours, *other))
    assert navigation.shortfalls((ours[0], other[0])).endswith("(reached).")
    assert navigation.shortfalls(tuple(ours)) == ""


@pytest.mark.parametrize(
    "option", ["--guard", "--controllers=points", "--worlds=here.npz", "--setups=strict", "--off=0.5", "--late=0.1"]
)
def test_an_option_of_another_experiment_is_refused_by_its_name(option: str) -> None:
    result = CliRunner().invoke(app, ["experiment", "navigation", "--runs", "1", option])
    assert result.exit_code == 2
    assert result.output.startswith(f"{option.partition('=')[0]}: navigation does not take it")
