"""Single searches for ``achour-table1``: timed as a user calls them, then repeated with the same seed for details."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from companion.core.clock import stopwatch_s
from companion.planning.papers.achour_ga import walked
from companion.planning.papers.line_of_sight import free_samples, shortened
from companion.planning.papers.prm import queried
from companion.planning.problem import Budget, PlanningProblem
from companion.planning.random_numbers import draw_seed, seeded
from companion.planning.raster import CellArray, plain
from companion.planning.registry import make_planner
from companion.settings import PlannerSettings
from companion.settings.planners import AchourSettings
from sitl.experiments.achour_environments import FIELDS_A_METRE

Nodes = NDArray[np.float64]

GENETIC, ROADMAP, LINES = "achour", "prm", "theta-star"
METHODS = (GENETIC, ROADMAP, LINES)
SETTINGS = PlannerSettings(achour=AchourSettings(unit_fields=FIELDS_A_METRE))
"""The defaults, but lengths in the equations are in metres, as in the paper's environments."""


@dataclass(frozen=True, eq=False, slots=True)
class Trial:
    """One search.

    ``at_once``: without a second attempt or extra samples. ``number`` is the paper's N: iterations of the last attempt
    (``achour``), samples in the roadmap (``prm``). ``attempts``: how often samples were drawn. ``nodes``: of the path
    as the paper's method finds it, shape (n, 2), columns x and y in fields, no rows if there is none; ``straight``:
    those that are left where each sees the next.
    """

    seed: int
    time_ms: float
    at_once: bool
    number: int
    attempts: int
    nodes: Nodes
    straight: Nodes

    @property
    def found(self) -> bool:
        """Whether there is a path."""
        return len(self.nodes) > 0


def length_m(nodes: Nodes) -> float:
    """Length of the lines from node to node."""
    return float(np.hypot(*np.diff(nodes, axis=0).T).sum()) / FIELDS_A_METRE


def make_trials(method: str, problem: PlanningProblem, seeds: range) -> tuple[Trial, ...]:
    """One search for each seed."""
    planner, look = make_planner(method, SETTINGS), _LOOKS[method]
    planner.plan(problem, Budget(), np.random.default_rng(seeds.start))  # so that no time has the loading in it
    trials = []
    for seed in seeds:
        rng = np.random.default_rng(seed)
        began_s = stopwatch_s()
        planner.plan(problem, Budget(), rng)
        trials.append(look(problem, seed, 1e3 * (stopwatch_s() - began_s)))
    return tuple(trials)


def samples_of(problem: PlanningProblem, trial: Trial) -> CellArray:
    """The free samples of a genetic search's first attempt, shape (n, 2)."""
    state = seeded(_kernel_seed(trial.seed))
    return free_samples(plain(problem.weights), SETTINGS.achour.samples, state)


def _kernel_seed(seed: int) -> int:
    return draw_seed(np.random.default_rng(seed))


def _pulled(problem: PlanningProblem, nodes: CellArray) -> Nodes:
    if len(nodes) == 0:
        return nodes.astype(np.float64)
    return shortened(plain(problem.weights), nodes, problem.corner_cutting).astype(np.float64)


def _genetic(problem: PlanningProblem, seed: int, time_ms: float) -> Trial:
    walk = walked(problem, SETTINGS.achour.model_copy(update={"shorten": False}), _kernel_seed(seed))
    at_once = len(walk.nodes) > 0 and walk.attempts == 1
    nodes, straight = walk.nodes.astype(np.float64), _pulled(problem, walk.nodes)
    return Trial(seed, time_ms, at_once, walk.last_iterations, walk.attempts, nodes, straight)


def _roadmap(problem: PlanningProblem, seed: int, time_ms: float) -> Trial:
    query = queried(problem, SETTINGS.prm, _kernel_seed(seed))
    at_once = len(query.nodes) > 0 and query.rounds == 0
    nodes, straight = query.nodes.astype(np.float64), _pulled(problem, query.nodes)
    return Trial(seed, time_ms, at_once, query.roadmap, 1 + query.rounds, nodes, straight)


def _lines(problem: PlanningProblem, seed: int, time_ms: float) -> Trial:
    path = make_planner(LINES, SETTINGS).plan(problem, Budget(), np.random.default_rng(seed)).path
    curve = np.empty((0, 2)) if path is None or path.curve is None else path.curve
    return Trial(seed, time_ms, len(curve) > 0, 0, 1, curve, curve)


_LOOKS: dict[str, Callable[[PlanningProblem, int, float], Trial]] = {
    GENETIC: _genetic,
    ROADMAP: _roadmap,
    LINES: _lines,
}
