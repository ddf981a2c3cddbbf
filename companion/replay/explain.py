"""Why a decision was made: the map as it was known, every way that was weighed, and what it cost. For replays."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from companion.app import Companion
from companion.core.frames import Pose
from companion.core.grid import Grid
from companion.mapping.evidence_map import known_fields
from companion.navigation.field_step import Decision, NavState, is_clear
from companion.navigation.turning_cost import with_turning_cost
from companion.planning.hybrid import Hybrid
from companion.planning.planner import Capabilities, Planner
from companion.planning.problem import Budget, Path, PlanningProblem, PlanResult
from companion.planning.raster import CellArray, cells_cost, plain
from companion.planning.smoothing import curve_cost
from companion.replay.replay import Observer
from companion.settings import Settings


@dataclass(frozen=True, eq=False, slots=True)
class Candidate:
    """A way that was weighed. ``cost``: of its fields, inf without a way; ``curve_cost``: of driving along its curve, if it has one.

    ``part_of``: it was one planner's proposal among those of a search.
    """

    name: str
    note: str
    path: Path | None
    cost: float
    curve_cost: float | None = None
    part_of: bool = False


@dataclass(frozen=True, eq=False, slots=True)
class Explanation:
    """One decision. ``ground``, ``grid`` and ``weighed``: the mission's own weights, those with what had been seen, and those with what
    turning costs, over which was searched; ``known``: which fields had been seen. ``state``: the navigator's before the step.
    """

    number: int
    time_s: float
    target: str
    decision: Decision
    pose: Pose
    state: NavState
    ground: Grid
    grid: Grid
    weighed: Grid
    known: NDArray[np.bool_]
    candidates: tuple[Candidate, ...]


@dataclass
class _Scene:
    """What is known when a step begins."""

    pose: Pose
    state: NavState
    ground: Grid
    grid: Grid
    weighed: Grid
    known: NDArray[np.bool_]
    found: list[Candidate] = field(default_factory=list)


Tell = Callable[[Candidate], None]


class Watcher(Observer):
    """Waits for one decision and keeps what led to it: ``explanation``, None until then."""

    def __init__(self, number: int, settings: Settings, turning_radius_m: float) -> None:
        self.explanation: Explanation | None = None
        self._number = number
        self._settings = settings
        self._turning_radius_m = turning_radius_m
        self._scene: _Scene | None = None

    def step_begins(self, companion: Companion) -> None:
        """Look at everything, and from now on at the planners' answers."""
        if self.explanation is None:
            self._scene = self._seen(companion)
            driver = companion.driver
            assert driver is not None
            if not isinstance(driver.searcher.planner, _Overheard):
                driver.searcher.planner = _overheard(driver.searcher.planner, self._take)

    def decided(self, companion: Companion, number: int, time_s: float, target: str, decision: Decision) -> None:
        """Keep it if it is the one."""
        if number == self._number and self.explanation is None:
            scene = self._scene or self._seen(companion)
            if scene is None:
                return
            left = [] if scene.state.current is None else [_what_is_left(scene)]
            self.explanation = Explanation(
                number, time_s, target, decision, scene.pose, scene.state, scene.ground, scene.grid, scene.weighed,
                scene.known, (*left, *scene.found),
            )  # fmt: skip
        self._scene = None

    def _seen(self, companion: Companion) -> _Scene | None:
        driver, evidence, pose = companion.driver, companion.evidence, companion.status().pose
        state = None if driver is None else driver.leg[0]
        if evidence is None or state is None or pose is None:
            return None
        grid = evidence.grid.with_weights(evidence.grid.weights.copy())
        weighed = with_turning_cost(grid, pose, self._settings.guidance, self._turning_radius_m)
        return _Scene(pose, state, evidence.base, grid, weighed, known_fields(evidence))

    def _take(self, candidate: Candidate) -> None:
        if self._scene is not None:
            self._scene.found.append(candidate)


def _what_is_left(scene: _Scene) -> Candidate:
    """The path that was being followed, from here on."""
    assert scene.state.current is not None
    current = scene.state.current
    ahead = current.cell_array[scene.state.index :]
    note = "clear" if is_clear(scene.grid, ahead) else "blocked"
    cost = cost_of(scene.weighed, ahead)
    return Candidate("what is left of the current path", note, Path(ahead, cost), cost)


