"""The paper's own simulation (Kwasniewski & Gosiewski 2018, section 5): from field to field, without a vehicle.

The robot sees a triangle of fields in the direction of its last move: layer k holds 2k + 1 fields. Where the paper is
silent: the triangle has eight directions, on a diagonal it is the quadrant (in layer k the larger offset is k);
obstacles hide what lies behind them; before a move the robot turns, so it sees the field it is about to enter.
"""

from __future__ import annotations

import gc
from dataclasses import dataclass, field
from enum import StrEnum
from functools import cache

import numpy as np
from numpy.typing import NDArray

from companion.core.clock import stopwatch_s
from companion.core.grid import BASE_WEIGHT, OBSTACLE, Cell, Grid, Weights
from companion.navigation.field_step import Action, Decision, Part, SearchKind, initial_state, step
from companion.navigation.search_budget import PathSearcher
from companion.planning import registry
from companion.planning.problem import PlanResult
from companion.planning.registry import make_planner
from companion.settings import Settings

LAYERS = 4
STEP_LIMIT = 2000


class Outcome(StrEnum):
    """How a run ended."""

    REACHED = "reached"
    UNREACHABLE = "unreachable"
    STEP_LIMIT = "step limit"


@dataclass
class FieldRun:
    """One run. ``track``: the fields entered, start first; ``parts``: the navigator's part at each move.

    ``steps`` counts moves, ``return_steps`` those of part A; ``step_seconds`` has the time of each call of the step
    function.
    """

    seed: int
    outcome: Outcome = Outcome.STEP_LIMIT
    steps: int = 0
    return_steps: int = 0
    searches: int = 0
    by_curves: int = 0
    """Searches that the genetic algorithm answered with a curve of its own, and not a graph search."""
    planning_s: float = 0.0
    step_seconds: list[float] = field(default_factory=list)
    track: list[Cell] = field(default_factory=list)
    parts: list[Part] = field(default_factory=list)


@dataclass(frozen=True, eq=False, slots=True)
class View:
    """The fields of one triangle, apex left out. Shape of offsets (n, 2): x, y.

    ``between`` has shape (n, layers - 1, 2): the fields on the straight line from the apex to each, padded with the
    apex.
    """

    offsets: NDArray[np.int64]
    between: NDArray[np.int64]


@cache
def view_towards(step_x: int, step_y: int, layers: int = LAYERS) -> View:
    """The triangle in one of the eight directions (steps of -1, 0, 1, not both 0)."""
    cells = []
    for k in range(1, layers + 1):
        for i in range(2 * k + 1):
            if step_x and step_y:
                # The quadrant: up one side of its square, along the other.
                cells.append((step_x * min(i, k), step_y * min(2 * k - i, k)))
            else:
                cells.append((step_x * k + step_y * (i - k), step_y * k + step_x * (i - k)))
    between = np.zeros((len(cells), max(layers - 1, 1), 2), np.int64)
    for row, (x, y) in enumerate(cells):
        k = max(abs(x), abs(y))
        for i in range(1, k):
            between[row, i - 1] = (round(x * i / k), round(y * i / k))
    return View(np.array(cells, np.int64), between)


def seen_from(truth: Weights, cell: Cell, view: View) -> NDArray[np.int64]:
    """The fields of the triangle that are inside the map and not hidden; shape (n, 2): x, y."""
    height, width = truth.shape
    cells = view.offsets + cell
    lines = view.between + cell
    inside = ((cells >= 0) & (cells < (width, height))).all(axis=1)
    np.clip(lines, 0, (width - 1, height - 1), out=lines)
    hidden = (truth[lines[..., 1], lines[..., 0]] >= OBSTACLE).any(axis=1)
    seen: NDArray[np.int64] = cells[inside & ~hidden]
    return seen


