"""Kwasniewski & Gosiewski 2018, Table 1: four known maps, Dijkstra and three settings of the genetic algorithm."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from rich.table import Table

from companion.core.clock import stopwatch_s
from companion.core.grid import Grid
from companion.planning import problem as planning
from companion.planning.planner import Planner
from companion.planning.problem import Budget, PlanningProblem
from companion.planning.registry import make_planner, warm_up
from companion.settings import PlannerSettings
from sitl.experiments import drawing
from sitl.experiments.experiment import START, TARGET, Advance, ExperimentReport, Options, load_maps, where_measured
from sitl.experiments.plain_dijkstra import least_cost
from sitl.experiments.results_page import markdown_table, terminal_table

NAME = "kwasniewski-table1"
TITLES = {"known-1": "Map 1", "known-2": "Map 2", "known-3": "Map 3", "known-4": "Map 4"}
SHOWN = 3
"""The paper gives three times for each setting and map."""

PLAIN, DIJKSTRA = "Dijkstra (Python)", "Dijkstra"
BUDGETS = {
    "GA 1": Budget(1, 500, (4,), 40),
    "GA 2": Budget(1, 500, (4,), 100),
    "GA 3": Budget(1, 500, (5,), 100),
}
FIVE = "GA 3, 5 points"
"""GA 3 with the five way points of the paper's text, where ours has seven."""
NOT_FOUND = "N.F."

PAPER_S: dict[str, dict[str, tuple[float | None, ...]]] = {
    "known-1": {
        DIJKSTRA: (43.06, 46.73, 44.02),
        "GA 1": (0.03, 0.03, 0.03),
        "GA 2": (0.07, 0.08, 0.07),
        "GA 3": (0.08, 0.08, 0.08),
    },
    "known-2": {
        DIJKSTRA: (42.51, 42.37, 42.24),
        "GA 1": (0.21, 0.10, 0.18),
        "GA 2": (0.07, 0.14, 0.14),
        "GA 3": (0.15, 0.15, 0.15),
    },
    "known-3": {
        DIJKSTRA: (42.29, 42.73, 47.78),
        "GA 1": (1.10, 0.77, None),
        "GA 2": (3.42, 2.10, 0.77),
        "GA 3": (0.59, 0.59, 1.37),
    },
    "known-4": {
        DIJKSTRA: (41.29, 39.54, 40.06),
        "GA 1": (None, None, None),
        "GA 2": (None, None, None),
        "GA 3": (None, None, None),
    },
}
"""Table 1 as printed: seconds in Python 3.6 on the authors' computer; None = not found."""


SearchCall = Callable[[int], tuple[planning.Path | None, float | None]]
"""Search once with this seed: the path, where there is one to show, and its cost, None where nothing was found."""


@dataclass(frozen=True, slots=True)
class Trial:
    """One search: its time, and what it found (None: nothing)."""

    time_ms: float
    path: planning.Path | None = None
    cost: float | None = None


@dataclass(frozen=True, slots=True)
class Entry:
    """All searches of one method on one map."""

    map_name: str
    method: str
    trials: tuple[Trial, ...]

    @property
    def found(self) -> int:
        """Searches that found a path."""
        return sum(trial.cost is not None for trial in self.trials)

    @property
    def median_ms(self) -> float:
        """Median time of all searches, successful or not."""
        return float(np.median([trial.time_ms for trial in self.trials]))

    def first_times(self) -> str:
        """The first three times as the paper gives them."""
        return " ".join(
            f"{drawing.figures(t.time_ms)}" if t.cost is not None else NOT_FOUND for t in self.trials[:SHOWN]
        )


@dataclass(frozen=True)
class TableReport(ExperimentReport):
    """See ``ExperimentReport``."""

    name: ClassVar[str] = NAME
    options: Options
    maps: dict[str, Grid]
    entries: tuple[Entry, ...]

    def tables(self) -> list[Table]:
        """One for each map, a row a method."""
        return [
            terminal_table(
                f"{NAME}, {TITLES[name]}", HEAD, [_row(entry) for entry in self.entries if entry.map_name == name]
            )
            for name in self.maps
        ]

    def as_json(self) -> dict[str, object]:
        """Times in milliseconds, None where nothing was found; the paper's in seconds."""
        return {
            "experiment": NAME,
            "runs": self.options.runs,
            "seed": self.options.seed,
            "start": list(START),
            "target": list(TARGET),
            "results": [
                {
                    "map": entry.map_name,
                    "method": entry.method,
                    "tried": len(entry.trials),
                    "found": entry.found,
                    "median_ms": entry.median_ms,
                    "first_ms": [t.time_ms if t.cost is not None else None for t in entry.trials[:SHOWN]],
                    "costs": [trial.cost for trial in entry.trials],
                    "paper_s": list(PAPER_S[entry.map_name].get(entry.method, ())),
                }
                for entry in self.entries
            ],
        }

    def pictures(self) -> dict[str, Figure]:
        """See ``ExperimentReport``."""
        return {NAME: self._draw()}

    def section(self) -> str:
        """See ``ExperimentReport``."""
        return _section(self)

    def _draw(self) -> Figure:
        figure, panels = drawing.four_panels(11.0, 6.6)
        colours = {DIJKSTRA: drawing.GREY, "GA 3": drawing.BLUE}
        for panel, (name, grid) in zip(panels, self.maps.items(), strict=True):
            drawing.draw_map(panel, grid)
            notes = []
            for method, colour in colours.items():
                entry = next(e for e in self.entries if (e.map_name, e.method) == (name, method))
                path = next((trial.path for trial in entry.trials if trial.path is not None), None)
                notes.append(f"{method} {f'{entry.median_ms:.2g} ms' if entry.found else 'finds nothing'}")
                if path is not None:
                    panel.plot(*path.cell_array.T, color=colour, linewidth=2.0, alpha=0.9)
            drawing.draw_ends(panel, START, TARGET)
            drawing.title(panel, f"{TITLES[name]}: {', '.join(notes)}")
        handles = [Line2D([], [], color=colour, linewidth=2.0, label=method) for method, colour in colours.items()]
        figure.legend(handles=handles, loc="outside lower center", ncols=2, frameon=False)
        return figure


