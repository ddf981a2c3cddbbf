"""Why a lidar gives nothing is told while a run waits."""

from __future__ import annotations

from companion.lidar.reader import Lidars
from companion.supervision.lidar_trouble_monitor import LidarTroubleMonitor
from tests.support.lidars import desk, faulty
from tests.support.notices import Notices


def told(*faults: dict[str, object]) -> list[str]:
    """What is told in ten seconds in which one fault follows the other."""
    rig, notices = desk("LD19"), Notices()
    monitor = LidarTroubleMonitor(Lidars([rig.reader]), notices)
    for fault in faults:
        rig.device.faults = faulty(**fault)
        for _ in range(10):
            monitor.tick(rig.now_s)
            rig.run(1.0)
    return notices.texts


def test_each_trouble_of_a_lidar_is_told_once() -> None:
    silent, stalled = told({"unplugged": True}, {"stalled": True})
    assert silent.startswith("lidar 1 (LD19) on desk: nothing comes; look at its power and cable")
    assert stalled.startswith("lidar 1 (LD19) on desk: readings come, but no whole turns; look whether its motor turns")


def test_one_that_has_seen_nothing_yet_is_told_what_to_give_on_open_ground() -> None:
    rig, notices = desk("LD19", "min=11.9"), Notices()
    monitor = LidarTroubleMonitor(Lidars([rig.reader]), notices)
    for _ in range(6):
        monitor.tick(rig.now_s)
        rig.run(1.0)
    (text,) = notices.texts
    assert "hardly an echo: open ground" in text and text.endswith("on open ground give it empty=5")


def test_nothing_is_told_of_one_that_has_given_turns() -> None:
    assert told({}, {"unplugged": True}) == []
