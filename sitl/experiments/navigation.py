"""Every planner in the navigator, through unknown ground, field by field: what better or faster planning achieves."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from rich.table import Table

from companion.bench.cases import Case, map_case
from companion.bench.movingai import ScenarioFileError
from companion.core.grid import BASE_WEIGHT, OBSTACLE, Cell, Grid, inflated
from companion.planning import registry
from companion.planning.problem import Budget, PlanningProblem
from companion.planning.registry import PLANNERS, make_planner
from companion.settings import PlannerSettings, Settings, parse_settings
from sitl.experiments import drawing
from sitl.experiments.experiment import (
    START,
    TARGET,
    Advance,
    ExperimentError,
    ExperimentReport,
    Options,
    each,
    load_maps,
    planners_of,
    where_measured,
)
from sitl.experiments.field_level import STEP_LIMIT, FieldRun, Outcome, measured_runs
from sitl.experiments.intervals import mean_with_interval, ratio_with_interval
from sitl.experiments.results_page import markdown_table, terminal_table, without_intervals
from sitl.generators.kinds import GroundKind
from sitl.generators.made_ground import made

NAME = "navigation"
MAPS = ("one-obstacle", "clutter", "rooms", "complex")
PROBLEMS = 10
"""Of each map that the user names; the first are trivial, the last the longest."""
RUNS_A_TASK = 5
KINDS = (GroundKind.CLUTTER, GroundKind.ROOMS, GroundKind.YARD, GroundKind.MAZE, GroundKind.FOREST)
MADE_FIELD_M = 0.5
"""Fields of made grounds; the rover, of ``MADE_RADIUS_M``, is a point on them, as obstacles are grown by as much."""
MADE_RADIUS_M = 0.35
CURVES = ("hybrid", "bspline-ga")
"""Planners that ask a genetic algorithm for curves."""
OURS, STEPS_REFERENCE, STEPS_FACTOR = "hybrid", "dstar-lite", 1.05
"""Aimed at: what drives by default takes no more steps than so many times this one's."""
SHOWN = {"hybrid": drawing.BLUE, "bspline-ga": drawing.ORANGE, "dstar-lite": drawing.GREEN, "theta-star": drawing.RED}


@dataclass(frozen=True, eq=False, slots=True)
class Ground:
    """One problem: a map nobody has told the navigator about, and what the best path would be if it knew.

    ``seed``: of a made ground, which is driven with this one only; None: driven with every seed.
    """

    name: str
    truth: Grid
    start: Cell
    target: Cell
    best_steps: int
    seed: int | None = None


@dataclass(frozen=True, slots=True)
class Series:
    """All runs of one planner on one map, or on all grounds of a kind. ``grounds``: on which each was."""

    planner: str
    map_name: str
    runs: tuple[FieldRun, ...]
    grounds: tuple[Ground, ...]

    @property
    def arrived(self) -> list[tuple[Ground, FieldRun]]:
        """Those that reached the target."""
        pairs = zip(self.grounds, self.runs, strict=True)
        return [(ground, one) for ground, one in pairs if one.outcome is Outcome.REACHED]

    @property
    def over(self) -> list[float]:
        """Steps of each run that arrived, over the least possible."""
        return [one.steps / ground.best_steps for ground, one in self.arrived]

    @property
    def reached(self) -> int:
        """Runs that arrived."""
        return sum(run.outcome is Outcome.REACHED for run in self.runs)

    def row(self, reference: Series | None) -> list[str]:
        """Figures for people. ``reference``: the runs to compare with, one on each ground."""
        steps_ms = 1e3 * np.concatenate([run.step_seconds for run in self.runs])
        searches, curves = (sum(getattr(run, name) for run in self.runs) for name in ("searches", "by_curves"))
        return [
            self.planner,
            f"{self.reached}/{len(self.runs)}",
            f"{np.median(self.over):.3f}" if self.over else "-",
            mean_with_interval(_of_grounds([ground for ground, _ in self.arrived], self.over), digits=3),
            self._ratio(reference),
            f"{np.mean([run.return_steps for run in self.runs]):.1f}",
            f"{np.median([run.searches for run in self.runs]):.0f}",
            f"{curves / searches:.2f}" if self.planner in CURVES and searches else "-",
            drawing.figures(float(np.median([1e3 * run.planning_s for run in self.runs]))),
            drawing.figures(float(np.percentile(steps_ms, 99))),
        ]

    def _ratio(self, reference: Series | None) -> str:
        """Steps over the reference's on the same grounds."""
        if reference is None or reference is self:
            return "-" if reference is None else "1"
        others = {ground: float(one.steps) for ground, one in reference.arrived}
        arrived = [(ground, one) for ground, one in self.arrived if ground in others]
        own, its = ([one.steps for _, one in arrived], [others[ground] for ground, _ in arrived])
        means = [_of_grounds([ground for ground, _ in arrived], values) for values in (own, its)]
        return ratio_with_interval(np.column_stack(means))


