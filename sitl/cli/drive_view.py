"""``drive --view``: adds the companion's map, targets, decisions and texts to the view of the simulator."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from companion.app import Status
from companion.core.clock import stopwatch_s
from companion.core.grid import OBSTACLE
from companion.executive.mission_progress import TargetStatus
from companion.mapping.evidence_map import EvidenceMap, known_fields
from companion.navigation.field_step import Part
from sitl.cli.drive_progress import Also
from sitl.cli.viewer import Viewer
from sitl.lockstep import Drive, Report
from sitl.view.sketch import Kind, Layer, Place, PlaceState, Scene
from sitl.view.view import Fact, Section, View
from sitl.view.watching import Watching, world_layers

STATES = {
    TargetStatus.PENDING: PlaceState.PENDING,
    TargetStatus.REACHED: PlaceState.REACHED,
    TargetStatus.UNREACHABLE: PlaceState.LOST,
    TargetStatus.SKIPPED: PlaceState.LOST,
}
PARTS = {Part.RETURN: "returning", Part.EXPLORE: "exploring", Part.SEARCH: "new path"}


def run_with_view(run: Drive, viewer: Viewer, pace: Callable[[float], None], also: Also) -> Report:
    """Drive to the end while the view is shown; ``pace`` waits until a simulated time may be passed."""
    with viewer:
        shown = DriveView(run, viewer)

        def observe(status: Status) -> None:
            shown.observe(status)
            also.show(status)
            pace(status.time_s)

        report = run.run(observe, also.every_s)
        shown.finish()
    return report


class DriveView:
    """Shows a lock-step run; real time is read only to decide when to draw."""

    def __init__(self, run: Drive, viewer: Viewer) -> None:
        self._run = run
        self._viewer = viewer
        self._watching = Watching(run.mission.name, run.simulator)
        self._collisions = 0
        self._told_of = (-1, "")
        """The step and the reason of the last decision that was told."""

    def observe(self, status: Status) -> None:
        """Take in a new moment of the run, and draw it if that is due."""
        self._take_in(status)
        now_s = stopwatch_s()
        if self._viewer.is_due(now_s):
            self._viewer.show(self._view(status, now_s))

    def _take_in(self, status: Status) -> None:
        self._watching.note()
        collisions = self._run.simulator.collisions
        for collision in collisions[self._collisions :]:
            self._watching.tell(f"{collision.time_s:.0f} s: {collision.told(self._run.scenario.start)}")
        self._collisions = len(collisions)
        for news in status.news:
            self._watching.tell(f"{status.time_s:.0f} s: {news.text}")
        decision = status.decision
        if decision is None or (status.steps, decision.reason) == self._told_of:
            return
        self._told_of = (status.steps, decision.reason)
        if decision.part is not Part.EXPLORE:  # following the path is not an event: the panel always shows it
            self._watching.tell(f"{status.time_s:.0f} s: {decision.reason}")

    def finish(self) -> None:
        """Draw the last moment."""
        status = self._run.take_status()
        self._take_in(status)
        self._viewer.show(self._view(status, stopwatch_s()))

    def _view(self, status: Status, now_s: float) -> View:
        watching = self._watching
        sections = (watching.vehicle_section(now_s), mission_section(status, self._run), watching.links_section())
        return View(watching.title, self._scene(), sections, tuple(watching.events))

    def _scene(self) -> Scene:
        """The true world, dimmed, overlaid with the companion's map and targets."""
        scene, simulator, companion = self._watching.scene(), self._run.simulator, self._run.companion
        evidence, progress = companion.evidence, companion.progress
        layers = world_layers(simulator.world, simulator.time_s, Kind.HIDDEN)
        places = [place for place in scene.places if place.state is PlaceState.START]
        if evidence is not None and progress is not None and companion.origin is not None:
            # After a reboot the autopilot's origin is where it rebooted, and so is the companion's.
            north_m, east_m = self._run.scenario.start.place_of(companion.origin)
            layers += seen_layers(evidence, north_m, east_m)
            for target, state in zip(progress.targets, progress.statuses, strict=True):
                there = (target.point.north_m + north_m, target.point.east_m + east_m)
                places.append(Place(target.name, *there, STATES[state]))
        return replace(scene, layers=layers, places=tuple(places))


def seen_layers(evidence: EvidenceMap, north_m: float, east_m: float) -> tuple[Layer, ...]:
    """Layers of the companion's map; the origin of its frame is at this place in the world."""
    base = evidence.base
    corner = (base.resolution_m, base.south_west.north_m + north_m, base.south_west.east_m + east_m)
    closed = base.weights >= OBSTACLE
    occupied = evidence.log_odds >= evidence.settings.occupied_at
    fine = (evidence.evidence_m, *corner[1:])
    layers = [Layer(Kind.SEEN, known_fields(evidence), *corner), Layer(Kind.CLOSED, closed, *corner)]
    return (*layers, Layer(Kind.WALL, occupied, *fine))


def mission_section(status: Status, run: Drive) -> Section:
    """State, target and last decision of the companion."""
    companion = run.companion
    decision = status.decision
    goal = companion.progress.goal if companion.progress else None
    left = ""
    if goal is not None and status.pose is not None and status.target:
        left = f", {status.pose.point.distance_m(goal.point):.0f} m"
    part = f"{decision.part.value}, {PARTS[decision.part]}" if decision else "-"
    searches = len(companion.driver.searcher.seconds) if companion.driver else 0
    facts = (
        Fact("doing", status.doing),
        Fact("target", f"{status.target or '-'}{left}"),
        Fact("reached", f"{status.targets_reached} of {status.targets}"),
        Fact("part", part),
        Fact("why", decision.reason if decision else "-"),
        Fact("steps", f"{status.steps}, {searches} searches"),
    )
    return Section("Mission", facts)