class FieldRobot:
    """The robot on the ground ``truth``; its own map, ``known``, begins at the base weight everywhere.

    ``layers``: of its view, beyond its own field.
    """

    def __init__(
        self, truth: Grid, start: Cell, target: Cell, settings: Settings, seed: int, layers: int = LAYERS
    ) -> None:
        self.truth = truth
        self._layers = layers
        self.known = truth.with_weights(np.full(truth.weights.shape, BASE_WEIGHT))
        self.cell = start
        self.target = target
        self.run = FieldRun(seed, track=[start])
        rng = np.random.default_rng(seed)
        planner = make_planner(settings.navigator.planner, settings.planner)
        self._searcher = PathSearcher(planner, rng)
        self._navigator = settings.navigator
        self._state = initial_state(start, target, int(rng.integers(2**63)), settings.navigator.better_every_fields)
        self._heading = (int(np.sign(target.x - start.x)), int(np.sign(target.y - start.y)))

    def drive(self, step_limit: int = STEP_LIMIT) -> FieldRun:
        """Move until the target is reached, proved or believed unreachable, or the limit of steps is."""
        run = self.run
        self._look()
        decision = self._step()
        while decision.action in (Action.FOLLOW, Action.BACKTRACK) and run.steps < step_limit:
            onward = _next_field(decision, self.cell)
            self._turn_to(onward)
            if self.known.is_obstacle(onward) or self._corner_is_cut(onward):
                # What it saw on turning is in the way: the step function once more in the same field.
                decision = self._step()
                continue
            self._move(onward, decision)
            decision = self._step()
        if decision.action is Action.REACHED:
            run.outcome = Outcome.REACHED
        elif decision.action is Action.UNREACHABLE:
            run.outcome = Outcome.UNREACHABLE
        run.searches, run.by_curves = len(self._searcher.seconds), self._searcher.by_curves
        run.planning_s = float(np.sum(self._searcher.seconds))
        return run

    def _step(self) -> Decision:
        """The step function on the map as known now."""

        def search(kind: SearchKind, start: Cell, target: Cell) -> PlanResult:
            return self._searcher.search(self.known.weights, kind, start, target, self._navigator)

        began_s = stopwatch_s()
        self._state, decision = step(self._state, self.known, self.cell, search)
        self.run.step_seconds.append(stopwatch_s() - began_s)
        return decision

    def _turn_to(self, onward: Cell) -> None:
        heading = (onward.x - self.cell.x, onward.y - self.cell.y)
        if heading != self._heading:
            self._heading = heading
            self._look()

    def _move(self, onward: Cell, decision: Decision) -> None:
        if self.truth.is_obstacle(onward):
            raise AssertionError(f"drove into the obstacle at {onward}")
        self.cell = onward
        self.run.steps += 1
        self.run.return_steps += decision.action is Action.BACKTRACK
        self.run.track.append(onward)
        self.run.parts.append(decision.part)
        self._look()

    def _look(self) -> None:
        if self._heading == (0, 0):
            return
        x, y = seen_from(self.truth.weights, self.cell, view_towards(*self._heading, self._layers)).T
        self.known.weights[y, x] = self.truth.weights[y, x]

    def _corner_is_cut(self, onward: Cell) -> bool:
        here = self.cell
        if here.x == onward.x or here.y == onward.y:
            return False
        return self.known.is_obstacle(Cell(here.x, onward.y)) or self.known.is_obstacle(Cell(onward.x, here.y))


def _next_field(decision: Decision, cell: Cell) -> Cell:
    """The field after the robot's own on the decision's path."""
    return decision.path[1] if decision.path[0] == cell else decision.path[0]


def drive_fields(
    truth: Grid,
    start: Cell,
    target: Cell,
    settings: Settings,
    seed: int,
    step_limit: int = STEP_LIMIT,
    layers: int = LAYERS,
) -> FieldRun:
    """One run over unknown ground; a function of its arguments (but for the times measured)."""
    return FieldRobot(truth, start, target, settings, seed, layers).drive(step_limit)


def measured_runs(
    truth: Grid, start: Cell, target: Cell, settings: Settings, seeds: range, layers: int = LAYERS
) -> list[FieldRun]:
    """One run for each seed. Neither loading compiled code nor a full collection counts as planning of some run."""
    _warm_up_once()
    collecting = gc.isenabled()
    gc.disable()
    try:
        return [drive_fields(truth, start, target, settings, seed, layers=layers) for seed in seeds]
    finally:
        if collecting:
            gc.enable()


@cache
def _warm_up_once() -> None:
    """Once in each process."""
    registry.warm_up()
