"""What the planner is asked: the budget for each kind of search, kinematic constraints in fields, a free start."""

import math

import numpy as np
import pytest

from companion.core.frames import Pose
from companion.core.grid import BASE_WEIGHT, OBSTACLE, Cell, empty_grid
from companion.core.rover_limits import RoverLimits
from companion.navigation.field_step import SearchKind
from companion.navigation.search_budget import PathSearcher, budget_of, kinematics_of
from companion.planning.planner import Capabilities
from companion.planning.problem import KinematicConstraints, ObstacleTrajectory, PlanResult, PlanStatus
from companion.settings import NavigatorSettings, Settings

SETTINGS = Settings()
RNG = np.random.default_rng(0)
NOTHING_FOUND = PlanResult(PlanStatus.NO_PATH, None, "spy")


class Spy:
    """A planner that remembers what it was asked."""

    name = "spy"
    capabilities = Capabilities()

    def plan(self, problem, budget, rng):
        self.problem, self.budget, self.rng = problem, budget, rng
        return NOTHING_FOUND


def asked(kind=SearchKind.THOROUGH, weights=None, settings=SETTINGS.navigator, **more):
    spy = Spy()
    weights = np.full((5, 8), BASE_WEIGHT) if weights is None else weights
    searcher = PathSearcher(spy, RNG)
    result = searcher.search(weights, kind, Cell(1, 2), Cell(7, 3), settings, **more)
    assert result is NOTHING_FOUND
    assert len(searcher.seconds) == 1 and searcher.seconds[0] >= 0.0
    return spy


def test_only_thorough_searches_get_the_thorough_budget():
    thorough, quick = budget_of(SETTINGS.navigator.thorough), budget_of(SETTINGS.navigator.quick)
    assert thorough != quick
    assert asked(SearchKind.THOROUGH).budget == thorough
    assert asked(SearchKind.RETURN).budget == asked(SearchKind.BETTER).budget == quick


def test_a_budget_has_all_of_its_settings():
    settings = SETTINGS.navigator.thorough
    budget = budget_of(settings)
    for name in ("min_epochs", "max_epochs", "control_points", "population"):
        assert getattr(budget, name) == getattr(settings, name)


def test_the_budget_is_that_of_the_settings_given():
    other = NavigatorSettings.model_validate({"thorough": {"population": 77}})
    assert asked(settings=other).budget == budget_of(other.thorough) != budget_of(SETTINGS.navigator.thorough)


def test_the_planner_gets_problem_and_generator():
    obstacles = (ObstacleTrajectory(1.0, np.zeros((1, 3))),)
    kinematics = KinematicConstraints(0.5, 2.0)
    spy = asked(moving_obstacles=obstacles, kinematics=kinematics)
    assert (spy.problem.start, spy.problem.target) == (Cell(1, 2), Cell(7, 3))
    assert spy.problem.moving_obstacles is obstacles and spy.problem.kinematics is kinematics
    assert spy.rng is RNG


def test_the_start_is_free_though_the_map_has_an_obstacle_there():
    weights = np.full((5, 8), BASE_WEIGHT)
    weights[2, 1] = weights[3, 1] = OBSTACLE
    given = weights.copy()
    spy = asked(weights=weights)
    assert spy.problem.weights[2, 1] < OBSTACLE and spy.problem.weights[3, 1] == OBSTACLE
    assert np.array_equal(weights, given), "the map itself is not changed"


def test_a_map_with_a_free_start_is_not_copied():
    weights = np.full((5, 8), BASE_WEIGHT)
    assert asked(weights=weights).problem.weights is weights


@pytest.mark.parametrize(
    ("heading_deg", "angle_deg"), [(0.0, 90.0), (90.0, 0.0), (180.0, -90.0), (-90.0, -180.0), (45.0, 45.0)]
)
def test_the_heading_turns_from_clockwise_from_north_to_anticlockwise_from_east(heading_deg, angle_deg):
    pose = Pose(0.0, 0.0, math.radians(heading_deg), 0.0)
    kinematics = kinematics_of(pose, RoverLimits(0.35, 2.0, 8.0), 1.0, SETTINGS, empty_grid(9, 9, 0.5))
    assert math.degrees(kinematics.heading_rad) == pytest.approx(angle_deg)


def test_radius_and_speeds_are_in_fields():
    pose, rover = Pose(0.0, 0.0, 0.0, 0.0), RoverLimits(0.35, 2.0, 8.0, turning_radius_m=1.5)
    kinematics = kinematics_of(pose, rover, 1.0, SETTINGS, empty_grid(9, 9, 0.5))
    assert kinematics.turning_radius_fields == pytest.approx(3.0 * SETTINGS.steering.planned_radius)
    assert kinematics.speeds_fields_s == pytest.approx((2.0 * SETTINGS.guidance.min_speed_m_s, 2.0))


def test_no_speed_is_planned_above_the_limit_or_above_the_rovers_own():
    pose, rover = Pose(0.0, 0.0, 0.0, 0.0), RoverLimits(0.35, 2.0, 8.0)
    fastest_m_s = SETTINGS.guidance.max_speed_m_s
    assert kinematics_of(pose, rover, 99.0, SETTINGS, empty_grid(9, 9)).speeds_fields_s[1] == pytest.approx(fastest_m_s)
    slow = kinematics_of(pose, rover, 0.05, SETTINGS, empty_grid(9, 9))
    assert slow.speeds_fields_s == pytest.approx((0.05, 0.05))
