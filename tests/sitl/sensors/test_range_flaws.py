"""Sensors with flaws against the truth, by statistics; each bound is five standard deviations of what is counted."""

import itertools
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from companion.mission.load import load_mission
from companion.mission.mission import MissionError
from companion.mission.sensor_tables import SensorsTable
from sitl.cli.commands import app
from sitl.scenario import scenario_from_mission, with_sensors
from sitl.sensors.range_flaws import Flaws, Sun, with_flaws
from sitl.sensors.range_sensors import UNKNOWN, RangeSensing, SensorSuite
from sitl.sensors.suites import suite_of
from sitl.simulator import Simulator
from sitl.world.doors import Door
from sitl.world.truth import SimStart
from sitl.world.world import World
from tests.support.sitl_client import HOME, Client

COUNT = 40_000
LIMITS_M = (0.2, 8.0)
MISSIONS = Path(__file__).resolve().parents[3] / "missions"


def ranges(true_m: float, flaws: Flaws, bearing_rad: float = 0.0, noise_m: float = 0.0) -> Any:
    """Many ranges of something that is ``true_m`` away."""
    bearings_rad = np.full(COUNT, bearing_rad)
    return with_flaws(np.full(COUNT, true_m), bearings_rad, LIMITS_M, flaws, noise_m, np.random.default_rng(7))


def share_within(found: float, expected: float) -> bool:
    return abs(found - expected) <= 5.0 * math.sqrt(expected * (1.0 - expected) / COUNT)


def test_without_flaws_it_tells_the_truth() -> None:
    assert set(ranges(3.0, Flaws())) == {3.0}
    assert set(ranges(8.0, Flaws())) == {math.inf}


@pytest.mark.parametrize(("own_m", "expected_m"), [(None, 0.02), (0.0, 0.0), (0.1, 0.1)])
def test_noise_has_its_size_and_no_bias(own_m: float | None, expected_m: float) -> None:
    errors_m = ranges(3.0, Flaws(noise_m=own_m), noise_m=0.02) - 3.0
    assert abs(errors_m.mean()) <= 5.0 * expected_m / math.sqrt(COUNT) + 1e-12
    assert errors_m.std() == pytest.approx(expected_m, rel=5.0 / math.sqrt(2.0 * COUNT))


@pytest.mark.parametrize("true_m", [3.0, 8.0])
@pytest.mark.parametrize("dropout", [0.01, 0.3, 1.0])
def test_dropouts_are_as_frequent_as_said(true_m: float, dropout: float) -> None:
    found = ranges(true_m, Flaws(dropout=dropout))
    assert share_within(float(np.isnan(found).mean()), dropout)


@pytest.mark.parametrize("true_m", [3.0, 8.0])
def test_false_echoes_lie_anywhere_before_the_true_one(true_m: float) -> None:
    found = ranges(true_m, Flaws(false_echo=0.1))
    false = found[found < true_m]
    assert share_within(false.size / COUNT, 0.1)
    assert false.min() >= LIMITS_M[0]
    span_m = true_m - LIMITS_M[0]
    assert false.mean() == pytest.approx(LIMITS_M[0] + span_m / 2.0, abs=5.0 * span_m / math.sqrt(12.0 * false.size))


def test_one_flaw_does_not_move_the_dice_of_another() -> None:
    plain, dropping = ranges(3.0, Flaws(false_echo=0.1)), ranges(3.0, Flaws(false_echo=0.1, dropout=0.2))
    heard = ~np.isnan(dropping)
    assert (plain[heard] == dropping[heard]).all()


@pytest.mark.parametrize(
    ("true_m", "aside_deg", "seen"),
    [(3.0, 0.0, True), (5.0, 0.0, False), (5.0, 29.0, False), (5.0, 31.0, True), (7.9, 180.0, True)]
)  # fmt: skip
def test_towards_the_sun_it_sees_less_far(true_m: float, aside_deg: float, seen: bool) -> None:
    sun = Sun(math.radians(170.0), math.radians(60.0), 0.5)
    for side in (-1.0, 1.0):
        found = ranges(true_m, Flaws(sun=sun), math.radians(170.0 + side * aside_deg))
        assert np.isfinite(found).all() == seen
        assert seen or np.isinf(found).all()


