"""The known map, as it is told, and what counts together."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from companion.core.frames import NedPoint
from companion.core.grid import empty_grid
from companion.mapping.evidence_map import new_map
from companion.mapping.map_queries import occupied_fields
from companion.mission.mission import Mission
from companion.settings import Settings
from sitl.cli.commands import app
from sitl.experiments import driving_courses
from sitl.experiments.driving import DrivingReport, Series, together
from sitl.experiments.driving_courses import CourseDrive, drive, tell
from sitl.experiments.experiment import Options
from sitl.generators.made_ground import made
from sitl.lockstep import Drive, DriveOutcome, Report
from sitl.scenario import SOMEWHERE, Scenario
from sitl.world.truth import SimStart
from sitl.world.world import World

RADIUS_M = 0.35


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("kind", ["rooms", "maze", "yard"])
def test_no_wall_of_the_told_map_has_a_hole_and_beyond_it_nothing_is_known(kind: str, seed: int) -> None:
    ground = made(kind, seed)
    start = SimStart(*ground.start_m, math.pi / 2.0, SOMEWHERE)
    corner = NedPoint(-40.3 + 0.05 * seed, -20.1)
    evidence = new_map(empty_grid(170, 170, 0.5, corner), RADIUS_M, Settings().mapping)
    tell(evidence, ground.world, start)
    occupied = evidence.log_odds >= evidence.settings.occupied_at
    north, east = np.nonzero(ground.world.obstacles)
    rows, columns = (
        ((places + 0.5) * ground.world.resolution_m - begin_m - edge_m) / evidence.evidence_m
        for places, begin_m, edge_m in ((north, start.north_m, corner.north_m), (east, start.east_m, corner.east_m))
    )
    assert occupied[rows.astype(int), columns.astype(int)].all()
    inside = np.zeros_like(occupied)
    inside[
        math.floor(rows.min()) - 1 : math.ceil(rows.max()) + 2,
        math.floor(columns.min()) - 1 : math.ceil(columns.max()) + 2,
    ] = True
    assert not evidence.log_odds[~inside].any() and (evidence.log_odds < 0.0).sum() > 10_000


def test_on_fields_of_the_worlds_size_the_told_map_is_the_world() -> None:
    rng = np.random.default_rng(0)
    world = World(rng.uniform(size=(15, 24)) < 0.2)
    start = SimStart(7.5, 2.5, 0.0, SOMEWHERE)
    evidence = new_map(empty_grid(24, 15, 1.0, NedPoint(-7.5, -2.5)), RADIUS_M, Settings().mapping)
    tell(evidence, world, start)
    assert (occupied_fields(evidence) == world.obstacles).all()


def test_together_each_seed_counts_once_and_only_if_every_course_was_driven_to_its_end() -> None:
    def series(course: str, *times_s: float) -> Series:
        reports = (Report(0, DriveOutcome.REACHED, driving_time_s=one) for one in times_s)
        late = Report(0, DriveOutcome.TIME_LIMIT, driving_time_s=1800.0)
        return Series("hybrid", course, (*map(CourseDrive, reports), CourseDrive(late)))

    times_s = together([series("a", 10.0, 12.0, 14.0), series("b", 100.0, 110.0, 120.0)])
    assert times_s[:3].tolist() == [55.0, 61.0, 67.0] and math.isnan(times_s[3])
    assert series("a", 10.0).time_s == 10.0 and series("a", 10.0).missed == 1


def test_a_planner_that_reached_only_the_easy_targets_is_compared_on_those_alone() -> None:
    """Its mean stood over that of all seeds: as slow as the reference on each ground, it looked quicker."""

    def series(planner: str, times_s: list[float], known: bool = False) -> Series:
        drives = (
            CourseDrive(
                Report(
                    0, DriveOutcome.TIME_LIMIT if math.isnan(time_s) else DriveOutcome.REACHED, driving_time_s=time_s
                ),
                bound_s,
            )
            for time_s, bound_s in zip(times_s, (10.0, 20.0), strict=True)
        )
        return Series(planner, "a", tuple(drives), known)

    both = (series("theta-star", [20.0, 60.0]), series("theta-star", [15.0, 50.0], known=True))
    report = DrivingReport(Options(runs=2), (series("prm", [20.0, math.nan]), *both))
    told = {row[0]: row[1:5] for row in report._rows("a")}
    assert told["theta-star"][2] == "1.231 (1.200 to 1.333)"
    rows = {name: [cell.partition(" (")[0] for cell in row] for name, row in told.items()}
    assert rows["prm"] == ["20.0", "1.000", "1.333", "2.000"]
    assert rows["theta-star"][2:] == ["1.231", "2.667"] and rows["bound"] == ["15.0", "0.375", "0.462", "1.000"]


def test_with_a_turning_radius_companion_and_rover_have_steered_wheels(monkeypatch: pytest.MonkeyPatch) -> None:
    radii_m: list[tuple[float, float]] = []

    def noted(mission: Mission, scenario: Scenario, *rest: Any) -> Drive:
        radii_m.append((mission.rover.turning_radius_m, scenario.turning_radius_m))
        return Drive(mission, scenario, *rest)

    monkeypatch.setattr(driving_courses, "Drive", noted)
    monkeypatch.setattr(driving_courses, "TIME_LIMIT_S", 1.0)
    drive("forest", "theta-star", 0, turning_radius_m=2.5)
    drive("forest", "theta-star", 0)
    assert radii_m == [(2.5, 2.5), (0.0, 0.0)]


def test_steered_wheels_have_a_section_and_a_picture_of_their_own() -> None:
    usual, steered = (DrivingReport(Options(runs=1, turning_radius_m=radius_m), ()) for radius_m in (0.0, 2.5))
    assert (usual.section_name, steered.section_name) == ("driving", "driving-steered")
    assert "--turning-radius 2.5" in steered.options.command("driving")
    assert "--turning-radius" not in usual.options.command("driving")


@pytest.mark.parametrize("arguments", [["gates"], ["driving", "--world", "map.map"]])
def test_a_turning_radius_goes_with_random_grounds_alone(arguments: list[str]) -> None:
    result = CliRunner().invoke(app, ["experiment", *arguments, "--turning-radius", "2.5"])
    assert result.exit_code == 2 and result.output.startswith("--turning-radius: ")


@pytest.mark.thorough
def test_with_steered_wheels_it_comes_through_a_forest() -> None:
    steered = drive("forest", "theta-star", 0, turning_radius_m=2.5)
    assert steered.reached and steered.report.collisions == 0
    assert steered.report.driving_time_s != drive("forest", "theta-star", 0).report.driving_time_s


@pytest.mark.thorough
def test_no_drive_beats_the_bound_and_on_the_known_map_it_is_nearer_to_it() -> None:
    unknown, known = drive("maze", "theta-star", 1), drive("maze", "theta-star", 1, known=True)
    assert known.bound_s is not None and unknown.bound_s is None
    assert known.bound_s < known.report.driving_time_s < 0.9 * unknown.report.driving_time_s
    assert known.report.drawn_ah < unknown.report.drawn_ah
