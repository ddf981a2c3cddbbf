"""Wang, Sillitoe & Mulvaney 2007, table IV: replanning among static and moving obstacles, for time and for length."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import Any, ClassVar

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from rich.table import Table

from companion.core.grid import Grid
from companion.planning.registry import warm_up
from companion.settings.planners import VertexSettings
from sitl.experiments import drawing
from sitl.experiments.experiment import Advance, ExperimentReport, Options, each, where_measured
from sitl.experiments.results_page import markdown_table, terminal_table, without_intervals
from sitl.experiments.wang_environments import ENVIRONMENTS, Environment, place_at
from sitl.experiments.wang_trip import SPEEDS_M_S, Trip, length_m, make_trip, time_s

NAME = "wang-table4"
TIME, LENGTH = "time", "length"
SAFE_M = 1.0
"""Table II."""
FEWEST_PAIRS = 3
SETTINGS = {
    TIME: VertexSettings(length_weight=0.0, time_weight=1.0, safe_fields=SAFE_M, mover_safe_fields=SAFE_M),
    LENGTH: VertexSettings(length_weight=1.0, time_weight=0.0, safe_fields=SAFE_M, mover_safe_fields=SAFE_M),
}

AS_ABOVE = "as above"
VARIANTS = {
    AS_ABOVE: SETTINGS[TIME],
    "fastest speed only": SETTINGS[TIME].model_copy(update={"speed_levels": 1}),
    "time and length": SETTINGS[TIME].model_copy(update={"length_weight": 1.0}),
    "no straight line": SETTINGS[TIME].model_copy(update={"straight_line": False}),
}
"""What choosing speeds pays, mixed weights, and the paper's own first population."""


@dataclass(frozen=True, slots=True)
class Printed:
    """A row of the paper's table IV, as printed."""

    length_m: int
    time_s: int
    first_generations: int
    first_s: float
    all_s: float
    speeds_m_s: str


PAPER = {
    (TIME, 1): Printed(419, 606, 64, 5.63, 29.9, "0.7, 0.6, 0.7, 0.7, 0.7"),
    (TIME, 2): Printed(317, 546, 54, 5.41, 33.6, "0.4, 0.7, 0.7"),
    (TIME, 3): Printed(300, 428, 48, 10.4, 47.9, "0.7, 0.7, 0.7, 0.7"),
    (TIME, 4): Printed(385, 551, 84, 28.7, 106.0, "0.7, 0.7, 0.7"),
    (LENGTH, 1): Printed(408, 1198, 12, 2.72, 25.9, "0.7, 0.3, 0.3, 0.3"),
    (LENGTH, 2): Printed(311, 990, 60, 5.11, 33.6, "0.4, 0.3, 0.3"),
    (LENGTH, 3): Printed(300, 512, 45, 7.56, 51.3, "0.7, 0.3, 0.7, 0.7"),
    (LENGTH, 4): Printed(346, 1061, 75, 29.4, 108.0, "0.6, 0.3, 0.3, 0.5, 0.3, 0.3"),
}


