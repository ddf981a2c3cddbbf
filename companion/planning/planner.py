"""The interface of all planners, and what the complete ones and the random ones have in common.

Nouns: planner, capabilities.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

from numpy.random import Generator

from companion.core.grid import Weights
from companion.planning.problem import Budget, Path, PlanningProblem, PlanResult, PlanStatus
from companion.planning.random_numbers import draw_seed
from companion.planning.raster import plain
from companion.settings import PlannerSettings


@dataclass(frozen=True, slots=True)
class Capabilities:
    """What a planner guarantees or considers.

    ``turning_radius``: it considers the vehicle's, but cannot always keep it.
    """

    proves_no_path: bool = False
    optimal: bool = False
    random: bool = False
    smooth_curve: bool = False
    any_angle: bool = False
    moving_obstacles: bool = False
    speeds: bool = False
    turning_radius: bool = False


class Planner(Protocol):
    """Finds a path for a problem.

    The result is a function of the problem, the budget and the generator's state. The path begins at the start and ends
    at the target, is 8-connected, touches no obstacle and cuts no corner (unless the problem allows it).
    ``problem.weights`` is only read. A start or target on an obstacle or outside the map is not an error: there is no
    path.
    """

    @property
    def name(self) -> str:
        """The name that its results have."""
        ...

    @property
    def capabilities(self) -> Capabilities:
        """What it guarantees."""
        ...

    def plan(self, problem: PlanningProblem, budget: Budget, rng: Generator) -> PlanResult:
        """Search. Never raises for an unsolvable problem."""
        ...


PlannerFactory = Callable[[PlannerSettings], Planner]


class CompletePlanner(ABC):
    """A planner that finds a path or proves that there is none.

    It needs no settings, no budget and no random numbers.
    """

    name: str
    capabilities: Capabilities

    def __init__(self, settings: PlannerSettings) -> None:
        del settings

    def plan(self, problem: PlanningProblem, budget: Budget, rng: Generator) -> PlanResult:
        """See ``Planner.plan``. FOUND or NO_PATH; the budget and the generator are not used."""
        del budget, rng
        path = self._path(problem, plain(problem.weights)) if problem.ends_are_free else None
        return PlanResult(PlanStatus.NO_PATH if path is None else PlanStatus.FOUND, path, self.name)

    @abstractmethod
    def _path(self, problem: PlanningProblem, weights: Weights) -> Path | None:
        """A path between free ends, None if there is none. ``weights``: those of the problem, see ``raster.plain``."""


Outcome = tuple[Path | None, int, int, int]
"""The result of a random search: path, evaluations, epochs, control points; see ``PlanResult``."""


class RandomPlanner(ABC):
    """A planner that searches with random numbers and never proves that there is no path."""

    name: str
    capabilities: Capabilities

    def plan(self, problem: PlanningProblem, budget: Budget, rng: Generator) -> PlanResult:
        """See ``Planner.plan``. FOUND or BUDGET_SPENT. Draws one number from the generator."""
        seed = draw_seed(rng)
        if not problem.ends_are_free:
            return PlanResult(PlanStatus.BUDGET_SPENT, None, self.name)
        if problem.start == problem.target:
            return PlanResult(PlanStatus.FOUND, Path((problem.start,), 0.0), self.name)
        path, evaluations, epochs, control_points = self._search(problem, plain(problem.weights), budget, seed)
        status = PlanStatus.BUDGET_SPENT if path is None else PlanStatus.FOUND
        return PlanResult(status, path, self.name, evaluations, epochs, control_points)

    @abstractmethod
    def _search(self, problem: PlanningProblem, weights: Weights, budget: Budget, seed: int) -> Outcome:
        """One search between two different free ends. ``weights``: those of the problem, see ``raster.plain``."""


def from_settings(kind: Any, settings: object, **others: object) -> Any:
    """A kernel's named tuple whose fields are the settings of the same names, and ``others`` for what is no setting."""
    return kind(*(others[name] if name in others else getattr(settings, name) for name in kind._fields))
