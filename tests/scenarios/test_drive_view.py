"""What ``drive --view`` shows of a drive that others interrupt: everything where it really is, and who did what."""

from __future__ import annotations

import io
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import pytest
from matplotlib.axes import Axes
from rich.console import Console

from companion.app import Status
from companion.recording.recorder import NullRecorder
from companion.settings import Settings
from companion.viewer.terminal.painter import MakeView, Painter
from companion.viewer.terminal.screen import View
from companion.viewer.terminal.sketch import Kind
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


@pytest.fixture(scope="module")
def driven(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Driven]:
    mission = yard(tmp_path_factory.mktemp("yard"))
    scenario = with_faults(scenario_from_mission(mission), PLAN)
    run, viewer = Drive(mission, scenario, Settings(), 0, NullRecorder(), 120.0), Kept()
    shown, statuses = DriveView(run, viewer), []

    def observe(status: Status) -> None:
        statuses.append(status)
        shown.observe(status)

    shown.finish(run.run(observe))
    assert any("EKF origin moved" in text for text in run.companion.outcome.said)
    yield Driven(run, viewer.views, statuses)


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
    expected = ["mode HOLD, was GUIDED", "mode GUIDED, was HOLD", "the autopilot has lost power"]
    expected.append("the autopilot has booted: MANUAL, disarmed")
    assert [text for text in told if text in expected] == expected


def test_the_news_tell_all_that_the_companion_said(driven: Driven) -> None:
    told = [text.partition(" s: ")[2] for text in driven.views[-1].events]
    said = driven.run.companion.outcome.said
    assert len(said) > 5 and any("mode is not GUIDED" in text for text in said)
    assert [text for text in told if text in said] == said


@pytest.mark.parametrize(("columns", "rows"), [(60, 16), (80, 24), (140, 40)])
def test_what_is_waited_for_and_the_newest_news_can_be_read(driven: Driven, columns: int, rows: int) -> None:
    status, view = driven.statuses[-1], driven.views[-2]
    assert len(status.doing) > 44
    lines = screen(view, columns, rows)
    assert len(lines) == rows
    below = [line.strip() for line in lines[max(n for n, line in enumerate(lines) if line.startswith("╰")) + 1 :]]
    assert " ".join(" ".join(below).split()).startswith(status.doing)
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
    outcome, _, news = text.partition("outcome: time limit, 0 of 1 targets reached")
    assert outcome == "" or not frames
    assert not frames or driven.views[-1].events[-1].rstrip(".") in news
