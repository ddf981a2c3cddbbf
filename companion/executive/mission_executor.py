"""The mission under way: where it lies, what has been mapped, which target is next, and the driver that goes there."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from companion.control.braking import counted_s, for_link
from companion.control.controller import ControlCommand
from companion.control.local_view import LocalView
from companion.core.frames import GeoPoint, NedPoint, Pose
from companion.core.grid import Cell
from companion.core.rover_limits import RoverLimits
from companion.core.scan import RangeScan
from companion.executive.goal_driver import GoalDriver, controller_for
from companion.executive.mission_layout import MissionLayout, apart_m, fenced_again, lay_again
from companion.executive.mission_progress import (
    Leg,
    MissionProgress,
    TargetStatus,
    on_reached,
    on_time,
    on_unreachable,
    returning,
    with_errand,
)
from companion.executive.refuge import Refuge, refuges
from companion.executive.trail import Trail
from companion.mapping.evidence_map import EvidenceMap, forget, integrate, look_again
from companion.mission.fence import AutopilotFence
from companion.mission.mission import Mission
from companion.mission.resolve import ResolvedTarget
from companion.navigation.field_step import Action, Decision
from companion.navigation.search_budget import Searcher
from companion.navigation.step_runner import StepRunner
from companion.perception.moving_obstacles import Moving, merged
from companion.perception.object_tracker import ObjectTracker
from companion.planning.registry import make_planner
from companion.recording.recorder import DecisionLog
from companion.settings import Settings

INFO, WARNING = 6, 4
ORIGIN_MOVED_M = 0.2
"""The autopilot tells its origin in whole 1e-7 degrees (1 cm): more than this is another origin."""
VERDICT_S = 15.0
"""After a jump of the position no target is given up for so long: a receiver that errs is mostly right again by then."""

WATCHED_SCANS = 20
"""Before another try after waiting, obstacles that are not in the newest scans are forgotten: a door may have opened."""

Tell = Callable[[str, int], None]
"""Says a text with its severity to the people."""


class MissionExecutor:
    """Made when the rover may be driven for the first time. ``scan``: any of its sensor, which tells how far and wide it sees."""

    def __init__(
        self,
        mission: Mission,
        settings: Settings,
        layout: MissionLayout,
        scan: RangeScan,
        runner: StepRunner,
        log: DecisionLog,
        tell: Tell,
        rng: np.random.Generator,
    ) -> None:
        self.layout = layout
        self.progress: MissionProgress = layout.progress
        self.doing = "driving"
        self.maps_begun = 0
        """Grows whenever what had been mapped is worth nothing any more."""
        self._mission = mission
        self._given = self._settings = settings
        self._link_s = 0.0
        self._runner = runner
        self._log = log
        self._tell = tell
        self._scans = 0
        self.trail = Trail()
        """The way back to where the mission began."""
        self._refuges: list[Refuge] = []
        rover = mission.rover
        margin_m = settings.guidance.narrow_margin_m if scan.is_narrow else 0.0
        self._limits = RoverLimits(
            rover.radius_m + margin_m,
            rover.cruise_speed_m_s,
            scan.max_range_m,
            scan.is_narrow,
            rover.turning_radius_m,
        )
        if rover.turning_radius_m > 0.0 and scan.is_narrow:
            tell("Single beams see too little for a rover that turns in arcs: give it a lidar", WARNING)
        planner = make_planner(settings.navigator.planner, settings.planner)
        searcher = Searcher(planner, settings.navigator, rng)
        self.driver = GoalDriver(controller_for(self._limits), searcher, runner)
        self._tracker = ObjectTracker(layout.evidence)

    @property
    def evidence(self) -> EvidenceMap:
        """The map."""
        return self.layout.evidence

    def view(self, pose: Pose, speed_m_s: float) -> LocalView:
        """This moment, with the settings that the link's latency allows."""
        return LocalView(pose, speed_m_s, self.evidence, self._limits, self._settings)

    @property
    def reached(self) -> int:
        """How many targets have been reached."""
        return sum(status is TargetStatus.REACHED for status in self.progress.statuses)

    @property
    def returning(self) -> bool:
        """Whether the rover is on its way back for good."""
        return bool(self._refuges) or self.progress.ended

    @property
    def target_refused(self) -> str:
        """Why the target that is next must not be driven to; empty when it may, and while the rover is on an errand or on its way back."""
        on_errand = self.progress.errand is not None or self.progress.leg is not Leg.TRAVEL
        return "" if on_errand else self.layout.refused.get(self.progress.index, "")

    def statuses(self) -> list[tuple[str, TargetStatus]]:
        """Every target's name and what has become of it so far."""
        return [(t.name, status) for t, status in zip(self.progress.targets, self.progress.statuses, strict=True)]

    def retune(self, settings: Settings) -> None:
        """Other settings from the next tick on; those of the map itself and the planner stay."""
        self._given = settings
        self._settings = for_link(settings, self._link_s)
        self.driver.searcher.settings = self._settings.navigator

    def heed_latency(self, link_s: float) -> None:
        """Drive from now on so that a link that takes so long, there and back, does no harm."""
        if counted_s(link_s) != self._link_s:
            self._link_s = counted_s(link_s)
            self.retune(self._given)

    def map_scan(self, pose: Pose, yaw_rate_rad_s: float, scan: RangeScan) -> None:
        """Take a scan into the map, unless it is smeared by turning."""
        if abs(yaw_rate_rad_s) <= np.radians(self._settings.mapping.max_yaw_rate_deg_s):
            self._scans += 1
            self._tracker.take(pose, yaw_rate_rad_s, scan)
            integrate(self.evidence, pose, scan, self._scans)
            self._tracker.remember(pose, scan.max_range_m)

    def follow_origin(self, origin: GeoPoint, now_s: float) -> bool:
        """Whether the autopilot has moved the origin of its frame; the mission is then laid out anew, with an empty map."""
        moved_m = apart_m(origin, self.layout.origin)
        if moved_m <= ORIGIN_MOVED_M:
            return False
        self._tell(f"EKF origin moved {moved_m:.1f} m: mission laid out anew", WARNING)
        self.maps_begun += 1
        self.layout = lay_again(self.layout, self.progress, self._mission, self._settings.mapping, origin)
        self.progress = self.layout.progress
        before = self.driver
        # A step of the one before may be drawing from the generator in its thread at this moment: the seed stays.
        searcher, seed = before.searcher, before.seed
        self.driver = GoalDriver(controller_for(self._limits), searcher, self._runner, seed)
        self.driver.tally = before.tally
        self.driver.doubt_until(now_s + VERDICT_S)
        self._tracker = ObjectTracker(self.evidence)
        self.trail, self._refuges = Trail(), self._refuges[-1:]
        return True

    def run_errand(self, errand: ResolvedTarget) -> None:
        """Drive there first; then the mission goes on."""
        self.progress = with_errand(self.progress, errand)
        self.driver.leave()

    def heed_fence(self, fence: AutopilotFence) -> None:
        """The autopilot's fence as it is now; a new one closes and opens ground at once."""
        if fence is self.layout.fence or fence == self.layout.fence:
            return
        self.layout = fenced_again(self.layout, self.progress, self._mission, fence)
        self.driver.leave()
        self._tell(f"The autopilot's fence has changed: {len(self.layout.bounds)} borders now", WARNING)

    def outside(self, point: NedPoint) -> str:
        """In words, that the rover is beyond a border; empty when it is not."""
        name = self.layout.bounds.outside(point)
        return f"the rover is beyond the border of {name}" if name else ""

    def go_back(self, reason: str, rally: list[NedPoint], pose: Pose) -> None:
        """Give the mission up: to the nearest of the rally points, or back the way the rover came. ``reason`` is told."""
        planner = make_planner("dijkstra", self._settings.planner)
        self._refuges = refuges(self.progress.home, self.trail, rally, pose.point, self.evidence, planner)
        missed = [name for name, status in self.statuses() if status is not TargetStatus.REACHED]
        self._tell(f"Returning: {reason}. Missed: {', '.join(missed) or 'nothing'}", WARNING)
        self._seek_refuge()

    def _seek_refuge(self) -> None:
        """The next place to try."""
        refuge = self._refuges[0]
        self.progress = returning(self.progress, refuge.place)
        along = " along the way it came" if refuge.way else ""
        self._tell(f"Back to {refuge.place.name}, {refuge.length_m:.0f} m{along}", WARNING)

    def forget_map(self, now_s: float) -> None:
        """What has been seen lies elsewhere now."""
        forget(self.evidence)
        self.maps_begun += 1
        self._tracker = ObjectTracker(self.evidence)
        self.driver.leave()
        self.driver.doubt_until(now_s + VERDICT_S)

    def drive(self, view: LocalView, now_s: float, announced: tuple[Moving, ...] = ()) -> ControlCommand | None:
        """What to do for the mission now; None when it has ended. ``announced``: who has told of itself and may come near."""
        moving = merged(announced, self._tracker.moving(now_s, view.settings.traffic), now_s)
        self.trail.enter(self.evidence.base.cell_at(view.pose.point))
        waited = self.progress.leg is Leg.WAIT
        self.progress = on_time(self.progress, now_s)
        if waited and self.progress.leg is Leg.TRAVEL:
            look_again(self.evidence, self._scans - WATCHED_SCANS)
        if self.progress.ended:
            return None
        if self.progress.leg in (Leg.STAY, Leg.WAIT):
            self.doing = "holding" if self.progress.leg is Leg.STAY else "waiting for the way to clear"
            self.driver.pause()
            return self.driver.standing(view, moving)
        if self.driver.goal is not self.progress.goal:
            if self._is_refused(now_s):
                return self.driver.standing(view, moving)
            self._tell(f"Heading for {self.progress.goal.name}", INFO)
            self.driver.head_for(self.progress.goal, view, self._way_back(view.pose))
        self.doing = "driving"
        command, decision = self.driver.update(view, moving)
        if decision is not None:
            self._take_decision(decision, now_s)
        return command

    def _is_refused(self, now_s: float) -> bool:
        """Whether the target that is next lies behind the autopilot's fence: it is not even tried, and the mission goes on after it."""
        reason = self.target_refused
        if not reason:
            return False
        self._tell(f"Refused: {reason}", WARNING)
        navigator = self._settings.navigator
        self.progress = on_unreachable(self.progress, now_s, navigator.wait_retry_s, navigator.wait_limit_s)
        return True

    def _way_back(self, pose: Pose) -> tuple[Cell, ...]:
        """The fields to follow to a refuge, where they are known: as long as nothing has taken the rover off that way."""
        if not self._refuges or not self._refuges[0].way:
            return ()
        way, here = self.trail.back(), self.evidence.base.cell_at(pose.point)
        return way if way[0] == here and way[-1] == self._refuges[0].place.cell else ()

    def _take_decision(self, decision: Decision, now_s: float) -> None:
        goal = self.progress.goal
        self._log.write_decision(now_s, goal.name, decision)
        if decision.action is Action.REACHED:
            self._tell(f"Reached {goal.name}", INFO)
            self.progress = on_reached(self.progress, now_s)
        elif decision.action is Action.UNREACHABLE:
            self._tell(f"Unreachable: {goal.name} ({decision.reason})", WARNING)
            navigator = self._settings.navigator
            if len(self._refuges) > 1:
                self._refuges.pop(0)
                self._seek_refuge()
            else:
                # How long a leg of AUTO may take is the autopilot's to say (DO_GUIDED_LIMITS).
                limit_s = math.inf if self._mission.in_auto else navigator.wait_limit_s
                self.progress = on_unreachable(self.progress, now_s, navigator.wait_retry_s, limit_s)
        if decision.action in (Action.REACHED, Action.UNREACHABLE):
            self.driver.leave()
