"""The event dispatcher: what becomes of events."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from companion.core.scan import WIRED
from companion.core.severity import Severity
from companion.executive.mission_run import LocatedScan
from companion.operator.notifications import News
from companion.perception.scan_filter import sensor_of
from companion.settings import Settings
from companion.settings.settings_file import parse_settings
from companion.supervision.event_dispatcher import KEPT, EventDispatcher
from companion.vehicle.commands import (
    AnswerRequest,
    ParameterValue,
)
from companion.vehicle.events import (
    EkfStatusSeen,
    Event,
    HeartbeatSeen,
    ParameterAsked,
    RangeSeen,
    TextSeen,
)
from companion.vehicle.state import VehicleState
from tests.companion.perception.test_range_age import scan_at, to_and_fro
from tests.companion.safety.test_mode_latch import EKF_GOOD, HOLD
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

    def __init__(self, folder: Path, *, begun: bool = True, settings: Settings | None = None) -> None:
        self.desk, self.taken, self.noted = Desk(folder, settings=settings), [], []
        self.scans, self.localization = SimpleNamespace(fits=True), SimpleNamespace(position_doubted=False)
        notifier: Any = SimpleNamespace(news=["old"], note=lambda text, severity: self.noted.append((text, severity)))
        one, other = (
            SimpleNamespace(take=lambda event, vehicle, name=name: self.taken.append(name)) for name in ("one", "other")
        )
        link: Any = self.desk.autopilot
        parts: Any = ((one, other), self.scans, self.localization, self.desk.settings)
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


@pytest.mark.parametrize(("sender", "told_s", "age_s"), [(1, 0.2, 0.2), (1, 0.0, 0.0), (WIRED, 0.2, 0.0)])
def test_ranges_over_the_link_lie_where_the_rover_was_before_as_long_as_they_are_old(
    tmp_path: Path, sender: int, told_s: float, age_s: float
) -> None:
    """A rover that turns at 1 rad/s and rolls at 1 m/s: it came on an arc of 1 m."""
    heard = Heard(tmp_path, settings=parse_settings({"mapping": {"range_age_s": told_s}}, "here"))
    seen = heard.desk.stand(2.0, 3.0)
    now_s = heard.desk.now_s
    assert seen.scan is not None and seen.position is not None and seen.attitude is not None
    for time_s in (now_s - 0.3, now_s - 0.1, now_s):
        turning = replace(seen.attitude, time_s=time_s, heading_rad=time_s - now_s, yaw_rate_rad_s=1.0)
        rolling = replace(seen.position, time_s=time_s, north_m_s=1.0, east_m_s=0.0)
        heard.desk.run.vehicle = replace(seen, attitude=turning, position=rolling)
        scan = replace(seen.scan.scan, time_s=time_s, sender=sender)
        (found,) = heard.listen(RangeSeen(time_s, scan))
    assert found.scan is scan and found.pose.time_s == pytest.approx(now_s - age_s)
    assert found.pose.heading_rad == pytest.approx(-age_s)
    there_m = 2.0 - math.sin(age_s), 3.0 + 1.0 - math.cos(age_s)
    assert (found.pose.north_m, found.pose.east_m) == pytest.approx(there_m, abs=0.002)


def at(seen: VehicleState, time_s: float, heading_rad: float, rate_rad_s: float) -> VehicleState:
    """The vehicle, heard anew: it stands and turns."""
    position, attitude, heartbeat, ahead = seen.position, seen.attitude, seen.heartbeat, seen.scan_ahead
    assert position is not None and attitude is not None and heartbeat is not None and ahead is not None
    return replace(
        seen,
        position=replace(position, time_s=time_s, north_m_s=0.0, east_m_s=0.0),
        attitude=replace(attitude, time_s=time_s, heading_rad=heading_rad, yaw_rate_rad_s=rate_rad_s),
        heartbeat=replace(heartbeat, time_s=time_s),
        scan_ahead=replace(ahead, time_s=time_s),
        ekf=EkfStatusSeen(time_s, EKF_GOOD),
    )


@pytest.mark.parametrize(
    ("silent", "old_s", "told"),
    [
        ("position", 0.2, 1),
        ("position", 0.4, 0),
        ("attitude", 0.0, 1),
        ("attitude", 0.4, 0),
        ("ekf", 0.4, 1),
        ("ekf", 2.0, 0),
    ],
)
def test_ranges_do_not_seem_old_by_positions_and_headings_that_are(
    tmp_path: Path, silent: str, old_s: float, told: int
) -> None:
    """A rover whose autopilot falls silent while it turns: it stops, but in the last attitude it turns on."""
    heard, texts = Heard(tmp_path), []
    heard.notifier.tell = lambda text, severity: texts.append(text)
    seen = heard.desk.stand(0.0, 0.0)
    for time_s in heard.desk.now_s + np.arange(0.0, 6.0, 0.1):
        heading_rad, rate_rad_s = to_and_fro(time_s)
        now = at(seen, time_s, heading_rad, rate_rad_s)
        heard.desk.run.vehicle = replace(now, **{silent: replace(getattr(now, silent), time_s=time_s - old_s)})
        scan = replace(scan_at(time_s, heading_rad - 0.2 * rate_rad_s, (0.0, 0.0)), time_s=time_s)
        heard.desk.autopilot.events = [RangeSeen(time_s, scan)]
        heard.dispatcher.listen(time_s)
    assert len(texts) == told


@pytest.mark.parametrize("told_s", [None, 0.0])
def test_the_age_of_ranges_is_found_and_told_once_unless_the_settings_say_it(
    tmp_path: Path, told_s: float | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    heard = Heard(
        tmp_path, settings=parse_settings({"mapping": {"range_age_s": told_s}} if told_s == 0.0 else {}, "here")
    )
    told: list[str] = []
    forgotten: list[float] = []
    heard.notifier.tell = lambda text, severity: told.append(text)
    monkeypatch.setattr(heard.desk.executor, "forget_map", forgotten.append)
    seen = heard.desk.stand(0.0, 0.0)
    assert seen.position is not None and seen.attitude is not None
    turned_rad = []
    for time_s in heard.desk.now_s + np.arange(0.0, 6.0, 0.1):
        heading_rad, rate_rad_s = to_and_fro(time_s)
        heard.desk.run.vehicle = at(seen, time_s, heading_rad, rate_rad_s)
        scan = replace(scan_at(time_s, to_and_fro(time_s - 0.2)[0], (0.0, 0.0)), time_s=time_s)
        heard.desk.autopilot.events = [RangeSeen(time_s, scan)]
        found = heard.dispatcher.listen(time_s)[-1]
        # Beside it one of the same sender and message that looks backwards, and whose ranges are not old.
        behind = replace(scan_at(time_s, heading_rad, (0.0, 0.0)), time_s=time_s)
        behind = replace(behind, bearing_rad=np.roll(behind.bearing_rad, 36), range_m=np.roll(behind.range_m, 36))
        heard.desk.autopilot.events = [RangeSeen(time_s, behind)]
        heard.dispatcher.listen(time_s)
        turned_rad.append((heading_rad - found.pose.heading_rad) / rate_rad_s)
    assert turned_rad[0] == 0.0 and turned_rad[-1] == pytest.approx(0.0 if told_s == 0.0 else 0.2, abs=0.03)
    assert len(told) == (0 if told_s == 0.0 else 1)
    assert told_s == 0.0 or told[0].startswith("Ranges (OBSTACLE_DISTANCE) are 0.")
    assert len(forgotten) == (0 if told_s == 0.0 else 1), "what had been mapped before lies aside"


def test_once_an_age_is_found_the_map_begins_anew_with_the_newest_scans_where_they_were_taken(tmp_path: Path) -> None:
    heard = Heard(tmp_path)
    heard.notifier.tell = lambda text, severity: None
    seen = heard.desk.stand(0.0, 0.0)
    mapped = []
    for time_s in heard.desk.now_s + np.arange(0.0, 6.0, 0.1):
        heard.desk.run.vehicle = at(seen, time_s, *to_and_fro(time_s))
        scan = replace(scan_at(time_s, to_and_fro(time_s - 0.2)[0], (0.0, 0.0)), time_s=time_s)
        heard.desk.autopilot.events = [RangeSeen(time_s, scan)]
        mapped.append(heard.dispatcher.listen(time_s))
    assert heard.desk.executor.maps_begun == 1
    (again,) = (one for one in mapped if len(one) != 1)
    assert len(again) == 1 + KEPT
    for one in again:
        assert one.pose.heading_rad == pytest.approx(to_and_fro(one.scan.time_s - 0.2)[0], abs=0.1)


def test_a_run_that_goes_on_with_an_age_keeps_the_map_that_was_laid_with_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    heard, told = Heard(tmp_path), []
    heard.notifier.tell = lambda text, severity: told.append(text)
    monkeypatch.setattr(heard.desk.executor, "forget_map", lambda now_s: told.append("the map is forgotten"))
    seen = heard.desk.stand(0.0, 0.0)
    scan = scan_at(heard.desk.now_s, 0.0, (0.0, 0.0))
    heard.desk.executor.range_ages.go_on([(sensor_of(scan), 0.2)])
    heard.desk.run.vehicle = at(seen, heard.desk.now_s, 0.0, 0.0)
    heard.desk.autopilot.events = [RangeSeen(heard.desk.now_s, replace(scan, time_s=heard.desk.now_s))]
    heard.dispatcher.listen(heard.desk.now_s)
    assert told == ["Ranges (OBSTACLE_DISTANCE) are 0.20 s older than positions"]
