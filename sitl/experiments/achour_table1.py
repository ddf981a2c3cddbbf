"""Achour & Chaalal 2011, Table I: four environments of growing complexity, the genetic algorithm and the roadmap."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import Any, ClassVar

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from rich.table import Table

from companion.core.grid import Grid
from companion.planning.problem import PlanningProblem
from companion.planning.registry import warm_up
from sitl.experiments import drawing
from sitl.experiments.achour_environments import FIELDS_A_METRE, OBSTACLES, START_M, TARGET_M, environments
from sitl.experiments.achour_trials import (
    GENETIC,
    LINES,
    METHODS,
    ROADMAP,
    SETTINGS,
    Trial,
    length_m,
    make_trials,
    samples_of,
)
from sitl.experiments.experiment import Advance, ExperimentReport, Options, where_measured
from sitl.experiments.results_page import markdown_table, terminal_table

NAME = "achour-table1"


@dataclass(frozen=True, slots=True)
class Printed:
    """A cell of the paper's table I: N and T. ``tries``: attempts until success, where the text gives them."""

    number: int
    time_s: float
    tries: int | None = None


PAPER = {
    ("1", GENETIC): Printed(34, 20.02),
    ("2", GENETIC): Printed(38, 23.85),
    ("3", GENETIC): Printed(41, 21.96),
    ("4", GENETIC): Printed(70, 24.02, tries=5),
    ("1", ROADMAP): Printed(500, 118.90),
    ("2", ROADMAP): Printed(1015, 122.63),
    ("3", ROADMAP): Printed(1634, 168.92),
    ("4", ROADMAP): Printed(2043, 168.36),
}
"""As printed, M = 500 everywhere; the five tries are in section VII."""

COLUMNS = ("number", "time_ms", "path_nodes", "length_m", "straight_nodes", "straight_m")
HEAD = ("method", "found", "at once", "N", "time", "nodes", "m", "straight", "m")


