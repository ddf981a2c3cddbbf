"""Another companion on the same rover."""

from __future__ import annotations

from typing import Any

import pytest

from companion.safety.reasons import Doubt, Reason, WaitReason
from companion.supervision.rival_monitor import LISTEN_S, RivalMonitor
from companion.vehicle.events import (
    HeartbeatSeen,
)
from tests.companion.safety.test_mode_latch import GUIDED, HOLD, vehicle
from tests.support.fake_autopilot import FakeAutopilot


@pytest.mark.parametrize(
    ("mode", "armed", "listens"), [(GUIDED, True, True), (GUIDED, False, False), (HOLD, True, False)]
)
def test_a_rover_that_is_found_driving_is_listened_to_first(mode: int, armed: bool, listens: bool) -> None:
    link: Any = FakeAutopilot()
    rivals = RivalMonitor(link)
    assert rivals.awaited(0.0) == Reason(WaitReason.OTHER_COMPANION_SIGNS), "nothing was heard yet"
    rivals.take(HeartbeatSeen(10.0, mode, armed, 1), vehicle())
    rivals.take(HeartbeatSeen(11.0, GUIDED, True, 1), vehicle())
    assert (rivals.awaited(10.0) is not None) is listens
    assert rivals.awaited(10.0 + LISTEN_S) is None
    assert rivals.doubt(12.0) is None
    link.rival = True
    assert rivals.doubt(12.0) == Reason(Doubt.OTHER_COMPANION)
