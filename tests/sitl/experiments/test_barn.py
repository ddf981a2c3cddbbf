"""The BARN benchmark: its score against the challenge's logs, its worlds, and runs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import astuple, replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest
from numpy.typing import NDArray
from typer.testing import CliRunner

from companion.core.footprint import Footprint
from companion.lidar.spec import LidarSpec
from companion.mission.mission import Mission
from companion.settings import Settings
from sitl.cli.commands import app
from sitl.experiments import barn
from sitl.experiments.barn import (
    FASTEST,
    MADE,
    OLD_FASTEST,
    BarnReport,
    BarnRun,
    RunEnd,
    Setup,
    drive,
    limits_of,
    run,
    score,
    standard,
    with_interval,
    worst,
)
from sitl.experiments.barn_measures import difficulty_of
from sitl.experiments.barn_worlds import BODY_M, FIRST_ROW, START_M, BarnWorld, made_world, read_worlds
from sitl.experiments.experiment import Advance, ExperimentError, Options
from sitl.experiments.gates import GatesReport
from sitl.experiments.off_model import off_model
from sitl.plant.rover import SIM_ROVER
from sitl.scenario import Scenario
from sitl.sensors.range_sensors import SensorSuite
from tests.support.shared_data import SHARED

BARN = SHARED / "data" / "barn"
needs_barn = pytest.mark.skipif(not BARN.is_dir(), reason="no BARN worlds beside the checkout")


@pytest.fixture(scope="module")
def worlds() -> list[BarnWorld]:
    return read_worlds(BARN / "worlds.npz")


@needs_barn
@pytest.mark.parametrize(
    ("log", "success", "old", "new"), [("dwa_out.txt", 0.850, 0.158, 0.159), ("drl_vo_out.txt", 0.936, 0.234, 0.372)]
)
def test_the_score_is_that_of_the_challenge(
    worlds: list[BarnWorld], log: str, success: float, old: float, new: float
) -> None:
    """Two planners' 500 runs: world, success, collision, time-out, seconds, score, as the challenge counted them."""
    optimal_s = {world.number: world.optimal_s for world in worlds}
    runs = np.loadtxt(BARN / log)
    assert {int(number) for number in runs[:, 0]} == {world.number for world in standard(worlds)}
    assert runs[:, 1].mean() == pytest.approx(success)
    for fastest, expected in ((OLD_FASTEST, old), (FASTEST, new)):
        scores = [score(bool(one[1]), one[4], optimal_s[int(one[0])], fastest) for one in runs]
        assert np.mean(scores) == pytest.approx(expected, abs=6e-4)


@needs_barn
def test_its_worlds_are_where_the_challenge_has_them(worlds: list[BarnWorld]) -> None:
    assert len(worlds) == 250
    for world in worlds[::50]:
        ground = world.world()
        assert ground.clearance_m(START_M[1], START_M[0], 1.0) > 0.9
        for x, y in world.path_m:
            assert ground.clearance_m(float(y), float(x), 1.0) > 0.15, "its path is free"


@pytest.mark.parametrize("seed", [0, 1, 7])
def test_our_own_worlds_come_from_their_seed_and_have_a_way(seed: int) -> None:
    world, again = made_world(seed), made_world(seed)
    assert np.array_equal(world.lattice, again.lattice) and 5.0 < world.optimal_s < 9.0
    share = world.lattice[FIRST_ROW:, 1:-1].mean()
    assert 0.02 < share < 0.4 and not world.lattice[1:FIRST_ROW, 1:-1].any()
    ground = world.world()
    assert min(ground.clearance_m(float(y), float(x), 1.0) for x, y in world.path_m) > BODY_M - 0.1


QUARTILES_OF_BARN = np.array(
    [[0.51, 2.42, 3.46, 1.73, 1.01], [0.55, 2.71, 3.98, 2.01, 1.03], [0.66, 3.09, 4.04, 2.53, 1.06]]
)
"""Of the challenge's 250 worlds: a quarter, half and three quarters do not exceed these figures."""


def quartiles(worlds: Sequence[BarnWorld]) -> NDArray[np.float64]:
    """Of the five measures, shape (3, 5)."""
    found: NDArray[np.float64] = np.percentile([astuple(difficulty_of(one)) for one in worlds], (25, 50, 75), axis=0)
    return found


