"""The monitors of supervision: other companions, the autopilot's fence, borders, and the position."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from companion.core.frames import LocalFrame, NedPoint
from companion.mavlink.download import Downloaded
from companion.mission.autopilot_fence import NO_FENCE, PARAMETERS, AutopilotFence
from companion.mission.items import Item
from companion.safety.reasons import Doubt, Reason, WaitReason
from companion.settings import FenceSettings, Settings
from companion.supervision.fence_monitor import FAILED_S, STATUS_S, FenceMonitor
from companion.supervision.localization_monitor import (
    ASK_PLACES_S,
    CALM_S,
    ONCE_S,
    SETTLED_S,
    WANDERINGS,
    LocalizationMonitor,
)
from companion.supervision.mission_limits import BorderMonitor
from companion.supervision.rival_monitor import LISTEN_S, RivalMonitor
from companion.vehicle.dead_reckoning import Drift
from companion.vehicle.events import (
    FenceStatusSeen,
    HeartbeatSeen,
    HomeSeen,
    LocalPositionSeen,
    OriginSeen,
    ParameterSeen,
    PlanChangedSeen,
    PlanKind,
)
from companion.vehicle.state import VehicleState
from tests.companion.safety.test_mode_latch import GUIDED, HOLD, PLACE, vehicle
from tests.support.desk import Desk
from tests.support.fake_autopilot import FakeAutopilot
from tests.support.notices import Notices


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


# The autopilot's fence ------------------------------------------------------------------------------------------------


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

    def service(self, now_s: float) -> None:
        self.monitor.service(self.vehicle, now_s)


def test_fence_and_rally_points_are_awaited() -> None:
    fenced = Fenced()
    fenced.service(10.0)
    assert set(fenced.autopilot.downloads.asked) == {PlanKind.FENCE, PlanKind.RALLY}
    assert fenced.monitor.awaited() == Reason(WaitReason.FENCE, ("",)) and fenced.monitor.fence == NO_FENCE
    fenced.store(PlanKind.FENCE, 10.5)
    fenced.service(10.5)
    assert fenced.monitor.awaited() is not None and fenced.monitor.fence == AutopilotFence(circle_m=30.0, home=PLACE)
    fenced.store(PlanKind.RALLY, 11.0, Item(0, 5100, 0, (0.0, 0.0, 0.0, 0.0), 1.0, 2.0))
    fenced.service(11.0)
    assert fenced.monitor.awaited() is None and fenced.monitor.rally == (PLACE,)


def test_where_no_fence_is_heeded_none_is_asked_for() -> None:
    fenced = Fenced(heed="never")
    fenced.service(10.0)
    assert fenced.monitor.awaited() is None and fenced.autopilot.downloads.asked == []


def test_a_list_that_failed_is_asked_for_again_and_says_why() -> None:
    fenced = Fenced()
    fenced.store(PlanKind.FENCE, 10.0, failure="no answer")
    fenced.service(10.0)
    assert fenced.monitor.awaited() == Reason(WaitReason.FENCE, (" (no answer)",))
    fenced.service(10.0 + FAILED_S)
    assert fenced.autopilot.downloads.asked.count(PlanKind.FENCE) == 2


@pytest.mark.parametrize("event", [PlanChangedSeen(12.0, PlanKind.FENCE), ParameterSeen(12.0, "FENCE_TOTAL", 4.0)])
def test_any_sign_of_another_list_has_it_fetched_again(event: Any) -> None:
    fenced = Fenced()
    fenced.service(10.0)
    fenced.monitor.take(event, fenced.vehicle)
    fenced.service(12.0)
    assert fenced.autopilot.downloads.asked.count(PlanKind.FENCE) == 2


def test_a_list_that_makes_no_sense_leaves_what_was_known() -> None:
    fenced = Fenced()
    fenced.vehicle = replace(fenced.vehicle, parameters={**fenced.vehicle.parameters, "FENCE_TYPE": 6.0})
    nonsense = Item(0, 5001, 0, (3.0, 0.0, 0.0, 0.0), 1.0, 2.0)
    fenced.store(PlanKind.FENCE, 10.0, nonsense)
    fenced.store(PlanKind.RALLY, 10.0, nonsense)
    fenced.service(10.0)
    assert fenced.monitor.fence == NO_FENCE and fenced.monitor.rally == () and len(fenced.notices.told) == 2


def test_a_breach_is_doubted_and_told_once() -> None:
    fenced = Fenced()
    for time_s in (10.0, 11.0):
        fenced.monitor.take(FenceStatusSeen(time_s, True), fenced.vehicle)
        fenced.service(time_s)
    assert fenced.monitor.doubt(11.0) == Reason(Doubt.FENCE_BREACHED) and len(fenced.notices.told) == 1
    assert fenced.monitor.doubt(11.0 + STATUS_S + 0.1) is None, "nobody says so any more"


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


# The position ---------------------------------------------------------------------------------------------------------


class Located(Desk):
    """A monitor of the position of a mission under way."""

    def __init__(self, folder: Path, *, begun: bool = True) -> None:
        super().__init__(folder)
        link: Any = self.autopilot
        self.monitor = LocalizationMonitor(self.run, link, self.settings, self.notices)
        if begun:
            self.begin()

    def report(self, **state: Any) -> VehicleState:
        position = LocalPositionSeen(self.now_s, self.now_s, 0.0, 0.0, 0.0, 0.0)
        seen = replace(vehicle(self.now_s), position=position, **state)
        self.monitor.take(position, seen)
        return seen

    def hear_origin(self, by_m: float = 0.0) -> None:
        origin = LocalFrame(PLACE).to_geo(NedPoint(by_m, 0.0))
        self.monitor.take(OriginSeen(self.now_s, origin), self.run.vehicle)

    @property
    def doubt(self) -> Doubt | None:
        found = self.monitor.doubt(self.now_s)
        return None if found is None else found.kind


def test_a_jump_is_doubted_until_the_origin_is_heard_again(tmp_path: Path) -> None:
    located = Located(tmp_path)
    located.report(jump_m=0.1)
    assert located.doubt is None and not located.monitor.position_doubted
    for _ in range(2):
        located.report(jump_m=5.0)
    assert located.doubt is Doubt.POSITION_JUMPED and len(located.notices.told) == 1
    located.monitor.service(located.now_s)
    located.monitor.service(located.now_s + ASK_PLACES_S / 2.0)
    assert located.autopilot.places_asked == 1
    located.hear_origin()
    assert located.doubt is Doubt.POSITION_JUMPED, "that answer may be older than the jump"
    located.clock.time_s += SETTLED_S + 0.01
    located.hear_origin()
    assert located.doubt is None and located.executor.maps_begun == 1


def test_how_far_a_jump_is_follows_the_settings(tmp_path: Path) -> None:
    located = Located(tmp_path)
    located.settings.replace(Settings.model_validate({"safety": {"jump_m": 8.0}}))
    located.report(jump_m=5.0)
    assert located.doubt is None


def test_an_origin_that_moves_is_doubted_until_the_next_answer(tmp_path: Path) -> None:
    located = Located(tmp_path)
    located.hear_origin(10.0)
    assert located.doubt is Doubt.ORIGIN_MOVED
    located.clock.time_s += SETTLED_S + 0.01
    located.hear_origin(10.0)
    assert located.doubt is None and located.executor.maps_begun == 2


def test_a_position_that_wanders_again_and_again_is_not_driven_by(tmp_path: Path) -> None:
    located = Located(tmp_path)
    for number in range(WANDERINGS):
        located.clock.time_s += ONCE_S + 0.1
        located.report(wander=Drift(off_m=2.0))
        assert located.doubt is (Doubt.POSITION_WANDERS if number == WANDERINGS - 1 else Doubt.POSITION_WANDERED)
        located.clock.time_s += SETTLED_S + 0.01
        located.hear_origin()
    assert located.doubt is Doubt.POSITION_WANDERS
    located.clock.time_s += CALM_S
    assert located.doubt is None


def test_a_loop_that_stood_still_settles_first(tmp_path: Path) -> None:
    located = Located(tmp_path)
    located.monitor.stalled(located.now_s)
    assert located.doubt is Doubt.LOOP_STOOD_STILL and not located.monitor.position_doubted
    located.clock.time_s += SETTLED_S + 0.01
    assert located.doubt is None


def test_before_the_mission_there_is_no_map_to_doubt_and_home_is_told_once(tmp_path: Path) -> None:
    located = Located(tmp_path, begun=False)
    located.report(jump_m=5.0)
    assert located.doubt is None and located.notices.told == []
    located.begin()
    away = LocalFrame(PLACE).to_geo(NedPoint(3.0, 0.0))
    for _ in range(2):
        located.monitor.take(HomeSeen(10.0, away), located.run.vehicle)
    assert len(located.notices.told) == 1 and located.doubt is None
