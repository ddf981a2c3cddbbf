"""Driving times of several planners: the shipped missions in lock-step, with the rover's own dynamics."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from matplotlib.figure import Figure
from rich.table import Table

from companion.bench.movingai import ScenarioFileError, read_scenarios, scenario_file, spread
from companion.executive.mission_progress import TargetStatus
from companion.executive.warm_up import warm_up
from companion.mapping.map_files import load_map
from companion.mission.load import load_mission
from companion.mission.mission import Mission
from companion.recording.recorder import NullRecorder
from sitl.experiments import drawing
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
from sitl.experiments.navigation import OURS, STEPS_FACTOR, STEPS_REFERENCE, settings_with
from sitl.experiments.results_page import markdown_table, terminal_table
from sitl.lockstep import Drive, DriveOutcome, Report
from sitl.map_mission import mission_on_map
from sitl.scenario import scenario_from_mission

NAME = "driving"
MISSIONS = (
    "open.toml",
    "one-obstacle.toml",
    "clutter.toml",
    "rooms.toml",
    "complex.toml",
    "dead-end.toml",
    "field.plan",
)
DRIVEN = ("hybrid", "bspline-ga", "astar", "theta-star", "dstar-lite", "dijkstra")
"""What a rover would be driven with; the older genetic algorithms are compared field by field."""
REFERENCES = ("astar", "theta-star")
PROBLEMS = 4
MAP_RESOLUTION_M = 2.0
"""Field size of maps that do not say: wide enough for a rover of 0.35 m."""
TIME_LIMIT_S = 1800.0


@dataclass(frozen=True, slots=True)
class Series:
    """All drives of one mission with one planner."""

    planner: str
    mission: str
    reports: tuple[Report, ...]

    @property
    def time_s(self) -> float:
        """Mean driving time."""
        return float(np.mean([report.driving_time_s for report in self.reports]))

    @property
    def steps(self) -> float:
        """Mean fields driven."""
        return float(np.mean([report.steps for report in self.reports]))

    @property
    def missed(self) -> int:
        """Drives in which a target was missed."""
        return sum(
            report.outcome not in (DriveOutcome.REACHED, DriveOutcome.COLLISION)
            or any(status is not TargetStatus.REACHED for _, status in report.targets)
            for report in self.reports
        )

    def row(self, best_s: float) -> list[str]:
        """Figures for people; ``best_s``: the reference's time on this mission."""
        reports = self.reports
        return [
            self.planner,
            f"{self.time_s:.1f}",
            f"{self.time_s / best_s:.3f}",
            f"{np.mean([report.distance_m for report in reports]):.1f}",
            f"{self.steps:.1f}",
            f"{np.mean([report.return_steps for report in reports]):.1f}",
            f"{self.missed}",
            f"{sum(report.collisions for report in reports)}",
            drawing.figures(float(np.median([1e3 * report.planning_time_s for report in reports]))),
        ]


HEAD = ("planner", "time s", "/ref", "metres", "steps", "back", "missed", "coll.", "plan ms")


