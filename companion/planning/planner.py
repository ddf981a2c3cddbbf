"""The planner's contract, and the planners there are."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from numpy.random import Generator

from companion.planning.problem import Budget, PlanningProblem, PlanResult
from companion.settings import PlannerSettings


@dataclass(frozen=True, slots=True)
class Capabilities:
    """What a planner can promise. ``turning_radius``: it heeds the problem's, if it can."""

    proves_no_path: bool = False
    optimal: bool = False
    random: bool = False
    smooth_curve: bool = False
    any_angle: bool = False
    moving_obstacles: bool = False
    speeds: bool = False
    turning_radius: bool = False


class Planner(Protocol):
    """Anything that turns a problem into a path.

    The answer is a function of problem, budget and the generator's state. The path's ends are start and target, it is
    8-connected, touches no obstacle and cuts no corner (unless the problem allows it). ``problem.weights`` is
    only read. A start or target on an obstacle or outside the map is no error: there is no path.
    """

    @property
    def name(self) -> str:
        """The name in PLANNERS."""
        ...

    @property
    def capabilities(self) -> Capabilities:
        """What it promises."""
        ...

    def plan(self, problem: PlanningProblem, budget: Budget, rng: Generator) -> PlanResult:
        """Search. Never raises for an unsolvable problem."""
        ...


PlannerFactory = Callable[[PlannerSettings], Planner]
