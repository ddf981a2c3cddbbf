"""The limits of a mission: borders, and what is left in the battery."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from companion.executive.mission_progress import MissionPhase
from companion.mission.autopilot_fence import AutopilotFence
from companion.operator.notifications import Outcome
from companion.safety.battery_monitor import BatteryMonitor
from companion.safety.gps_gate import GpsGate
from companion.safety.reasons import Doubt, PowerReason, Reason, WaitReason
from companion.settings import FenceSettings, PowerSettings, Settings
from companion.supervision.fence_monitor import FenceMonitor
from companion.supervision.mission_limits import BorderMonitor, MissionLimits
from companion.supervision.rival_monitor import RivalMonitor
from companion.vehicle.events import (
    BatterySeen,
    HeartbeatSeen,
)
from tests.companion.safety.test_mode_latch import HOLD, PLACE, vehicle
from tests.support.desk import Desk


def test_a_rover_beyond_a_border_is_doubted(tmp_path: Path) -> None:
    desk = Desk(tmp_path)
    borders = BorderMonitor(desk.run)
    assert borders.doubt(10.0) is None
    desk.begin()
    desk.executor.heed_fence(AutopilotFence(circle_m=5.0, home=PLACE))
    assert borders.doubt(10.0) is None
    desk.stand(6.0, 0.0)
    found = borders.doubt(10.0)
    assert found is not None and found.kind is Doubt.BEYOND_BORDER


POWER = PowerSettings(return_percent=20.0, hold_percent=10.0, after_s=1.0)


class Limited(Desk):
    """A mission with its limits."""

    def __init__(self, folder: Path, *, begun: bool = True) -> None:
        super().__init__(folder)
        link: Any = self.autopilot
        self.outcome, self.batteries, self.rivals = Outcome(), BatteryMonitor(POWER), RivalMonitor(link)
        self.fences = FenceMonitor(link, FenceSettings(heed="never"), self.notices)
        self.gate = GpsGate(self.settings)
        self.limits = MissionLimits(self.run, self.fences, self.batteries, self.rivals, self.gate, POWER, self.outcome)
        if begun:
            self.begin()
            self.executor.decide(self.stand(0.0, 0.0), self.now_s)

    def drain(self, percent: int) -> None:
        """For long enough to be believed."""
        for _ in range(3):
            self.batteries.take(BatterySeen(self.now_s, 0, 12.0, percent), self.run.vehicle)
            self.batteries.level(self.now_s)
            self.clock.time_s += 0.6


def test_what_is_awaited_before_a_mission(tmp_path: Path) -> None:
    limited = Limited(tmp_path, begun=False)
    found = limited.limits.awaited(10.0, left_driving=False)
    assert found is not None and found.kind is WaitReason.OTHER_COMPANION_SIGNS
    limited.rivals.take(HeartbeatSeen(10.0, HOLD, True, 1), vehicle())
    assert limited.limits.awaited(10.0, left_driving=False) is None
    limited.drain(15)
    found = limited.limits.awaited(limited.now_s, left_driving=False)
    assert found is not None and found.kind is WaitReason.CHARGED_BATTERY
    assert limited.limits.awaited(limited.now_s, left_driving=True) is None, "a reason to go back, not to stay"
    assert limited.limits.must_stop(limited.now_s) is None


@pytest.mark.parametrize("percent", [15, 5])
def test_a_low_battery_breaks_a_mission_off(tmp_path: Path, percent: int) -> None:
    limited = Limited(tmp_path)
    assert limited.limits.enforce(limited.now_s) is None and limited.outcome.broken_off is None
    limited.drain(percent)
    why = Reason(PowerReason.CHARGE, ("battery", percent))
    stops = percent == 5
    for _ in range(2):
        assert limited.limits.enforce(limited.now_s) == (why if stops else None)
    assert limited.outcome.broken_off == why
    assert (limited.executor.progress.phase is MissionPhase.HOME) is not stops
    assert len([text for text in limited.notices.texts if text.startswith("Returning: ")]) == (0 if stops else 1)


def test_a_rover_does_not_begin_with_a_poor_fix_and_one_that_is_taken_up_may_stand_with_it(tmp_path: Path) -> None:
    limited = Limited(tmp_path, begun=False)
    limited.run.vehicle = limited.stand(0.0, 0.0, armed=False)
    limited.rivals.take(HeartbeatSeen(limited.now_s, HOLD, False, 1), limited.run.vehicle)
    assert limited.limits.awaited(limited.now_s, left_driving=False) is None
    limited.settings.replace(Settings.model_validate({"safety": {"gps_fix": "rtk-fixed"}}))
    awaited = limited.limits.awaited(limited.now_s, left_driving=False)
    assert awaited is not None and awaited.kind is WaitReason.GOOD_DATA
    assert str(awaited) == "good data (GPS fix not told for over 1 s)"
    assert limited.limits.awaited(limited.now_s, left_driving=True) is None