@pytest.mark.thorough
def test_our_own_worlds_are_as_hard_as_those_of_barn() -> None:
    """Within 6 %: of 50 of BARN's worlds, drawn at random, half are off by more than 7 % in one of these figures."""
    worlds = [made_world(seed) for seed in range(MADE)]
    assert quartiles(worlds) == pytest.approx(QUARTILES_OF_BARN, rel=0.06)
    beside_walls = np.mean([world.lattice[FIRST_ROW:, [1, -2]].mean() for world in worlds])
    assert 0.35 < beside_walls < 0.55, "posts stand close to the walls: in BARN 0.42 of the cells there"


def test_the_middle_one_of_a_few_of_our_worlds_is_as_hard_as_that_of_barn() -> None:
    assert quartiles([made_world(seed) for seed in range(12)])[1] == pytest.approx(QUARTILES_OF_BARN[1], rel=0.12)


@pytest.mark.thorough
@needs_barn
def test_barns_own_worlds_are_as_hard_as_is_said(worlds: list[BarnWorld]) -> None:
    assert quartiles(worlds) == pytest.approx(QUARTILES_OF_BARN, rel=0.02)


def test_a_world_without_a_way_is_refused_in_one_line() -> None:
    shut = np.zeros((64, 30), np.bool_)
    shut[50] = True
    with pytest.raises(ExperimentError, match="world 7: no way from start to goal; leave it out of --worlds"):
        difficulty_of(BarnWorld(7, shut, np.zeros((2, 2))))


def test_a_rover_off_its_model_is_off_by_no_more_than_that() -> None:
    drivetrain, limits = off_model(np.random.default_rng(3), 0.3)
    assert 0.7 <= drivetrain.top_speed_m_s / SIM_ROVER.top_speed_m_s <= 1.3
    assert 0.7 <= limits["ATC_ACCEL_MAX"] <= 1.3 and 84.0 <= limits["ATC_STR_ACC_MAX"] <= 156.0
    assert off_model(np.random.default_rng(3), 0.0)[0] == SIM_ROVER
    quick = off_model(np.random.default_rng(3), 0.3, limits_of(Setup.JACKAL))[1]
    assert 14.0 <= quick["ATC_ACCEL_MAX"] <= 26.0 and quick["MOT_SLEWRATE"] == 0.0


def test_planned_motions_lead_through_narrow_ground() -> None:
    world = made_world(3)
    one = drive(world, "motion-ga", 0)
    assert one.end is RunEnd.REACHED and one.seconds < 2.0 * world.optimal_s
    assert one.track_m[0] == pytest.approx(START_M)
    both = {(Setup.GUARDED, name): (one,) for name in ("motion-ga", "dwa")}
    report = BarnReport(Options(1), (world,), both)
    assert "not an entry" in report.section() and "motion-ga" in report.section()
    assert report.section_name == "barn" and report.pictures()["barn-worst"].axes  # type: ignore[attr-defined]
    assert len(report.as_json()["runs"]) == 2  # type: ignore[arg-type]

    other = BarnReport(Options(1), (world,), {(Setup.STRICT, "motion-ga"): (one,)})
    assert other.section_name == "barn-strict" and "(BARN): strict" in other.section()
    read = replace(other, options=replace(other.options, lidar="RPLIDAR-A1"))
    assert read.section_name == "barn-strict-rplidar-a1" and "(BARN): strict and RPLIDAR-A1" in read.section()
    alone = BarnReport(Options(1), (world,), {(Setup.GUARDED, "motion-ga"): (one,)})
    assert alone.section_name == "barn-motion-ga" and "(BARN): motion-ga" in alone.section()
    assert list(other.pictures()) == ["barn-strict-worst"] and "images/barn-strict-worst.png" in other.section()


@pytest.mark.thorough
@needs_barn
@pytest.mark.parametrize(("number", "seed"), [(120, 0), (180, 1), (204, 1), (210, 1)])
def test_over_a_late_link_it_touches_nothing(worlds: list[BarnWorld], number: int, seed: int) -> None:
    """0.2 s each way. Each ended at a post while only the latest effect of what is told was reckoned with."""
    world = next(one for one in worlds if one.number == number)
    assert drive(world, "motion-ga", seed, late_s=0.2).end is RunEnd.REACHED


