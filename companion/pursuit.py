"""The mission under way: where it lies, what has been mapped, which target is next, and the driver that goes there."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from companion.driver import Driver
from companion.frames import GeoPoint, Pose
from companion.guidance import Guide
from companion.itinerary import Itinerary, Leg, TargetStatus, on_reached, on_time, on_unreachable, with_errand
from companion.laying import Laid, apart_m, lay_again
from companion.mapping import EvidenceMap, forget, integrate
from companion.mission.mission import Mission
from companion.mission.resolve import ResolvedTarget
from companion.navigator import Action, Decision
from companion.output_check import Surroundings
from companion.planning.registry import make_planner
from companion.reach import RoverLimits
from companion.recorder import DecisionLog
from companion.scan import RangeScan
from companion.searching import Searcher
from companion.settings import Settings
from companion.stepping import StepRunner
from companion.stopping import counted_s, for_link
from companion.tracking import Tracker
from companion.traffic import Moving, merged

INFO, WARNING = 6, 4
ORIGIN_MOVED_M = 0.2
"""The autopilot tells its origin in whole 1e-7 degrees (1 cm): more than this is another origin."""

Tell = Callable[[str, int], None]
"""Says a text with its severity to the people."""


class Pursuit:
    """Made when the rover may be driven for the first time. ``scan``: any of its sensor, which tells how far and wide it sees."""

    def __init__(
        self,
        mission: Mission,
        settings: Settings,
        laid: Laid,
        scan: RangeScan,
        runner: StepRunner,
        log: DecisionLog,
        tell: Tell,
        rng: np.random.Generator,
    ) -> None:
        self.laid = laid
        self.itinerary: Itinerary = laid.itinerary
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
        self.driver = Driver(laid.evidence, self._limits, settings, searcher, runner)
        self._tracker = Tracker(laid.evidence, settings.traffic)

    @property
    def evidence(self) -> EvidenceMap:
        """The map."""
        return self.laid.evidence

    @property
    def surroundings(self) -> Surroundings:
        """What is known of the ground, and the rover on it."""
        return Surroundings(self.evidence, self._limits, self._settings)

    @property
    def reached(self) -> int:
        """How many targets have been reached."""
        return sum(status is TargetStatus.REACHED for status in self.itinerary.statuses)

    def statuses(self) -> list[tuple[str, TargetStatus]]:
        """Every target's name and what has become of it so far."""
        return [(t.name, status) for t, status in zip(self.itinerary.targets, self.itinerary.statuses, strict=True)]

    def retune(self, settings: Settings) -> None:
        """Other settings from the next tick on; those of the map itself and the planner stay."""
        self._given = settings
        self._settings = for_link(settings, self._link_s)
        self._tracker.retune(settings.traffic)
        self.driver.retune(self._settings)

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

    def follow_origin(self, origin: GeoPoint) -> bool:
        """Whether the autopilot has moved the origin of its frame; the mission is then laid out anew, with an empty map."""
        moved_m = apart_m(origin, self.laid.origin)
        if moved_m <= ORIGIN_MOVED_M:
            return False
        self._tell(f"EKF origin moved {moved_m:.1f} m: mission laid out anew", WARNING)
        self.maps_begun += 1
        self.laid = lay_again(self.laid, self.itinerary, self._mission, self._settings.mapping, origin)
        self.itinerary = self.laid.itinerary
        before = self.driver
        self.driver = Driver(self.evidence, self._limits, self._settings, before.searcher, self._runner)
        self.driver.tally = before.tally
        self._tracker = Tracker(self.evidence, self._settings.traffic)
        return True

    def run_errand(self, errand: ResolvedTarget) -> None:
        """Drive there first; then the mission goes on."""
        self.itinerary = with_errand(self.itinerary, errand)
        self.driver.leave()

    def forget_map(self) -> None:
        """What has been seen lies elsewhere now."""
        forget(self.evidence)
        self.maps_begun += 1
        self._tracker = Tracker(self.evidence, self._settings.traffic)
        self.driver.leave()

    def drive(self, pose: Pose, speed_m_s: float, now_s: float, announced: tuple[Moving, ...] = ()) -> Guide | None:
        """What to do for the mission now; None when it has ended. ``announced``: who has told of itself and may come near."""
        moving = merged(announced, self._tracker.moving(now_s), now_s)
        self.itinerary = on_time(self.itinerary, now_s)
        if self.itinerary.ended:
            return None
        if self.itinerary.leg in (Leg.STAY, Leg.WAIT):
            self.doing = "holding" if self.itinerary.leg is Leg.STAY else "waiting for the way to clear"
            self.driver.pause()
            return self.driver.standing(pose, speed_m_s, moving)
        if self.driver.goal is not self.itinerary.goal:
            self._tell(f"Heading for {self.itinerary.goal.name}", INFO)
            self.driver.head_for(self.itinerary.goal, pose)
        self.doing = "driving"
        guide, decision = self.driver.update(pose, speed_m_s, moving)
        if decision is not None:
            self._take_decision(decision, now_s)
        return guide

    def _take_decision(self, decision: Decision, now_s: float) -> None:
        goal = self.itinerary.goal
        self._log.write_decision(now_s, goal.name, decision)
        if decision.action is Action.REACHED:
            self._tell(f"Reached {goal.name}", INFO)
            self.itinerary = on_reached(self.itinerary, now_s)
        elif decision.action is Action.UNREACHABLE:
            self._tell(f"Unreachable: {goal.name} ({decision.reason})", WARNING)
            navigator = self._settings.navigator
            self.itinerary = on_unreachable(self.itinerary, now_s, navigator.wait_retry_s, navigator.wait_limit_s)
        if decision.action in (Action.REACHED, Action.UNREACHABLE):
            self.driver.leave()
