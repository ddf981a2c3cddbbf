"""What the doctor finds about lidars."""

from __future__ import annotations

import pytest

from companion.diagnosis.finding import Level
from companion.lidar.examination import LidarHeard, lidar_findings
from tests.support.lidars import Desk, desk, faulty


def heard(rig: Desk, seconds: float = 3.0) -> LidarHeard:
    scans = rig.run(seconds)
    return LidarHeard(rig.reader.name, "/dev/ttyUSB0", seconds, rig.reader.counters, scans[-1] if scans else None)


def names(found: LidarHeard, *, others: bool = True) -> list[str]:
    return [one.name for one in lidar_findings([found], others_look_ahead=others)]


def test_nothing_is_wrong_with_a_good_one() -> None:
    found = heard(desk("LD19"))
    assert names(found, others=False) == []
    assert found.described.startswith("lidar 1 (LD19) on /dev/ttyUSB0: 9.7 turns a second, 450 readings each, 100%")


@pytest.mark.parametrize(
    ("fault", "finding"),
    [
        ({"unplugged": True}, "lidar-silent"),
        ({"stalled": True}, "lidar-stalled"),
        ({"damaged": 0.01}, "lidar-damaged"),
    ],
)
def test_what_is_wrong_is_found(fault: dict[str, object], finding: str) -> None:
    rig = desk("LD19")
    rig.device.faults = faulty(**fault)
    assert finding in names(heard(rig))


def test_another_model_than_it_is_told_from_silence() -> None:
    rig = desk("LD19")
    rig.device._encoder = desk("YDLIDAR-X4").device._encoder
    rig.device.hear(b"\xa5\x60")
    found = list(lidar_findings([heard(rig)], others_look_ahead=True))
    assert [one.name for one in found] == ["lidar-unreadable"] and found[0].level is Level.STOP


def test_one_that_does_not_look_ahead_is_not_enough() -> None:
    found = heard(desk("LD19", "mask=300..60"))
    assert names(found, others=False) == ["not-ahead"] and names(found, others=True) == []


def test_what_sees_the_rover_itself_is_noted() -> None:
    assert "lidar-own-body" in names(heard(desk("LD19", "max=12", forward_m=3.85)))
