"""The driver beside a navigator that takes its time, and a rover that does not move."""

from dataclasses import replace
from threading import Event

import numpy as np
import pytest

from companion.control.controller import ControlCommand, Purpose
from companion.control.local_view import LocalView
from companion.control.motion_prediction import Points, braked_m, moved_on_arc
from companion.control.point_controller import PointController
from companion.core.frames import NedPoint, Pose
from companion.core.grid import empty_grid
from companion.core.rover_limits import RoverLimits
from companion.core.scan import RangeScan
from companion.executive.goal_driver import GoalDriver
from companion.mapping.evidence_map import EvidenceMap, integrate, new_map
from companion.mission.mission import OnBlocked
from companion.mission.resolve import ResolvedTarget
from companion.navigation.field_step import Action, Decision, NavState
from companion.navigation.search_budget import PathSearcher
from companion.navigation.step_runner import InlineRunner, StepCall, StepRunner, ThreadRunner
from companion.perception.moving_obstacles import Moving
from companion.planning.planner import Capabilities
from companion.planning.problem import Budget, PlanningProblem, PlanResult, PlanStatus
from companion.planning.registry import make_planner
from companion.settings import Settings
from companion.settings.settings_file import parse_settings
from companion.vehicle.commands import GuidedPosition, GuidedVelocity

SETTINGS = Settings()


class LateRunner:
    """Hands a result over only when told to."""

    def __init__(self) -> None:
        self.call: StepCall | None = None
        self.ready = False

    @property
    def busy(self) -> bool:
        return self.call is not None

    @property
    def working(self) -> bool:
        return self.call is not None and not self.ready

    def start(self, call: StepCall) -> None:
        self.call = call

    def take(self) -> tuple[NavState, Decision] | None:
        if not self.ready or self.call is None:
            return None
        call, self.call, self.ready = self.call, None, False
        return call()

    def close(self) -> None:
        """Nothing to end."""


def target(north_m: float, east_m: float) -> ResolvedTarget:
    point = NedPoint(north_m, east_m)
    return ResolvedTarget("t", point, empty_grid(40, 40).cell_at(point), 0.0, OnBlocked.SKIP, None)


def seen_map(pose: Pose) -> EvidenceMap:
    evidence = new_map(empty_grid(40, 40), 0.35, SETTINGS.mapping)
    bearings = np.radians(np.arange(0.0, 360.0, 5.0))
    scan = RangeScan(0.0, bearings, np.full(72, np.inf), 0.2, 8.0, np.radians(5.0), "test")
    integrate(evidence, pose, scan, 1)
    return evidence


class Drive:
    """A goal driver on one map that the rover stands on."""

    def __init__(self, runner: StepRunner, controller: PointController | None = None) -> None:
        planner = make_planner("hybrid", SETTINGS.planner)
        searcher = PathSearcher(planner, np.random.default_rng(1))
        self.driver = GoalDriver(controller or PointController(), searcher, runner)
        self.evidence = seen_map(Pose(20.5, 20.5, 0.0, 0.0))

    def at(self, time_s: float, speed_m_s: float = 0.0) -> LocalView:
        pose = Pose(20.5, 20.5, 0.0, time_s)
        return LocalView(pose, speed_m_s, self.evidence, RoverLimits(0.35, 2.0, 8.0), SETTINGS)

    def head_for(self, goal: ResolvedTarget, time_s: float = 0.0) -> None:
        self.driver.head_for(goal, self.at(time_s))

    def update(self, time_s: float, speed_m_s: float = 0.0) -> tuple[ControlCommand, Decision | None]:
        view = self.at(time_s, speed_m_s)
        decision = self.driver.decide(view)
        return self.driver.guide(view), decision


def test_the_rover_stands_until_the_first_decision() -> None:
    runner = LateRunner()
    drive = Drive(runner)
    drive.head_for(target(30.5, 20.5))
    assert drive.update(0.05)[0].setpoint == GuidedVelocity(0.0, 0.0)
    runner.ready = True
    command, decision = drive.update(0.1)
    assert decision is not None
    assert isinstance(command.setpoint, GuidedPosition)
    assert command.setpoint.point.north_m > 22.0


def test_a_step_begun_for_the_last_leg_does_not_steer_the_next_one() -> None:
    runner = LateRunner()
    drive = Drive(runner)
    drive.head_for(target(30.5, 20.5))
    drive.update(0.05)
    assert runner.busy
    drive.driver.leave()
    drive.head_for(target(10.5, 20.5), 0.1)
    runner.ready = True
    assert drive.update(0.15)[1] is None
    assert drive.driver.step_s == 0.0, "it is not counted either"
    drive.update(0.2)
    runner.ready = True
    _, decision = drive.update(0.25)
    assert decision is not None
    assert decision.path[-1].y == 10


def test_a_rover_that_does_not_get_on_backs_out_and_plans_anew() -> None:
    drive = Drive(InlineRunner())
    drive.head_for(target(30.5, 20.5))
    setpoints = [drive.update(0.05 * tick)[0].setpoint for tick in range(300)]
    backwards = [s for s in setpoints if isinstance(s, GuidedVelocity) and s.forward_m_s < 0.0]
    assert backwards
    assert drive.driver.tally.stuck >= 1
    assert isinstance(setpoints[20], GuidedPosition)
    assert drive.evidence.penalty.max() > 0.0


