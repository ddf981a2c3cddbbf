"""Kwasniewski & Gosiewski 2018, sections 5 and 6: many runs on four unknown maps, times and steps as histograms."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any, ClassVar, Literal, get_args

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray
from rich.table import Table

from companion.core.grid import Grid
from companion.navigation.field_step import Part
from companion.planning import registry
from companion.settings import PlannerSettings, Settings, parse_settings
from sitl.experiments import drawing
from sitl.experiments.experiment import (
    START,
    TARGET,
    Advance,
    ExperimentReport,
    Options,
    each,
    load_maps,
    where_measured,
)
from sitl.experiments.field_level import LAYERS, STEP_LIMIT, FieldRobot, FieldRun, Outcome, measured_runs
from sitl.experiments.results_page import markdown_table, terminal_table

NAME = "kwasniewski-maps"
Profile = Literal["default", "paper"]
PROFILES: tuple[Profile, ...] = get_args(Profile)
TITLES = {
    "one-obstacle": "Map 1: one obstacle",
    "clutter": "Map 2: 22 simple obstacles",
    "rooms": "Map 3: rooms",
    "complex": "Map 4: complex environment",
}


@dataclass(frozen=True, slots=True)
class Reading:
    """One way to read the paper. ``layers``: of the view, beyond the robot's field; ``span_way_points``: see there."""

    layers: int
    span_way_points: int

    @property
    def view(self) -> str:
        """In words."""
        return f"field + {self.layers}"

    @property
    def way_points(self) -> str:
        """In words: with 4, 5, 6 and 8 control points."""
        return f"{WAY_POINTS}, 7, 9, 13" if self.span_way_points else f"always {WAY_POINTS}"


WAY_POINTS = PlannerSettings().way_points
OURS = Reading(LAYERS, PlannerSettings().span_way_points)
READINGS = (OURS, Reading(LAYERS - 1, OURS.span_way_points), Reading(LAYERS, 0), Reading(LAYERS - 1, 0))
"""The first is what the rest of this page takes. The paper's "4 layers" may count the robot's own field as one."""
COLOURS = {"default": drawing.BLUE, "paper": drawing.ORANGE}
RUNS_A_TASK = 5


