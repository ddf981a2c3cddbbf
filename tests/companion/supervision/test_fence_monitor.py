"""The autopilot's fence and rally points: awaited, fetched again, and a breach of them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from companion.mavlink.download import Downloaded
from companion.mission.autopilot_fence import NO_FENCE, PARAMETERS, AutopilotFence
from companion.mission.items import Item
from companion.safety.reasons import Doubt, Reason, WaitReason
from companion.settings import FenceSettings
from companion.supervision.fence_monitor import FAILED_S, STATUS_S, FenceMonitor
from companion.vehicle.events import (
    EkfStatusSeen,
    FenceStatusSeen,
    ParameterSeen,
    PlanChangedSeen,
    PlanKind,
)
from tests.companion.safety.test_mode_latch import PLACE, vehicle
from tests.support.fake_autopilot import FakeAutopilot
from tests.support.notices import Notices


class Fenced:
    """A fence monitor, and what the autopilot has stored."""

    def __init__(self, **settings: Any) -> None:
        self.autopilot, self.notices = FakeAutopilot(), Notices()
        link: Any = self.autopilot
        self.monitor = FenceMonitor(link, FenceSettings(**settings), self.notices)
        self.vehicle = replace(
            vehicle(),
            parameters=dict(zip(PARAMETERS, (1.0, 2.0, 0.0, 30.0, 0.0), strict=True)),
        )

    def store(self, kind: PlanKind, time_s: float, *items: Item, failure: str = "") -> None:
        self.autopilot.downloads.lists[kind] = Downloaded(kind, time_s, items, failure)

    def tick(self, now_s: float) -> None:
        """An event that says nothing of the fence, and a tick."""
        self.monitor.take(EkfStatusSeen(now_s, 0), self.vehicle)
        self.monitor.tick(now_s)


def test_fence_and_rally_points_are_awaited() -> None:
    fenced = Fenced()
    fenced.tick(10.0)
    assert set(fenced.autopilot.downloads.asked) == {PlanKind.FENCE, PlanKind.RALLY}
    assert fenced.monitor.awaited() == Reason(WaitReason.FENCE, ("",)) and fenced.monitor.fence == NO_FENCE
    fenced.store(PlanKind.FENCE, 10.5)
    fenced.tick(10.5)
    assert fenced.monitor.awaited() is not None and fenced.monitor.fence == AutopilotFence(circle_m=30.0, home=PLACE)
    fenced.store(PlanKind.RALLY, 11.0, Item(0, 5100, 0, (0.0, 0.0, 0.0, 0.0), 1.0, 2.0))
    fenced.tick(11.0)
    assert fenced.monitor.awaited() is None and fenced.monitor.rally == (PLACE,)


def test_where_no_fence_is_heeded_none_is_asked_for() -> None:
    fenced = Fenced(heed="never")
    fenced.tick(10.0)
    assert fenced.monitor.awaited() is None and fenced.autopilot.downloads.asked == []


def test_a_list_that_failed_is_asked_for_again_and_says_why() -> None:
    fenced = Fenced()
    fenced.store(PlanKind.FENCE, 10.0, failure="no answer")
    fenced.tick(10.0)
    assert fenced.monitor.awaited() == Reason(WaitReason.FENCE, (" (no answer)",))
    fenced.tick(10.0 + FAILED_S)
    assert fenced.autopilot.downloads.asked.count(PlanKind.FENCE) == 2


@pytest.mark.parametrize("event", [PlanChangedSeen(12.0, PlanKind.FENCE), ParameterSeen(12.0, "FENCE_TOTAL", 4.0)])
def test_any_sign_of_another_list_has_it_fetched_again(event: Any) -> None:
    fenced = Fenced()
    fenced.tick(10.0)
    fenced.monitor.take(event, fenced.vehicle)
    fenced.tick(12.0)
    assert fenced.autopilot.downloads.asked.count(PlanKind.FENCE) == 2


def test_a_list_that_makes_no_sense_leaves_what_was_known() -> None:
    fenced = Fenced()
    fenced.vehicle = replace(fenced.vehicle, parameters={**fenced.vehicle.parameters, "FENCE_TYPE": 6.0})
    nonsense = Item(0, 5001, 0, (3.0, 0.0, 0.0, 0.0), 1.0, 2.0)
    fenced.store(PlanKind.FENCE, 10.0, nonsense)
    fenced.store(PlanKind.RALLY, 10.0, nonsense)
    fenced.tick(10.0)
    assert fenced.monitor.fence == NO_FENCE and fenced.monitor.rally == () and len(fenced.notices.told) == 2


def test_a_breach_is_doubted_and_told_once() -> None:
    fenced = Fenced()
    for time_s in (10.0, 11.0):
        fenced.monitor.take(FenceStatusSeen(time_s, True), fenced.vehicle)
        fenced.tick(time_s)
    assert fenced.monitor.doubt(11.0) == Reason(Doubt.FENCE_BREACHED) and len(fenced.notices.told) == 1
    assert fenced.monitor.doubt(11.0 + STATUS_S + 0.1) is None, "nobody says so any more"
