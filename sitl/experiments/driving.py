"""Driving times of several planners: shipped missions and made grounds in lock-step, with the rover's own dynamics.

Beside each: the same drives on the known map, and the least time that is possible.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray
from rich.table import Table

from companion.bench.movingai import ScenarioFileError, read_scenarios, scenario_file, spread
from companion.executive.warm_up import warm_up
from companion.mapping.map_files import load_map
from companion.mission.load import load_mission
from companion.mission.mission import Mission
from sitl.experiments import drawing
from sitl.experiments.driving_courses import CourseDrive, drive
from sitl.experiments.experiment import (
    Advance,
    ExperimentError,
    ExperimentReport,
    Options,
    each,
    planners_of,
    shipped_missions,
    where_measured,
)
from sitl.experiments.intervals import mean_interval, mean_with_interval, ratio_with_interval
from sitl.experiments.navigation import CURVES, OURS, STEPS_FACTOR, STEPS_REFERENCE, settings_with
from sitl.experiments.results_page import markdown_table, terminal_table, without_intervals
from sitl.generators.kinds import GroundKind
from sitl.lockstep import Report
from sitl.map_mission import mission_on_map

NAME = "driving"
MISSIONS = (
    "open.toml",
    "one-obstacle.toml",
    "clutter.toml",
    "rooms.toml",
    "complex.toml",
    "dead-end.toml",
    "field.plan",
    "ackermann.toml",
)
KINDS = (GroundKind.CLUTTER, GroundKind.ROOMS, GroundKind.YARD, GroundKind.MAZE, GroundKind.FOREST)
DRIVEN = ("hybrid", "bspline-ga", "theta-star", "dstar-lite")
"""What a rover would be driven with; the older genetic algorithms are compared field by field."""
REFERENCE = "theta-star"
KNOWN = f"{REFERENCE}, map known"
PROBLEMS = 4
MAP_RESOLUTION_M = 2.0
"""Field size of maps that do not say: wide enough for a rover of 0.35 m."""
ALL = "all"
Times = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Series:
    """All drives of one course with one planner, in the order of their seeds. ``known``: with the map."""

    planner: str
    course: str
    drives: tuple[CourseDrive, ...]
    known: bool = False

    @property
    def name(self) -> str:
        """Of its row."""
        return KNOWN if self.known else self.planner

    @property
    def reports(self) -> list[Report]:
        """What each drive came to."""
        return [one.report for one in self.drives]

    @property
    def times_s(self) -> Times:
        """From the first movement to the last, of each drive; NaN where a target was missed."""
        return np.array([one.report.driving_time_s if one.reached else math.nan for one in self.drives])

    @property
    def time_s(self) -> float:
        """Mean of those that reached all."""
        return _mean(self.times_s)

    @property
    def steps(self) -> float:
        """Mean fields driven."""
        return float(np.mean([report.steps for report in self.reports]))

    @property
    def missed(self) -> int:
        """Drives in which a target was missed."""
        return sum(not one.reached for one in self.drives)

    @property
    def bounds_s(self) -> Times:
        """The least time of each drive; NaN where that was not asked for, or there is none."""
        return np.array([math.nan if one.bound_s is None else one.bound_s for one in self.drives])


HEAD = (
    "planner", "time s", f"/ {REFERENCE}", "/ known", "/ bound", "metres", "back", "missed", "coll.", "Ah", "by curves",
    "plan ms",
)  # fmt: skip
SHORT = ("planner", "s", "/ref", "/known", "/bound", "m", "back", "missed", "coll.", "Ah", "curves", "ms")


@dataclass(frozen=True)
class DrivingReport(ExperimentReport):
    """See ``ExperimentReport``."""

    name: ClassVar[str] = NAME
    options: Options
    series: tuple[Series, ...]

    def tables(self) -> list[Table]:
        """One for each course, a row a planner, then all of them together."""
        names = (*self._courses(), ALL)
        return [terminal_table(f"{NAME}: {name}", SHORT, without_intervals(self._rows(name))) for name in names]

    def as_json(self) -> dict[str, object]:
        """Every drive's figures."""
        return {
            "experiment": NAME,
            "seed": self.options.seed,
            "runs": self.options.runs,
            "results": [
                {
                    "planner": one.planner,
                    "course": one.course,
                    "known": one.known,
                    "drives": [{**drive.report.as_json(), "bound_s": drive.bound_s} for drive in one.drives],
                }
                for one in self.series
            ],
        }

    @property
    def section_name(self) -> str:
        """Steered wheels stand beside the usual rovers."""
        return f"{NAME}-steered" if self.options.turning_radius_m else NAME

    def pictures(self) -> dict[str, Figure]:
        """See ``ExperimentReport``."""
        return {self.section_name: self._draw()}

    def _courses(self) -> list[str]:
        return list(dict.fromkeys(series.course for series in self.series))

    def _rows(self, course: str) -> list[list[str]]:
        rows = {
            name: [one for one in self.series if one.name == name and course in (ALL, one.course)]
            for name in dict.fromkeys(series.name for series in self.series)
        }
        reference_s, known_s = together(rows[REFERENCE]), together(rows[KNOWN])
        bounds_s: Times = np.mean([one.bounds_s for one in rows[KNOWN]], axis=0)
        quotients = [_quotient(bounds_s, other_s) for other_s in (reference_s, known_s, bounds_s)]
        unknown = np.isnan(bounds_s).any()
        bound = ["bound", "-" if unknown else f"{bounds_s.mean():.1f}", *quotients, *[""] * (len(HEAD) - 5)]
        return [*(_row(own, reference_s, known_s, bounds_s) for own in rows.values()), bound]

    def _draw(self) -> Figure:
        names = self._courses()
        rows = list(dict.fromkeys(series.name for series in self.series))
        figure = Figure(figsize=(12.0, 5.0), layout="constrained", dpi=110)
        panel = figure.subplots()
        colours = (drawing.BLUE, drawing.ORANGE, drawing.RED, drawing.GREEN, "#7b5ea7", "#5f8aa8", "#a07d4c")
        width = 0.8 / len(rows)
        for i, row in enumerate(rows):
            own = {one.course: one for one in self.series if one.name == row}
            places = np.arange(len(names)) + (i - (len(rows) - 1) / 2) * width
            colour = drawing.GREY if row == KNOWN else colours[i % len(colours)]
            panel.bar(places, [own[name].time_s for name in names], width * 0.9, label=row, color=colour)
            for place, name in zip(places, names, strict=True):
                reached_s = own[name].times_s[~np.isnan(own[name].times_s)]
                if len(reached_s):
                    panel.plot([place, place], mean_interval(reached_s), color="0.2", linewidth=1.0)
        bounds_s = [
            next(one.bounds_s.mean() for one in self.series if one.course == name and one.known) for name in names
        ]
        middles = np.arange(len(names))
        panel.hlines(bounds_s, middles - 0.42, middles + 0.42, color="0.1", linewidth=1.6, label="bound")
        panel.set_xticks(range(len(names)), names, rotation=20, fontsize=8, ha="right")
        panel.set_ylabel("driving time, s (mean, 95 % interval)")
        panel.spines[["top", "right"]].set_visible(False)
        figure.legend(loc="outside lower center", ncols=len(rows) + 1, frameon=False)
        return figure

    def section(self) -> str:
        """See ``ExperimentReport``."""
        courses = self._courses()
        tables = "\n\n".join(f"{name}:\n\n{markdown_table(HEAD, self._rows(name))}" for name in courses)
        runs, first = self.options.runs, self.options.seed
        radius_m = self.options.turning_radius_m
        title = "Driving times with steered wheels" if radius_m else "What the rover feels: driving times"
        steered = f", for a rover with steered wheels whose tightest arc has a radius of {radius_m:g} m,"
        driven = f"Random grounds (*made*){steered}" if radius_m else "Shipped missions and random grounds (*made*)"
        return f"""## {title}

`{self.options.command(NAME)}`

{driven} in lock-step, with the rover's dynamics and sensor noise, led by points,
with several planners in the navigator. Each row is made of {runs} drives, with seeds {first} to {first + runs - 1}, the
same for all; each seed is another ground of its kind. *time s*: mean driving time of the drives that reached all
targets; */ {REFERENCE}*: the same over that planner's, of the seeds with which both did; in brackets 95 % intervals, by
resampling seeds. *{KNOWN}*: the whole map is known from the start, as if all had been seen before; */ known*: the time
over that one, of the seeds with which both did, which is what better exploring could gain at all. *bound*: about the
least time that physics allows, the shortest way of the footprint, any angle, at the mission's speeds, and the stays;
fences do not count. */ bound*: over that of the same seeds. *back*: steps in return mode;
*missed*: drives in which a target was not reached; *Ah*: charge from the battery; *by curves*: the share of searches
that the genetic algorithm answered with a curve of its own, and not a graph search.

{tables}

All together, for each seed the mean over the courses:

{markdown_table(HEAD, self._rows(ALL))}

{shortfalls(self.series)}

Driving times do not depend on the computer; plan ms (all planning of a drive) was measured on {where_measured()}.

![Driving times](images/{self.section_name}.png)
"""