@dataclass(frozen=True)
class DrivingReport(ExperimentReport):
    """See ``ExperimentReport``."""

    name: ClassVar[str] = NAME
    options: Options
    series: tuple[Series, ...]

    def tables(self) -> list[Table]:
        """One for each mission, a row a planner, then the sums."""
        named = [terminal_table(f"{NAME}: {name}", HEAD, self._rows(name)) for name in self._names()]
        return [*named, terminal_table(f"{NAME}: all missions together", SUM_HEAD, self._sums())]

    def as_json(self) -> dict[str, object]:
        """Every drive's figures."""
        return {
            "experiment": NAME,
            "seed": self.options.seed,
            "runs": self.options.runs,
            "results": [
                {"planner": s.planner, "mission": s.mission, "drives": [report.as_json() for report in s.reports]}
                for s in self.series
            ],
        }

    def pictures(self) -> dict[str, Figure]:
        """See ``ExperimentReport``."""
        return {NAME: self._draw()}

    def _names(self) -> list[str]:
        return list(dict.fromkeys(series.mission for series in self.series))

    def _planners(self) -> list[str]:
        return list(dict.fromkeys(series.planner for series in self.series))

    def _rows(self, name: str) -> list[list[str]]:
        own = [series for series in self.series if series.mission == name]
        references = [s.time_s for s in own if s.planner in REFERENCES] or [s.time_s for s in own]
        return [series.row(min(references)) for series in own]

    def _sums(self) -> list[list[str]]:
        sums = {p: sum(s.time_s for s in self.series if s.planner == p) for p in self._planners()}
        reference_s = min([sums[p] for p in REFERENCES if p in sums] or sums.values())
        return [
            [
                planner,
                f"{total_s:.1f}",
                f"{total_s / reference_s:.3f}",
                f"{sum(s.missed for s in self.series if s.planner == planner)}",
                f"{sum(r.collisions for s in self.series if s.planner == planner for r in s.reports)}",
            ]
            for planner, total_s in sums.items()
        ]

    def _draw(self) -> Figure:
        names, planners = self._names(), self._planners()
        figure = Figure(figsize=(11.0, 4.6), layout="constrained", dpi=110)
        panel = figure.subplots()
        colours = (drawing.BLUE, drawing.ORANGE, drawing.GREY, drawing.RED, drawing.GREEN, "#7b5ea7")
        width = 0.8 / len(planners)
        for i, planner in enumerate(planners):
            own = {s.mission: s for s in self.series if s.planner == planner}
            places = np.arange(len(names)) + (i - (len(planners) - 1) / 2) * width
            panel.bar(
                places,
                [own[name].time_s for name in names],
                width * 0.9,
                label=planner,
                color=colours[i % len(colours)],
            )
            for place, name in zip(places, names, strict=True):
                times_s = [report.driving_time_s for report in own[name].reports]
                panel.plot([place, place], [min(times_s), max(times_s)], color="0.2", linewidth=1.0)
        panel.set_xticks(range(len(names)), names, rotation=15, fontsize=8)
        panel.set_ylabel("driving time, s (mean, least and most)")
        panel.spines[["top", "right"]].set_visible(False)
        figure.legend(loc="outside lower center", ncols=len(planners), frameon=False)
        return figure

    def section(self) -> str:
        """See ``ExperimentReport``."""
        tables = "\n\n".join(f"{name}:\n\n{markdown_table(HEAD, self._rows(name))}" for name in self._names())
        return f"""## What the rover feels: driving times

`{self.options.command(NAME)}`

The shipped missions in lock-step, with the rover's dynamics and sensor noise, with several planners in the navigator;
each row is made of {self.options.runs} drives, with seeds {self.options.seed} to
{self.options.seed + self.options.runs - 1}. *time* is the mean driving time, */ref* the same divided by the faster of
`{REFERENCES[0]}` and `{REFERENCES[1]}`; *missed* counts drives in which a target was not reached.

{tables}

All missions together:

{markdown_table(SUM_HEAD, self._sums())}

{shortfalls(self.series)}

Driving times do not depend on the computer; plan (all planning of a drive, ms) was measured on {where_measured()}.

![Driving times](images/{NAME}.png)
"""


def shortfalls(series: tuple[Series, ...]) -> str:
    """What was aimed at, and every mission where it is not reached, in words; empty if ``hybrid`` was not driven."""
    own = {(s.planner, s.mission): s for s in series}
    slower, longer = [], []
    for one in (s for s in series if s.planner == OURS):
        references = [own[p, one.mission].time_s for p in REFERENCES if (p, one.mission) in own]
        if references and one.time_s > min(references):
            slower.append(f"{one.mission} ({one.time_s / min(references):.3f})")
        steps = own.get((STEPS_REFERENCE, one.mission))
        if steps is not None and one.steps > STEPS_FACTOR * steps.steps:
            longer.append(f"{one.mission} ({one.steps / steps.steps:.3f})")
    missed = sum(s.missed for s in series if s.planner == OURS)
    if not any(s.planner == OURS for s in series):
        return ""
    return (
        f"Aimed at with `{OURS}` on every mission: no more time than the faster of the references"
        f" ({_misses(slower)}); at most {STEPS_FACTOR:g} times the steps of `{STEPS_REFERENCE}` ({_misses(longer)});"
        f" no target missed ({f'{missed} missed' if missed else 'reached'})."
    )


def _misses(missed: list[str]) -> str:
    return f"not reached: {', '.join(missed)}" if missed else "reached"


SUM_HEAD = ("planner", "time s", "/ref", "missed", "coll.")


def run(options: Options, advance: Advance) -> DrivingReport:
    """Make all drives. The result (but for planning times) does not depend on ``jobs``."""
    missions = {**_shipped(options), **_given(options)}
    planners = planners_of(options, DRIVEN)
    for planner in planners:
        warm_up(settings_with(planner))
    keys = [(name, planner) for name in missions for planner in planners]
    tasks = [(name, planner, options.seed + i) for name, planner in keys for i in range(options.runs)]
    collected: dict[tuple[str, str], list[Report]] = {key: [] for key in keys}
    made = each(options.jobs, drive, ((missions[name], planner, seed) for name, planner, seed in tasks))
    for done, ((name, planner, _), report) in enumerate(zip(tasks, made, strict=True), start=1):
        collected[name, planner].append(report)
        advance(done, len(tasks))
    series = tuple(Series(planner, name, tuple(reports)) for (name, planner), reports in collected.items())
    return DrivingReport(options, series)


def drive(mission: Mission, planner: str, seed: int) -> Report:
    """One mission in lock-step with this planner in the navigator."""
    scenario = scenario_from_mission(mission)
    report = Drive(mission, scenario, settings_with(planner), seed, NullRecorder(), TIME_LIMIT_S).run()
    report.track.clear()
    return report


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
