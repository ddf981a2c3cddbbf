"""The one thing every planner looks at first."""

from __future__ import annotations

from companion.grid import OBSTACLE
from companion.planning.problem import PlanningProblem


def ends_free(problem: PlanningProblem) -> bool:
    """Whether start and target are inside the map and free; if not, no planner has a path."""
    weights = problem.weights
    height, width = weights.shape
    for x, y in (problem.start, problem.target):
        if not (0 <= x < width and 0 <= y < height and weights[y, x] < OBSTACLE):
            return False
    return True
