"""What the genetic algorithm's kernels are called with: plain tuples, since named ones take the dispatcher microseconds."""

from __future__ import annotations

import math
from operator import attrgetter

from companion.planning.problem import PlanningProblem
from companion.settings import PlannerSettings

Places = tuple[int, int, int, int, bool, float, float, bool]
"""The fields of ``ga_fitness.Task``."""
TuningValues = tuple[int, int, float, float, float, float, float, float, float, int, float, bool, int, float]
"""The fields of ``ga_fitness.Tuning``."""
Lives = tuple[int, int, int]
"""The fields of ``ga_population.Span``."""


def places_of(problem: PlanningProblem, by_length: bool) -> Places:
    """What ``Task`` is made of."""
    motion = problem.motion
    heading_rad = math.nan if motion.heading_rad is None else float(motion.heading_rad)
    radius = float(motion.turning_radius_fields)
    return (*problem.start, *problem.target, problem.corner_cutting, radius, heading_rad, by_length)


_TUNING = attrgetter(
    "way_points",
    "span_way_points",
    "mixing",
    "selected_share",
    "mutation_probability",
    "mutation_range",
    "line_probability",
    "line_range",
    "neighbourhood",
    "margin_fields",
    "obstacle_value",
    "adaptive",
    "most_control_points",
    "number_probability",
)


def tuning_of(settings: PlannerSettings) -> TuningValues:
    """What ``Tuning`` is made of."""
    values: TuningValues = _TUNING(settings)
    return values
