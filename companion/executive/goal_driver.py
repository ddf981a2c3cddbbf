"""Goal driver: drives one leg, the way to one goal: navigator steps, the reference path from them, recovery when stuck.

Nouns: goal driver.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import partial

from companion.control.arc_controller import ArcController
from companion.control.collision_avoidance import CollisionAvoidance
from companion.control.controller import STANDSTILL, ControlCommand, Controller
from companion.control.local_view import LocalView
from companion.control.motion_controller import MotionController
from companion.control.motion_planners import motion_planner
from companion.control.point_controller import PointController
from companion.control.reference_path import ReferencePath, advanced, narrowest_ahead, reference_path, rejoined
from companion.control.stuck_recovery import StuckRecovery
from companion.core.footprint import Footprint
from companion.core.frames import NedPoint
from companion.core.grid import Cell
from companion.core.own_parts import OwnKind, blamed
from companion.core.rover_limits import RoverLimits
from companion.mapping.map_edits import forget_weak_evidence
from companion.mission.resolve import ResolvedTarget
from companion.navigation.field_step import (
    Action,
    Decision,
    DecisionReason,
    NavState,
    Part,
    SearchKind,
    Steps,
    abandon_path,
    follows_clear_path,
    initial_state,
    retrace,
    step,
    way_back_is_clear,
)
from companion.navigation.search_budget import PathSearcher, kinematics_of
from companion.navigation.step_runner import StepRunner
from companion.navigation.turning_cost import with_turning_cost
from companion.perception.moving_obstacles import Moving, motion_changed, planners_movers
from companion.planning import problem
from companion.planning.problem import PlanResult
from companion.settings import ControllerKind

DOUBT_REACH_M = 2.5
NARROW_WITHIN_M, NARROW_ASIDE_M = 2.0, 0.3
"""A stuck rover takes for the cause the narrowest place so near ahead, if there is less room than this aside."""


@dataclass
class Tally:
    """Counts for the summary."""

    steps: int = 0
    return_steps: int = 0
    stuck: int = 0


def controller_for(rover: RoverLimits, footprint: Footprint, kind: ControllerKind, seed: int) -> Controller:
    """What leads the rover along paths. ``seed``: of a motion planner's random choices."""
    if kind != "points":
        return MotionController(footprint, motion_planner(kind, seed))
    return ArcController() if rover.turning_radius_m > 0.0 else PointController()


