"""Each lidar that is wired to the companion must be heard."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from companion.core.scan import WIRED, RangeScan
from companion.safety.lidar_monitor import LidarMonitor
from companion.safety.reasons import Doubt, Reason
from companion.settings import Settings
from companion.settings.live_settings import LiveSettings
from companion.vehicle.events import RangeSeen
from companion.vehicle.state import VehicleState

FRONT, REAR = "lidar 1 (LD19)", "lidar 2 (LD19)"


def monitor(*names: str) -> LidarMonitor:
    return LidarMonitor(names, LiveSettings(Settings()))


def seen(source: str, time_s: float, sender: int = WIRED) -> RangeSeen:
    return RangeSeen(time_s, RangeScan(time_s, np.zeros(1), np.ones(1), 0.1, 8.0, 0.1, source, sender))


def test_without_lidars_there_is_no_doubt() -> None:
    assert monitor().doubt(5.0) is None


def test_one_that_was_never_heard_is_missing() -> None:
    watch = monitor(FRONT, REAR)
    watch.take(seen(FRONT, 1.0), VehicleState())
    assert watch.doubt(1.0) == Reason(Doubt.DATA_MISSING, (REAR,))


def test_one_that_falls_silent_is_doubted_though_another_is_heard() -> None:
    watch = monitor(FRONT, REAR)
    watch.take(seen(REAR, 1.0), VehicleState())
    for time_s in (1.0, 1.9, 2.1):
        watch.take(seen(FRONT, time_s), VehicleState())
    assert watch.doubt(2.0) is None
    assert watch.doubt(2.1) == Reason(Doubt.DATA_OLD, (REAR, 1.0))
    watch.take(seen(REAR, 2.2), VehicleState())
    assert watch.doubt(2.2) is None


def test_a_sensor_on_the_link_does_not_count_for_it() -> None:
    watch = monitor(FRONT)
    watch.take(seen(FRONT, 1.0, sender=196), VehicleState())
    assert watch.doubt(1.0) == Reason(Doubt.DATA_MISSING, (FRONT,))


def test_one_whose_turns_tell_nothing_is_as_good_as_silent() -> None:
    """Also from the beginning; a stray reading in a hundred is none."""
    watch, unknown = monitor(FRONT), np.full(450, np.nan)
    unknown[:4] = 3.0
    blind = RangeScan(0.0, np.zeros(450), unknown, 0.1, 8.0, 0.1, FRONT, WIRED)
    watch.take(RangeSeen(0.5, blind), VehicleState())
    assert watch.doubt(0.5) == Reason(Doubt.LIDAR_BLIND, (FRONT, 1.0))
    watch.take(seen(FRONT, 1.0), VehicleState())
    for time_s in (1.5, 2.0, 2.1):
        assert watch.doubt(time_s - 0.1) is None
        watch.take(RangeSeen(time_s, blind), VehicleState())
    assert watch.doubt(2.1) == Reason(Doubt.LIDAR_BLIND, (FRONT, 1.0))
    watch.take(seen(FRONT, 2.2), VehicleState())
    assert watch.doubt(2.2) is None


def test_one_whose_turns_come_late_again_and_again_is_doubted() -> None:
    watch = monitor(FRONT)
    for time_s, late_s, doubted in ((1.0, 0.0, False), (1.2, 0.5, False), (1.4, 0.5, True), (1.5, 0.1, False)):
        one = seen(FRONT, time_s)
        watch.take(RangeSeen(time_s, replace(one.scan, late_s=late_s)), VehicleState())
        assert watch.doubt(time_s) == (Reason(Doubt.LIDAR_LATE, (FRONT, 0.3)) if doubted else None)