def together(series: Sequence[Series]) -> Times:
    """The time of each seed: the mean over the courses; NaN where one was not driven to its end."""
    times_s: Times = np.mean([one.times_s for one in series], axis=0)
    return times_s


def _row(own: Sequence[Series], reference_s: Times, known_s: Times, bounds_s: Times) -> list[str]:
    """Figures of one planner, on one course or on several together, for people."""
    times_s, reports = together(own), [report for one in own for report in one.reports]
    searches = sum(report.searches for report in reports)
    curves = sum(report.genetic_searches for report in reports)
    return [
        own[0].name,
        mean_with_interval(times_s[~np.isnan(times_s)], digits=1),
        "1" if own[0].name == REFERENCE else _quotient(times_s, reference_s),
        *(_quotient(times_s, other_s) for other_s in (known_s, bounds_s)),
        f"{np.mean([report.distance_m for report in reports]):.1f}",
        f"{np.mean([report.return_steps for report in reports]):.1f}",
        f"{sum(one.missed for one in own)}",
        f"{sum(report.collisions for report in reports)}",
        f"{np.mean([report.drawn_ah for report in reports]):.3f}",
        f"{curves / searches:.2f}" if own[0].planner in CURVES and searches else "-",
        drawing.figures(float(np.median([1e3 * report.planning_time_s for report in reports]))),
    ]


