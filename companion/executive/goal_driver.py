"""Drives one leg: field steps of the navigator, the route that follows from them, and what to do when the rover is stuck."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from companion.control.arc_controller import ArcController
from companion.control.collision_avoidance import CollisionAvoidance
from companion.control.point_controller import STANDSTILL, STOP, ControlCommand, Motion, guide
from companion.control.reference_path import Route, advanced, route_along
from companion.control.stuck_recovery import StuckRecovery
from companion.core.frames import NedPoint, Pose
from companion.core.grid import Cell
from companion.core.rover_limits import RoverLimits
from companion.mapping.evidence_map import EvidenceMap, doubt
from companion.mission.resolve import ResolvedTarget
from companion.navigation.field_step import (
    Action,
    Decision,
    NavState,
    Part,
    SearchKind,
    abandon_path,
    initial_state,
    is_clear,
    retrace,
    step,
)
from companion.navigation.search_budget import PathSearcher, motion_of
from companion.navigation.step_runner import StepRunner
from companion.navigation.turning_cost import with_turning_cost
from companion.perception.moving_obstacles import Moving, motion_changed, planners_movers
from companion.planning import problem
from companion.planning.problem import PlanResult
from companion.settings import Settings
from companion.vehicle.commands import GuidedHeading

DOUBT_REACH_M = 2.5
OVERSPEED = 1.15
"""A rover that surges so far beyond its speed, as one does that leaves soft ground, is braked: room was kept for the speed it was told."""


@dataclass
class Tally:
    """Counts for the summary."""

    steps: int = 0
    return_steps: int = 0
    stuck: int = 0


class GoalDriver:
    """One leg after the other, on one map."""

    def __init__(
        self,
        evidence: EvidenceMap,
        rover: RoverLimits,
        settings: Settings,
        searcher: PathSearcher,
        runner: StepRunner,
        seed: int | None = None,
    ) -> None:
        """``seed``: of the navigator's own choices; None: drawn from the searcher's generator."""
        self.evidence = evidence
        self.searcher = searcher
        self.tally = Tally()
        self.route: Route | None = None
        self.decision: Decision | None = None
        self._rover = rover
        self._settings = settings
        self._runner = runner
        self._goal: ResolvedTarget | None = None
        self._state: NavState | None = None
        self._recovery = StuckRecovery(evidence, rover.radius_m, settings.guidance)
        self._doubts_left = 0
        self.seed = int(searcher.rng.integers(2**63)) if seed is None else seed
        self._epoch = 0
        self._sure_from_s = -math.inf
        self._began_s = 0.0
        self.step_s = 0.0
        """From the round in which the last step began to the one that took its answer: a replay has the same rounds."""
        self._pending = 0  # the epoch of the step under way: a step begun before a new leg or a recovery is void
        self._helm = ArcController(evidence, settings) if rover.turning_radius_m > 0.0 else None
        self._looking_rad: float | None = None
        self._braking = False
        self._moving: tuple[Moving, ...] = ()
        self._planned_among: tuple[Moving, ...] = ()
        self._replanned_s = -math.inf
        self._way_giver = CollisionAvoidance(evidence, rover)

    def head_for(self, goal: ResolvedTarget, pose: Pose, way: tuple[Cell, ...] = ()) -> None:
        """Begin a leg from here, if there is one along a way that was driven before."""
        self._goal = goal
        self._epoch += 1
        cell = self.evidence.base.cell_at(pose.point)
        seed = (self.seed + self._epoch) % 2**63
        self._state = initial_state(cell, goal.cell, seed, self._settings.navigator.better_every_fields)
        if way:
            self._state = retrace(self._state, way)
        self.route = None
        self.decision = None
        self._doubts_left = self._settings.navigator.doubts
        self._recovery.begin(pose)

    def take_up(self, goal: ResolvedTarget, state: NavState, doubts_left: int, pose: Pose) -> None:
        """Go on with a leg that an earlier run had begun: its way back is remembered, its path is planned anew."""
        self.head_for(goal, pose)
        self._state = replace(state, target=goal.cell, better_every=self._settings.navigator.better_every_fields)
        self._doubts_left = min(doubts_left, self._doubts_left)

    def go_on(self, tally: Tally, epoch: int) -> None:
        """Count on from where an earlier run had come to."""
        self.tally, self._epoch = tally, epoch

    @property
    def leg(self) -> tuple[NavState | None, int, int]:
        """For those who keep it: the navigator's memory, how often the map may still be doubted, how many legs there have been."""
        return self._state, self._doubts_left, self._epoch

    @property
    def planning(self) -> bool:
        """Whether a step is under way, so that the generator of random numbers is between two states."""
        return self._runner.busy

    def retune(self, settings: Settings) -> None:
        """Other settings from the next tick on; the leg goes on."""
        self._settings = settings
        self.searcher.settings = settings.navigator
        self._recovery.retune(settings.guidance)
        if self._helm is not None:
            self._helm.retune(settings)

    @property
    def goal(self) -> ResolvedTarget | None:
        """Where this leg leads."""
        return self._goal

    def doubt_until(self, time_s: float) -> None:
        """No target is given up before then: the position jumped, and what is seen now may lie elsewhere."""
        self._sure_from_s = time_s

    def leave(self) -> None:
        """The leg is over (or must begin again from where the rover is now)."""
        self._drop_manoeuvre()
        self._goal = None
        self._state = None
        self.route = None

    def standing(self, pose: Pose, speed_m_s: float, moving: tuple[Moving, ...]) -> ControlCommand:
        """What to do where there is nothing to do: stand, and make way."""
        return self._make_way(STANDSTILL, pose, speed_m_s, moving)

    def pause(self) -> None:
        """The rover stands still for a good reason: do not count it as stuck."""
        self._recovery.pause()

    def update(
        self, pose: Pose, speed_m_s: float, moving: tuple[Moving, ...] = ()
    ) -> tuple[ControlCommand, Decision | None]:
        """One tick: the setpoint for now, and the navigator's decision if it has just made one. ``moving``: what moves about."""
        guide, decision = self._drive(pose, speed_m_s, moving)
        if self._goal is None or not moving or (decision is not None and decision.action is Action.REACHED):
            return guide, decision
        way = self._make_way(guide, pose, speed_m_s, moving)
        # Who makes way is not stuck; who does so for very long is.
        if self._way_giver.is_patient(pose.time_s, self._settings.traffic.patience_s, yields=way is not guide):
            self.pause()
        return way, decision

    def _make_way(
        self, guide: ControlCommand, pose: Pose, speed_m_s: float, moving: tuple[Moving, ...]
    ) -> ControlCommand:
        manoeuvre = self._helm.manoeuvre if self._helm else None
        route = self.route if manoeuvre is None else manoeuvre.as_route()
        backwards = self._helm is not None and self._helm.backwards
        return self._way_giver.give(guide, route, pose, speed_m_s, moving, self._settings, backwards=backwards)

    def _drive(
        self, pose: Pose, speed_m_s: float, moving: tuple[Moving, ...]
    ) -> tuple[ControlCommand, Decision | None]:
        """The same as if nothing came across."""
        self._moving = moving
        if self._goal is None or self._state is None:
            return STANDSTILL, None
        backing = self._recovery.backing(pose)
        if backing is not None:
            return backing, None
        decision = self._field_step(pose)
        if self._arrived(pose, speed_m_s):
            self.decision = Decision(Action.REACHED, Part.EXPLORE, (), None, "target reached")
            return STANDSTILL, self.decision
        if decision is not None and decision.action is Action.UNREACHABLE:
            return STANDSTILL, decision
        if self.route is None:
            return STANDSTILL, decision
        self.route = advanced(self.route, pose)
        guidance = self._settings.guidance
        planned_m_s = min(max(self.route.planned_m_s, guidance.min_speed_m_s), guidance.max_speed_m_s)
        rover = replace(self._rover, cruise_speed_m_s=min(self._fastest_m_s, planned_m_s))
        now = self._guided(self.route, pose, speed_m_s, rover)
        if self._recovery.is_stuck(pose, now):
            self._get_unstuck(pose)
        return now, decision

    def _guided(self, route: Route, pose: Pose, speed_m_s: float, rover: RoverLimits) -> ControlCommand:
        """The setpoint that leads along the route, for a rover that turns on the spot or for one that cannot."""
        if self._helm is not None:
            return self._helm.guide(route, pose, speed_m_s, rover)
        told_m_s = self._goal.speed_m_s if self._goal is not None else None
        if speed_m_s > OVERSPEED * max(self._rover.cruise_speed_m_s, told_m_s or 0.0):
            return ControlCommand(Motion.BRAKE, STOP, 0.0)
        settings, looking, braking = self._settings.guidance, self._looking_rad, self._braking
        now = guide(route, pose, speed_m_s, self.evidence, rover, settings, looking_rad=looking, braking=braking)
        self._braking = now.motion is Motion.BRAKE
        self._looking_rad = now.setpoint.heading_rad if isinstance(now.setpoint, GuidedHeading) else None
        return now

    def _field_step(self, pose: Pose) -> Decision | None:
        """Start the navigator's step when a new field is entered or the path ahead is blocked; take its result."""
        assert self._state is not None
        cell = self.evidence.base.cell_at(pose.point)
        self._notice_changes(pose)
        if not self._runner.busy and self.evidence.base.contains(cell) and self._step_is_due(cell):
            state = self._state
            grid = with_turning_cost(self.evidence.grid, pose, self._settings.guidance, self._rover.turning_radius_m)
            weights = grid.weights
            navigator = self.searcher.settings
            movers, motion = self._movers(pose), self._motion(pose)

            def search(kind: SearchKind, start: Cell, target: Cell) -> PlanResult:
                return self.searcher.search(weights, kind, start, target, movers, motion, navigator)

            if cell != state.past[-1]:
                self.tally.steps += 1
                self.tally.return_steps += 1 if state.returning else 0
            self._pending = self._epoch
            self._began_s = pose.time_s
            self._runner.start(lambda: step(state, grid, cell, search))
        result = self._runner.take()
        if result is not None:
            self.step_s = pose.time_s - self._began_s
        if result is None or self._pending != self._epoch:
            return None
        if self._is_doubted(result[1], pose):
            self._state = abandon_path(self._state)
            self.route = self.decision = None
            return None
        self._state, self.decision = result
        self._lay_route(self.decision, pose)
        return self.decision

    @property
    def _plans_among_movers(self) -> bool:
        return self.searcher.planner.capabilities.moving_obstacles

    def _movers(self, pose: Pose) -> tuple[problem.ObstacleTrajectory, ...]:
        """What moves, for a planner that asks."""
        if not self._plans_among_movers:
            return ()
        radius_m, traffic = self._rover.radius_m, self._settings.traffic
        return planners_movers(self._moving, self.evidence.grid, radius_m, pose.time_s, traffic)

    def _motion(self, pose: Pose) -> problem.VehicleMotion:
        """How the rover can move, for the planner."""
        return motion_of(pose, self._rover, self._fastest_m_s, self._settings, self.evidence.base.resolution_m)

    @property
    def _fastest_m_s(self) -> float:
        """The mission's own speed for this leg, or the rover's."""
        wanted_m_s = None if self._goal is None else self._goal.speed_m_s
        return self._rover.cruise_speed_m_s if wanted_m_s is None else wanted_m_s

    def _notice_changes(self, pose: Pose) -> None:
        """A plan made among moving things is dropped when one of them moves otherwise than it did."""
        state, traffic = self._state, self._settings.traffic
        if state is None or not self._plans_among_movers or pose.time_s - self._replanned_s < traffic.replan_s:
            return
        if not self._runner.busy and motion_changed(self._planned_among, self._moving, traffic):
            self._replanned_s, self._planned_among = pose.time_s, self._moving
            self._state = abandon_path(state)

    def _is_doubted(self, decision: Decision, pose: Pose) -> bool:
        """Before the first step back, or giving up, on a proof: that is only as good as the map, which is looked at again, and as the
        position."""
        giving_up = decision.action is Action.UNREACHABLE or (decision.part is Part.RETURN and decision.proved)
        if not giving_up or pose.time_s < self._sure_from_s:
            return giving_up
        if self._doubts_left == 0 or not doubt(self.evidence, pose.point, DOUBT_REACH_M):
            return False
        self._doubts_left -= 1
        return True

    def _step_is_due(self, cell: Cell) -> bool:
        assert self._state is not None
        if cell != self._state.past[-1] or self.decision is None:
            return True
        if self._state.returning:
            return not is_clear(self.evidence.grid, self._state.past[:-4:-1])
        current = self._state.current
        return current is None or not is_clear(self.evidence.grid, current.cell_array[self._state.index :])

    def _lay_route(self, decision: Decision, pose: Pose) -> None:
        """The route for a decision; a path that goes on keeps its route."""
        assert self._goal is not None
        if decision.action is Action.FOLLOW and decision.new_path is None and self.route is not None:
            return
        if decision.action not in (Action.FOLLOW, Action.BACKTRACK) or not decision.path:
            self.route = None
            return
        end = self._goal.point if decision.action is Action.FOLLOW else None
        half_width_m = self._rover.radius_m + self._settings.guidance.clearance_m
        self.route = route_along(decision.new_path, decision.path, self.evidence, pose.point, end, half_width_m)

    def _arrived(self, pose: Pose, speed_m_s: float) -> bool:
        assert self._goal is not None
        distance_m = pose.point.distance_m(self._goal.point)
        near_m = self._settings.guidance.arrival_m
        return distance_m <= near_m or (distance_m <= 2.0 * near_m and speed_m_s < 0.1)

    def _get_unstuck(self, pose: Pose) -> None:
        """Back out if there is room, away from a place that is remembered as costly, and plan anew."""
        assert self._state is not None
        self.tally.stuck += 1
        self._recovery.back_out(pose, self._place_ahead(pose))
        self._epoch += 1
        self._drop_manoeuvre()
        self._state = abandon_path(self._state)
        self.route = None
        self.decision = None

    def _drop_manoeuvre(self) -> None:
        if self._helm is not None:
            self._helm.reset()

    def _place_ahead(self, pose: Pose) -> NedPoint:
        if self.route is None:
            return pose.point.moved(pose.heading_rad, self.evidence.base.resolution_m)
        point = self.route.point_ahead(self.evidence.base.resolution_m)
        return pose.point.moved(pose.point.bearing_rad(point), self.evidence.base.resolution_m)