# In a suite and over MAVLink ------------------------------------------------------------------------------------------

LIDAR = {"first_deg": 0.0, "increment_deg": 5.0, "min_m": 0.1, "max_m": 8.0}


def room() -> World:
    """A wall from north 10 on, and a post of one metre at north 5, east 12."""
    obstacles = np.zeros((12, 24), dtype=np.bool_)
    obstacles[10:, :] = True
    obstacles[5, 12] = True
    return World(obstacles)


def suite(**tables: Any) -> SensorSuite:
    return suite_of(SensorsTable.model_validate(tables))


def client_of(sensors: SensorSuite, world: World | None = None, heading_rad: float = 0.0, **options: Any) -> Client:
    start = SimStart(5.5, 8.5, heading_rad, HOME)
    client = Client(Simulator(world or room(), start, sensors, **{"noise": False, **options}))
    client.command(511, 132, 1e5)
    return client


def test_a_lidar_has_the_sectors_that_it_says(tmp_path: Path) -> None:
    sensors = suite(lidar={**LIDAR, "sectors": 3, "increment_deg": 10.0, "first_deg": -10.0, "rate_hz": 20.0})
    client = client_of(sensors)
    client.run_to(2.0)
    scans = client.of("OBSTACLE_DISTANCE")
    assert len(scans) == pytest.approx(40, abs=1)
    assert (scans[-1].increment_f, scans[-1].angle_offset) == (10.0, -10.0)
    assert list(scans[-1].distances[:3]) == [457, 450, 457]
    assert set(scans[-1].distances[3:]) == {UNKNOWN}