def _mean(values: Times) -> float:
    """Of those that are known; NaN for none."""
    known = values[~np.isnan(values)]
    return float(known.mean()) if len(known) else math.nan


def _quotient(times_s: Times, others_s: Times) -> str:
    """One mean over the other, with its interval: of those seeds alone with which both were driven to their end."""
    return ratio_with_interval(_both(times_s, others_s))


def _both(times_s: Times, others_s: Times) -> NDArray[np.float64]:
    """Shape (n, 2): of the seeds that both have."""
    pairs = np.column_stack((times_s, others_s))
    return pairs[~np.isnan(pairs).any(axis=1)]


def shortfalls(series: tuple[Series, ...]) -> str:
    """What was aimed at, and every course where it is not reached, in words; empty if ``hybrid`` was not driven."""
    own = {(s.planner, s.course): s for s in series if not s.known}
    slower, longer = [], []
    for one in (s for s in own.values() if s.planner == OURS):
        reference = own.get((REFERENCE, one.course))
        times_s = np.empty((0, 2)) if reference is None else _both(one.times_s, reference.times_s)
        if len(times_s) and (ratio := times_s[:, 0].mean() / times_s[:, 1].mean()) > 1.0:
            slower.append(f"{one.course} ({ratio:.3f})")
        steps = own.get((STEPS_REFERENCE, one.course))
        if steps is not None and one.steps > STEPS_FACTOR * steps.steps:
            longer.append(f"{one.course} ({one.steps / steps.steps:.3f})")
    missed = sum(s.missed for s in own.values() if s.planner == OURS)
    if not any(planner == OURS for planner, _ in own):
        return ""
    return (
        f"Aimed at with `{OURS}` on every course: no more time than `{REFERENCE}`"
        f" ({_misses(slower)}); at most {STEPS_FACTOR:g} times the steps of `{STEPS_REFERENCE}` ({_misses(longer)});"
        f" no target missed ({f'{missed} missed' if missed else 'reached'})."
    )


def _misses(missed: list[str]) -> str:
    return f"not reached: {', '.join(missed)}" if missed else "reached"


def run(options: Options, advance: Advance) -> DrivingReport:
    """Make all drives. The result (but for planning times) does not depend on ``jobs``."""
    shipped = {} if options.turning_radius_m else _shipped(options)
    courses: dict[str, Mission | str] = {**shipped, **{f"made {kind}": kind.value for kind in KINDS}, **_given(options)}
    planners = tuple(dict.fromkeys((*planners_of(options, DRIVEN), REFERENCE)))
    for planner in planners:
        warm_up(settings_with(planner))
    keys = [(name, planner, False) for name in courses for planner in planners]
    keys += [(name, REFERENCE, True) for name in courses]
    tasks = [(key, options.seed + i) for key in keys for i in range(options.runs)]
    calls = ((courses[name], planner, seed, known, options.turning_radius_m) for (name, planner, known), seed in tasks)
    collected: dict[tuple[str, str, bool], list[CourseDrive]] = {key: [] for key in keys}
    made = each(options.jobs, drive, calls, options.keep)
    for done, ((key, _), one) in enumerate(zip(tasks, made, strict=True), start=1):
        collected[key].append(one)
        advance(done, len(tasks))
    series = (Series(planner, name, tuple(own), known) for (name, planner, known), own in collected.items())
    return DrivingReport(options, tuple(series))


def _shipped(options: Options) -> dict[str, Mission]:
    return {file.stem: load_mission(file) for file in shipped_missions(options.maps, MISSIONS)}


def _given(options: Options) -> dict[str, Mission]:
    """The longer problems of maps that the user names."""
    missions = {}
    for file in options.worlds:
        ground = load_map(file, MAP_RESOLUTION_M)
        scenarios = scenario_file(file)
        if scenarios is None:
            raise ExperimentError(f"{file}: a MovingAI scenario file is needed beside it ({file.name}.scen)")
        try:
            problems = read_scenarios(scenarios)
        except ScenarioFileError as error:
            raise ExperimentError(str(error)) from error
        longer = problems[len(problems) // 4 :]
        for number, problem in enumerate(spread(longer, PROBLEMS), start=1):
            if problem.start != problem.target:
                mission = mission_on_map(file, ground, problem.start, problem.target, prior=False)
                missions[f"{file.stem} {number}"] = mission
    return missions
