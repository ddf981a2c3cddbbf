"""The genetic algorithm's inputs as its compiled kernels take them: the task, the tuning, the lifetime of a population.

From Python the kernels are called with plain tuples of these fields, because numba needs microseconds more for a named
tuple, which would be a fifth of a short search.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

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
    adaptive: bool
    most_control_points: int
    number_probability: float


class Task(NamedTuple):
    """Start, target, rule for corners, the vehicle's tightest arc (0: it turns on the spot) and its heading (NaN: any).

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


Plain = tuple[Any, ...]
"""The fields of a named tuple."""


def tuning_of(settings: PlannerSettings) -> Plain:
    """The fields of ``Tuning`` for these settings."""
    return tuple(from_settings(Tuning, settings))


def task_of(problem: PlanningProblem, by_length: bool) -> Plain:
    """The fields of ``Task`` for this problem."""
    kinematics = problem.kinematics
    heading_rad = math.nan if kinematics.heading_rad is None else float(kinematics.heading_rad)
    radius_fields = float(kinematics.turning_radius_fields)
    return (*problem.start, *problem.target, problem.corner_cutting, radius_fields, heading_rad, by_length)