def test_a_lidar_with_flaws_tells_them_in_its_own_codes() -> None:
    sensing = RangeSensing(
        suite(lidar={**LIDAR, "dropout": 0.2, "false_echo": 0.1}), World.open(), 0.0, np.random.default_rng(2)
    )
    cells = np.array([sensing.scan_cm(0.0, 0.0, 0.0) for _ in range(COUNT // 72)])
    assert (cells == UNKNOWN).mean() == pytest.approx(0.2, abs=5.0 * math.sqrt(0.16 / cells.size))
    assert (cells == 801).mean() == pytest.approx(0.8 * 0.9, abs=5.0 * math.sqrt(0.25 / cells.size))
    assert ((cells <= 800) & (cells >= 10)).mean() == pytest.approx(0.08, abs=5.0 * math.sqrt(0.08 / cells.size))


@pytest.mark.parametrize("latency_s", [0.0, 0.04, 0.1, 0.25])
def test_what_is_sent_is_as_old_as_said(latency_s: float) -> None:
    """A door shuts at 5 s, at which a scan is made: that scan is the first to show it, and comes out so much later."""
    row = np.zeros((12, 24), dtype=np.bool_)
    row[8] = True
    world = World(np.zeros_like(row), doors=(Door("d", row, ((0, 5000),)),))
    far = {"min_m": 0.1, "max_m": 8.0, "latency_s": latency_s}
    sensors = suite(
        lidar={**LIDAR, "latency_s": latency_s}, beam=[{**far, "orientation": 0}], proximity={**far, "sectors": [0]}
    )
    client = client_of(sensors, world)
    seen: dict[str, float] = {}
    for tick in range(1, 300):
        for message in client.run_to(tick * 0.02):
            if message.get_type() == "OBSTACLE_DISTANCE" and message.distances[0] == 250:
                seen.setdefault("lidar", client.simulator.time_s)
            if message.get_type() == "DISTANCE_SENSOR" and message.current_distance == 250:
                seen.setdefault(str(message.id), client.simulator.time_s)
    assert seen["lidar"] == pytest.approx(5.0 + math.ceil(latency_s * 50.0) / 50.0, abs=1e-6), "with the next main loop"
    for number in ("0", "10"):  # sent by the autopilot ten times a second, whenever that is
        assert 5.0 + latency_s - 1e-6 <= seen[number] <= 5.0 + latency_s + 0.1 + 1e-6


def test_beams_look_where_they_are_turned_to_and_as_wide_as_they_are() -> None:
    near = {"min_m": 0.05, "max_m": 9.0}
    sensors = suite(
        beam=[
            {**near, "orientation": 0},
            {**near, "orientation": 2},
            {**near, "orientation": 4},
            {**near, "orientation": 25, "height_m": 0.4},
            {**near, "orientation": 24},
            {**near, "orientation": 1, "width_deg": 2.0},
            {**near, "orientation": 1, "width_deg": 80.0},
        ]
    )
    client = client_of(sensors)
    client.run_to(5.0)
    latest = {m.id: m for m in client.of("DISTANCE_SENSOR")}
    assert [latest[i].orientation for i in range(7)] == [0, 2, 4, 25, 24, 1, 1]
    assert [latest[i].current_distance for i in range(5)] == [450, 350, 900, 40, 900]
    assert latest[5].current_distance == pytest.approx(450.0 * math.sqrt(2.0), abs=12.0)
    assert latest[6].current_distance == pytest.approx(350.0, abs=5.0), "the nearest of all its rays counts"
    assert client.of("RANGEFINDER")[-1].distance == pytest.approx(0.4), (
        "the smallest of all, also of one that looks down"
    )


def test_a_beam_that_knows_nothing_is_not_sent() -> None:
    client = client_of(suite(beam=[{"orientation": 0, "min_m": 0.2, "max_m": 6.0, "dropout": 0.25}]))
    client.run_to(5.0)
    client.received.clear()
    client.run_for(400.0)
    sent = len(client.of("DISTANCE_SENSOR"))
    assert sent / 4000 == pytest.approx(0.75, abs=5.0 * math.sqrt(0.75 * 0.25 / 4000))
    assert {m.current_distance for m in client.of("DISTANCE_SENSOR")} == {450}


def test_beams_measure_at_their_own_rate() -> None:
    client = client_of(suite(beam=[{"orientation": 0, "min_m": 0.2, "max_m": 6.0, "rate_hz": 2.0, "noise_m": 0.3}]))
    client.run_to(5.0)
    client.received.clear()
    client.run_for(60.0)
    told = [m.current_distance for m in client.of("DISTANCE_SENSOR")]
    changes = sum(one != two for one, two in itertools.pairwise(told))
    assert len(told) == pytest.approx(600, abs=2)
    assert 105 <= changes <= 121


def test_proximity_sectors_have_their_own_numbers_and_the_nearest_of_their_width() -> None:
    client = client_of(suite(proximity={"min_m": 0.2, "max_m": 6.0}))
    client.run_to(5.0)
    latest = {m.id: m for m in client.of("DISTANCE_SENSOR")}
    assert {number: m.orientation for number, m in latest.items()} == {10 + i: i for i in range(8)}
    world = room()
    for number, message in latest.items():
        bearings = np.radians(45.0 * (number - 10) + np.linspace(-22.5, 22.5, 500))
        true_m = float(world.rays_m(5.5, 8.5, bearings[None, :], 6.0)[0])
        assert message.current_distance == pytest.approx(100.0 * true_m, abs=6.0), number
    assert {m.get_srcComponent() for m in latest.values()} == {1}


def test_a_sector_that_knows_nothing_shows_its_maximum() -> None:
    client = client_of(suite(proximity={"sectors": [0], "min_m": 0.2, "max_m": 6.0, "dropout": 0.5}))
    client.run_to(5.0)
    client.received.clear()
    client.run_for(200.0)
    told = np.array([m.current_distance for m in client.of("DISTANCE_SENSOR")])
    assert set(told) == {450, 600}
    assert (told == 600).mean() == pytest.approx(0.5, abs=5.0 * math.sqrt(0.25 / told.size))


def test_the_same_seed_gives_the_same_bytes_and_another_does_not() -> None:
    far = {"min_m": 0.2, "max_m": 6.0, "dropout": 0.1, "false_echo": 0.1, "noise_m": 0.05}
    sensors = suite(lidar={**LIDAR, **far}, beam=[{**far, "orientation": 0}], proximity=far)
    raws = []
    for seed in (1, 1, 2):
        client = client_of(sensors, seed=seed, noise=True)
        client.run_to(10.0)
        raws.append(client.raw)
    assert raws[0] == raws[1] != raws[2]


def test_a_described_suite_without_flaws_sends_what_the_named_one_does() -> None:
    """Apart from the rays of a sector these are the numbers of lidar-360."""
    described = suite(lidar={**LIDAR, "rays": 5})
    one, two = (
        Client(Simulator(room(), SimStart(5.5, 8.5, 0.0, HOME), sensors)) for sensors in ("lidar-360", described)
    )
    one.run_to(20.0)
    two.run_to(20.0)
    assert one.raw == two.raw


BAD = [
    ("[lidar]\nfirst_deg = 0.0\nincrement_deg = 10.0\nmin_m = 0.1\nmax_m = 5.0\n", "more than a full turn"),
    (
        "[lidar]\nfirst_deg = 0.0\nincrement_deg = 5.0\nmin_m = 0.1\nmax_m = 0.1\n",
        ": lidar: max_m must be more than min_m; docs/worlds.md describes",
    ),
    ("[[beam]]\norientation = 9\nmin_m = 0.1\nmax_m = 5.0\n", "beam 1.orientation"),
    ("[[beam]]\norientation = 0\nmin_m = 0.1\nmax_m = 5.0\ndropouts = 0.1\n", "did you mean 'dropout'"),
    ("[proximity]\nsectors = [8]\nmin_m = 0.1\nmax_m = 5.0\n", "proximity.sectors"),
    ("[proximity]\nmin_m = 0.1\nmax_m = 5.0\nfalse_echo = 2.0\n", "proximity.false_echo"),
    ("[proximity]\nmin_m = 0.1\nmax_m = 5.0\nsun = { bearing_deg = 3.0 }\n", "sun.range_share: is missing"),
    ("sonar = 3\n", "unknown key"),
    ("[lidar\n", "not valid TOML"),
]


@pytest.mark.parametrize(("text", "words"), BAD)
def test_bad_sensors_get_one_line(tmp_path: Path, text: str, words: str) -> None:
    (tmp_path / "s.toml").write_text(text)
    for command in ("drive", "serve"):
        result = CliRunner().invoke(app, [command, str(MISSIONS / "open.toml"), "--sensors", str(tmp_path / "s.toml")])
        assert result.exit_code == 2
        assert words in result.output
        assert "s.toml" in result.output
        assert len(result.output.strip().splitlines()) == 1


HEAD = "[[target]]\nnorth_m = 5.0\neast_m = 5.0\n[sitl]\n"


def test_a_mission_describes_sensors_or_names_them(tmp_path: Path) -> None:
    path = tmp_path / "m.toml"
    (tmp_path / "s.toml").write_text("[proximity]\nmin_m = 0.2\nmax_m = 6.0\n")
    for text in ('sensors = "s.toml"', "[sitl.sensors.proximity]\nmin_m = 0.2\nmax_m = 6.0\n"):
        path.write_text(HEAD + text)
        mission = load_mission(path)
        assert mission.sitl is not None
        assert str(mission.sitl.sensors) == "proximity sectors"
    for text, words in (('sensors = "sonar"', "unknown sensors 'sonar'"),
                        ('sensors = "gone.toml"', "gone.toml: cannot be read"),
                        ("[sitl.sensors]\nsonar = 3", "sitl.sensors: sonar: unknown key")):  # fmt: skip
        path.write_text(HEAD + text)
        with pytest.raises(MissionError, match=words) as caught:
            load_mission(path)
        assert len(str(caught.value).splitlines()) == 1


def test_the_shipped_description_is_understood() -> None:
    mission = with_sensors(load_mission(MISSIONS / "open.toml"), str(MISSIONS / "sensors" / "weathered.toml"))
    client = Client(scenario_from_mission(mission).simulator(0))
    client.set_mode(4)  # whoever has not spoken is told nothing by the scanner
    client.run_to(5.0)
    assert client.of("OBSTACLE_DISTANCE")
    assert {m.orientation for m in client.of("DISTANCE_SENSOR")} == {2, 6, 25}
