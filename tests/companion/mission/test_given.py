"""What the command line says of missions whose file cannot."""

from __future__ import annotations

from pathlib import Path

import pytest

from companion.mission.given import INSTEAD, Given, with_given
from companion.mission.load import load_mission
from companion.mission.mission import MissionError

MISSIONS = Path(__file__).resolve().parents[3] / "missions"


@pytest.mark.parametrize("name", ["field.plan", "field.waypoints"])
def test_a_ground_stations_file_gets_fields_radius_and_speed(name: str) -> None:
    mission = load_mission(MISSIONS / name)
    assert with_given(mission, Given()) == mission
    said = with_given(mission, Given(0.4, 0.6, 1.2))
    assert (said.grid.resolution_m, said.grid.by_footprint) == (0.4, False)
    assert (said.rover.radius_m, said.rover.cruise_speed_m_s) == (0.6, 1.2)
    assert said.targets == mission.targets
    assert with_given(mission, Given(radius_m=0.6)).grid.by_footprint


@pytest.mark.parametrize(
    ("given", "option"),
    [(Given(0.5), "--resolution-m"), (Given(None, 0.5), "--radius-m"), (Given(None, None, 1.0), "--speed")],
)
def test_a_toml_mission_says_them_itself(given: Given, option: str) -> None:
    mission = load_mission(MISSIONS / "rooms.toml")
    with pytest.raises(MissionError) as error:
        with_given(mission, given)
    assert str(error.value) == f"{mission.source}: {option}: a TOML mission says this itself: {INSTEAD[option]}"
    assert with_given(mission, Given()) == mission