def cost_of(grid: Grid, cells: CellArray) -> float:
    """Cost of a way over a grid, inf where it leaves it."""
    x, y = cells.T
    inside = len(cells) == 0 or (x.min() >= 0 and y.min() >= 0 and x.max() < grid.width and y.max() < grid.height)
    return float(cells_cost(plain(grid.weights), cells)) if inside else math.inf


class _Overheard:
    """A planner whose answers are told. ``part_of``: another one asks it."""

    def __init__(self, planner: Planner, tell: Tell, *, part_of: bool) -> None:
        self._planner = planner
        self._tell = tell
        self._part_of = part_of

    @property
    def name(self) -> str:
        """The planner's."""
        return self._planner.name

    @property
    def capabilities(self) -> Capabilities:
        """The planner's."""
        return self._planner.capabilities

    def plan(self, problem: PlanningProblem, budget: Budget, rng: Generator) -> PlanResult:
        """The planner's answer."""
        result = self._planner.plan(problem, budget, rng)
        self._tell(_candidate(problem, result, part_of=self._part_of))
        return result


def _overheard(planner: Planner, tell: Tell) -> Planner:
    """The planner, and those that it asks in its turn."""
    if isinstance(planner, Hybrid):
        planner.genetic = _Overheard(planner.genetic, tell, part_of=True)
        planner.graph = _Overheard(planner.graph, tell, part_of=True)
    return _Overheard(planner, tell, part_of=False)


def _candidate(problem: PlanningProblem, result: PlanResult, *, part_of: bool) -> Candidate:
    path = result.path
    work = f"{result.epochs} epochs, {result.evaluations} paths tried" if result.epochs else ""
    ends = f"field {problem.start[0]}, {problem.start[1]} to {problem.target[0]}, {problem.target[1]}"
    name = f"proposed by {result.planner}" if part_of else f"search by {result.planner}, {ends}"
    along = None if path is None or path.curve is None else float(curve_cost(plain(problem.weights), path.curve))
    note = ", ".join(part for part in (result.status.value, work) if part)
    return Candidate(name, note, path, math.inf if path is None else path.cost, along, part_of)


def in_words(why: Explanation) -> list[str]:
    """The explanation, line by line."""
    decision, pose = why.decision, why.pose
    here, goal = why.state.past[-1], why.state.target
    cell = why.grid.cell_at(pose.point)
    lines = [
        f"decision {why.number} at {why.time_s:.2f} s, heading for {why.target}: {decision.action} (part {decision.part}): "
        f"{decision.reason}",
        f"rover in field {cell.x}, {cell.y} (north {pose.north_m:.2f} m, east {pose.east_m:.2f} m, heading "
        f"{math.degrees(pose.heading_rad) % 360.0:.0f} deg), last step in {here.x}, {here.y}; target field {goal.x}, {goal.y}; "
        f"{len(why.state.past)} fields of past path{', going back along it' if why.state.returning else ''}",
        f"map: {why.grid.width} x {why.grid.height} fields of {why.grid.resolution_m:g} m, {why.known.mean():.0%} seen, "
        f"{int((why.grid.weights >= 1.0).sum())} are obstacles",
    ]
    for candidate in why.candidates:
        lines.append(
            f"{'    ' if candidate.part_of else '  '}{candidate.name}: {cost_in_words(candidate)}; {candidate.note}"
        )
    if not why.candidates:
        lines.append("  nothing was searched, and there was no path to follow")
    if decision.path:
        lines.append(_shares(why, np.asarray(decision.path)))
    return lines


def cost_in_words(candidate: Candidate) -> str:
    """Cost and length of a candidate."""
    if candidate.path is None:
        return "no path"
    along = "" if candidate.curve_cost is None else f" ({candidate.curve_cost:.2f} along its curve)"
    return f"cost {candidate.cost:.2f}{along}, {candidate.path.length_fields:.1f} fields long"


def _shares(why: Explanation, cells: CellArray) -> str:
    """What the cost of the way that was decided on is made of."""
    ground, seen, whole = (cost_of(grid, cells) for grid in (why.ground, why.grid, why.weighed))
    return (
        f"taken: {len(cells)} fields, cost {whole:.2f} = {ground:.2f} ground + {seen - ground:.2f} beside obstacles or "
        f"remembered as costly + {whole - seen:.2f} for turning"
    )
