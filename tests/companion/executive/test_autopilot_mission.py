"""The mission that the autopilot has stored: a change of it is noticed and told once."""

from __future__ import annotations

import pytest

from companion.core.severity import Severity
from companion.executive.autopilot_mission import MissionChangeMonitor
from companion.mavlink.download import Downloaded, Downloads
from companion.mission.items import Item
from companion.mission.stored_mission import digest
from companion.vehicle.events import (
    ItemCurrentSeen,
    PlanChangedSeen,
    PlanItemSeen,
    PlanKind,
    TextSeen,
)
from companion.vehicle.state import VehicleState
from tests.companion.mission.test_stored_mission import GOING
from tests.support.notices import Notices


class Shelf(Downloads):
    """Downloads that are over at once."""

    def __init__(self, items: list[Item]) -> None:
        super().__init__()
        self.items, self.asked, self.time_s = items, 0, 0.0

    def ask(self, kind: PlanKind) -> None:
        assert kind is PlanKind.MISSION
        self.asked, self.time_s = self.asked + 1, self.time_s + 1.0

    def last(self, kind: PlanKind) -> Downloaded | None:
        return Downloaded(kind, self.time_s, tuple(self.items)) if self.asked else None


SIGNS = {
    "an upload that came by": [PlanChangedSeen(5.0, 0)],
    "the autopilot's word": [TextSeen(5.0, 6, "Flight plan received")],
    "another number of items": [ItemCurrentSeen(4.0, 1, 5), ItemCurrentSeen(5.0, 1, 6)],
}
LATER = PlanItemSeen(6.0, 0, 1, 16, 3, (0.0, 0.0, 0.0, 0.0), 0.0, 0.0, True)


@pytest.mark.parametrize("signs", SIGNS.values(), ids=SIGNS)
def test_a_mission_that_changes_is_fetched_again_and_told_once(signs: list[object]) -> None:
    notices = Notices()
    shelf = Shelf(GOING[:3])
    watch = MissionChangeMonitor(digest(GOING), shelf, notices)
    for event in (*signs, LATER, LATER, *signs[-1:], LATER):
        watch.take(event, VehicleState())  # type: ignore[arg-type]
    assert shelf.asked >= 1
    assert [severity for _, severity in notices.told] == [Severity.WARNING]


@pytest.mark.parametrize("signs", SIGNS.values(), ids=SIGNS)
def test_the_same_mission_again_is_not_worth_a_word(signs: list[object]) -> None:
    notices = Notices()
    watch = MissionChangeMonitor(digest(GOING), Shelf(GOING), notices)
    for event in (*signs, LATER):
        watch.take(event, VehicleState())  # type: ignore[arg-type]
    assert notices.told == []


def test_a_mission_from_a_file_is_compared_with_nothing() -> None:
    shelf = Shelf(GOING)
    watch = MissionChangeMonitor("", shelf, Notices())
    for signs in SIGNS.values():
        for event in signs:
            watch.take(event, VehicleState())  # type: ignore[arg-type]
    assert shelf.asked == 0
