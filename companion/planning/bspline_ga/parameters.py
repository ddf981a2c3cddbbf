"""The genetic algorithm's inputs as its compiled kernels take them: the task, the tuning, the lifetime of a population."""

from __future__ import annotations

import math
from typing import NamedTuple

from companion.planning.planner import from_settings
from companion.planning.problem import PlanningProblem
from companion.settings import PlannerSettings


class Tuning(NamedTuple):
    """The settings of the algorithm, by the names that they have in ``PlannerSettings``."""

    way_points: int
    span_way_points: int
    mixing: float
    selected_share: float
    mutation_probability: float
    mutation_range: float
    line_probability: float
    line_range: float
    neighbourhood: float
    margin_fields: int
    obstacle_value: float
    adaptive: bool = False
    most_control_points: int = 16
    number_probability: float = 0.5


class Task(NamedTuple):
    """Start, target, the rule for corners, the vehicle's tightest arc (0: it turns on the spot) and its heading (NaN: any).

    ``by_length``: the fields under a line count in proportion to its length; else each field counts the same.
    """

    start_x: int
    start_y: int
    target_x: int
    target_y: int
    corner_cutting: bool
    turning_radius_fields: float = 0.0
    heading_rad: float = math.nan
    by_length: bool = False


class Lifetime(NamedTuple):
    """The size of a population and how many epochs it lives: see ``Budget``."""

    population: int
    min_epochs: int
    max_epochs: int


def tuning_of(settings: PlannerSettings) -> Tuning:
    """The tuning that these settings describe."""
    tuning: Tuning = from_settings(Tuning, settings)
    return tuning


def task_of(problem: PlanningProblem, by_length: bool) -> Task:
    """The task that a problem describes."""
    motion = problem.motion
    heading_rad = math.nan if motion.heading_rad is None else float(motion.heading_rad)
    radius_fields = float(motion.turning_radius_fields)
    return Task(*problem.start, *problem.target, problem.corner_cutting, radius_fields, heading_rad, by_length)
