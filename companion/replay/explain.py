"""Explains a decision during a replay: the map as it was known, every path that was considered, and its cost.

Where motions are planned, also the first motions that were judged after it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from companion.app import Companion
from companion.control.motion_controller import MotionChoice, MotionController
from companion.control.motion_kernels import BLOCKED_S, way_of
from companion.core.frames import Pose
from companion.core.grid import OBSTACLE, Grid
from companion.mapping.map_queries import known_fields
from companion.navigation.field_step import Decision, NavState, arrived, follows_clear_path
from companion.navigation.turning_cost import with_turning_cost
from companion.planning.hybrid import Hybrid
from companion.planning.planner import Capabilities, Planner
from companion.planning.problem import Budget, Path, PlanningProblem, PlanResult
from companion.planning.raster import CellArray, cells_cost, plain
from companion.planning.smoothing import curve_cost
from companion.replay.replay import ReplayObserver
from companion.settings import Settings


@dataclass(frozen=True, eq=False, slots=True)
class Candidate:
    """A path that was considered. ``cost``: of its fields, inf without a path; ``curve_cost``: along its curve, if any.

    ``part_of``: the proposal of one planner within a search. ``problem``: what was asked, None where nothing was.
    """

    name: str
    note: str
    path: Path | None
    cost: float
    curve_cost: float | None = None
    part_of: bool = False
    problem: PlanningProblem | None = None


@dataclass(frozen=True, eq=False, slots=True)
class Explanation:
    """One decision, with what was known before it.

    ``ground``: the mission's own weights; ``grid``: with the obstacles seen so far; ``weighed``: with the cost of
    turning as well, which the search used. ``known``: the fields that had been seen. ``state``: the navigator's state
    before the step.
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
    motions: MotionChoice | None = None
    """None where no motions are planned, or none were before the next decision."""

    @property
    def problem(self) -> PlanningProblem | None:
        """What the last search was asked; None if nothing was searched."""
        return next((one.problem for one in reversed(self.candidates) if one.problem and not one.part_of), None)


@dataclass
class _Scene:
    """What is known at the beginning of a step."""

    pose: Pose
    state: NavState
    ground: Grid
    grid: Grid
    weighed: Grid
    known: NDArray[np.bool_]
    candidates: list[Candidate] = field(default_factory=list)


OnCandidate = Callable[[Candidate], None]


class DecisionExplainer(ReplayObserver):
    """Waits for one decision and keeps what led to it in ``explanation``, None until then.

    ``number``: which one; None for none. ``every`` is told each decision as soon as it is made, without motions.
    """

    def __init__(
        self,
        number: int | None,
        settings: Settings,
        turning_radius_m: float,
        every: Callable[[Explanation], None] | None = None,
    ) -> None:
        self.explanation: Explanation | None = None
        self._every = every
        self._number = number
        self._settings = settings
        self._turning_radius_m = turning_radius_m
        self._scene: _Scene | None = None
        self._before: MotionChoice | None = None
        self._open = False
        """Whether motions may still be added."""

    def step_begins(self, companion: Companion) -> None:
        """Note what is known, and wrap the planner to see its answers."""
        if self.explanation is None or self._every is not None:
            self._scene = self._noted(companion)
            driver = companion.driver
            assert driver is not None
            if not isinstance(driver.searcher.planner, _ObservedPlanner):
                driver.searcher.planner = _observed(driver.searcher.planner, self._add)

    def decided(self, companion: Companion, number: int, time_s: float, target: str, decision: Decision) -> None:
        """Keep it if it is the decision to explain."""
        self._open = False
        wanted = number == self._number and self.explanation is None
        scene = (self._scene or self._noted(companion)) if wanted or self._every is not None else None
        self._scene = None
        if scene is None:
            return
        rest = [] if scene.state.current is None else [_rest_of_path(scene)]
        explanation = Explanation(
            number, time_s, target, decision, scene.pose, scene.state, scene.ground, scene.grid, scene.weighed,
            scene.known, (*rest, *scene.candidates),
        )  # fmt: skip
        if wanted:
            self.explanation, self._before, self._open = explanation, _choice(companion), True
        if self._every is not None:
            self._every(explanation)

    def ticked(self, companion: Companion, time_s: float) -> None:
        """Keep the first motions that are judged after the decision."""
        if self._open and self.explanation is not None and _choice(companion) is not self._before:
            self.explanation = replace(self.explanation, motions=_choice(companion))
            self._open = False

    def _noted(self, companion: Companion) -> _Scene | None:
        driver, evidence, pose = companion.driver, companion.evidence, companion.status().pose
        state = None if driver is None else driver.nav_state
        if evidence is None or state is None or pose is None:
            return None
        grid = evidence.grid.with_weights(evidence.grid.weights.copy())
        weighed = with_turning_cost(grid, pose, self._settings.guidance, self._turning_radius_m)
        return _Scene(pose, state, evidence.base, grid, weighed, known_fields(evidence))

    def _add(self, candidate: Candidate) -> None:
        if self._scene is not None:
            self._scene.candidates.append(candidate)


