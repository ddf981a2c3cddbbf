"""What people ask for on the page of a drive: it goes a ground station's way, and the record of it can be replayed."""

from __future__ import annotations

from pathlib import Path

import pytest

from companion.mavlink.local_station import LocalStation
from companion.mission.load import load_mission
from companion.recording.reader import load_record
from companion.recording.recorder import Recorder
from companion.replay.replay import replay
from companion.settings.settings_file import parse_settings
from companion.viewer import page_requests
from companion.viewer.page_requests import NOT_DRIVING, NOT_HEARD, NOT_PAUSED, OTHER_GOAL, TOO_OLD, PageRequests
from sitl.lockstep import Drive
from sitl.scenario import scenario_from_mission
from tests.companion.viewer.test_feed import MISSION


class Page:
    """Somebody at the page of a drive that goes ``speedup`` times as fast as real time."""

    speedup = 1.0

    def __init__(self, folder: Path) -> None:
        mission, settings = load_mission(MISSION), parse_settings({}, "test")
        station = LocalStation()
        self.requests = PageRequests(station)
        self.recorder = Recorder(folder, mission, settings, 3, arm=True)
        scenario = scenario_from_mission(mission)
        self.run = Drive(mission, scenario, settings, 3, self.recorder, 300.0, station=station)
        self.number = 0
        self.real_s = 0.0
        """The stopwatch of whoever looks on."""

    def stopwatch_s(self) -> float:
        return self.real_s

    def ticks(self, seconds: float) -> None:
        end_s = self.run.simulator.time_s + seconds
        while self.run.simulator.time_s < end_s and not self.run.companion.done:
            self.run.companion.tick()
            self.real_s += 0.05 / self.speedup
            self.requests.note(self.run.companion.status().time_s)

    def drives(self) -> None:
        while self.run.companion.vehicle.speed_m_s < 0.5:
            self.ticks(0.5)

    def ask(self, action: str, **more: object) -> str:
        """What was answered: nothing if it was accepted."""
        self.number += 1
        shown = {"t": self.run.companion.status().time_s, **more}
        self.requests.take({"number": self.number, "action": action, **shown}, self.run.companion)
        answers: list[dict] = []
        for _ in range(20):
            self.ticks(0.2)
            answers += self.requests.answered(self.run.companion)
        (answer,) = answers
        assert answer["number"] == self.number and answer["action"] == action
        assert answer["ok"] is (answer["text"] in ("", NOT_PAUSED))
        return str(answer["text"])


@pytest.fixture
def page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Page:
    page = Page(tmp_path / "record")
    monkeypatch.setattr(page_requests, "stopwatch_s", page.stopwatch_s)
    return page


@pytest.mark.thorough
def test_pause_go_on_send_and_skip_and_the_record_is_replayed(page: Page) -> None:
    page.ticks(2.0)
    assert page.ask("skip", goal="far end") == page.ask("goto", place=[1.0, 1.0]) == NOT_DRIVING
    companion = page.run.companion
    assert page.ask("pause") == ""
    page.ticks(60.0)
    assert companion.executor is None and "asked for before the mission began" in companion.status().doing
    assert page.ask("resume") == ""
    page.drives()
    assert page.ask("resume") == NOT_PAUSED
    assert page.ask("pause") == ""
    page.ticks(3.0)
    heartbeat = companion.vehicle.heartbeat
    assert heartbeat is not None and heartbeat.mode == 4 and companion.vehicle.speed_m_s < 0.1
    assert page.ask("goto", place=[5.0, 1.0]).startswith("not driving")
    now_s = companion.status().time_s
    assert page.ask("resume", t=now_s - 5.0) == page.ask("resume", t=now_s + 60.0) == TOO_OLD
    assert page.ask("resume", t=None) == TOO_OLD
    assert page.ask("resume") == ""
    page.drives()
    assert page.ask("goto", place=[9000.0, 0.0]).endswith("farther than 300 m")
    assert page.ask("goto", place=[3.0, 3.0]) == ""
    assert page.ask("skip", goal="another") == OTHER_GOAL
    assert companion.executor is not None and page.ask("skip", goal="requested goal 1") == ""
    goal = companion.executor.progress.goal.name
    assert page.ask("skip", goal=goal) == ""
    page.ticks(30.0)
    assert companion.done and [str(status) for _, status in companion.statuses()] == ["skipped"]
    companion.close()
    page.recorder.close()
    result = replay(load_record(page.recorder.directory))
    assert not result.differences and result.ticks > 100


@pytest.mark.thorough
def test_in_a_drive_that_goes_faster_the_same_delay_is_no_fault(page: Page) -> None:
    page.speedup = 20.0
    page.drives()
    assert page.ask("goto", place=[3.0, 3.0], t=page.run.companion.status().time_s - 0.3 * page.speedup) == ""
    page.ticks(3.0 * page.speedup)
    assert page.ask("skip", goal="any", t=page.run.companion.status().time_s - 3.5 * page.speedup) == TOO_OLD
    page.recorder.close()


def test_what_nobody_answers_is_told_after_a_while(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    page = Page(tmp_path / "record")
    page.requests.take({"number": 6, "action": "pause"}, page.run.companion)
    assert [answer["text"] for answer in page.requests.answered(page.run.companion)] == [NOT_HEARD]
    page.ticks(2.0)
    page.requests.take({"number": 7, "action": "pause"}, page.run.companion)
    assert page.requests.answered(page.run.companion) == []
    monkeypatch.setattr(page_requests, "NO_ANSWER_S", -1.0)
    (answer,) = page.requests.answered(page.run.companion)
    assert answer["number"] == 7 and not answer["ok"] and "did not answer" in answer["text"]
    page.recorder.close()
