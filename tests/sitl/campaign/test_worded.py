"""Values of axes in words: what is read, what is refused."""

from __future__ import annotations

from pathlib import Path

import pytest

from sitl.campaign.worded import GroundSpec, SensorSpec, Worded, faults_of
from sitl.faults.fault_file import FaultFileError
from sitl.generators.kinds import GroundKind
from sitl.sensors.range_sensors import suite_named


def test_ground_with_parameters_and_things_that_move() -> None:
    ground = GroundSpec.of("rooms least_door_m=1.5 most_door_m=1.8 movers=3")
    assert ground is not None and (ground.kind, ground.movers) == (GroundKind.ROOMS, 3)
    assert ground.given.model_dump()["least_door_m"] == 1.5
    assert GroundSpec.of("rooms.toml") is None


def test_sensors_with_flaws() -> None:
    changed = SensorSpec.of("lidar-360 dropout=0.1 max_m=5 noise_m=0.05").changed("lidar-360")
    usual = suite_named("lidar-360")
    assert changed.lidar is not None and usual.lidar is not None
    assert (changed.lidar.max_m, changed.lidar.flaws.dropout, changed.lidar.flaws.noise_m) == (5.0, 0.1, 0.05)
    assert changed.lidar.rays == usual.lidar.rays
    assert SensorSpec.of("beams").changed("beams") == suite_named("beams")


def test_faults_one_after_the_other(tmp_path: Path) -> None:
    plan = faults_of("link_outage start_s=10 since=driving duration_s=0.8; gps_noise start_s=60 metres=0.5", tmp_path)
    assert [fault.start_s for fault in plan.faults] == [10.0, 60.0]


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("rooms target_east_m=5", "target_east_m=5: give metres from 6 to 38"),
        ("rooms target_east_m=near", "target_east_m=near: give metres from 6 to 38"),
        ("rooms target_east_m=true", "target_east_m=True: give metres from 6 to 38"),
        ("rooms movers=true", "movers=True: give a whole number from 0 to 50"),
        ("clutter least_things=true", "least_things"),
        ("rooms movers=many", "movers=many: give a whole number from 0 to 50"),
        ("rooms least_door_m=0.2", "least_door_m"),
        ("rooms door_m=2", "known here: least_door_m, most_door_m, room_m"),
        ("rooms movers", "movers: write NAME=VALUE after rooms"),
        ("rooms movers=1 movers=2", "movers stands there twice"),
        ("rooms least_door_m=3 most_door_m=2", "most_door_m 2 is less than least_door_m 3"),
    ],
)
def test_words_that_are_wrong_are_refused_in_one_line(text: str, says: str) -> None:
    with pytest.raises(ValueError, match=r".") as caught:
        GroundSpec.of(text)
    assert says in str(caught.value) and "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("outage start_s=1", "unknown kind 'outage'"),
        ("link_outage", "start_s"),
        ("link_outage start_s", "write NAME=VALUE"),
        ("link_outage start_s=1 width=2", "width"),
    ],
)
def test_faults_that_are_wrong_too(tmp_path: Path, text: str, says: str) -> None:
    with pytest.raises(FaultFileError) as caught:
        faults_of(text, tmp_path)
    assert says in str(caught.value) and "\n" not in str(caught.value)


def test_words_are_written_as_they_are_read() -> None:
    text = "cylinders filled=0.2 smoothed=2 movers=1"
    assert str(Worded.of(text)) == text