def _of_grounds(grounds: Sequence[Ground], values: Sequence[float]) -> list[float]:
    """Of runs on several grounds the mean on each, since the grounds were drawn; on a single one as they are."""
    of_ground: dict[Ground, list[float]] = {}
    for ground, value in zip(grounds, values, strict=True):
        of_ground.setdefault(ground, []).append(value)
    return list(values) if len(of_ground) == 1 else [float(np.mean(own)) for own in of_ground.values()]


HEAD = (
    "planner", "reached", "steps/best", "mean", f"/ {STEPS_REFERENCE}", "back", "searches", "by curves", "plan ms",
    "p99 ms",
)  # fmt: skip
SHORT = ("planner", "reached", "/best", "mean", "/ref", "back", "searches", "curves", "ms", "p99")


@dataclass(frozen=True)
class NavigationReport(ExperimentReport):
    """See ``ExperimentReport``."""

    name: ClassVar[str] = NAME
    options: Options
    grounds: tuple[Ground, ...]
    series: tuple[Series, ...]

    def tables(self) -> list[Table]:
        """One for each map, a row a planner; the last says what they are made of."""
        tables = [
            terminal_table(f"{NAME}: {name}", SHORT, without_intervals(self._rows(name))) for name in self._names()
        ]
        tables[-1].caption, tables[-1].caption_justify = (
            " ".join(self._runs_explained().replace("*", "").split()),
            "left",
        )
        return tables

    def as_json(self) -> dict[str, object]:
        """Every run's figures, in the order of their seeds."""
        return {
            "experiment": NAME,
            "seed": self.options.seed,
            "runs": self.options.runs,
            "step_limit": STEP_LIMIT,
            "results": [
                {
                    "planner": series.planner,
                    "map": series.map_name,
                    "outcomes": [run.outcome.value for run in series.runs],
                    "steps": [run.steps for run in series.runs],
                    "return_steps": [run.return_steps for run in series.runs],
                    "searches": [run.searches for run in series.runs],
                    "steps_over_best": series.over,
                    "by_curves": [run.by_curves for run in series.runs],
                    "planning_ms": [round(1e3 * run.planning_s, 4) for run in series.runs],
                }
                for series in self.series
            ],
        }

    def pictures(self) -> dict[str, Figure]:
        """See ``ExperimentReport``."""
        return {NAME: self._draw()}

    def _runs_explained(self) -> str:
        """How many runs a row is made of; column names between asterisks."""
        runs, first = self.options.runs, self.options.seed
        many = "1 run, with seed" if runs == 1 else f"{runs} runs, with seeds {first} to"
        return f"""*reached* counts the runs that arrived, of all that were made: on each map {many}
{first + runs - 1}, of planners that draw random numbers, and 1 of others, whose run is always the same; on each made
ground 1 run. A planner whose
searches may end without a path or a proof (prm, achour and the genetic algorithms) sends the rover back when its budget
is spent, which shows in *back*, and may give up a target that can be reached."""

    def _names(self) -> list[str]:
        return list(dict.fromkeys(ground.name for ground in self.grounds))

    def _rows(self, name: str) -> list[list[str]]:
        own = [series for series in self.series if series.map_name == name]
        reference = next((series for series in own if series.planner == STEPS_REFERENCE), None)
        return [series.row(reference) for series in own]

    def _draw(self) -> Figure:
        figure, panels = drawing.four_panels(11.0, 6.6)
        for panel, name in zip(panels, MAPS, strict=True):
            ground = next(ground for ground in self.grounds if ground.name == name)
            drawing.draw_map(panel, ground.truth)
            for planner, colour in SHOWN.items():
                for series in self.series:
                    if (series.planner, series.map_name) == (planner, name):
                        typical = sorted(series.runs, key=lambda run: (run.steps, run.seed))[len(series.runs) // 2]
                        panel.plot(*np.array(typical.track, float).T, color=colour, linewidth=1.6, alpha=0.85)
            drawing.draw_ends(panel, ground.start, ground.target)
            drawing.title(panel, name)
        driven = {series.planner for series in self.series}
        shown = {planner: colour for planner, colour in SHOWN.items() if planner in driven}
        handles = [Line2D([], [], color=colour, linewidth=2.0, label=planner) for planner, colour in shown.items()]
        figure.legend(handles=handles, loc="outside lower center", ncols=len(handles), frameon=False)
        return figure

    def section(self) -> str:
        """See ``ExperimentReport``."""
        tables = "\n\n".join(f"{name}:\n\n{markdown_table(HEAD, self._rows(name))}" for name in self._names())
        return f"""## Every planner inside the navigator

`{self.options.command(NAME)}`

The four maps of the section on unknown maps, and *made* grounds: random worlds of 44 m x 32 m on fields of
{MADE_FIELD_M:g} m, another one for each seed, the same for all planners. They are driven field by field as there (at
most {STEP_LIMIT} steps), each time with another planner in the navigator. *steps/best* is the median (then the mean) of
the steps over those of a shortest path for somebody who knows the map; */ {STEPS_REFERENCE}* the mean steps over that
planner's on the same grounds; in brackets 95 % intervals, by resampling runs, or grounds where there are several;
*back* the mean number of steps in return mode; *by curves* the share of searches that the genetic algorithm answered
with a curve of its own, and not a graph search; *plan* the median of all planning of one run together, *p99* of single
calls of the navigator's step, searches included, in milliseconds. {self._runs_explained()}

{tables}

{shortfalls(self.series)}

Measured on {where_measured()}.

![Typical paths](images/{NAME}.png)
"""


def shortfalls(series: tuple[Series, ...]) -> str:
    """What was aimed at, and every map where it is not reached, in words; empty if one of the two was not compared."""
    own = {(s.planner, s.map_name): s for s in series}
    pairs = [(one, own.get((STEPS_REFERENCE, one.map_name))) for one in series if one.planner == OURS]
    ratios = {a.map_name: float(np.median(a.over) / np.median(b.over)) for a, b in pairs if b and a.over and b.over}
    if not ratios:
        return ""
    missed = [f"{name} ({ratio:.3f})" for name, ratio in ratios.items() if ratio > STEPS_FACTOR]
    verdict = f"not reached: {', '.join(missed)}" if missed else "reached"
    return (
        f"Aimed at: median steps of `{OURS}` at most {STEPS_FACTOR:g} times those of `{STEPS_REFERENCE}` ({verdict})."
    )


def run(options: Options, advance: Advance) -> NavigationReport:
    """Make all runs. The result (but for times) does not depend on ``jobs``."""
    planners, given = planners_of(options, PLANNERS), list(_given_grounds(options))  # first: they may be refused
    grounds = [*_paper_grounds(options), *_made_grounds(options), *given]
    registry.warm_up(planners)
    tasks = []
    for ground in grounds:
        for planner in planners:
            random = make_planner(planner, PlannerSettings()).capabilities.random
            seeds = range(options.seed, options.seed + (options.runs if random else 1))
            seeds = seeds if ground.seed is None else range(ground.seed, ground.seed + 1)
            tasks += [(planner, ground, seeds[at : at + RUNS_A_TASK]) for at in range(0, len(seeds), RUNS_A_TASK)]
    keys = [(planner, ground.name) for ground in grounds for planner in planners]
    collected: dict[tuple[str, str], list[tuple[FieldRun, Ground]]] = {key: [] for key in keys}
    calls = (
        (ground.truth, ground.start, ground.target, settings_with(planner), seeds) for planner, ground, seeds in tasks
    )
    results = each(options.jobs, measured_runs, calls)
    for done, ((planner, ground, _), runs) in enumerate(zip(tasks, results, strict=True), start=1):
        collected[planner, ground.name] += [(one, ground) for one in runs]
        advance(done, len(tasks))
    return NavigationReport(options, tuple(grounds), tuple(_series(*key, runs) for key, runs in collected.items()))


def _series(planner: str, name: str, runs: list[tuple[FieldRun, Ground]]) -> Series:
    return Series(planner, name, tuple(one for one, _ in runs), tuple(ground for _, ground in runs))


def _paper_grounds(options: Options) -> Iterable[Ground]:
    for name, grid in load_maps(options.maps, MAPS).items():
        yield from _grounds(Case(name, 1, grid.weights, ((START, TARGET),)))


def _made_grounds(options: Options) -> Iterable[Ground]:
    """Random worlds, one of each kind for each seed."""
    for kind in KINDS:
        for seed in range(options.seed, options.seed + options.runs):
            ground = made(kind, seed)
            fine_m, solid = ground.world.resolution_m, ground.world.obstacles
            grown = inflated(np.where(solid, OBSTACLE, BASE_WEIGHT), MADE_RADIUS_M / fine_m)
            pieces = round(MADE_FIELD_M / fine_m)
            # What lies under a field's middle: so a door that the rover fits through stays open.
            weights = np.ascontiguousarray(grown[pieces // 2 :: pieces, pieces // 2 :: pieces])
            start, goal = (
                Cell(int(east_m / MADE_FIELD_M), int(north_m / MADE_FIELD_M))
                for north_m, east_m in (ground.start_m, ground.goal_m)
            )
            yield from _grounds(Case(f"made {kind}", 1, weights, ((start, goal),)), seed)


def _given_grounds(options: Options) -> Iterable[Ground]:
    for file in options.worlds:
        try:
            yield from _grounds(map_case(file, PROBLEMS))
        except ScenarioFileError as error:
            raise ExperimentError(str(error)) from error


def _grounds(case: Case, seed: int | None = None) -> Iterable[Ground]:
    """The problems of a map that have a solution."""
    graph = make_planner("dijkstra", PlannerSettings())
    for start, target in case.ends:
        problem = PlanningProblem(case.weights, start, target)
        best = graph.plan(problem, Budget(), np.random.default_rng(0)).path
        if best is not None and len(best.cell_array) > 1:
            yield Ground(case.name, Grid(case.weights, 1.0), start, target, len(best.cell_array) - 1, seed)


def settings_with(planner: str) -> Settings:
    """The defaults with another planner in the navigator."""
    return parse_settings({"navigator": {"planner": planner}}, "experiment")
