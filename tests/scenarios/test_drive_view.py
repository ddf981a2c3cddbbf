"""What ``drive --view`` shows of a drive that others interrupt: everything where it really is, and who did what."""

from __future__ import annotations

import io
import json
import math
import threading
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.axes import Axes
from rich.console import Console

from companion.app import Status
from companion.recording.reader import load_record
from companion.recording.recorder import Recorder
from companion.replay.replay import replay
from companion.safety.reasons import LatchReason
from companion.settings import Settings
from companion.viewer import feed
from companion.viewer.feed import ViewerFeed
from companion.viewer.report_data import ReportWatch
from companion.viewer.terminal.painter import MakeView, Painter
from companion.viewer.terminal.run_view import RunView
from companion.viewer.terminal.screen import View
from companion.viewer.terminal.sketch import Kind
from companion.viewer.wire import JSON
from sitl.cli.drive_view import DriveView
from sitl.faults.plan import FaultPlan, PilotTakesOver, Reboot
from sitl.lockstep import Drive, DriveOutcome
from sitl.scenario import scenario_from_mission, with_faults
from sitl.view.picture import save_picture
from tests.companion.viewer.terminal.test_screen import screen
from tests.support.rig import yard

GATE_M = (7.5, 15.5)
"""North and east in the world, from the map's south-west corner: the middle of field 15, 7."""
PLAN = FaultPlan((PilotTakesOver(3.0, 5.0, "driving", mode="HOLD"), Reboot(9.0, 12.0, "driving")))


class Kept(Painter):
    """Draws nothing and keeps what was to be drawn."""

    def __init__(self) -> None:
        super().__init__(Console(file=io.StringIO()))
        self.views: list[View] = []

    def is_due(self, now_s: float) -> bool:
        return True

    def show(self, make: MakeView) -> None:
        self.views.append(make())


@dataclass
class Driven:
    """A drive to a field behind a wall, which the pilot interrupts and then a power failure of the autopilot ends."""

    run: Drive
    views: list[View] = field(default_factory=list)
    statuses: list[Status] = field(default_factory=list)
    told: list[dict[str, Any]] = field(default_factory=list)
    """What the page is told."""
    record: Path = Path()
    rovers: list[tuple[float, float, float]] = field(default_factory=list)
    """Where the terminal of the real run shows it: time, north, east."""


class Page:
    """Takes what a page is told."""

    def __init__(self) -> None:
        self.begins_anew = threading.Event()
        self.is_full = False
        self.told: list[dict[str, Any]] = []

    def put(self, kind: bytes, payload: bytes, *, last: bool = False) -> bool:
        self.told += [json.loads(payload)] if kind == JSON else []
        return True


@pytest.fixture(scope="module")
def driven(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Driven]:
    mission, record = yard(tmp_path_factory.mktemp("yard")), tmp_path_factory.mktemp("record")
    scenario = with_faults(scenario_from_mission(mission), PLAN)
    recorder = Recorder(record, mission, Settings(), 0, arm=True, start_us=0)
    run, viewer, page = Drive(mission, scenario, Settings(), 0, recorder, 120.0), Kept(), Page()
    shown, fed, statuses = DriveView(run, viewer), ViewerFeed(run.companion, page, {}), []
    terminal, rovers = RunView(run.companion, "yard"), []

    def observe(status: Status) -> None:
        statuses.append(status)
        shown.observe(status)
        fed.show(status)
        terminal.note(status)
        if (rover := terminal.view(status)().sketch.rover) is not None:
            rovers.append((status.time_s, rover.north_m, rover.east_m))

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(feed, "FRAME_S", -1.0)
        patch.setattr(feed, "SCENE_S", -1.0)
        shown.finish(run.run(observe))
    recorder.close()
    assert any("moved its origin" in text for text in run.companion.outcome.said)
    yield Driven(run, viewer.views, statuses, page.told, record, rovers)


@pytest.mark.thorough
def test_targets_and_walls_stay_where_they_are_when_the_autopilot_counts_from_elsewhere(driven: Driven) -> None:
    origin, start = driven.run.companion.origin, driven.run.scenario.start
    assert origin is not None and driven.run.mission.targets
    moved_m = [there - here for there, here in zip(start.place_of(origin), (start.north_m, start.east_m), strict=True)]
    assert max(map(abs, moved_m)) > 2.0
    for view in (view for view in driven.views if len(view.sketch.places) > 1):
        gate = view.sketch.places[-1]
        assert (gate.north_m, gate.east_m) == pytest.approx(GATE_M, abs=0.1)
        seen = next(layer for layer in view.sketch.layers if layer.kind is Kind.SEEN)
        # Its fields are the mission's own, layout from the new origin: they lie elsewhere by less than a field.
        assert (seen.south_m, seen.west_m) == pytest.approx((0.0, 0.0), abs=1.0)


@pytest.fixture(scope="module")
def watch(driven: Driven) -> ReportWatch:
    """What a report has of it."""
    record = load_record(driven.record)
    watch = ReportWatch(record)
    replay(record, watch)
    return watch