class GoalDriver:
    """Drives one leg after the other, on one map. What it needs to know of a moment comes as a ``LocalView``."""

    def __init__(
        self, controller: Controller, searcher: PathSearcher, runner: StepRunner, seed: int | None = None
    ) -> None:
        """``seed``: of the navigator's own choices; None: drawn from the searcher's generator."""
        self.searcher = searcher
        self.tally = Tally()
        self.path: ReferencePath | None = None
        self.decision: Decision | None = None
        self._controller = controller
        self._runner = runner
        self._goal: ResolvedTarget | None = None
        self._state: NavState | None = None
        self._recovery = StuckRecovery()
        self._doubts_left = 0
        self.seed = int(searcher.rng.integers(2**63)) if seed is None else seed
        self._epoch = 0
        self._sure_from_s = -math.inf
        self._began_s = 0.0
        self.step_s = 0.0
        """How long the last step took: from the tick in which it began to the tick that took its answer."""
        self._pending = 0  # the epoch of the step under way: a step begun before a new leg or a recovery is void
        self._planned_among: tuple[Moving, ...] = ()
        self._replanned_s = -math.inf
        self._among_movers = False
        """Whether the step under way is planned among things that move."""
        self._shut_in = False
        """Whether things that move left no path: the next step is planned without them."""
        self._avoidance = CollisionAvoidance()
        self.makes_way = False
        """Whether something else than the path leads in this tick, because of what moves."""

    def head_for(
        self, goal: ResolvedTarget, view: LocalView, way: tuple[Cell, ...] = (), driven: Steps = frozenset()
    ) -> None:
        """Begin a leg from here.

        ``way``: the fields to follow, if they have been driven before; ``driven``: steps of it that the map bars.
        """
        navigator = view.settings.navigator
        self._goal = goal
        self._epoch += 1
        cell = view.evidence.base.cell_at(view.pose.point)
        seed = (self.seed + self._epoch) % 2**63
        self._state = initial_state(cell, goal.cell, seed, navigator.better_every_fields)
        if way:
            self._state = retrace(self._state, way, driven)
        self.path = None
        self.decision = None
        self._doubts_left = navigator.doubts
        self._recovery.begin(view.pose)

    def take_up(self, goal: ResolvedTarget, state: NavState, doubts_left: int, view: LocalView) -> None:
        """Go on with a leg that an earlier run had begun: its way back is remembered, its path is planned anew."""
        self.head_for(goal, view)
        better_every = view.settings.navigator.better_every_fields
        self._state = replace(state, target=goal.cell, better_every=better_every)
        self._doubts_left = min(doubts_left, self._doubts_left)

    def go_on(self, tally: Tally, epoch: int) -> None:
        """Count on from where an earlier run had come to."""
        self.tally, self._epoch = tally, epoch

    def forget_places(self) -> None:
        """The fields before which the rover was stuck lie elsewhere now."""
        self._recovery = StuckRecovery()

    @property
    def controller(self) -> Controller:
        """What leads the rover along the path."""
        return self._controller

    @property
    def nav_state(self) -> NavState | None:
        """The navigator's state on this leg; None between legs."""
        return self._state

    @property
    def doubts_left(self) -> int:
        """How often the map may still be doubted on this leg."""
        return self._doubts_left

    @property
    def epoch(self) -> int:
        """How many legs and recoveries have begun so far."""
        return self._epoch

    @property
    def planning(self) -> bool:
        """Whether a step is under way, so that the generator of random numbers is between two states."""
        return self._runner.busy

    @property
    def goal(self) -> ResolvedTarget | None:
        """Where this leg leads."""
        return self._goal

    def give_up_no_target_before(self, time_s: float) -> None:
        """The position jumped, and what is seen until then may lie elsewhere."""
        self._sure_from_s = time_s

    def leave(self) -> None:
        """The leg is over (or must begin again from where the rover is now)."""
        self._controller.reset()
        self._goal = None
        self._state = None
        self.path = None

    def standing(self, view: LocalView, moving: tuple[Moving, ...]) -> ControlCommand:
        """What to do where there is nothing to do: stand, and make way."""
        return self._avoided(STANDSTILL, view, moving)[0]

    def pause(self) -> None:
        """The rover stands still for a good reason: do not count it as stuck."""
        self._recovery.pause()

    @property
    def stuck_here(self) -> int:
        """How often the rover was stuck where it was stuck last."""
        return self._recovery.times_here

    def decide(self, view: LocalView, moving: tuple[Moving, ...] = ()) -> Decision | None:
        """The navigator's decision if there is a new one in this tick. ``moving``: what moves."""
        if self._goal is None or self._state is None or self._recovery.is_backing(view.pose.time_s):
            return None
        decision = self._field_step(view, moving)
        if self._has_arrived(view):
            decision = self.decision = Decision(Action.REACHED, Part.EXPLORE, (), None, DecisionReason.REACHED)
        return decision

    def guide(self, view: LocalView, moving: tuple[Moving, ...] = ()) -> ControlCommand:
        """The command for this tick: along the path, and out of the way of what moves."""
        self.makes_way, command = False, self._follow(view)
        moving = self._avoidance.with_what_it_turned_off_for(moving, view.pose.time_s)
        if not moving or (self.decision is not None and self.decision.action is Action.REACHED):
            return command
        command, yields = self._avoided(command, view, moving)
        # A rover that makes way is not stuck; one that does so for very long is.
        if self._avoidance.is_patient(view.pose.time_s, view.settings.traffic.patience_s, yields=yields):
            self.pause()
        return command

    def _avoided(
        self, command: ControlCommand, view: LocalView, moving: tuple[Moving, ...]
    ) -> tuple[ControlCommand, bool]:
        """What to do because of what moves, and whether that is something else than the command."""
        controller = self._controller
        line, path = controller.line_ahead(self.path), self.path
        foresees = None if path is None else partial(controller.foreseen, path, view)
        option = self._avoidance.avoid(
            command, line, view, moving, backwards=controller.backwards,
            foresees=foresees, turned_stops=partial(controller.turned_stops, view),
        )  # fmt: skip
        self.makes_way = option.yields
        return option.command, option.yields

    def _follow(self, view: LocalView) -> ControlCommand:
        """The command if nothing comes across: back out, follow the path, or stand where there is none."""
        if self._goal is None:
            return STANDSTILL
        if (backing := self._recovery.backing(view)) is not None:
            return backing
        if self.path is None:
            return STANDSTILL
        on_path = advanced(self.path, view.pose)
        self.path = rejoined(on_path, view.pose.point, view.evidence, view.rover.radius_m)
        with blamed(OwnKind.CONTROLLER, view.settings.guidance.controller):
            command = self._controller.follow(self.path, self._at_planned_speed(self.path, view))
        if self._recovery.is_stuck(view, command):
            self._get_unstuck(view)
        return command

    def _at_planned_speed(self, path: ReferencePath, view: LocalView) -> LocalView:
        """The same moment, with the speed that is planned here as cruise speed."""
        guidance, wanted_m_s = view.settings.guidance, self._fastest_m_s(view)
        planned_m_s = min(max(path.planned_m_s, guidance.min_speed_m_s), guidance.max_speed_m_s)
        return view.with_speeds(min(wanted_m_s, planned_m_s), max(view.rover.cruise_speed_m_s, wanted_m_s))

    def _field_step(self, view: LocalView, moving: tuple[Moving, ...]) -> Decision | None:
        """Start the navigator's step when a new field is entered or the path ahead is blocked; take its result."""
        assert self._state is not None
        pose, evidence = view.pose, view.evidence
        cell = evidence.base.cell_at(pose.point)
        self._notice_changes(view, moving)
        if not self._runner.busy and evidence.base.contains(cell) and self._step_is_due(cell, view):
            self._start_step(self._state, cell, view, moving)
        result = self._runner.take()
        if result is None or self._pending != self._epoch:
            return None
        self.step_s = pose.time_s - self._began_s
        self._shut_in = self._among_movers and _gives_up(result[1])
        if self._shut_in or self._is_doubted(result[1], view):
            self._state = abandon_path(self._state)
            self.path = self.decision = None
            return None
        self._state, self.decision = result
        self._lay_path(self.decision, view)
        return self.decision

    def _start_step(self, state: NavState, cell: Cell, view: LocalView, moving: tuple[Moving, ...]) -> None:
        """Hand a step over to the runner, with all it needs to know as it is now."""
        pose, settings, rover = view.pose, view.settings, view.rover
        grid = with_turning_cost(view.evidence.grid, pose, settings.guidance, rover.turning_radius_m)
        weights, navigator = grid.weights, settings.navigator
        movers = () if self._shut_in else self._movers(view, moving)
        self._among_movers = bool(movers)
        kinematics = kinematics_of(pose, rover, self._fastest_m_s(view), settings, grid)

        def search(kind: SearchKind, start: Cell, target: Cell) -> PlanResult:
            return self.searcher.search(weights, kind, start, target, navigator, movers, kinematics)

        if cell != state.past[-1]:
            self.tally.steps += 1
            self.tally.return_steps += 1 if state.returning else 0
        self._pending = self._epoch
        self._began_s = pose.time_s
        self._runner.start(lambda: step(state, grid, cell, search))

    @property
    def _plans_among_movers(self) -> bool:
        return self.searcher.planner.capabilities.moving_obstacles

    def _movers(self, view: LocalView, moving: tuple[Moving, ...]) -> tuple[problem.ObstacleTrajectory, ...]:
        """What moves, for a planner that asks."""
        if not self._plans_among_movers:
            return ()
        radius_m, traffic = view.rover.radius_m, view.settings.traffic
        return planners_movers(moving, view.evidence.grid, radius_m, view.pose.time_s, traffic)

    def _fastest_m_s(self, view: LocalView) -> float:
        """The mission's own speed for this leg, or the rover's."""
        wanted_m_s = None if self._goal is None else self._goal.speed_m_s
        return view.rover.cruise_speed_m_s if wanted_m_s is None else wanted_m_s

    def _notice_changes(self, view: LocalView, moving: tuple[Moving, ...]) -> None:
        """Drop a plan made among moving obstacles if one of them has changed its motion."""
        state, traffic, now_s = self._state, view.settings.traffic, view.pose.time_s
        if state is None or not self._plans_among_movers or now_s - self._replanned_s < traffic.replan_s:
            return
        if not self._runner.busy and motion_changed(self._planned_among, moving, traffic):
            self._replanned_s, self._planned_among = now_s, moving
            self._state = abandon_path(state)

    def _is_doubted(self, decision: Decision, view: LocalView) -> bool:
        """Whether the map must be looked at again before the rover gives up, or goes back because there is no path.

        The proof that there is no path is only as good as the map and the position.
        """
        giving_up = _gives_up(decision)
        if not giving_up or view.pose.time_s < self._sure_from_s:
            return giving_up
        if self._doubts_left == 0 or not forget_weak_evidence(view.evidence, view.pose.point, DOUBT_REACH_M):
            return False
        self._doubts_left -= 1
        return True

    def _step_is_due(self, cell: Cell, view: LocalView) -> bool:
        assert self._state is not None
        if cell != self._state.past[-1] or self.decision is None:
            return True
        if self._state.returning:
            return not way_back_is_clear(self._state, view.evidence.grid, 3)
        return not follows_clear_path(self._state, view.evidence.grid)

    def _lay_path(self, decision: Decision, view: LocalView) -> None:
        """The reference path for a decision; a planned path that goes on keeps its own."""
        assert self._goal is not None
        if decision.action is Action.FOLLOW and decision.new_path is None and self.path is not None:
            return
        if decision.action not in (Action.FOLLOW, Action.BACKTRACK) or not decision.path:
            self.path = None
            return
        end = self._goal.point if decision.action is Action.FOLLOW else None
        half_width_m = view.rover.radius_m + view.settings.guidance.clearance_m
        start = view.pose.point
        self.path = reference_path(decision.new_path, decision.path, view.evidence, start, end, half_width_m)

    def _has_arrived(self, view: LocalView) -> bool:
        assert self._goal is not None
        distance_m = view.pose.point.distance_m(self._goal.point)
        near_m = view.settings.guidance.arrival_m
        return distance_m <= near_m or (distance_m <= 2.0 * near_m and view.speed_m_s < 0.1)

    def _get_unstuck(self, view: LocalView) -> None:
        """Back out if there is room, away from a place that is remembered as costly, and plan anew."""
        assert self._state is not None
        self.tally.stuck += 1
        self._recovery.back_out(view, self._place_ahead(view))
        self._epoch += 1
        self._controller.reset()
        self._state = abandon_path(self._state)
        self.path = None
        self.decision = None

    def _place_ahead(self, view: LocalView) -> NedPoint:
        """The narrowest place soon to come on the path; a field's side ahead where none is narrow."""
        pose, side_m = view.pose, view.evidence.base.resolution_m
        if self.path is None:
            return pose.point.moved(pose.heading_rad, side_m)
        narrow_m = view.rover.radius_m + NARROW_ASIDE_M
        room_m, place = narrowest_ahead(self.path, view.evidence, NARROW_WITHIN_M, narrow_m)
        if room_m < narrow_m:
            return place
        return pose.point.moved(pose.point.bearing_rad(self.path.point_ahead(side_m)), side_m)


def _gives_up(decision: Decision) -> bool:
    """Whether the target is given up, or the rover goes back, because there is no path."""
    return decision.action is Action.UNREACHABLE or (decision.part is Part.RETURN and decision.proved)