HEAD = ("method", "first 3, ms", "median", "found", "paper's 3, s")


def run(options: Options, advance: Advance) -> TableReport:
    """Make all searches, one after the other (they are timed): ``jobs`` does not count."""
    maps = load_maps(options.maps, tuple(TITLES))
    warm_up()
    settings = PlannerSettings()
    entries = []
    for name, grid in maps.items():
        problem = PlanningProblem(grid.weights, START, TARGET, corner_cutting=True)
        seeds = range(options.seed, options.seed + max(options.runs, SHOWN))
        entries.append(Entry(name, PLAIN, _timed(_plain(problem), seeds[:SHOWN])))
        dijkstra = make_planner("dijkstra", settings)
        entries.append(Entry(name, DIJKSTRA, _timed(_planned(dijkstra, problem, Budget()), seeds)))
        genetic = make_planner("bspline-ga", settings)
        for method, budget in BUDGETS.items():
            entries.append(Entry(name, method, _timed(_planned(genetic, problem, budget), seeds)))
            advance(sum(e.method in BUDGETS for e in entries), len(BUDGETS) * len(maps))
        five = make_planner("bspline-ga", settings.model_copy(update={"span_way_points": 0}))
        entries.append(Entry(name, FIVE, _timed(_planned(five, problem, BUDGETS["GA 3"]), seeds)))
    return TableReport(options, maps, tuple(entries))


def _timed(call: SearchCall, seeds: range) -> tuple[Trial, ...]:
    trials = []
    for seed in seeds:
        began_s = stopwatch_s()
        path, cost = call(seed)
        trials.append(Trial(1e3 * (stopwatch_s() - began_s), path, cost))
    return tuple(trials)


def _planned(planner: Planner, problem: PlanningProblem, budget: Budget) -> SearchCall:
    def call(seed: int) -> tuple[planning.Path | None, float | None]:
        path = planner.plan(problem, budget, np.random.default_rng(seed)).path
        return path, None if path is None else path.cost

    return call


def _plain(problem: PlanningProblem) -> SearchCall:
    def call(seed: int) -> tuple[planning.Path | None, float | None]:
        del seed
        cost = least_cost(problem.weights, problem.start, problem.target)
        return None, None if cost == math.inf else cost

    return call


def _paper_times(entry: Entry) -> str:
    times = PAPER_S[entry.map_name].get(entry.method)
    return "" if times is None else " ".join(NOT_FOUND if t is None else f"{t:.2f}" for t in times)


def _row(entry: Entry) -> list[str]:
    return [
        entry.method,
        entry.first_times(),
        drawing.figures(entry.median_ms),
        f"{entry.found}/{len(entry.trials)}",
        _paper_times(entry),
    ]


def _ratios(report: TableReport) -> tuple[float, float]:
    """Median of Dijkstra over that of GA 1 on the first map: in the paper, and here."""
    paper = PAPER_S["known-1"]
    theirs = float(np.median(np.array(paper[DIJKSTRA], float)) / np.median(np.array(paper["GA 1"], float)))
    here = {entry.method: entry.median_ms for entry in report.entries if entry.map_name == "known-1"}
    return theirs, here[DIJKSTRA] / here["GA 1"]


def _found_in_maze(report: TableReport) -> str:
    entries = [entry for entry in report.entries if entry.map_name == "known-4" and entry.method in BUDGETS]
    return f"{sum(entry.found for entry in entries)} of {sum(len(entry.trials) for entry in entries)}"


def _section(report: TableReport) -> str:
    theirs, ours = _ratios(report)
    tables = "\n\n".join(
        f"{TITLES[name]}:\n\n{markdown_table(HEAD, [_row(e) for e in report.entries if e.map_name == name])}"
        for name in report.maps
    )
    return f"""## Known maps (Kwaśniewski & Gosiewski 2018, Table 1)

`{report.options.command(NAME)}`

From {tuple(START)} to {tuple(TARGET)} on known maps of 100 x 50 fields. GA 1: population 40, 4 control points; GA 2:
population 100, 4 control points; GA 3: population 100, 5 control points; all with 1 to 500 epochs. A curve is looked at
in 5 way points, with 5 control points in 7; *{FIVE}*: in 5 there, too, as the paper's text has it. {NOT_FOUND} means
that the budget was spent without a path. Mind the units: **milliseconds here, seconds in the paper**.

{tables}

Measured on {where_measured()}. Times here and there cannot be compared one to one: the paper's programs are Python 3.6
on a computer that is not named, ours are compiled (the row in plain Python shows how much of the paper's 40 s belongs
to its implementation). What can be compared: on map 1 the paper's Dijkstra takes {theirs:.0f} times as long as its GA
1, ours {ours:.1f} times; on map 4 the paper's three settings found a path in 0 of 9 runs, ours in
{_found_in_maze(report)}.

![The four maps](images/{NAME}.png)

The paper's maps are not available as data; ours (`missions/maps/known-1` to `known-4`) are drawn to fit its text:
complexity grows from one simple obstacle to a maze. As in the paper, and unlike everywhere else in this project, paths
may cut an obstacle's corner here.
"""
