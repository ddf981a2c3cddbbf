"""Does the genetic algorithm do better when it chooses the number of control points itself? Success against epochs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray
from rich.table import Table

from companion.core.clock import stopwatch_s
from companion.planning.problem import Budget, PlanningProblem
from companion.planning.registry import make_planner, warm_up
from companion.settings import PlannerSettings
from sitl.experiments import drawing
from sitl.experiments.experiment import START, TARGET, Advance, ExperimentReport, Options, load_maps, where_measured
from sitl.experiments.results_page import markdown_table, terminal_table

NAME = "adaptive-control-points"
TITLES = {"known-1": "Map 1", "known-2": "Map 2", "known-3": "Map 3", "known-4": "Map 4"}
EPOCHS = 500
NUMBERS = (4, 5, 6, 8, 10)


@dataclass(frozen=True, slots=True)
class Way:
    """A way to come to a number of control points, with EPOCHS epochs in all."""

    budget: Budget
    adaptive: bool
    colour: str


WAYS = {
    "always 4": Way(Budget(1, EPOCHS, (4,)), False, drawing.GREY),
    "in turn": Way(Budget(1, EPOCHS // len(NUMBERS), NUMBERS), False, drawing.ORANGE),
    "adaptive": Way(Budget(1, EPOCHS // len(NUMBERS), NUMBERS), True, drawing.BLUE),
}


@dataclass(frozen=True, slots=True)
class Search:
    """One search; ``epochs`` None: nothing found."""

    time_ms: float
    epochs: int | None = None
    control_points: int = 0
    cost: float = 0.0


@dataclass(frozen=True, slots=True)
class Entry:
    """All searches of one way on one map."""

    map_name: str
    way: str
    searches: tuple[Search, ...]

    @property
    def successes(self) -> tuple[Search, ...]:
        """Those that found a path."""
        return tuple(search for search in self.searches if search.epochs is not None)

    def share_within(self, epochs: NDArray[np.int64]) -> NDArray[np.float64]:
        """The share of all searches that had found a path after so many epochs."""
        needed = np.array([search.epochs for search in self.successes], np.int64)
        return np.asarray((needed[None, :] <= epochs[:, None]).sum(axis=1) / len(self.searches), np.float64)


HEAD = ("control points", "found", "epochs", "p90", "number", "cost", "ms")


@dataclass(frozen=True)
class AdaptiveReport(ExperimentReport):
    """See ``ExperimentReport``."""

    name: ClassVar[str] = NAME
    options: Options
    entries: tuple[Entry, ...]

    def tables(self) -> list[Table]:
        """One for each map, a row a way."""
        return [terminal_table(f"{NAME}, {title}", HEAD, self._rows(name)) for name, title in TITLES.items()]

    def as_json(self) -> dict[str, object]:
        """Every search; epochs None where nothing was found."""
        return {
            "experiment": NAME,
            "runs": self.options.runs,
            "seed": self.options.seed,
            "epochs": EPOCHS,
            "results": [
                {
                    "map": entry.map_name,
                    "control_points": entry.way,
                    "found": len(entry.successes),
                    "epochs": [search.epochs for search in entry.searches],
                    "numbers": [search.control_points for search in entry.successes],
                    "costs": [search.cost for search in entry.successes],
                    "times_ms": [search.time_ms for search in entry.searches],
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

    def _rows(self, map_name: str) -> list[list[str]]:
        return [_row(entry) for entry in self.entries if entry.map_name == map_name]

    def _draw(self) -> Figure:
        figure, panels = drawing.four_panels(9.5, 6.0)
        epochs = np.arange(1, EPOCHS + 1)
        for panel, (name, title) in zip(panels, TITLES.items(), strict=True):
            for entry in self.entries:
                if entry.map_name == name:
                    panel.plot(epochs, 100.0 * entry.share_within(epochs), color=WAYS[entry.way].colour, linewidth=2.0)
            panel.set_xscale("log")
            panel.set_ylim(-3.0, 103.0)
            panel.set_xlabel("epochs", fontsize=8)
            panel.set_ylabel("searches with a path, %", fontsize=8)
            drawing.title(panel, title)
        handles = [Line2D([], [], color=way.colour, linewidth=2.0, label=name) for name, way in WAYS.items()]
        figure.legend(handles=handles, loc="outside lower center", ncols=len(WAYS), frameon=False)
        return figure


def run(options: Options, advance: Advance) -> AdaptiveReport:
    """Make all searches, one after the other (they are timed): ``jobs`` does not count."""
    maps = load_maps(options.maps, tuple(TITLES))
    warm_up()
    entries: list[Entry] = []
    for map_name, grid in maps.items():
        problem = PlanningProblem(grid.weights, START, TARGET)
        for name, way in WAYS.items():
            seeds = range(options.seed, options.seed + options.runs)
            entries.append(Entry(map_name, name, tuple(_searched(way, problem, seed) for seed in seeds)))
            advance(len(entries), len(maps) * len(WAYS))
    return AdaptiveReport(options, tuple(entries))


def _searched(way: Way, problem: PlanningProblem, seed: int) -> Search:
    planner = make_planner("bspline-ga", PlannerSettings(adaptive=way.adaptive))
    rng = np.random.default_rng(seed)
    began_s = stopwatch_s()
    result = planner.plan(problem, way.budget, rng)
    time_ms = 1e3 * (stopwatch_s() - began_s)
    if result.path is None:
        return Search(time_ms)
    return Search(time_ms, result.epochs, result.control_points, result.path.cost)


def _row(entry: Entry) -> list[str]:
    done = entry.successes
    found = f"{len(done)}/{len(entry.searches)}"
    time = drawing.figures(float(np.median([search.time_ms for search in entry.searches])))
    if not done:
        return [entry.way, found, "", "", "", "", time]
    epochs = np.array([search.epochs for search in done], float)
    numbers = f"{np.mean([search.control_points for search in done]):.1f}"
    cost = f"{np.median([search.cost for search in done]):.1f}"
    return [entry.way, found, f"{np.median(epochs):.0f}", f"{np.percentile(epochs, 90):.0f}", numbers, cost, time]


def _section(report: AdaptiveReport) -> str:
    tables = "\n\n".join(f"{title}:\n\n{markdown_table(HEAD, report._rows(name))}" for name, title in TITLES.items())
    return f"""## Control points that adapt (our extension)

`{report.options.command(NAME)}`

The B-spline genetic algorithm from {tuple(START)} to {tuple(TARGET)} on the known maps, no corner cutting, population
30, {EPOCHS} epochs in all: with 4 control points always; with {", ".join(map(str, NUMBERS))} in turn,
{EPOCHS // len(NUMBERS)} epochs each, which is how the paper goes on after a failure; and with a number that is part of
the chromosome and is bred with it (`planner.adaptive`), in searches of as many epochs that begin with these numbers to
twice as many. Epochs (median, 90th percentile), number of control points (mean) and cost (median) are those of the
searches that found a path; ms is the median of all.

{tables}

Measured on {where_measured()}.

![Success against epochs](images/{NAME}.png)
"""
