"""Every planner in the navigator, through unknown ground, field by field: what better or faster planning achieves."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from rich.table import Table

from companion.bench.cases import Case, map_case
from companion.bench.movingai import ScenarioFileError
from companion.core.grid import Cell, Grid
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
from sitl.experiments.results_page import markdown_table, terminal_table

NAME = "navigation"
MAPS = ("one-obstacle", "clutter", "rooms", "complex")
PROBLEMS = 10
"""Of each map that the user names; the first are trivial, the last the longest."""
RUNS_A_TASK = 5
OURS, STEPS_REFERENCE, STEPS_FACTOR = "hybrid", "dstar-lite", 1.05
"""Aimed at: what drives by default takes no more steps than so many times this one's."""
SHOWN = {"hybrid": drawing.BLUE, "bspline-ga": drawing.ORANGE, "dstar-lite": drawing.GREEN, "theta-star": drawing.RED}


@dataclass(frozen=True, eq=False, slots=True)
class Ground:
    """One problem: a map nobody has told the navigator about, and what the best path would be if it knew."""

    name: str
    truth: Grid
    start: Cell
    target: Cell
    best_steps: int


@dataclass(frozen=True, slots=True)
class Series:
    """All runs of one planner on one map. ``over``: steps of each run that arrived, over the least possible."""

    planner: str
    map_name: str
    runs: tuple[FieldRun, ...]
    over: tuple[float, ...]

    @property
    def reached(self) -> int:
        """Runs that arrived."""
        return sum(run.outcome is Outcome.REACHED for run in self.runs)

    def row(self) -> list[str]:
        """Figures for people."""
        steps_ms = 1e3 * np.concatenate([run.step_seconds for run in self.runs])
        return [
            self.planner,
            f"{self.reached}/{len(self.runs)}",
            f"{np.median(self.over):.3f}" if self.over else "-",
            f"{np.mean(self.over):.3f}" if self.over else "-",
            f"{np.mean([run.return_steps for run in self.runs]):.1f}",
            f"{np.median([run.searches for run in self.runs]):.0f}",
            drawing.figures(float(np.median([1e3 * run.planning_s for run in self.runs]))),
            drawing.figures(float(np.percentile(steps_ms, 99))),
        ]


HEAD = ("planner", "reached", "steps/best", "mean", "back", "searches", "plan ms", "p99 ms")


@dataclass(frozen=True)
class NavigationReport(ExperimentReport):
    """See ``ExperimentReport``."""

    name: ClassVar[str] = NAME
    options: Options
    grounds: tuple[Ground, ...]
    series: tuple[Series, ...]

    def tables(self) -> list[Table]:
        """One for each map, a row a planner; the last says what they are made of."""
        tables = [terminal_table(f"{NAME}: {name}", HEAD, self._rows(name)) for name in self._names()]
        tables[-1].caption, tables[-1].caption_justify = self._runs_explained().replace("*", ""), "left"
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
                    "steps_over_best": list(series.over),
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
        made = "1 run, with seed" if runs == 1 else f"{runs} runs, with seeds {first} to"
        return f"""*reached* counts the runs that arrived, of all that were made: on each problem {made}
{first + runs - 1}, of planners that draw random numbers, and 1 of others, whose run is always the same. A planner whose
searches may end without a path or a proof (prm, achour and the genetic algorithms) sends the rover back when its budget
is spent, which shows in *back*, and may give up a target that can be reached."""

    def _names(self) -> list[str]:
        return list(dict.fromkeys(ground.name for ground in self.grounds))

    def _rows(self, name: str) -> list[list[str]]:
        return [series.row() for series in self.series if series.map_name == name]

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

The four maps of the section on unknown maps, driven field by field as there (at most {STEP_LIMIT} steps), each time
with another planner in the navigator. *steps/best* is the median (then the mean) of the steps over those of a shortest
path for somebody who knows the map; *back* the mean number of steps in return mode; *plan* the median of all planning
of one run together, *p99* of single calls of the navigator's step, searches included, in milliseconds.
{self._runs_explained()}

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
    grounds = (*_paper_grounds(options), *_given_grounds(options))
    planners = planners_of(options, PLANNERS)
    registry.warm_up(planners)
    keys = [(planner, ground) for ground in grounds for planner in planners]
    tasks = []
    for planner, ground in keys:
        random = make_planner(planner, PlannerSettings()).capabilities.random
        seeds = range(options.seed, options.seed + (options.runs if random else 1))
        tasks += [(planner, ground, seeds[at : at + RUNS_A_TASK]) for at in range(0, len(seeds), RUNS_A_TASK)]
    collected: dict[tuple[str, str], list[tuple[FieldRun, int]]] = {(p, g.name): [] for p, g in keys}
    calls = (
        (ground.truth, ground.start, ground.target, settings_with(planner), seeds) for planner, ground, seeds in tasks
    )
    made = each(options.jobs, measured_runs, calls)
    for done, ((planner, ground, _), runs) in enumerate(zip(tasks, made, strict=True), start=1):
        collected[planner, ground.name] += [(one, ground.best_steps) for one in runs]
        advance(done, len(tasks))
    return NavigationReport(options, grounds, tuple(_series(*key, runs) for key, runs in collected.items()))


def _series(planner: str, name: str, runs: list[tuple[FieldRun, int]]) -> Series:
    over = tuple(one.steps / best for one, best in runs if one.outcome is Outcome.REACHED)
    return Series(planner, name, tuple(one for one, _ in runs), over)


def _paper_grounds(options: Options) -> Iterable[Ground]:
    for name, grid in load_maps(options.maps, MAPS).items():
        yield from _grounds(Case(name, 1, grid.weights, ((START, TARGET),)))


def _given_grounds(options: Options) -> Iterable[Ground]:
    for file in options.worlds:
        try:
            yield from _grounds(map_case(file, PROBLEMS))
        except ScenarioFileError as error:
            raise ExperimentError(str(error)) from error


def _grounds(case: Case) -> Iterable[Ground]:
    """The problems of a map that have a solution."""
    graph = make_planner("dijkstra", PlannerSettings())
    for start, target in case.ends:
        problem = PlanningProblem(case.weights, start, target)
        best = graph.plan(problem, Budget(), np.random.default_rng(0)).path
        if best is not None and len(best.cell_array) > 1:
            yield Ground(case.name, Grid(case.weights, 1.0), start, target, len(best.cell_array) - 1)


def settings_with(planner: str) -> Settings:
    """The defaults with another planner in the navigator."""
    return parse_settings({"navigator": {"planner": planner}}, "experiment")
