"""The one thing every planner looks at first."""

from __future__ import annotations

from companion.core.grid import OBSTACLE
from companion.planning.problem import Path, PlanningProblem, PlanResult, PlanStatus


def ends_free(problem: PlanningProblem) -> bool:
    """Whether start and target are inside the map and free; if not, no planner has a path."""
    weights = problem.weights
    height, width = weights.shape
    for x, y in (problem.start, problem.target):
        if not (0 <= x < width and 0 <= y < height and weights[y, x] < OBSTACLE):
            return False
    return True


def answered_at_once(problem: PlanningProblem, planner: str) -> PlanResult | None:
    """The answer of a planner that proves nothing where there is nothing to search: an end that is not free, or no way to go."""
    if not ends_free(problem):
        return PlanResult(PlanStatus.BUDGET_SPENT, None, planner)
    if problem.start == problem.target:
        return PlanResult(PlanStatus.FOUND, Path((problem.start,), 0.0), planner)
    return None