@dataclass(frozen=True, slots=True)
class Entry:
    """All trips with one criterion in one environment."""

    criterion: str
    environment: int
    trips: tuple[Trip, ...]

    @property
    def found(self) -> list[Trip]:
        """Those that found both paths."""
        return [trip for trip in self.trips if trip.found]

    @property
    def example(self) -> Trip | None:
        """The trip with the median value."""
        ranked = sorted(self.found, key=lambda trip: trip.online.value if trip.online else 0.0)
        return ranked[len(ranked) // 2] if ranked else None

    @property
    def touched(self) -> int:
        """Trips on which the robot touched a moving obstacle."""
        return sum(trip.gap_m is not None and trip.gap_m < 0.0 for trip in self.trips)

    def figures(self) -> dict[str, float | None]:
        """Medians over the trips that found both paths; ``least_gap_m`` is the least."""
        plans = [(trip, trip.online) for trip in self.found if trip.online is not None]
        if not plans:
            return dict.fromkeys(COLUMNS)
        columns: dict[str, list[float]] = {
            "offline_length_m": [length_m(trip.offline) for trip, _ in plans],
            "offline_time_s": [time_s(trip.offline) for trip, _ in plans],
            "length_m": [length_m(plan) for _, plan in plans],
            "time_s": [time_s(plan) for _, plan in plans],
            "first_generations": [plan.first_feasible for _, plan in plans],
            "first_ms": [trip.first_ms or 0.0 for trip, _ in plans],
            "all_ms": [trip.all_ms or 0.0 for trip, _ in plans],
            "offline_first_generations": [trip.offline.first_feasible for trip, _ in plans],
            "offline_first_ms": [trip.offline_first_ms for trip, _ in plans],
            "offline_ms": [trip.offline_ms for trip, _ in plans],
        }
        medians: dict[str, float | None] = {name: float(np.median(values)) for name, values in columns.items()}
        return medians | {"least_gap_m": min(trip.gap_m or 0.0 for trip, _ in plans)}

    def speeds(self) -> str:
        """The speeds of the example's path."""
        plan = None if self.example is None else self.example.online
        return "" if plan is None else " ".join(f"{speed:.1f}" for speed in plan.speeds_fields_s)

    def top_speed_share(self) -> float:
        """Of all segments of all paths, how many are driven at the highest speed."""
        speeds = [trip.online.speeds_fields_s for trip in self.found if trip.online is not None]
        return float(np.mean(np.concatenate(speeds) > SPEEDS_M_S[1] - 1e-9)) if speeds else 0.0


COLUMNS = (
    "offline_length_m",
    "offline_time_s",
    "length_m",
    "time_s",
    "first_generations",
    "first_ms",
    "all_ms",
    "offline_first_generations",
    "offline_first_ms",
    "offline_ms",
    "least_gap_m",
)


@dataclass(frozen=True)
class WangReport(ExperimentReport):
    """See ``ExperimentReport``."""

    name: ClassVar[str] = NAME
    options: Options
    entries: tuple[Entry, ...]
    variants: tuple[Entry, ...]
    """With a variant's name as their criterion."""

    def tables(self) -> list[Table]:
        """One for each criterion: what was planned, and how long it took."""
        return [
            *(terminal_table(f"{NAME}, least {name}", HEAD, self._rows(name)) for name in (TIME, LENGTH)),
            terminal_table(f"{NAME}, variants", VARIANT_HEAD, without_intervals(_variant_rows(self.variants))),
        ]

    def as_json(self) -> dict[str, object]:
        """Medians, and each run's value; the paper's figures beside them."""
        return {
            "experiment": NAME,
            "runs": self.options.runs,
            "seed": self.options.seed,
            "variants": [
                {
                    "variant": one.criterion,
                    "environment": one.environment,
                    "tried": len(one.trips),
                    "found": len(one.found),
                    "touched": one.touched,
                    **one.figures(),
                }
                for one in self.variants
            ],
            "settings": {criterion: settings.model_dump() for criterion, settings in SETTINGS.items()},
            "results": [
                {
                    "criterion": entry.criterion,
                    "environment": entry.environment,
                    "tried": len(entry.trips),
                    "found": len(entry.found),
                    "touched": entry.touched,
                    **entry.figures(),
                    "speeds_m_s": entry.speeds(),
                    "top_speed_share": entry.top_speed_share(),
                    "values": [trip.online.value for trip in entry.found if trip.online is not None],
                    "paper": {name: getattr(printed, name) for name in Printed.__slots__},
                }
                for entry in self.entries
                for printed in (PAPER[entry.criterion, entry.environment],)
            ],
        }

    def pictures(self) -> dict[str, Figure]:
        """See ``ExperimentReport``."""
        return {NAME: self._draw()}

    def section(self) -> str:
        """See ``ExperimentReport``."""
        return _section(self)

    def _rows(self, criterion: str) -> list[list[str]]:
        return [row for entry in self.entries if entry.criterion == criterion for row in _rows_of(entry)]

    def _draw(self) -> Figure:
        figure, panels = drawing.four_panels(10.0, 10.4)
        for panel, (number, environment) in zip(panels, ENVIRONMENTS.items(), strict=True):
            _draw_environment(panel, environment)
            for criterion, colour in COLOURS.items():
                entry = next(e for e in self.entries if (e.criterion, e.environment) == (criterion, number))
                if entry.example is not None:
                    _draw_trip(panel, entry.example, colour)
            drawing.draw_ends(panel, environment.start, environment.target)
            drawing.title(panel, f"Environment {number}")
        handles = [
            *(Line2D([], [], color=colour, linewidth=2.0, label=f"least {name}") for name, colour in COLOURS.items()),
            Line2D([], [], color=drawing.GREY, linewidth=1.0, linestyle=":", label="planned before the change"),
            Line2D([], [], color=drawing.RED, linewidth=1.0, label="moving obstacles after the change"),
        ]
        figure.legend(handles=handles, loc="outside lower center", ncols=4, frameon=False)
        return figure


COLOURS = {TIME: drawing.BLUE, LENGTH: drawing.GREEN}
ONLINE_OFFLINE = (
    ("generations until the first feasible path", "first_generations", "offline_first_generations"),
    ("time until then", "first_ms", "offline_first_ms"),
    ("time for 1000 generations", "all_ms", "offline_ms"),
)
"""What the paper finds to be less on-line than off-line, and the two figures."""
VARIANT_HEAD = ("variant", "env.", "found", "off-line s", "more s", "off-line m", "gen.", "touched")
HEAD = ("env.", "found", "m", "s", "gen.", "first", "1000", "speeds m/s")


def run(options: Options, advance: Advance) -> WangReport:
    """Make all trips."""
    warm_up()
    cases = list(product({**SETTINGS, **VARIANTS}.items(), ENVIRONMENTS))
    entries = []
    for (criterion, settings), number in cases:
        make_trip(ENVIRONMENTS[number], settings, options.seed)  # so that no time has the loading in it
        seeds = range(options.seed, options.seed + options.runs)
        trips = each(options.jobs, make_trip, ((ENVIRONMENTS[number], settings, seed) for seed in seeds))
        entries.append(Entry(criterion, number, tuple(trips)))
        advance(len(entries), len(cases))
    of_paper = len(SETTINGS) * len(ENVIRONMENTS)
    return WangReport(options, tuple(entries[:of_paper]), tuple(entries[of_paper:]))


def _variant_rows(entries: tuple[Entry, ...]) -> list[list[str]]:
    """``more s``: against the first variant, the mean over pairs of one seed with its 95 % interval."""
    usual = {one.environment: one.trips for one in entries if one.criterion == AS_ABOVE}
    rows = []
    for one in entries:
        figures, pairs = one.figures(), zip(one.trips, usual[one.environment], strict=True)
        more_s = [time_s(a.offline) - time_s(b.offline) for a, b in pairs if a.found and b.found]
        cells = [one.criterion, f"{one.environment}", f"{len(one.found)}/{len(one.trips)}"]
        if one.found:
            told = "" if one.criterion == AS_ABOVE else _mean_with_interval(more_s)
            cells += [f"{figures['offline_time_s']:.0f}", told]
            cells += [f"{figures['offline_length_m']:.0f}", f"{figures['first_generations']:.0f}"]
        rows.append([*cells, *[""] * (7 - len(cells)), f"{one.touched}/{len(one.trips)}"])
    return rows


def _mean_with_interval(values: list[float]) -> str:
    """With the 95 % interval by Student's t; from three pairs on."""
    mean = float(np.mean(values)) if values else 0.0
    if len(values) < FEWEST_PAIRS:
        return f"{mean:.1f}"
    from scipy import stats

    half = float(stats.t.ppf(0.975, len(values) - 1) * np.std(values, ddof=1) / np.sqrt(len(values)))
    return f"{mean:.1f} ({mean - half:.1f} to {mean + half:.1f})"


def _rows_of(entry: Entry) -> list[list[str]]:
    """Ours, and the paper's below it."""
    figures, printed = entry.figures(), PAPER[entry.criterion, entry.environment]
    ours = [f"{entry.environment}", f"{len(entry.found)}/{len(entry.trips)}"]
    if entry.found:
        ours += [f"{figures[name]:.0f}" for name in ("length_m", "time_s", "first_generations")]
        ours += [f"{drawing.figures(figures[name] or 0.0)} ms" for name in ("first_ms", "all_ms")]
        ours += [entry.speeds()]
    theirs = [f"{printed.length_m}", f"{printed.time_s}", f"{printed.first_generations}"]
    theirs += [f"{printed.first_s:g} s", f"{printed.all_s:g} s", printed.speeds_m_s.replace(",", "")]
    return [ours + [""] * (len(HEAD) - len(ours)), ["paper", "", *theirs]]


def _draw_environment(panel: Any, environment: Environment) -> None:
    drawing.draw_map(panel, Grid(environment.weights()))
    panel.set_xticks(range(0, 501, 100))
    panel.set_yticks(range(0, 501, 100))
    for moving in environment.moving:
        here = place_at(moving.before.track(), environment.change_s)
        line = np.array((here, *moving.after.places))
        panel.plot(*line.T, color=drawing.RED, linewidth=1.0)
        angles = np.linspace(0.0, 2.0 * np.pi, 40)
        circle = (here[0] + moving.radius_m * np.cos(angles), here[1] + moving.radius_m * np.sin(angles))
        panel.fill(*circle, color=drawing.RED, alpha=0.5, linewidth=0.0)


def _draw_trip(panel: Any, trip: Trip, colour: str) -> None:
    assert trip.online is not None
    panel.plot(*trip.offline.corners.T, color=drawing.GREY, linewidth=1.0, linestyle=":")
    panel.plot(*trip.online.corners.T, color=colour, linewidth=2.0, alpha=0.9)
    panel.plot(*trip.online.corners[0], marker="D", markersize=5, color=colour, zorder=6)


def _ratios(report: WangReport) -> tuple[float, float]:
    """The least ratio of the paper's times to ours: to the first feasible path, and for 1000 generations."""
    first, whole = [], []
    for entry in report.entries:
        figures, printed = entry.figures(), PAPER[entry.criterion, entry.environment]
        if figures["first_ms"] and figures["all_ms"]:
            first.append(1e3 * printed.first_s / figures["first_ms"])
            whole.append(1e3 * printed.all_s / figures["all_ms"])
    return min(first, default=0.0), min(whole, default=0.0)


def _quicker(entries: tuple[Entry, ...]) -> str:
    """In how many rows on-line planning needs less than off-line planning, which the paper claims."""
    counts = []
    for name, online, offline in ONLINE_OFFLINE:
        pairs = [(figures[online], figures[offline]) for figures in (entry.figures() for entry in entries)]
        less = sum(one is not None and other is not None and one < other for one, other in pairs)
        counts.append(f"{name} in {less}")
    return f"{', '.join(counts[:-1])}, and {counts[-1]} of the {len(entries)} rows"


def _section(report: WangReport) -> str:
    entries = report.entries
    first, whole = _ratios(report)
    tables = "\n\n".join(f"Least {name}:\n\n{markdown_table(HEAD, report._rows(name))}" for name in (TIME, LENGTH))
    details = markdown_table(
        (
            "criterion and environment",
            "static",
            "moving",
            "off-line length m",
            "off-line time s",
            "off-line gen.",
            "off-line first",
            "off-line 1000",
            "at top speed",
            "touched",
            "least gap m",
        ),
        [_detail(entry) for entry in entries],
    )
    return f"""## Moving obstacles (Wang, Sillitoe & Mulvaney 2007, table IV)

`{report.options.command(NAME)}`

A robot plans off-line with `vertex++` from {tuple(ENVIRONMENTS[1].start)} to {tuple(ENVIRONMENTS[1].target)}, 1 m a
field, speeds of {SPEEDS_M_S[0]} to {SPEEDS_M_S[1]} m/s, and follows that plan until the moving obstacles change their
ways and speeds (after 400, 380, 300 and 320 s, as in the paper). Then it plans on-line, from where it is: the table has
that plan, medians of all runs, and the speeds of the run with the median cost. "gen." is the generation of the first
feasible path, "first" the time until then, "1000" the time for 1000 generations (ours with the making of the polygons).
Below each row stands the paper's as printed: **milliseconds here, seconds there**.

{tables}

"Off-line" is the first plan, which begins at the same place whatever is sought: the fair comparison of the criteria,
since where the robot is when the obstacles change depends on how fast it was. "Touched" counts the runs in which the
robot came into contact with a moving obstacle when both were simulated in steps of 50 ms from the start to the target;
the gap is to the obstacle's edge.

{details}

The paper says that on-line planning generally needs fewer generations and less time than off-line planning, as the rest
of the way has fewer vertices ("off-line gen." and "off-line first" are those of the first feasible path). Here the
median is less on-line for {_quicker(entries)}.

What choosing speeds pays, what a mixed cost gives (*time and length*: weight 1 on seconds and 1 on metres), and what
the straight line in the first population (ours) changes:
variants of least time, with the same seeds. "More s" is the off-line time against the first variant, over pairs of one
seed, with its 95 % interval; less than 0: quicker than with five speeds to choose from. "Gen." cannot be compared with
the paper's while the straight line is there.

{markdown_table(VARIANT_HEAD, _variant_rows(report.variants))}

Measured on {where_measured()}. The paper: Matlab 7.2 on a Pentium 4 of 2.8 GHz, and no word on failures. The paper's
times are at least {first:.0f} times ours to the first feasible path, {whole:.0f} times for 1000 generations. Lengths
cannot be compared, the environments are not the paper's.

![The four environments](images/{NAME}.png)

What is ours: the environments (`sitl/experiments/wang_environments.py`), with the paper's numbers of obstacles (table
I), its obstacle speeds after the change (table III) and its safe distance of {SAFE_M:g} m (table II); moving obstacles
are discs. Red is what they do after the change, the disc is where they are at that moment; the diamond is where the
robot is.
"""


def _detail(entry: Entry) -> list[str]:
    figures, environment = entry.figures(), ENVIRONMENTS[entry.environment]
    row = [f"{entry.criterion} {entry.environment}", f"{len(environment.static)}", f"{len(environment.moving)}"]
    if not entry.found:
        return [*row, *[""] * 6, f"{entry.touched}/{len(entry.trips)}", ""]
    row += [
        f"{figures['offline_length_m']:.0f}",
        f"{figures['offline_time_s']:.0f}",
        f"{figures['offline_first_generations']:.0f}",
        f"{drawing.figures(figures['offline_first_ms'] or 0.0)} ms",
        f"{drawing.figures(figures['offline_ms'] or 0.0)} ms",
        f"{100 * entry.top_speed_share():.0f} %",
    ]
    return [*row, f"{entry.touched}/{len(entry.trips)}", f"{figures['least_gap_m']:.1f}"]