def test_where_it_was_stuck_is_forgotten_with_the_map() -> None:
    """The third time at one place makes an obstacle of it; not if the map was forgotten between."""
    penalties = []
    for forgets in (False, True):
        drive = Drive(InlineRunner())
        for attempt in range(3):
            drive.head_for(target(30.5, 20.5), 100.0 * attempt)
            ticks = 0
            while drive.driver.tally.stuck == attempt and ticks < 400:
                drive.update(100.0 * attempt + 0.05 * ticks)
                ticks += 1
            penalties.append(float(drive.evidence.penalty.max()))
            drive.driver.leave()
            drive.evidence = seen_map(Pose(20.5, 20.5, 0.0, 0.0))
            if forgets:
                drive.driver.forget_places()
    assert penalties[2] > penalties[0] and set(penalties[3:]) == {penalties[0]}


def test_the_thread_gives_the_same_decision() -> None:
    inline = Drive(InlineRunner())
    inline.head_for(target(30.5, 20.5))
    _, wanted = inline.update(0.05)
    runner = ThreadRunner()
    try:
        threaded = Drive(runner)
        threaded.head_for(target(30.5, 20.5))
        decision = None
        for _ in range(3000):
            decision = threaded.update(0.05)[1]
            if decision is not None:
                break
            Event().wait(0.01)
        assert decision is not None
        assert wanted is not None
        assert decision.path == wanted.path
    finally:
        runner.close()


def test_a_rover_faster_than_it_may_be_is_braked() -> None:
    one = Drive(InlineRunner())
    one.head_for(target(32.5, 20.5))
    assert one.update(0.0, 0.0)[0].purpose is Purpose.DRIVE
    assert one.update(0.1, 2.2)[0].purpose is Purpose.DRIVE
    surging, _ = one.update(0.2, 2.4)
    assert (surging.purpose, surging.setpoint) == (Purpose.BRAKE, GuidedVelocity(0.0, 0.0))
    assert one.update(0.3, 2.2)[0].purpose is Purpose.DRIVE


def test_what_comes_into_view_later_is_made_way_for_anew(monkeypatch: pytest.MonkeyPatch) -> None:
    """The patience for the first one does not last until then."""
    one, paused = Drive(InlineRunner()), []
    settings = parse_settings({"traffic": {"patience_s": 5.0}}, "test")
    one.head_for(target(32.5, 20.5))
    one.update(0.0, 1.5)
    pause = one.driver.pause

    def counted() -> None:
        paused.append(1)
        pause()

    monkeypatch.setattr(one.driver, "pause", counted)
    for begins_s in (0.1, 6.0):
        comes = Moving("seen", begins_s, NedPoint(23.4, 22.6), 0.0, -0.9, 0.5)
        told = one.driver.guide(replace(one.at(begins_s, 1.5), settings=settings), (comes,))
        assert (told.purpose, one.driver.makes_way) == (Purpose.BRAKE, True)
        one.driver.guide(one.at(begins_s + 0.1, 1.5))
    assert len(paused) == 2


class TurnsOff(PointController):
    """May turn to the right while it stops."""

    def turned_stops(self, view: LocalView, times_s: Points) -> tuple[tuple[ControlCommand, Points], ...]:
        rolls_m = braked_m(view.speed_m_s, times_s, view.settings.guidance)
        command = ControlCommand(Purpose.BRAKE, GuidedVelocity(0.0, 1.5), 0.0)
        return ((command, moved_on_arc(view.pose, 0.0, 0.75, rolls_m)),)


def test_it_makes_way_on_for_what_it_turned_off_for_when_that_is_out_of_view() -> None:
    walker = Moving("seen 1", 0.1, NedPoint(23.4, 22.6), 0.0, -0.9, 0.5)
    one = Drive(InlineRunner(), TurnsOff())
    one.head_for(target(32.5, 20.5))
    assert one.update(0.0, 1.9)[0].purpose is Purpose.DRIVE
    told = one.driver.guide(one.at(0.1, 1.9), (walker,))
    assert (told.purpose, told.setpoint) == (Purpose.BRAKE, GuidedVelocity(0.0, 1.5))
    one.driver.guide(one.at(0.2, 1.7), (walker,))
    one.driver.guide(one.at(0.3, 1.5))
    assert one.driver.makes_way
    assert one.driver.guide(one.at(6.0, 1.5)).purpose is Purpose.DRIVE
    assert not one.driver.makes_way


class ShutIn:
    """Plans among what moves, and finds nothing as long as there is anything; else as A*."""

    name = "shut in"
    capabilities = Capabilities(proves_no_path=True, moving_obstacles=True)

    def __init__(self, *, walled: bool) -> None:
        self._alone, self._walled = make_planner("astar", SETTINGS.planner), walled

    def plan(self, problem: PlanningProblem, budget: Budget, rng: np.random.Generator) -> PlanResult:
        if self._walled or problem.moving_obstacles:
            return PlanResult(PlanStatus.NO_PATH, None, self.name)
        return self._alone.plan(problem, budget, rng)


@pytest.mark.parametrize("walled", [False, True])
def test_what_moves_makes_no_target_unreachable(walled: bool) -> None:
    one, walker = Drive(InlineRunner()), Moving("m", 0.0, NedPoint(23.0, 20.5), 0.0, 0.3, 0.5)
    searcher = PathSearcher(ShutIn(walled=walled), np.random.default_rng(1))
    one.driver = GoalDriver(PointController(), searcher, InlineRunner())
    one.head_for(target(30.5, 20.5))
    found = [one.driver.decide(one.at(0.05 * tick), (walker,)) for tick in range(20)]
    actions = [one.action for one in found if one is not None]
    assert actions[0] is (Action.UNREACHABLE if walled else Action.FOLLOW)
    assert found[0] is None, "the first search is among what moves, and proves nothing"
