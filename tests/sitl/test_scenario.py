from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from companion.core.frames import GeoPoint
from companion.core.grid import Cell
from companion.mapping.map_files import MapError
from companion.mission.load import load_mission
from companion.mission.mission import GridSpec, Mission, RoverSpec, SitlSpec, Target
from companion.vehicle.recommended_parameters import RECOMMENDED_PARAMETERS
from sitl.plant.outline import Outline
from sitl.scenario import SOMEWHERE, ScenarioError, scenario_from_mission
from tests.support.rays import ray_m


@pytest.fixture
def world_file(tmp_path: Path) -> Path:
    """20 x 10 fields; the third row from the south is a wall west of x = 5."""
    pixels = np.full((10, 20), 255, dtype=np.uint8)
    pixels[10 - 1 - 2, :5] = 0
    path = tmp_path / "world.png"
    Image.fromarray(pixels).save(path)
    return path


def mission(world_file: Path | None, **changes: Any) -> Mission:
    spec = SitlSpec(world=world_file, start=Cell(7, 4), heading_deg=45.0, sensors="beams", **changes)
    return Mission("test", (Target("a", Cell(1, 1)),), GridSpec(size=(20, 10), home=Cell(9, 9)), sitl=spec)


def test_fields_of_world_and_mission_are_the_same(world_file: Path) -> None:
    scenario = scenario_from_mission(mission(world_file))
    assert (scenario.start.north_m, scenario.start.east_m) == (4.5, 7.5)
    assert np.degrees(scenario.start.heading_rad) == pytest.approx(45.0)
    assert scenario.world.obstacles[2].tolist() == [True] * 5 + [False] * 15
    assert ray_m(scenario.world, 4.5, 2.5, np.pi, 9.0) == pytest.approx(1.5)
    simulator = scenario.simulator(3)
    assert (simulator.truth.north_m, simulator.truth.east_m) == (4.5, 7.5)


def test_the_start_is_home_unless_said_otherwise(world_file: Path) -> None:
    plain = mission(world_file)
    assert plain.sitl is not None
    scenario = scenario_from_mission(replace(plain, sitl=replace(plain.sitl, start=None)))
    assert (scenario.start.north_m, scenario.start.east_m) == (9.5, 9.5)


def test_the_rover_of_the_mission_is_driven(world_file: Path) -> None:
    scenario = scenario_from_mission(replace(mission(world_file), rover=RoverSpec(radius_m=0.5, cruise_speed_m_s=1.5)))
    assert scenario.outline == Outline(0.5)
    assert scenario.parameters == {"WP_SPEED": 1.5, **RECOMMENDED_PARAMETERS}
    assert scenario.parameters["WP_JERK"] == 3.0
    assert scenario.sensors == "beams"


def test_a_mission_in_latitude_and_longitude_drives_on_open_ground_from_its_planned_home() -> None:
    place, planned = GeoPoint(50.0, 20.0), GeoPoint(50.001, 20.0)
    lonely = Mission("plan", (Target("a", place),))
    assert scenario_from_mission(lonely).start.home == place
    scenario = scenario_from_mission(replace(lonely, planned_home=planned))
    assert scenario.start.home == planned
    assert not scenario.world.obstacles.any()
    explicit = SitlSpec(home=GeoPoint(49.0, 19.0))
    assert scenario_from_mission(replace(lonely, planned_home=planned, sitl=explicit)).start.home == explicit.home
    usual = SitlSpec(home=SOMEWHERE)
    assert scenario_from_mission(replace(lonely, planned_home=planned, sitl=usual)).start.home == SOMEWHERE


@pytest.mark.parametrize(
    ("start", "sensors", "reason"),
    [
        (Cell(2, 2), "beams", "touches an obstacle"),
        (Cell(20, 2), "beams", "outside"),
        (Cell(-1, 2), "beams", "outside"),
        (Cell(7, 4), "sonar", "sitl.sensors: unknown sensors 'sonar'"),
    ],
)
def test_what_cannot_be_simulated_is_told_in_one_line(world_file: Path, start: Cell, sensors: str, reason: str) -> None:
    plain = mission(world_file)
    assert plain.sitl is not None
    with pytest.raises(ScenarioError, match=reason) as error:
        scenario_from_mission(replace(plain, sitl=replace(plain.sitl, start=start, sensors=sensors)))
    assert "\n" not in str(error.value)


def test_a_world_without_a_start_is_refused(world_file: Path) -> None:
    with pytest.raises(ScenarioError, match=r"sitl\.start"):
        scenario_from_mission(Mission("plan", (), sitl=SitlSpec(world=world_file)))


def test_a_world_that_is_none_is_told_with_the_mission_and_the_key(tmp_path: Path) -> None:
    path = tmp_path / "yard.toml"
    path.write_text('[[target]]\nnorth_m = 5.0\neast_m = 0.0\n[sitl]\nworld = "yard.txt"\n')
    (tmp_path / "yard.txt").touch()
    with pytest.raises(MapError, match=rf"^{path}: sitl.world: .*yard.txt: suffix '.txt' is no map format"):
        scenario_from_mission(load_mission(path))
