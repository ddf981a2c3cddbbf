"""Motion planners: which motion to begin now. A genetic algorithm, and two to compare it with.

Each is asked every tick and may go on from what it found the tick before. All judge motions by the same cost
(``motion_kernels.cost_s``), so that they differ only in how they search.

Nouns: motion planner.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from companion.control.motion_kernels import (
    MotionProblem,
    RoverModel,
    begin_later,
    costs_s,
    evolve,
    keep_all_within,
)
from companion.core.own_parts import OwnKind, made_by

Motions = NDArray[np.float64]
"""Shape (m, n, 2): m motions of n knots, each a speed (m/s) and a turn rate (rad/s)."""

KNOTS = 6
SPEED_SHARES = np.array([0.125, 0.25, 0.5, 0.75, 1.0])
TURN_SHARES = np.linspace(-1.0, 1.0, 9)
"""Of the fastest: the motions of one command that are always tried."""


class Found(NamedTuple):
    """The motion to begin, shape (n, 2), its cost in seconds, and the motions that were judged last, with theirs."""

    motion: Motions
    cost_s: float
    judged: Motions
    costs_s: NDArray[np.float64]


class MotionPlanner(Protocol):
    """Finds the motion to begin now."""

    def plan(self, problem: MotionProblem, passed_s: float) -> Found:
        """What is found. ``passed_s``: since the last call."""
        ...

    def forget(self) -> None:
        """What was found before does not count any more."""
        ...


class MotionGa:
    """A genetic algorithm on motions: a population that lives from tick to tick, and seeds of constant commands."""

    POPULATION = 64
    GENERATIONS = 5
    SEEDS = 8
    SIZES = np.array([0.5, 0.8])
    """Of mutations, m/s and rad/s."""

    def __init__(self, seed: int = 0) -> None:
        self._rng = np.random.default_rng(seed)
        self._motions = np.zeros((self.POPULATION, KNOTS, 2))
        self._costs = np.zeros(self.POPULATION)

    def plan(self, problem: MotionProblem, passed_s: float) -> Found:
        """See ``MotionPlanner``."""
        motions, rng = self._motions, self._rng
        begin_later(motions, passed_s / problem.horizon_s)
        seeds = constant_motions(problem.model)
        keep_all_within(seeds, problem)
        keep_all_within(motions, problem)
        # Stable: equally bad ones are many, and in which order another sort leaves them depends on the processor.
        best = np.argsort(costs_s(seeds, problem), kind="stable")[: self.SEEDS]
        motions[np.argsort(self._costs, kind="stable")[-self.SEEDS :]] = seeds[best]
        chances = rng.random((self.GENERATIONS, self.POPULATION, KNOTS + 4))
        kicks = rng.standard_normal((self.GENERATIONS, self.POPULATION, KNOTS, 2))
        self._costs = costs = evolve(motions, self.POPULATION // 4, chances, kicks, self.SIZES, problem)
        found = int(np.argmin(costs))
        return Found(motions[found].copy(), float(costs[found]), motions.copy(), costs.copy())

    def forget(self) -> None:
        """See ``MotionPlanner``."""
        self._motions[:] = 0.0
        self._costs[:] = 0.0


class DynamicWindow:
    """Constant commands that can be reached soon (Fox, Burgard & Thrun 1997, "The dynamic window approach")."""

    WINDOW_S = 0.5
    SPEEDS, TURNS = 9, 21

    def plan(self, problem: MotionProblem, passed_s: float) -> Found:
        """See ``MotionPlanner``."""
        model, start = problem.model, problem.start
        slower, faster = model.decel_m_s2 * self.WINDOW_S, model.accel_m_s2 * self.WINDOW_S
        turns = model.turn_accel_rad_s2 * self.WINDOW_S
        speeds = np.linspace(start.speed_m_s - slower, start.speed_m_s + faster, self.SPEEDS)
        rates = np.linspace(start.turn_rad_s - turns, start.turn_rad_s + turns, self.TURNS)
        grid = np.array([(0.0, 0.0), *((speed, rate) for speed in speeds for rate in (*rates, 0.0))])
        motions = np.repeat(grid[:, None, :], KNOTS, axis=1)
        keep_all_within(motions, problem)
        costs = costs_s(motions, problem)
        found = int(np.argmin(costs))
        return Found(motions[found], float(costs[found]), motions, costs)

    def forget(self) -> None:
        """See ``MotionPlanner``."""


class Mppi:
    """Model predictive path integral (Williams et al. 2017): a mean motion, moved towards better noisy copies."""

    SAMPLES = 320
    """As many as the genetic algorithm judges."""
    TEMPERATURE_S = 0.3
    SIZES = np.array([0.4, 0.6])

    def __init__(self, seed: int = 0) -> None:
        self._rng = np.random.default_rng(seed)
        self._mean = np.zeros((1, KNOTS, 2))

    def plan(self, problem: MotionProblem, passed_s: float) -> Found:
        """See ``MotionPlanner``."""
        begin_later(self._mean, passed_s / problem.horizon_s)
        motions = self._mean + self.SIZES * self._rng.standard_normal((self.SAMPLES, KNOTS, 2))
        motions[0], motions[1] = self._mean[0], 0.0
        keep_all_within(motions, problem)
        costs = costs_s(motions, problem)
        weights = np.exp(-(costs - costs.min()) / self.TEMPERATURE_S)
        self._mean = np.einsum("m,mnc->nc", weights / weights.sum(), motions)[None]
        keep_all_within(self._mean, problem)
        return Found(self._mean[0].copy(), float(costs_s(self._mean, problem)[0]), motions, costs)

    def forget(self) -> None:
        """See ``MotionPlanner``."""
        self._mean[:] = 0.0


MOTION_PLANNERS: Mapping[str, Callable[[int], MotionPlanner]] = {
    "motion-ga": MotionGa,
    "dwa": lambda seed: DynamicWindow(),
    "mppi": Mppi,
}
"""By the name of the controller that they make; called with the seed of their random choices."""


def motion_planner(name: str, seed: int = 0) -> MotionPlanner:
    """The planner of the controller with this name, one's own as well. Raises OwnPartError for one that is no use."""
    if name in MOTION_PLANNERS:
        return MOTION_PLANNERS[name](seed)
    own: MotionPlanner = made_by(OwnKind.CONTROLLER, name, ("plan", "forget"), seed)
    return own


def constant_motions(model: RoverModel) -> Motions:
    """Motions of one command each, over all that the rover can do; standing and turning on the spot among them."""
    speeds = np.concatenate(((-model.backwards_m_s, 0.0), model.fastest_m_s * SPEED_SHARES))
    turns = model.turn_fastest_rad_s * TURN_SHARES
    motions = np.empty((len(speeds), len(turns), KNOTS, 2))
    motions[..., 0] = speeds[:, None, None]
    motions[..., 1] = turns[:, None]
    return motions.reshape(-1, KNOTS, 2)
