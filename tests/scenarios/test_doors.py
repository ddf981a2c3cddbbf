"""A door that was seen closed is looked at again: on_blocked = "wait" is for that."""

from __future__ import annotations

from pathlib import Path

import pytest

from companion.mission.load import load_mission
from companion.recording.recorder import NullRecorder
from companion.settings import parse_settings
from sitl.lockstep import Drive
from sitl.scenario import scenario_from_mission

SETTINGS = parse_settings({"navigator": {"wait_limit_s": 120.0}}, "test")


def driven(folder: Path, open_s: str, sensors: str = "lidar-90") -> Drive:
    """A wall all across, with a door in it."""
    (folder / "world.toml").write_text(
        "size_m = [24.0, 12.0]\n"
        "[[obstacle]]\nline_m = [[0.2, 0.2], [11.8, 0.2], [11.8, 23.8], [0.2, 23.8], [0.2, 0.2]]\nwidth_m = 0.4\n"
        "[[obstacle]]\nline_m = [[0.0, 12.0], [4.0, 12.0]]\nwidth_m = 0.4\n"
        "[[obstacle]]\nline_m = [[8.0, 12.0], [12.0, 12.0]]\nwidth_m = 0.4\n"
        f"[[door]]\nline_m = [[4.0, 12.0], [8.0, 12.0]]\nwidth_m = 0.3\nopen_s = [{open_s}]\n"
    )
    (folder / "mission.toml").write_text(
        "[grid]\nresolution_m = 0.5\nsize = [48, 24]\nhome = [6, 12]\n"
        '[[target]]\nname = "behind"\nfield = [40, 12]\non_blocked = "wait"\n'
        f'[sitl]\nworld = "world.toml"\nheading_deg = 90.0\nsensors = "{sensors}"\n'
    )
    mission = load_mission(folder / "mission.toml")
    run = Drive(mission, scenario_from_mission(mission), SETTINGS, 0, NullRecorder(), 600.0)
    run.run()
    return run


@pytest.mark.thorough
@pytest.mark.parametrize("sensors", ["lidar-90", pytest.param("lidar-360", marks=pytest.mark.thorough)])
def test_a_door_that_opens_lets_the_rover_on(sensors: str, tmp_path: Path) -> None:
    run = driven(tmp_path, "[130.0]", sensors)
    said = run.report.said
    assert any("Unreachable" in text for text in said), "it has met the closed door first"
    assert run.report.exit_code == 0, said
    assert run.report.sim_time_s > 130.0
    assert run.simulator.collisions == ()


@pytest.mark.thorough
def test_a_door_that_stays_closed_is_given_up_after_the_limit(tmp_path: Path) -> None:
    run = driven(tmp_path, "[10000.0]")
    assert [status for _, status in run.report.targets] == ["unreachable"]
    assert sum("Unreachable" in text for text in run.report.said) >= 2
    assert run.simulator.collisions == ()
