"""What the doctor finds about lidars."""

from __future__ import annotations

import numpy as np
import pytest

from companion.diagnosis.finding import Level
from companion.lidar.examination import LidarHeard, lidar_findings
from companion.lidar.reader import LidarCounters
from companion.lidar.trouble import trouble
from tests.support.lidars import NAMES, Desk, desk, faulty


def heard(rig: Desk, seconds: float = 3.0) -> LidarHeard:
    scans = rig.run(seconds)
    newest = scans[-1] if scans else None
    return LidarHeard(rig.reader.name, "/dev/ttyUSB0", seconds, rig.reader.counters, newest, trouble(rig.reader))


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


def test_another_model_is_told_from_silence_and_named() -> None:
    """Nor is it said that nothing looks ahead: where it looks is not known."""
    rig = desk("LD19")
    rig.device._encoder = desk("YDLIDAR-X4").device._encoder
    rig.device.hear(b"\xa5\x60")
    found = list(lidar_findings([heard(rig)], others_look_ahead=False))
    assert [one.name for one in found] == ["lidar-unreadable"] and found[0].level is Level.STOP
    assert found[0].says == "lidar 1 (LD19) on desk: bytes come, but none is a packet of an LD19."
    assert found[0].remedy == "they are those of a YDLIDAR-X4: give --lidar that model"


@pytest.mark.parametrize("model", NAMES)
@pytest.mark.parametrize(
    ("data", "is_it"),
    [
        (b"".join(b"\xfd\x09\0\0" + bytes([n]) + bytes(16) for n in range(90)), "they are MAVLink"),
        (np.random.default_rng(1).bytes(6000), "is it another model"),
    ],
    ids=["mavlink", "noise"],
)
def test_bytes_of_no_lidar_are_told_for_what_they_are(model: str, data: bytes, is_it: str) -> None:
    rig = desk(model)
    rig.device.advance = lambda *_: None  # type: ignore[method-assign]
    rig.device.take = lambda: data  # type: ignore[method-assign]
    rig.run(0.2)
    found = trouble(rig.reader)
    assert found is not None and found.name == "lidar-unreadable" and found.remedy.startswith(is_it)


def test_open_ground_is_named_where_hardly_an_echo_comes() -> None:
    found = LidarHeard("lidar 1 (LD19)", "x", 3.0, LidarCounters(9000, 0, 3000, 30, 30, 0), None)
    (only,) = lidar_findings([found], others_look_ahead=True)
    assert only.name == "lidar-no-echo" and "open ground" in only.says and "empty=5" in only.remedy


def test_one_that_does_not_look_ahead_is_not_enough() -> None:
    found = heard(desk("LD19", "mask=300..60"))
    assert names(found, others=False) == ["not-ahead"] and names(found, others=True) == []


def test_what_sees_the_rover_itself_is_noted() -> None:
    assert "lidar-own-body" in names(heard(desk("LD19", "max=12", forward_m=3.85)))
