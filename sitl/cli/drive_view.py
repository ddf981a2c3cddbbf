"""``drive --view``: adds the companion's map, targets, decisions and texts to the view of the simulator."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from companion.app import Status
from companion.core.clock import stopwatch_s
from companion.executive.mission_progress import TargetStatus
from companion.navigation.field_step import Part
from companion.safety.reasons import EndReason, Reason
from companion.viewer.frame import doing_of
from companion.viewer.headway import Headway
from companion.viewer.terminal.known import headline_of, known_layers, mission_section, path_ahead, target_places
from companion.viewer.terminal.painter import Painter
from companion.viewer.terminal.screen import Headline, Mood, View
from companion.viewer.terminal.sketch import Kind, PlaceState, Sketch
from sitl.cli.drive_progress import Also
from sitl.lockstep import Drive, DriveOutcome, Report
from sitl.view.watching import Watching, world_layers


def run_with_view(run: Drive, painter: Painter, pace: Callable[[float], None], also: Also) -> Report:
    """Drive to the end while the view is shown; ``pace`` waits until a simulated time may be passed."""
    with painter:
        shown = DriveView(run, painter)

        def observe(status: Status) -> None:
            shown.observe(status)
            also.show(status)
            pace(status.time_s)

        report = run.run(observe, also.every_s)
        also.show(shown.finish(report))
    return report


class DriveView:
    """Shows a lock-step run; real time is read only to decide when to draw."""

    def __init__(self, run: Drive, painter: Painter) -> None:
        self._run = run
        self._painter = painter
        self._watching = Watching(run.mission.name, run.simulator)
        self._collisions = 0
        self._told_of = (-1, "")
        """The step and the reason of the last decision that was told."""
        self._reason = self._told = ""
        self._headway = Headway()
        self._repeats = 0

    def observe(self, status: Status) -> None:
        """Take in a new moment of the run, and draw it if that is due."""
        self._take_in(status)
        now_s = stopwatch_s()
        if self._painter.is_due(now_s):
            self._show(self._view(status, now_s, headline_of(self._run.companion, status, self._headway)))

    def _take_in(self, status: Status) -> None:
        self._watching.note()
        self._headway.note(self._run.companion, status)
        collisions = self._run.simulator.collisions
        for collision in collisions[self._collisions :]:
            self._watching.tell(f"{collision.time_s:.0f} s: {collision.told(self._run.scenario.start)}")
        self._collisions = len(collisions)
        time_s = self._run.simulator.time_s  # the clock of all lines: the companion's is a tick behind
        for news in status.news:
            self._watching.tell(f"{time_s:.0f} s: {news.text}")
        decision = status.decision
        if decision is None or (status.steps, decision.reason) == self._told_of:
            return
        self._told_of = (status.steps, decision.reason)
        if decision.part is not Part.EXPLORE:  # following the path is not an event: the panel always shows it
            self._tell_decision(time_s, decision.reason)

    def _tell_decision(self, time_s: float, reason: str) -> None:
        """One line for the same decision several times in a row."""
        events = self._watching.events
        again = bool(events) and events[-1] == self._told
        self._repeats = self._repeats + 1 if again and reason == self._reason else 1
        if self._repeats > 1:
            events.pop()
        self._reason = reason
        self._told = f"{time_s:.0f} s: {reason}{f' ({self._repeats} times)' * (self._repeats > 1)}"
        self._watching.tell(self._told)

    def finish(self, report: Report) -> Status:
        """Draw the last moment, with what the drive came to; that moment."""
        status = self._run.take_status()
        self._take_in(status)
        doing = doing_of(self._run.companion, status, self._headway)
        waits = f"{doing['line']}, {doing['why']}" if doing["state"] in ("stopped", "waiting") else ""
        if status.activity.reason == Reason(EndReason.NOBODY_HERE):
            waits = doing["why"]
        self._show(self._view(status, stopwatch_s(), outcome_line(report, waits)))
        return status

    def _show(self, view: View) -> None:
        self._painter.show(lambda: view)

    def _view(self, status: Status, now_s: float, headline: Headline) -> View:
        watching, companion = self._watching, self._run.companion
        sections = (watching.vehicle_section(now_s), mission_section(companion, status), watching.links_section())
        return View(watching.title, self._sketch(), sections, tuple(watching.events), headline)

    def _sketch(self) -> Sketch:
        """The true world, dimmed, overlaid with the companion's map and targets."""
        sketch, simulator, companion = self._watching.sketch(), self._run.simulator, self._run.companion
        evidence, progress = companion.evidence, companion.progress
        layers = world_layers(simulator.world, simulator.time_s, Kind.HIDDEN)
        places = [place for place in sketch.places if place.state is PlaceState.START]
        if evidence is not None and progress is not None and companion.origin is not None:
            # After a reboot the autopilot's origin is where it rebooted, and so is the companion's.
            north_m, east_m = self._run.scenario.start.place_of(companion.origin)
            layers += known_layers(evidence, north_m, east_m)
            places += target_places(progress, north_m, east_m, ended=companion.done)
            sketch = replace(sketch, path=path_ahead(companion, north_m, east_m))
        return replace(sketch, layers=layers, places=tuple(places))


def outcome_line(report: Report, waits: str = "") -> Headline:
    """What the drive came to. ``waits``: why the rover stood at its end, and what for."""
    reached = sum(status is TargetStatus.REACHED for _, status in report.targets)
    text = (
        f"outcome: {report.outcome}, {reached} of {len(report.targets)} targets reached, {report.distance_m:.0f} m in "
        f"{report.driving_time_s:.0f} s, {report.collisions} collision{'s' * (report.collisions != 1)}"
        f"{f'; {waits}' if waits else ''}"
    )
    return Headline(text, Mood.GOOD if report.outcome is DriveOutcome.REACHED else Mood.BAD)