def test_a_lidar_that_the_companion_reads_itself_leads_there_too_and_sees_no_more_than_the_challenges(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    world = made_world(3)
    one = drive(world, "motion-ga", 0, lidar="LD19")
    assert one.end is RunEnd.REACHED and one.seconds < 1.6 * world.optimal_s
    report = BarnReport(Options(1, lidar="LD19"), (world,), {(Setup.GUARDED, "motion-ga"): (one,)})
    page = " ".join(report.section().split())
    assert "(LD19, 10 turns a second); 270 degrees and 10 m of it count: 338 rays a turn" in page
    assert "--lidar LD19" in page and "(BARN): motion-ga and LD19" in page
    assert report.section_name == "barn-motion-ga-ld19"

    monkeypatch.setattr(barn, "Drive", drive_that_goes(9.1))
    monkeypatch.setattr(FakeDrive, "asked", [])
    drive(world, "motion-ga", 0, lidar="LD19")
    (asked,) = FakeDrive.asked
    (lidar,), (simulated,) = asked.lidars, asked.scenario.lidars
    assert (lidar.model.name, simulated.make.name) == ("LD19", "LD19")
    assert (lidar.mounting.masked_deg, lidar.mounting.max_m) == (((135.0, 225.0),), 10.0)
    assert asked.scenario.sensors == SensorSuite(), "and no distances come over MAVLink"


def test_a_lidar_is_named_as_people_write_it_and_one_that_is_none_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(barn, "Drive", drive_that_goes(9.1))
    monkeypatch.setattr(barn, "MADE", 1)
    asked = Options(1, lidar="ld-19", controllers=("dwa",))
    assert barn.run(asked, lambda done, total: None).options.lidar == "LD19"
    with pytest.raises(ExperimentError, match="--lidar 'LD18': is no model; models are LD06, LD19, "):
        barn.run(replace(asked, lidar="LD18"), lambda done, total: None)


@pytest.mark.thorough
def test_points_take_more_than_twice_the_time_there() -> None:
    motions, points = (drive(made_world(5), name, 0) for name in ("motion-ga", "points"))
    assert points.end is RunEnd.REACHED
    assert motions.seconds < 0.5 * points.seconds


@pytest.mark.thorough
def test_without_a_guard_it_takes_longer_and_with_a_jackals_limits_it_arrives() -> None:
    setups = (Setup.JACKAL, Setup.GUARDED, Setup.STRICT)
    quick, guarded, strict = (drive(made_world(3), "motion-ga", 0, setup) for setup in setups)
    assert [one.end for one in (quick, guarded, strict)] == [RunEnd.REACHED] * 3
    assert guarded.seconds < strict.seconds


def test_intervals_and_the_worst() -> None:
    def one(world: int, end: RunEnd, seconds: float) -> BarnRun:
        return BarnRun("dwa", Setup.GUARDED, world, 0, end, seconds, 5.0, np.zeros((1, 2)))

    runs = [one(0, RunEnd.REACHED, 6.0), one(1, RunEnd.CONTACT, 2.0), one(2, RunEnd.REACHED, 50.0)]
    assert [run.world for run in worst(runs)] == [1, 2, 0]
    assert with_interval(runs, lambda run: run.score()) == "0.208 (0.000 to 0.500)"


def numbered(numbers: Sequence[int]) -> tuple[BarnWorld, ...]:
    """Worlds of which nothing but the number counts."""
    return tuple(BarnWorld(number, np.zeros((64, 30), np.bool_), np.zeros((2, 2))) for number in numbers)


@pytest.mark.parametrize(
    ("archive", "numbers", "driven"),
    [
        (None, range(50), "50 worlds of our own making, 1 seed each"),
        (Path("all.npz"), range(300), "the standard set of 50 worlds, 1 seed each"),
        (Path("few.npz"), [0, 6, 7], "3 worlds of few.npz, not the standard set, 1 seed each"),
    ],
)
def test_title_and_page_say_what_is_driven(archive: Path | None, numbers: Sequence[int], driven: str) -> None:
    worlds = standard(numbered(numbers))
    runs = tuple(
        BarnRun("dwa", Setup.GUARDED, world.number, 0, RunEnd.REACHED, 6.0, 5.0, np.zeros((1, 2))) for world in worlds
    )
    report = BarnReport(Options(1, archive=archive), worlds, {(Setup.GUARDED, "dwa"): runs})
    hard, table = report.tables()
    assert str(table.title) == f"barn, guarded: {driven}"
    assert str(hard.title) == f"barn: {driven.removesuffix(', 1 seed each')}, how hard they are"
    page = " ".join(report.section().split())
    assert f"{driven[0].upper()}{driven[1:]}. Protocol" in page
    assert "gets 72 distances over MAVLink, each the shortest of 10 rays" in page
    assert ("The 3 worst runs" if len(runs) == 3 else "The 10 worst runs") in page


@pytest.mark.parametrize(
    ("name", "given", "runs"), [("barn", [], 10), ("gates", [], 100), ("barn", ["--runs", "3"], 3)]
)
def test_barn_has_ten_seeds_if_nothing_is_said(
    monkeypatch: pytest.MonkeyPatch, name: str, given: list[str], runs: int
) -> None:
    asked: list[Options] = []

    def quick(options: Options, advance: Advance) -> GatesReport:
        asked.append(options)
        return GatesReport(options, ())

    monkeypatch.setattr(f"sitl.experiments.{name}.run", quick)
    assert CliRunner().invoke(app, ["experiment", name, *given]).exit_code == 0
    assert [one.runs for one in asked] == [runs]


@pytest.mark.parametrize("shape", [(40, 20), (64,), (30, 64)])
def test_a_lattice_of_another_shape_is_refused_in_one_line(tmp_path: Path, shape: tuple[int, ...]) -> None:
    steps = np.zeros((2, 2), np.int64)
    np.savez(tmp_path / "w.npz", number=np.array([6]), lattice=np.zeros((1, *shape), np.bool_), path_6=steps)
    with pytest.raises(ExperimentError, match=r"w\.npz: world 6: its lattice has the shape .*; one of 64 x 30 cells"):
        read_worlds(tmp_path / "w.npz")


EMPTY, WAY = np.zeros((1, 64, 30), np.bool_), np.array([[14, 0], [14, 1]])


@pytest.mark.parametrize(
    ("arrays", "says"),
    [
        ({"path_6": WAY[0]}, r"world 6: its path has the shape \(2,\)"),
        ({"path_6": WAY[:1]}, r"world 6: its path has the shape \(1, 2\)"),
        ({"path_6": np.full((3, 2), np.nan)}, "world 6: its path has no numbers"),
        ({"path_6": WAY, "lattice": EMPTY + 0.5}, "world 6: its lattice has values other than 0"),
        ({"path_6": WAY, "lattice": np.repeat(EMPTY, 2, 0), "number": np.array([6, 6])}, "has world 6 more than once"),
        ({}, "no archive of BARN worlds"),
    ],
)
def test_worlds_that_cannot_be_right_are_refused_in_one_line(tmp_path: Path, arrays: dict[str, Any], says: str) -> None:
    np.savez(tmp_path / "w.npz", **{"number": np.array([6]), "lattice": EMPTY, **arrays})
    with pytest.raises(ExperimentError, match=rf"w\.npz: {says}"):
        read_worlds(tmp_path / "w.npz")


def test_a_single_array_is_no_archive(tmp_path: Path) -> None:
    np.save(tmp_path / "w.npy", EMPTY[0])
    with pytest.raises(ExperimentError, match=r"w\.npy: no archive of BARN worlds"):
        read_worlds(tmp_path / "w.npy")


def test_a_world_without_a_way_is_refused_before_anything_is_driven(tmp_path: Path) -> None:
    np.savez(tmp_path / "w.npz", number=np.array([6]), lattice=~EMPTY, path_6=WAY)
    driven: list[int] = []
    with pytest.raises(ExperimentError, match="world 6: no way from start to goal"):
        run(Options(1, archive=tmp_path / "w.npz"), lambda done, total: driven.append(done))
    assert driven == []


@pytest.mark.parametrize("content", [b"", b"no archive"])
def test_a_file_that_is_no_archive_is_refused_in_one_line(tmp_path: Path, content: bytes) -> None:
    file = tmp_path / "worlds.npz"
    file.write_bytes(content)
    with pytest.raises(ExperimentError, match=r"worlds\.npz: no archive of BARN worlds"):
        run(Options(1, archive=file), lambda done, total: None)
    with pytest.raises(ExperimentError, match="--setups: 'fast' is unknown; known: guarded, strict, jackal"):
        run(Options(1, setups=("fast",)), lambda done, total: None)
    with pytest.raises(ExperimentError, match="--setups: points is driven with guarded only"):
        run(Options(1, controllers=("points",), setups=("strict",)), lambda done, total: None)
    with pytest.raises(ExperimentError, match="--controllers: 'best' is unknown"):
        run(Options(1, controllers=("best",)), lambda done, total: None)


class FakeDrive:
    """Stands in for a drive: what it was made from. Its rover has moved 0.1 m after 5 s and does not arrive."""

    asked: ClassVar[list[FakeDrive]] = []

    def __init__(
        self, mission: Mission, scenario: Scenario, settings: Settings, seed: int, recorder: object,
        limit_s: float, late_s: float, lidars: tuple[LidarSpec, ...],
    ) -> None:  # fmt: skip
        self.lidars = lidars
        self.mission, self.scenario, self.settings, self.limit_s = mission, scenario, settings, limit_s
        self.simulator = self.companion = self
        self.time_s, self.done, self.collisions = 0.0, False, ()
        self.truth = scenario.start
        self.asked.append(self)

    def tick(self) -> None:
        self.time_s += 0.05
        went_m = 0.0 if self.time_s < 2.0 else 0.09 if self.time_s < 5.0 else 0.11
        self.truth = replace(self.scenario.start, north_m=self.scenario.start.north_m + went_m)


def drive_that_goes(went_m: float, *, touches: bool = False, done: bool = False) -> type[FakeDrive]:
    """A drive whose rover is so far north after its first tick."""

    class Goes(FakeDrive):
        def tick(self) -> None:
            super().tick()
            self.truth = replace(self.scenario.start, north_m=self.scenario.start.north_m + went_m)
            self.collisions, self.done = ("a post",) if touches else (), done  # type: ignore[assignment]

    return Goes


@pytest.mark.parametrize(
    ("went_m", "touches", "done", "end", "seconds"),
    [
        (9.1, False, False, RunEnd.REACHED, 0.0),
        (8.9, False, False, RunEnd.TIMEOUT, 100.0),
        (8.9, False, True, RunEnd.TIMEOUT, 0.0),
        (5.0, True, False, RunEnd.CONTACT, 0.0),
        (9.1, True, True, RunEnd.CONTACT, 0.0),
    ],
)
def test_a_run_ends_at_a_contact_within_1_m_of_the_goal_or_when_nobody_drives_on(
    monkeypatch: pytest.MonkeyPatch, went_m: float, touches: bool, done: bool, end: RunEnd, seconds: float
) -> None:
    """A contact counts though the goal was reached in the same tick."""
    monkeypatch.setattr(barn, "Drive", drive_that_goes(went_m, touches=touches, done=done))
    one = drive(made_world(3), "motion-ga", 0)
    assert one.end is end and one.seconds == pytest.approx(seconds, abs=0.1)


def test_each_world_and_seed_has_a_rover_of_its_own_and_the_companion_is_not_told_which(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(barn, "Drive", drive_that_goes(9.1))
    monkeypatch.setattr(FakeDrive, "asked", [])
    for world, seed, off in ((3, 0, 0.3), (3, 0, 0.3), (3, 1, 0.3), (4, 0, 0.3), (3, 0, 0.0)):
        drive(made_world(world), "motion-ga", seed, off=off)
    same, again, other_seed, other_world, exact = (one.scenario.drivetrain for one in FakeDrive.asked)
    assert same == again and len({same, other_seed, other_world, exact}) == 4 and exact == SIM_ROVER
    assert {one.settings.motion for one in FakeDrive.asked} == {FakeDrive.asked[0].settings.motion}


@pytest.mark.parametrize(
    ("setup", "controller", "guarded", "gains_m_s2"),
    [
        (Setup.GUARDED, "motion-ga", True, 1.0),
        (Setup.STRICT, "motion-ga", False, 1.0),
        (Setup.JACKAL, "motion-ga", True, 20.0),
        (Setup.GUARDED, "points", False, 1.0),
    ],
)
def test_a_setup_says_whether_there_is_a_guard_and_what_the_rover_is_taken_for(
    monkeypatch: pytest.MonkeyPatch, setup: Setup, controller: str, guarded: bool, gains_m_s2: float
) -> None:
    monkeypatch.setattr(barn, "Drive", drive_that_goes(9.1))
    monkeypatch.setattr(FakeDrive, "asked", [])
    drive(made_world(3), controller, 0, setup)
    (asked,) = FakeDrive.asked
    assert (asked.scenario.parameters.get("SCR_ENABLE") == 1.0) is guarded
    motion = asked.settings.motion
    assert motion.acceleration_m_s2 == motion.deceleration_m_s2 == gains_m_s2


def test_the_page_counts_ends_and_shows_the_best_controller() -> None:
    """Two of four arrive: one in 2.4, one in 6 times the optimal time; one of each other end."""

    def one(controller: str, world: int, end: RunEnd, seconds: float) -> BarnRun:
        return BarnRun(controller, Setup.GUARDED, world, 0, end, seconds, 5.0, np.zeros((1, 2)))

    ends = [(RunEnd.REACHED, 12.0), (RunEnd.REACHED, 30.0), (RunEnd.TIMEOUT, 100.0), (RunEnd.TIMEOUT, 100.0)]
    good = tuple(one("motion-ga", world, *end) for world, end in enumerate(ends))
    bad = (one("dwa", 0, RunEnd.CONTACT, 1.0),)
    report = BarnReport(
        Options(1), numbered(range(4)), {(Setup.GUARDED, "motion-ga"): good, (Setup.GUARDED, "dwa"): bad}
    )
    (found, touched) = report._rows(Setup.GUARDED, plain=True)
    assert found == ["motion-ga", "4", "0.500", "0.000", "0.500", "0.146", "0.104", "4.200"]
    assert touched[2:] == ["0.000", "1.000", "0.000", "0.000", "0.000", "-"]
    assert report._best() == (Setup.GUARDED, "motion-ga")


@pytest.mark.parametrize("setup", list(Setup))
def test_a_run_has_the_rover_the_lidar_and_the_limits_of_the_challenge(
    monkeypatch: pytest.MonkeyPatch, setup: Setup
) -> None:
    """A Jackal of 0.508 x 0.430 m at 2 m/s, 270 degrees of 720 rays that reach 10 m, 100 s from when it has moved."""
    monkeypatch.setattr(barn, "Drive", FakeDrive)
    monkeypatch.setattr(FakeDrive, "asked", [])
    one = drive(made_world(3), "motion-ga", 0, setup)
    assert one.end is RunEnd.TIMEOUT and one.seconds == pytest.approx(100.0, abs=0.2)
    (asked,) = FakeDrive.asked
    assert asked.time_s == pytest.approx(105.0, abs=0.2), "it counts from when the rover has moved"
    assert asked.limit_s >= asked.time_s, "the drive itself does not end before"
    rover, scenario = asked.mission.rover, asked.scenario
    assert rover.cruise_speed_m_s == scenario.parameters["WP_SPEED"] == 2.0
    assert rover.footprint == Footprint.rectangle(0.508, 0.430)
    touches = scenario.outline
    assert (touches.radius_m, touches.front_m, touches.rear_m, touches.half_width_m) == (0.0, 0.254, 0.254, 0.215)
    assert isinstance(scenario.sensors, SensorSuite)
    lidar = scenario.sensors.lidar
    assert lidar is not None and (lidar.max_m, lidar.rate_hz) == (10.0, 20.0)
    bearings_deg = np.degrees(lidar.bearings_rad())
    assert bearings_deg.size == 720 and len(bearings_deg) <= 72, "what a message has room for"
    assert (bearings_deg.min(), bearings_deg.max()) == pytest.approx((-135.0, 135.0), abs=0.5)