def _choice(companion: Companion) -> MotionChoice | None:
    """The last choice of a controller that plans motions."""
    controller = None if companion.driver is None else companion.driver.controller
    return controller.choice if isinstance(controller, MotionController) else None


def _rest_of_path(scene: _Scene) -> Candidate:
    """The path that was being followed, from the present field on."""
    assert scene.state.current is not None
    here = arrived(scene.state, scene.grid.cell_at(scene.pose.point))
    beside = here.current is not None
    state = here if beside else scene.state
    assert state.current is not None
    ahead = state.current.cell_array[state.index :]
    note = "clear" if follows_clear_path(state, scene.grid) else "blocked"
    note = note if beside else f"{note}; the rover has left it"
    cost = cost_of(scene.weighed, ahead)
    return Candidate("what is left of the current path", note, Path(ahead, cost), cost)


def cost_of(grid: Grid, cells: CellArray) -> float:
    """Cost of a path on a grid, inf if it leaves the grid."""
    x, y = cells.T
    inside = len(cells) == 0 or (x.min() >= 0 and y.min() >= 0 and x.max() < grid.width and y.max() < grid.height)
    return float(cells_cost(plain(grid.weights), cells)) if inside else math.inf


class _ObservedPlanner:
    """A planner whose answers are passed on. ``part_of``: another planner calls it."""

    def __init__(self, planner: Planner, on_candidate: OnCandidate, *, part_of: bool) -> None:
        self._planner = planner
        self._on_candidate = on_candidate
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
        """The planner's answer, which is passed on."""
        result = self._planner.plan(problem, budget, rng)
        self._on_candidate(_candidate(problem, result, part_of=self._part_of))
        return result


def _observed(planner: Planner, on_candidate: OnCandidate) -> Planner:
    """The planner, with the planners that it calls."""
    if isinstance(planner, Hybrid):
        planner.genetic = _ObservedPlanner(planner.genetic, on_candidate, part_of=True)
        planner.graph = _ObservedPlanner(planner.graph, on_candidate, part_of=True)
    return _ObservedPlanner(planner, on_candidate, part_of=False)


def _candidate(problem: PlanningProblem, result: PlanResult, *, part_of: bool) -> Candidate:
    path = result.path
    work = f"{result.epochs} epochs, {result.evaluations} paths tried" if result.epochs else ""
    ends = f"field {problem.start[0]}, {problem.start[1]} to {problem.target[0]}, {problem.target[1]}"
    name = f"proposed by {result.planner}" if part_of else f"search by {result.planner}, {ends}"
    along = None if path is None or path.curve is None else float(curve_cost(plain(problem.weights), path.curve))
    note = ", ".join(part for part in (result.status.value, _whose(result), work) if part)
    return Candidate(name, note, path, math.inf if path is None else path.cost, along, part_of, problem)


def _whose(result: PlanResult) -> str:
    """Whose proposal ``hybrid`` answers with; empty for other planners and without a path."""
    if result.planner != Hybrid.name or result.path is None:
        return ""
    return "the genetic curve" if result.control_points else "the graph's path, made smooth"


def explanation_lines(why: Explanation) -> list[str]:
    """The explanation as text, line by line."""
    decision, pose = why.decision, why.pose
    here, goal = why.state.past[-1], why.state.target
    cell = why.grid.cell_at(pose.point)
    past = len(why.state.past)
    returning = ", going back along it" if why.state.returning else ""
    lines = [
        f"decision {why.number} at {why.time_s:.2f} s, heading for {why.target}: "
        f"{decision.action} (part {decision.part}): {decision.reason}",
        f"rover in field {cell.x}, {cell.y} (north {pose.north_m:.2f} m, east {pose.east_m:.2f} m, heading "
        f"{math.degrees(pose.heading_rad) % 360.0:.0f} deg), last step in {here.x}, {here.y}; "
        f"target field {goal.x}, {goal.y}; past path of {past} field{'s' * (past != 1)}{returning}",
        f"map: {why.grid.width} x {why.grid.height} fields of {why.grid.resolution_m:g} m, "
        f"{map_line(why.ground.weights >= OBSTACLE, why.grid.weights >= OBSTACLE, why.known)}",
    ]
    for candidate in why.candidates:
        lines.append(
            f"{'    ' if candidate.part_of else '  '}{candidate.name}: {cost_text(candidate)}; {candidate.note}"
        )
    if not why.candidates:
        lines.append("  nothing was searched, and there was no path to follow")
    if any(candidate.curve_cost is not None for candidate in why.candidates):
        lines.append(TWO_COSTS)
    if decision.path:
        lines.append(_shares(why, np.asarray(decision.path)))
    return lines if why.motions is None else [*lines, *motion_lines(why.motions)]