@dataclass(frozen=True, slots=True)
class Entry:
    """All searches of one method in one environment."""

    environment: str
    method: str
    trials: tuple[Trial, ...]

    @property
    def found(self) -> list[Trial]:
        """Those that found a path."""
        return [trial for trial in self.trials if trial.found]

    @property
    def at_once(self) -> int:
        """How many found it without a second attempt or extra samples."""
        return sum(trial.at_once for trial in self.trials)

    @property
    def attempt_success(self) -> float:
        """Which share of all attempts ended at the target."""
        return len(self.found) / sum(trial.attempts for trial in self.trials)

    @property
    def example(self) -> Trial | None:
        """The search of median length among those that succeeded at once, or else among all that succeeded."""
        ranked = sorted(self.found, key=lambda trial: (not trial.at_once, length_m(trial.straight), trial.seed))
        return ranked[(self.at_once or len(ranked)) // 2] if ranked else None

    def figures(self) -> dict[str, float | None]:
        """Medians: of the time over all searches, else over those that found a path (None: there are none)."""
        columns: dict[str, list[float]] = {
            "number": [trial.number for trial in self.found],
            "time_ms": [trial.time_ms for trial in self.trials],
            "path_nodes": [len(trial.nodes) for trial in self.found],
            "length_m": [length_m(trial.nodes) for trial in self.found],
            "straight_nodes": [len(trial.straight) for trial in self.found],
            "straight_m": [length_m(trial.straight) for trial in self.found],
        }
        return {name: float(np.median(values)) if values else None for name, values in columns.items()}


@dataclass(frozen=True)
class AchourReport(ExperimentReport):
    """See ``ExperimentReport``."""

    name: ClassVar[str] = NAME
    options: Options
    problems: dict[str, PlanningProblem]
    entries: tuple[Entry, ...]

    def of(self, environment: str, method: str) -> Entry:
        """The searches of one method in one environment."""
        return next(e for e in self.entries if (e.environment, e.method) == (environment, method))

    def tables(self) -> list[Table]:
        """One for each environment."""
        return [terminal_table(f"{NAME}, environment {name}", HEAD, self.rows(name)) for name in self.problems]

    def rows(self, environment: str) -> list[list[str]]:
        """Each method, and below it what the paper prints of it."""
        return [row for method in METHODS for row in _rows(self.of(environment, method))]

    def as_json(self) -> dict[str, object]:
        """Times in milliseconds, lengths in metres; medians, and every run's; the paper's figures beside them."""
        return {
            "experiment": NAME,
            "runs": self.options.runs,
            "seed": self.options.seed,
            "settings": {"achour": SETTINGS.achour.model_dump(), "prm": SETTINGS.prm.model_dump()},
            "results": [
                {
                    "environment": entry.environment,
                    "method": entry.method,
                    "tried": len(entry.trials),
                    "found": len(entry.found),
                    "at_once": entry.at_once,
                    "attempt_success": entry.attempt_success,
                    **entry.figures(),
                    "times_ms": [trial.time_ms for trial in entry.trials],
                    "numbers": [trial.number for trial in entry.trials],
                    "attempts": [trial.attempts for trial in entry.trials],
                    "straight_lengths_m": [length_m(t.straight) if t.found else None for t in entry.trials],
                    "paper": _paper_as_json(entry),
                }
                for entry in self.entries
            ],
        }

    def pictures(self) -> dict[str, Figure]:
        """See ``ExperimentReport``."""
        return {NAME: _drawn(self)}

    def section(self) -> str:
        """See ``ExperimentReport``."""
        return _section(self)


def run(options: Options, advance: Advance) -> AchourReport:
    """Make all searches, one after the other (they are timed): ``jobs`` does not count."""
    warm_up()
    problems = environments()
    seeds = range(options.seed, options.seed + options.runs)
    entries: list[Entry] = []
    for name, method in product(problems, METHODS):
        entries.append(Entry(name, method, make_trials(method, problems[name], seeds)))
        advance(len(entries), len(problems) * len(METHODS))
    return AchourReport(options, problems, tuple(entries))


def _paper_as_json(entry: Entry) -> dict[str, object] | None:
    printed = PAPER.get((entry.environment, entry.method))
    return None if printed is None else {name: getattr(printed, name) for name in Printed.__slots__}


def _rows(entry: Entry) -> list[list[str]]:
    figures, tried = entry.figures(), len(entry.trials)
    at_once = f"{entry.at_once}/{tried}" if entry.method != LINES else ""
    number = figures["number"] if entry.method != LINES else None
    ours = [
        entry.method,
        f"{len(entry.found)}/{tried}",
        at_once,
        "" if number is None else f"{number:g}",
        f"{drawing.figures(figures['time_ms'] or 0.0)} ms",
        *("" if figures[name] is None else form.format(figures[name]) for name, form in PATH_COLUMNS),
    ]
    printed = PAPER.get((entry.environment, entry.method))
    if printed is None:
        return [ours]
    tries = "" if printed.tries is None else f"1/{printed.tries}"
    theirs = ["paper", "", tries, f"{printed.number}", f"{printed.time_s:.2f} s", "", "", "", ""]
    return [ours, theirs]


PATH_COLUMNS = (("path_nodes", "{:g}"), ("length_m", "{:.1f}"), ("straight_nodes", "{:g}"), ("straight_m", "{:.1f}"))
BEFORE, COLOURS = "#7fb4d9", {GENETIC: drawing.BLUE, ROADMAP: drawing.RED, LINES: drawing.GREY}


def _drawn(report: AchourReport) -> Figure:
    figure, panels = drawing.four_panels(10.0, 10.8)
    for panel, (name, problem) in zip(panels, report.problems.items(), strict=True):
        drawing.draw_map(panel, Grid(problem.weights))
        ticks_m = range(0, len(problem.weights) // FIELDS_A_METRE + 1, 5)
        for place, label in ((panel.set_xticks, panel.set_xlabel), (panel.set_yticks, panel.set_ylabel)):
            place([FIELDS_A_METRE * tick - 0.5 for tick in ticks_m], [f"{tick}" for tick in ticks_m])
            label("m", fontsize=8)
        _draw_paths(panel, report, name)
        drawing.draw_ends(panel, problem.start, problem.target)
        genetic, obstacles = report.of(name, GENETIC), len(OBSTACLES[name])
        rate = f"{100.0 * genetic.at_once / len(genetic.trials):.0f} % at once"
        drawing.title(panel, f"Environment {name}: {obstacles} obstacles, {GENETIC} {rate}")
    figure.legend(handles=_legend(), loc="outside lower center", ncols=4, frameon=False)
    return figure


def _draw_paths(panel: Any, report: AchourReport, environment: str) -> None:
    genetic, roadmap, lines = (report.of(environment, method).example for method in METHODS)
    if lines is not None:
        panel.plot(*lines.straight.T, color=COLOURS[LINES], linewidth=1.2, linestyle="--")
    if roadmap is not None:
        panel.plot(*roadmap.nodes.T, color=COLOURS[ROADMAP], linewidth=1.8, marker="o", markersize=2.5, alpha=0.9)
    if genetic is not None:
        if genetic.at_once:
            samples = samples_of(report.problems[environment], genetic)
            panel.plot(*samples.T, linestyle="", marker=".", markersize=2.0, color="#b8bcc4", zorder=1.5)
        panel.plot(*genetic.nodes.T, color=BEFORE, linewidth=0.9, marker="o", markersize=2.0)
        panel.plot(*genetic.straight.T, color=COLOURS[GENETIC], linewidth=2.4, alpha=0.9)


def _legend() -> list[Line2D]:
    def mark(label: str, colour: str, **style: Any) -> Line2D:
        return Line2D([], [], color=colour, label=label, **style)

    return [
        mark(f"{GENETIC}, pulled straight", COLOURS[GENETIC], linewidth=2.4),
        mark(f"{GENETIC}, as in the paper", BEFORE, linewidth=0.9, marker="o", markersize=2.5),
        mark("its samples of free space", "#b8bcc4", linestyle="", marker=".", markersize=4.0),
        mark(f"{ROADMAP}, as in the paper", COLOURS[ROADMAP], linewidth=1.8, marker="o", markersize=2.5),
        mark(f"{LINES}, for comparison", COLOURS[LINES], linewidth=1.2, linestyle="--"),
        mark("start", drawing.GREEN, linestyle="", marker="o", markersize=7, markeredgecolor="white"),
        mark("target", drawing.ORANGE, linestyle="", marker="s", markersize=7, markeredgecolor="white"),
    ]


def _least_ratio(report: AchourReport, method: str) -> float:
    """The paper's time over our median, in the environment where that is least."""
    ratios = []
    for name in report.problems:
        time_ms = report.of(name, method).figures()["time_ms"]
        if time_ms:
            ratios.append(1e3 * PAPER[name, method].time_s / time_ms)
    return min(ratios, default=0.0)


def _slowest_ms(report: AchourReport, method: str) -> float:
    return max(trial.time_ms for entry in report.entries if entry.method == method for trial in entry.trials)


def _longer(report: AchourReport, length: str) -> tuple[float, float]:
    """The median length of the genetic paths over that of the roadmap: the least and the greatest ratio."""
    ratios = []
    for name in report.problems:
        ours, theirs = (report.of(name, method).figures()[length] for method in (GENETIC, ROADMAP))
        if ours and theirs:
            ratios.append(ours / theirs)
    return min(ratios, default=0.0), max(ratios, default=0.0)


def _section(report: AchourReport) -> str:
    tables = "\n\n".join(
        f"Environment {name}, {len(OBSTACLES[name])} obstacles:\n\n{markdown_table(HEAD, report.rows(name))}"
        for name in report.problems
    )
    last = [*report.problems][-1]
    attempts = report.of(last, GENETIC).attempt_success
    as_found, straight = (_longer(report, length) for length in ("length_m", "straight_m"))
    side_m = len(report.problems[last].weights) // FIELDS_A_METRE
    return f"""## Segment by segment (Achour & Chaalal 2011, table I)

`{report.options.command(NAME)}`

From {START_M} to {TARGET_M} through {side_m} m x {side_m} m, {FIELDS_A_METRE} fields a metre, with M =
{SETTINGS.achour.samples} samples and B = {SETTINGS.achour.neighbours} neighbours, as the paper has it. "At once" counts
the runs that succeeded at the first attempt (`achour`; it may make {SETTINGS.achour.attempts}) or without extra samples
(`prm`; up to {SETTINGS.prm.rounds} rounds of {SETTINGS.prm.samples}). N is what it is in the paper: iterations of the
attempt that succeeded for `achour`, samples in the roadmap for `prm`. Then come nodes and length of the path as the
paper's method finds it, and of the same path pulled straight, where nodes between two that see each other are left out:
`achour` does this by default, `prm` does not, the paper neither. All figures are medians, time of all runs and the rest
of those that found a path. Below each row stands the paper's as printed: **milliseconds here, seconds there**.

{tables}

The paper's times are at least {_least_ratio(report, GENETIC):.0f} times our medians for `achour` and
{_least_ratio(report, ROADMAP):.0f} times for `prm`; the slowest single search took {_slowest_ms(report, GENETIC):.0f}
ms with `achour`, {_slowest_ms(report, ROADMAP):.0f} ms with `prm`. Measured on {where_measured()}; the paper: Matlab,
on a computer that is not named.

The paper gives no success rates. Of its environment 4 it says that the path was found after 5 tests; of the attempts of
`achour` in ours {100 * attempts:.0f} % succeed. It prints no lengths either, but calls the genetic algorithm's paths
the better ones in length. Here, as found, they are {as_found[0]:.2f} to {as_found[1]:.2f} times as long as those of
`prm`; with both pulled straight, {straight[0]:.2f} to {straight[1]:.2f} times. `theta-star` (complete, no samples,
default settings) shows about how short a path can be, and what that takes.

![The four environments](images/{NAME}.png)

What is ours: the environments (`sitl/experiments/achour_environments.py`), since the paper has only small pictures of
its own: walls and polygons, more of them each time, the second with two doors of 1.2 m. So neither times nor success
can be compared one to one. The robot is a point, as in the paper's abstract; its third degree of freedom, the heading,
has no part in the equations.
"""
