"""The event dispatcher: what becomes of events."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from companion.core.scan import WIRED
from companion.core.severity import Severity
from companion.executive.mission_run import LocatedScan
from companion.operator.notifications import News
from companion.supervision.event_dispatcher import EventDispatcher
from companion.vehicle.commands import (
    AnswerRequest,
    ParameterValue,
)
from companion.vehicle.events import (
    Event,
    HeartbeatSeen,
    ParameterAsked,
    RangeSeen,
    TextSeen,
)
from tests.companion.safety.test_mode_latch import HOLD
from tests.support.desk import Desk
from tests.support.whole import Whole


def test_ground_stations_are_answered_and_the_autopilots_warnings_shown(whole: Whole) -> None:
    answers = whole.tick(ParameterAsked(100.0, "CMP_STALE", -1), TextSeen(100.0, 3, "Bad battery"))
    assert [answer.name for answer in answers if isinstance(answer, ParameterValue)] == ["CMP_STALE"]
    assert not any(isinstance(answer, AnswerRequest) for answer in answers)
    assert whole.companion.status().news == (News(Severity.ERROR, "autopilot: Bad battery", own=False),)
    whole.tick()
    assert whole.companion.status().news == ()


class Heard:
    """A dispatcher with what it hands events to."""

    def __init__(self, folder: Path, *, begun: bool = True) -> None:
        self.desk, self.taken, self.noted = Desk(folder), [], []
        self.scans, self.localization = SimpleNamespace(fits=True), SimpleNamespace(position_doubted=False)
        notifier: Any = SimpleNamespace(news=["old"], note=lambda text, severity: self.noted.append((text, severity)))
        one, other = (
            SimpleNamespace(take=lambda event, vehicle, name=name: self.taken.append(name)) for name in ("one", "other")
        )
        link: Any = self.desk.autopilot
        parts: Any = ((one, other), self.scans, self.localization)
        self.dispatcher, self.notifier = EventDispatcher(self.desk.run, link, notifier, *parts), notifier
        if begun:
            self.desk.begin()

    def listen(self, *events: Event) -> list[LocatedScan]:
        self.desk.autopilot.events = list(events)
        return self.dispatcher.listen(self.desk.now_s)


def test_every_event_is_folded_and_handed_on_in_order(tmp_path: Path) -> None:
    heard = Heard(tmp_path)
    assert heard.listen(HeartbeatSeen(11.0, HOLD, False, 1)) == []
    heartbeat = heard.desk.run.vehicle.heartbeat
    assert heartbeat is not None and heartbeat.time_s == 11.0
    assert heard.taken == ["one", "other"] and heard.notifier.news == []


@pytest.mark.parametrize(("severity", "shown"), [(3, True), (4, True), (5, False)])
def test_only_warnings_of_the_autopilot_are_shown(tmp_path: Path, severity: int, shown: bool) -> None:
    heard = Heard(tmp_path)
    heard.listen(TextSeen(10.0, severity, "Bad battery"))
    assert heard.noted == ([("autopilot: Bad battery", Severity(severity))] if shown else [])


@pytest.mark.parametrize("missing", ["", "begun", "fits", "position", "attitude"])
def test_a_scan_goes_on_the_map_only_where_it_was_taken(tmp_path: Path, missing: str) -> None:
    heard = Heard(tmp_path, begun=missing != "begun")
    heard.scans.fits = missing != "fits"
    heard.localization.position_doubted = missing == "position"
    seen = heard.desk.stand(2.0, 3.0)
    if missing == "attitude":
        heard.desk.run.vehicle = replace(seen, attitude=None)
    assert seen.scan is not None
    found = heard.listen(seen.scan)
    assert len(found) == (0 if missing else 1)
    assert missing or ((found[0].pose.north_m, found[0].pose.east_m) == (2.0, 3.0) and found[0].scan is seen.scan.scan)


@pytest.mark.parametrize("sender", [1, WIRED])
def test_a_scan_of_a_wired_lidar_lies_before_the_position_that_came_late_over_the_link(
    tmp_path: Path, sender: int
) -> None:
    heard = Heard(tmp_path)
    seen = heard.desk.stand(2.0, 3.0)
    now_s = heard.desk.now_s
    assert seen.scan is not None and seen.position is not None
    heard.desk.run.vehicle = replace(
        seen,
        position=replace(seen.position, time_s=now_s, north_m_s=1.0),
        latency=replace(seen.latency, round_trips_s=(0.4, 0.4, 0.4)),
    )
    (found,) = heard.listen(RangeSeen(now_s, replace(seen.scan.scan, time_s=now_s, sender=sender)))
    assert found.pose.north_m == pytest.approx(2.2 if sender == WIRED else 2.0)