@dataclass(frozen=True, slots=True)
class Series:
    """All runs of one profile on one map."""

    profile: Profile
    map_name: str
    runs: tuple[FieldRun, ...]
    reading: Reading = OURS

    def count(self, outcome: Outcome) -> int:
        """Runs that ended so."""
        return sum(run.outcome is outcome for run in self.runs)

    def planning_ms(self) -> NDArray[np.float64]:
        """All planning of each run."""
        return 1e3 * np.array([run.planning_s for run in self.runs])

    def field_step_p99_ms(self) -> float:
        """99 % of all field steps were not slower."""
        return float(1e3 * np.percentile(np.concatenate([run.step_seconds for run in self.runs]), 99))

    def typical(self) -> FieldRun:
        """The run with the median number of steps."""
        return sorted(self.runs, key=lambda run: (run.steps, run.seed))[len(self.runs) // 2]


@dataclass(frozen=True)
class MapsReport(ExperimentReport):
    """See ``ExperimentReport``."""

    name: ClassVar[str] = NAME
    options: Options
    maps: dict[str, Grid]
    series: tuple[Series, ...]
    readings: tuple[Series, ...]
    """Of the profile ``paper``, with each reading."""

    def tables(self) -> list[Table]:
        """One for each profile, a row a map, and one of the readings."""
        named = [
            terminal_table(
                f"{NAME}, profile {profile}, times in ms", HEAD, [_row(s) for s in self.series if s.profile == profile]
            )
            for profile in PROFILES
        ]
        return [*named, terminal_table(f"{NAME}: readings", READING_HEAD, self.reading_rows())]

    def reading_rows(self) -> list[list[str]]:
        """A row for each reading and map."""
        chosen = [0, 1, 3, 4, 5, 6]
        rows = [(one.reading, _row(one)) for one in self.readings]
        return [[reading.view, reading.way_points, *(row[i] for i in chosen)] for reading, row in rows]

    def as_json(self) -> dict[str, object]:
        """Every run's figures, in the order of their seeds."""
        return {
            "experiment": NAME,
            "runs": self.options.runs,
            "seed": self.options.seed,
            "step_limit": STEP_LIMIT,
            "start": list(START),
            "target": list(TARGET),
            "results": [_series_json(series) for series in self.series],
            "readings": [{**asdict(one.reading), **_series_json(one)} for one in self.readings],
        }

    def pictures(self) -> dict[str, Figure]:
        """See ``ExperimentReport``."""
        return {
            f"{NAME}-paths": self._draw_paths(),
            f"{NAME}-times": self._draw_histograms("times"),
            f"{NAME}-steps": self._draw_histograms("steps"),
        }

    def section(self) -> str:
        """See ``ExperimentReport``."""
        return _section(self)

    def _draw_paths(self) -> Figure:
        figure, panels = drawing.four_panels(11.0, 6.6)
        for panel, (name, grid) in zip(panels, self.maps.items(), strict=True):
            series = next(s for s in self.series if s.map_name == name and s.profile == "paper")
            run = series.typical()
            robot = FieldRobot(grid, START, TARGET, profile_settings("paper"), run.seed)
            robot.drive()
            drawing.draw_map(panel, grid, seen=robot.known.weights >= 1.0)
            _draw_track(panel, run)
            drawing.draw_ends(panel, START, TARGET)
            back = f", {run.return_steps} of them going back" if run.return_steps else ""
            drawing.title(panel, f"{TITLES[name]}: {run.steps} steps{back}")
        _legend(figure)
        return figure

    def _draw_histograms(self, what: Literal["times", "steps"]) -> Figure:
        figure, panels = drawing.four_panels(11.0, 5.6)
        for panel, name in zip(panels, self.maps, strict=True):
            shown = [series for series in self.series if series.map_name == name]
            values = [s.planning_ms() if what == "times" else np.array([r.steps for r in s.runs]) for s in shown]
            bins = _bins(np.concatenate(values), whole=what == "steps")
            digits = 1 if what == "times" else 0
            panel.hist(
                [np.minimum(data, bins[-1]) for data in values],
                bins.tolist(),
                rwidth=0.9,
                color=[COLOURS[series.profile] for series in shown],
                label=[f"{s.profile}: median {np.median(v):.{digits}f}" for s, v in zip(shown, values, strict=True)],
            )
            over = sum(int((data > bins[-1]).sum()) for data in values)
            drawing.title(panel, TITLES[name] + (f" ({over} slower, in the last bar)" if over else ""))
            panel.set_xlabel("planning time of a run, ms" if what == "times" else "steps")
            panel.set_ylabel("runs")
            panel.yaxis.set_major_locator(MaxNLocator(integer=True, nbins=6))
            panel.legend(fontsize=8, frameon=False)
        return figure


HEAD = ("map", "reached", "limit", "steps", "back", "searches", "plan", "max", "p99")
READING_HEAD = ("view", "way points", "map", "reached", "steps", "back", "searches", "plan")


def run(options: Options, advance: Advance) -> MapsReport:
    """Make all runs. The result (but for times) does not depend on ``jobs``."""
    maps = load_maps(options.maps, tuple(TITLES))
    registry.warm_up()  # here, so that the workers find everything compiled
    keys = [(profile, name, OURS) for profile in PROFILES for name in maps]
    keys += [("paper", name, reading) for reading in READINGS if reading != OURS for name in maps]
    seeds = range(options.seed, options.seed + options.runs)
    tasks = [(key, seeds[at : at + RUNS_A_TASK]) for key in keys for at in range(0, options.runs, RUNS_A_TASK)]
    collected: dict[tuple[Profile, str, Reading], list[FieldRun]] = {key: [] for key in keys}
    done = 0
    calls = (
        (maps[name], START, TARGET, profile_settings(profile, reading), seeds, reading.layers)
        for (profile, name, reading), seeds in tasks
    )
    made = each(options.jobs, measured_runs, calls)
    for (key, _), runs in zip(tasks, made, strict=True):
        collected[key] += runs
        done += len(runs)
        advance(done, len(keys) * options.runs)
    series = [Series(profile, name, tuple(own), reading) for (profile, name, reading), own in collected.items()]
    readings = [one for reading in READINGS for one in series if one.profile == "paper" and one.reading == reading]
    return MapsReport(options, maps, tuple(one for one in series if one.reading == OURS), tuple(readings))


def profile_settings(profile: Profile, reading: Reading = OURS) -> Settings:
    """The settings of a profile, with the way points of a reading."""
    changed = {} if reading == OURS else {"planner": {"span_way_points": reading.span_way_points}}
    return parse_settings({"profile": profile, **changed}, "profile")


def _row(series: Series) -> list[str]:
    planning_ms = series.planning_ms()
    return [
        series.map_name,
        f"{series.count(Outcome.REACHED)}/{len(series.runs)}",
        f"{series.count(Outcome.STEP_LIMIT)}",
        f"{np.median([run.steps for run in series.runs]):.0f}",
        f"{np.mean([run.return_steps for run in series.runs]):.1f}",
        f"{np.median([run.searches for run in series.runs]):.0f}",
        f"{np.median(planning_ms):.2f}",
        f"{planning_ms.max():.1f}",
        f"{series.field_step_p99_ms():.2f}",
    ]


def _series_json(series: Series) -> dict[str, object]:
    return {
        "map": series.map_name,
        "profile": series.profile,
        "reached": series.count(Outcome.REACHED),
        "unreachable": series.count(Outcome.UNREACHABLE),
        "step_limit_overruns": series.count(Outcome.STEP_LIMIT),
        "steps": [run.steps for run in series.runs],
        "return_steps": [run.return_steps for run in series.runs],
        "searches": [run.searches for run in series.runs],
        "planning_ms": [round(value, 4) for value in series.planning_ms().tolist()],
        "planning_median_ms": float(np.median(series.planning_ms())),
        "field_step_p99_ms": series.field_step_p99_ms(),
    }


def _draw_track(panel: Any, run: FieldRun) -> None:
    """Onward blue, going back red, one line for each stretch."""
    points = np.array(run.track, float)
    back = np.array([part is Part.RETURN for part in run.parts])
    at = 0
    while at < len(back):
        stop = at + 1
        while stop < len(back) and back[stop] == back[at]:
            stop += 1
        colour = drawing.RED if back[at] else drawing.BLUE
        panel.plot(*points[at : stop + 1].T, color=colour, linewidth=2.0, solid_capstyle="round", alpha=0.9)
        at = stop


def _legend(figure: Figure) -> None:
    entries = [
        Line2D([], [], color=drawing.BLUE, linewidth=2.0, label="onward (parts B and C)"),
        Line2D([], [], color=drawing.RED, linewidth=2.0, label="return mode (part A)"),
        Patch(facecolor=drawing.WALL, label="obstacle, seen"),
        Patch(facecolor=drawing.UNSEEN, label="obstacle, never seen"),
        Line2D([], [], color=drawing.GREEN, marker="o", linestyle="", markersize=7, label="start"),
        Line2D([], [], color=drawing.ORANGE, marker="s", linestyle="", markersize=7, label="target"),
    ]
    figure.legend(handles=entries, loc="outside lower center", ncols=len(entries), frameon=False, fontsize=9)


def _bins(values: NDArray[Any], *, whole: bool) -> NDArray[np.float64]:
    """About 25 bars for nearly all values. The last one takes outliers, which come from interrupted computations."""
    low, high = float(values.min()), float(values.max())
    if whole:
        width = max(1, int(np.ceil((high - low + 1.0) / 25.0)))
        return np.arange(low, high + 2.0 * width, width) - 0.5
    return np.linspace(0.0, min(high, 2.0 * float(np.percentile(values, 95))) + 1e-9, 26)


def _section(report: MapsReport) -> str:
    tables = "\n\n".join(
        f"Profile `{profile}`:\n\n{markdown_table(HEAD, [_row(s) for s in report.series if s.profile == profile])}"
        for profile in PROFILES
    )
    return f"""## Unknown maps (Kwaśniewski & Gosiewski 2018, sections 5 and 6)

`{report.options.command(NAME)}`

Start {tuple(START)}, target {tuple(TARGET)}, 100 x 50 fields, at most {STEP_LIMIT} steps, a view of {LAYERS} layers.
Steps, searches and plan (all searches of one run together) are medians of the runs, max is the slowest run, back (steps
in return mode) is the mean, limit counts the runs that reached the limit of steps; 99 % of all calls of the step
function, searches included, took no longer than p99. Times are in milliseconds, without Python's garbage collection.

{tables}

The profile `paper` with other readings of the text. *view*: its "4 layers" may be four beyond the robot's field, as
everywhere else here, or count that field as the first. *way points*: it evaluates five, whatever the number of control
points; here a path with 5, 6 or 8 of them has 7, 9 or 13:

{markdown_table(READING_HEAD, report.reading_rows())}

The paper gives no table, only histograms of computing times in seconds (Python 3.6; its text names two of 189 s and 232
s on map 3) and says that almost all tests reached the target. Measured on {where_measured()}.

![Example paths](images/{NAME}-paths.png)

Each example is the run with the median number of steps in the profile `paper`.

![Planning times](images/{NAME}-times.png)

![Steps](images/{NAME}-steps.png)

What is ours:

- **The maps.** The paper's maps are not available as data. Ours (`missions/maps`) are drawn to fit its text: one
  obstacle; 22 simple obstacles placed at random; the rooms of a building; obstacles of different shapes placed at
  random.
- **The view.** The paper gives a triangle with its top in the robot's field and 2x + 1 fields in layer x. We take layer
  0 as the robot's own field and {LAYERS} layers beyond it, in the direction of the last move (at first: towards the
  target), which is one of eight; on a diagonal the triangle is the quadrant. The paper does not say whether obstacles
  hide what lies behind them: here they do.
- **Turning.** Before a move the robot turns to the field it is about to enter and so sees it. When that field turns out
  to be an obstacle, the step function is called once more in the same field. No diagonal step cuts an obstacle's
  corner.
- **Profiles.** `paper` searches with the genetic algorithm alone; `default` has graph search behind it.
"""
