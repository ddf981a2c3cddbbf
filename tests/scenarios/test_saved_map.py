"""A map saved at the end of one drive is known ground for the next."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from companion.mapping.map_files import load_map
from companion.mission.load import load_mission
from companion.recording.recorder import NullRecorder
from companion.settings import Settings
from sitl.lockstep import Drive
from sitl.scenario import scenario_from_mission

MISSION = Path(__file__).resolve().parents[2] / "missions" / "one-obstacle.toml"


@pytest.mark.thorough
def test_what_was_mapped_is_known_the_next_time(tmp_path: Path) -> None:
    mission = load_mission(MISSION)
    first = Drive(mission, scenario_from_mission(mission), Settings(), 1, NullRecorder())
    assert first.run().exit_code == 0
    assert first.companion.save_map(tmp_path / "seen")
    assert first.companion.evidence is not None
    seen = load_map(tmp_path / "seen.yaml")
    assert mission.grid.home is not None
    # Home is the middle of its field, and the map's place counts from there.
    west_m = seen.south_west.east_m + mission.grid.home.x + 0.5
    south_m = seen.south_west.north_m + mission.grid.home.y + 0.5
    assert abs(west_m - round(west_m)) < 1e-6 and abs(south_m - round(south_m)) < 1e-6
    obstacles = np.zeros_like(first.companion.evidence.grid.weights, bool)
    height, width = seen.weights.shape
    obstacles[round(south_m) : round(south_m) + height, round(west_m) : round(west_m) + width] = seen.weights >= 1.0
    assert obstacles.any() and (first.companion.evidence.grid.weights[obstacles] >= 1.0).all()

    known = replace(mission, prior_map=tmp_path / "seen.yaml")
    second = Drive(known, scenario_from_mission(known), Settings(), 1, NullRecorder())
    report = second.run()
    assert report.exit_code == 0
    assert second.companion.evidence is not None
    assert (second.companion.evidence.base.weights[obstacles] >= 1.0).all()
    assert report.distance_m <= first.report.distance_m + 1.0
