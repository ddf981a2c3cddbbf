"""Speeds that a planner chooses, and moving things that it is told of, on their way through the driver."""

from dataclasses import dataclass, field

import numpy as np
import pytest
from numpy.random import Generator

from companion.control.controller import Purpose
from companion.control.local_view import LocalView
from companion.control.point_controller import PointController
from companion.core.frames import NedPoint, Pose
from companion.core.grid import Cell, empty_grid
from companion.core.rover_limits import RoverLimits
from companion.core.scan import RangeScan
from companion.executive.goal_driver import GoalDriver
from companion.executive.setpoint_sender import SentSetpoints
from companion.mapping.evidence_map import EvidenceMap, integrate, new_map
from companion.mission.mission import OnBlocked
from companion.mission.resolve import ResolvedTarget
from companion.navigation.search_budget import PathSearcher
from companion.navigation.step_runner import InlineRunner
from companion.perception.moving_obstacles import Moving
from companion.planning.planner import Capabilities
from companion.planning.problem import Budget, Path, PlanningProblem, PlanResult, PlanStatus
from companion.settings import Settings
from companion.vehicle.commands import ChangeSpeed

SETTINGS = Settings()
FIELDS_M = 0.5
GOAL = ResolvedTarget("t", NedPoint(17.25, 10.25), Cell(20, 34), 0.0, OnBlocked.SKIP, None)


@dataclass
class Straight:
    """Straight north at one speed; keeps what it was asked."""

    speed_fields_s: float
    name: str = "straight"
    capabilities: Capabilities = field(default_factory=lambda: Capabilities(moving_obstacles=True, speeds=True))
    asked: list[PlanningProblem] = field(default_factory=list)

    def plan(self, problem: PlanningProblem, budget: Budget, rng: Generator) -> PlanResult:
        self.asked.append(problem)
        cells = tuple(Cell(problem.start.x, y) for y in range(problem.start.y, problem.target.y + 1))
        curve = np.array([cells[0], cells[-1]], np.float64)
        path = Path(cells, 1.0, curve, np.array([self.speed_fields_s]))
        return PlanResult(PlanStatus.FOUND, path, self.name)


def seen_map() -> EvidenceMap:
    evidence = new_map(empty_grid(40, 40, FIELDS_M), 0.35, SETTINGS.mapping)
    bearings = np.radians(np.arange(0.0, 360.0, 5.0))
    scan = RangeScan(0.0, bearings, np.full(72, np.inf), 0.1, 8.0, np.radians(5.0), "test")
    for stamp in (1, 2, 3):
        integrate(evidence, Pose(10.25, 10.25, 0.0, 0.0), scan, stamp)
    return evidence


SEEN = seen_map()


def driver_with(planner: Straight) -> GoalDriver:
    searcher = PathSearcher(planner, np.random.default_rng(1))
    driver = GoalDriver(PointController(), searcher, InlineRunner())
    driver.head_for(GOAL, at(0.0))
    return driver


def at(time_s: float, speed_m_s: float = 1.0) -> LocalView:
    return LocalView(Pose(10.25, 10.25, 0.0, time_s), speed_m_s, SEEN, RoverLimits(0.35, 2.0, 8.0), SETTINGS)


@pytest.mark.parametrize(("planned_fields_s", "told_m_s"), [(2.4, 1.2), (1.6, 0.8), (9.0, 2.0), (0.2, 0.5)])
def test_the_lower_of_planned_speed_and_guidances_limit_reaches_the_autopilot(
    planned_fields_s: float, told_m_s: float
) -> None:
    driver = driver_with(Straight(planned_fields_s))
    driver.decide(at(0.0))
    command = driver.guide(at(0.0))
    assert command.purpose is Purpose.DRIVE
    commands = SentSetpoints().due(command, 0.0, SETTINGS.guidance, 3.0, confirmed=None)
    assert ChangeSpeed(pytest.approx(told_m_s)) in commands


def test_the_planner_is_told_what_moves_and_how_fast_the_rover_goes() -> None:
    planner = Straight(2.0)
    cart = Moving("cart", 0.0, NedPoint(15.25, 2.25), 0.0, 0.1, 0.65)
    driver_with(planner).decide(at(0.0), (cart,))
    (problem,) = planner.asked
    assert problem.kinematics.speeds_fields_s == pytest.approx((1.0, 4.0))
    assert problem.moving_obstacles[0].radius_fields == pytest.approx(2.0)
    assert problem.moving_obstacles[0].track[0] == pytest.approx([0.0, 4.0, 30.0])


def test_it_plans_anew_when_something_moves_otherwise_and_not_while_it_does_not() -> None:
    planner = Straight(2.0)
    driving = driver_with(planner)

    def cart(time_s: float, east_m_s: float) -> tuple[Moving, ...]:
        return (Moving("cart", time_s, NedPoint(19.0, 2.0), 0.0, east_m_s, 0.5),)

    for tick in range(60):
        driving.decide(at(0.05 * tick), cart(0.05 * tick, -1.0))
    # The first plan, and one when the cart was first heard of.
    assert len(planner.asked) <= 2
    before = len(planner.asked)
    for tick in range(60, 70):
        driving.decide(at(0.05 * tick), cart(0.05 * tick, 0.6))
    assert len(planner.asked) == before + 1