@pytest.mark.thorough
def test_on_the_page_and_in_the_report_they_stay_too(driven: Driven, watch: ReportWatch) -> None:
    places = [one["targets"][0]["place"] for one in driven.told if one["kind"] == "scene" and one["targets"]]
    assert len({one["map_epoch"] for one in driven.told if one["kind"] == "scene"}) == 3
    assert len(places) > 1 and np.ptp(places, axis=0).max() < 0.1
    frames = [one for one in driven.told if one["kind"] == "frame" and one["goal"]]
    assert np.ptp([one["goal"]["place"] for one in frames], axis=0).max() < 0.1
    assert watch.scene["targets"][0]["place"] == pytest.approx(places[0], abs=0.1)
    goals = [one["goal"]["place"] for one in watch.frames if one.get("goal")]
    assert np.ptp(goals, axis=0).max() < 0.1
    (_, before), (_, after) = watch.maps
    assert before is not None and after is not None
    assert (before["south_m"], before["west_m"]) == pytest.approx((after["south_m"], after["west_m"]), abs=1.0)
    ends = [one["pose"] for one in (frames[0], frames[-1])]
    assert math.dist(ends[0][:2], ends[1][:2]) > 2.0, "where it had driven before the failure"


def test_a_rover_whose_autopilot_does_not_know_where_it_is_is_shown_where_it_was_and_as_old(
    driven: Driven, watch: ReportWatch
) -> None:
    lost_s = next(status.time_s for status in driven.statuses if "silent" in status.doing)
    begins_s = next(one["t"] for one in driven.told if one["kind"] == "frame" and one["state"] == "driving")
    for frames in ([one for one in driven.told if one["kind"] == "frame"], whole_frames(watch)):
        stood = [one for one in frames if one["t"] > lost_s]
        assert len(stood) > 100 and np.ptp([one["pose"][:2] for one in stood], axis=0).max() < 1.0
        assert math.dist(stood[0]["pose"][:2], (0.0, 0.0)) > 2.0
        unknown = [one for one in stood if "EKF has no position" in one["why"]]
        assert len(unknown) > 20 and all(one["rates"]["position_age_s"] > 1.5 and not one["rays"] for one in unknown)
        assert stood[-1]["rates"]["position_age_s"] < 0.5, "it knows again"
        first = next(one for one in frames if one["pose"])
        assert first["t"] < begins_s, "before the mission, but not before the autopilot knows"
    near_home = [one for one in driven.rovers if one[0] > lost_s and math.hypot(*one[1:]) < 0.01]
    assert len(driven.rovers) > 50 and near_home == [], "nor is it on the terminal"


def whole_frames(watch: ReportWatch) -> list[dict[str, Any]]:
    """The frames of a report, each with what has not changed since the one before."""
    frames: list[dict[str, Any]] = []
    for one in watch.frames:
        frames.append({**(frames[-1] if frames else {}), **one})
    return frames


def test_the_picture_has_the_target_there_too(driven: Driven, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    stars: list[tuple[float, float]] = []
    plot = Axes.plot

    def noted(axes: Axes, *args: object, **more: object) -> object:
        if "*" in args:
            stars.append((args[1], args[0]))  # type: ignore[arg-type]
        return plot(axes, *args, **more)  # type: ignore[arg-type]

    monkeypatch.setattr(Axes, "plot", noted)
    save_picture(driven.run, tmp_path / "yard.png")
    assert stars == [pytest.approx(GATE_M, abs=0.1)]


def test_the_news_tell_what_pilot_and_power_did(driven: Driven) -> None:
    told = [text.partition(" s: ")[2] for text in driven.views[-1].events]
    expected = ["mode HOLD now, GUIDED before", "mode GUIDED now, HOLD before", "the autopilot has lost power"]
    expected.append("the autopilot has started anew: MANUAL, disarmed")
    assert [text for text in told if text in expected] == expected
    modes = {fact.value for view in driven.views for fact in view.sections[0].facts if fact.name == "mode"}
    assert "no power" in modes


def test_the_news_tell_all_that_the_companion_said(driven: Driven) -> None:
    told = [text.partition(" s: ")[2] for text in driven.views[-1].events]
    said = driven.run.companion.outcome.said
    assert len(said) > 5 and any("mode is not GUIDED" in text for text in said)
    assert [text for text in told if text in said] == said


@pytest.mark.parametrize(("columns", "rows"), [(60, 16), (80, 24), (140, 40)])
def test_what_is_waited_for_and_the_newest_news_can_be_read(driven: Driven, columns: int, rows: int) -> None:
    status, view = driven.statuses[-1], driven.views[-2]
    told = f"stopped: {LatchReason.RESTARTED.value}, waiting for {status.activity.awaited}"
    lines = screen(view, columns, rows)
    assert len(lines) == rows
    below = [line.strip() for line in lines[max(n for n, line in enumerate(lines) if line.startswith("╰")) + 1 :]]
    assert " ".join(" ".join(below).split()).startswith(told)
    assert view.events[-1] in " ".join(below)


@pytest.mark.parametrize(("columns", "rows"), [(30, 8), (60, 16), (80, 24), (140, 40)])
def test_the_outcome_stands_under_the_last_picture_and_the_newest_news_under_it(
    driven: Driven, columns: int, rows: int
) -> None:
    assert driven.run.report.outcome is DriveOutcome.TIME_LIMIT
    lines = screen(driven.views[-1], columns, rows)
    assert len(lines) <= rows
    frames = [n for n, line in enumerate(lines) if line.startswith("╰")]
    text = " ".join(" ".join(lines[frames[-1] + 1 if frames else 0 :]).split())
    before, outcome, news = text.partition("outcome: time limit, 0 of 1 targets reached")
    assert outcome, "also where there is no room for a picture"
    assert columns < 80 or f"; stopped: {LatchReason.RESTARTED.value}" in news, "and why it came to no more"
    assert before == "" or not frames
    assert not frames or driven.views[-1].events[-1].rstrip(".") in news