def map_line(closed: NDArray[np.bool_], barred: NDArray[np.bool_], known: NDArray[np.bool_]) -> str:
    """How much was seen of what the mission leaves open. A wide fence would make a small share of it.

    ``closed``: by fences or a map that was given; ``barred``: with obstacles seen so far, too.
    """
    others = int(np.count_nonzero(~closed))
    seen, obstacles = (int(np.count_nonzero(fields & ~closed)) for fields in (known, barred))
    shut = closed.size - others
    told = f"{shut} closed by fences or a given map; of the other {others}, " if shut else ""
    share = "less than 1%" if 0 < 100 * seen < others else f"{seen / max(others, 1):.0%}"
    return f"{told}{seen} are seen ({share}), {obstacles} are barred by obstacles"


RANKS = (0.0, 0.25, 0.5, 0.75, 1.0)
"""Shares of the motions, by cost, of which the last is shown."""


TWO_COSTS = (
    "  the cost from field to field decides between paths; that along the curve only between the two planners of hybrid"
)


def motion_lines(choice: MotionChoice) -> list[str]:
    """Motions that were judged, from the cheapest to the dearest, and what the controller made of the chosen one."""
    costs_s = choice.found.costs_s
    order, free = np.argsort(costs_s), int((costs_s < BLOCKED_S).sum())
    last = len(order) - 1
    lines = [
        f"motions: {len(order)} judged, {choice.problem.horizon_s:g} s long, {free} of them touch nothing, in the "
        "first tick after the decision; their cost: seconds until the end of the next metres of the path, and for risk"
    ]
    for share in RANKS:
        rank = round(share * last)
        lines.append(f"  {rank + 1:4d}. {_motion_text(choice, order[rank])}")
    told = choice.told
    lines.append(
        f"chosen: {_motion_cost_text(choice.found.cost_s)}; the controller's command: {told.speed_m_s:.2f} m/s, "
        f"{math.degrees(told.turn_rad_s):.0f} deg/s. Making way and the last look may send less: "
        "report --csv says what was sent"
    )
    if choice.ahead is not None:
        lines.append(f"a position ahead takes its place: it leads on faster, at {choice.ahead.speed_m_s:.2f} m/s")
    return lines


def _motion_text(choice: MotionChoice, one: int) -> str:
    """Cost, first and last command, and where a motion leads."""
    motion, cost_s = choice.found.judged[one], float(choice.found.costs_s[one])
    way = way_of(motion, choice.problem)
    far_m = float(np.hypot(*(way[-1] - way[0])))
    begins, ends = (f"{speed:.2f} m/s, {math.degrees(turn):.0f} deg/s" for speed, turn in motion[[0, -1]])
    return f"{_motion_cost_text(cost_s)}: begins with {begins}, ends with {ends}, {far_m:.1f} m away"


def _motion_cost_text(cost_s: float) -> str:
    return "touches something" if cost_s >= BLOCKED_S else f"cost {cost_s:.2f} s"


def cost_text(candidate: Candidate) -> str:
    """Cost and length of a candidate."""
    if candidate.path is None:
        return "no path"
    along = "" if candidate.curve_cost is None else f" ({candidate.curve_cost:.2f} along its curve)"
    return f"cost {candidate.cost:.2f} from field to field{along}, {candidate.path.length_fields:.1f} fields long"


def _shares(why: Explanation, cells: CellArray) -> str:
    """The parts of the cost of the path that was chosen."""
    ground, seen, whole = (cost_of(grid, cells) for grid in (why.ground, why.grid, why.weighed))
    return (
        f"taken: {len(cells)} fields, cost {whole:.2f} from field to field = {ground:.2f} ground + {seen - ground:.2f} "
        f"beside obstacles or remembered as costly + {whole - seen:.2f} for turning"
    )
