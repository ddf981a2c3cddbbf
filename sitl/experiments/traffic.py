"""Moving obstacles: planning with their motion against yielding only, choosing speeds against one speed.

The claim of Wang et al. 2007, with a rover that drives: contacts and times over the same ground with the same seeds.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from enum import StrEnum
from typing import ClassVar

import numpy as np
from rich.table import Table

from companion.executive.mission_progress import TargetStatus
from companion.mission.load import load_mission
from companion.mission.mission import Mission
from companion.recording.recorder import NullRecorder
from companion.settings import Settings
from companion.settings.settings_file import parse_settings
from sitl.experiments.controllers import mission_on, scenario_on
from sitl.experiments.experiment import Advance, ExperimentReport, Options, each, shipped_missions
from sitl.experiments.intervals import mean_with_interval, ratio_with_interval
from sitl.experiments.off_model import parameters_for
from sitl.experiments.results_page import markdown_table, share_with_interval, terminal_table, without_intervals
from sitl.generators.kinds import GroundKind
from sitl.generators.made_ground import made
from sitl.lockstep import Drive
from sitl.scenario import scenario_from_mission

NAME = "traffic"
MISSIONS = ("crossing.toml", "depot.toml")
MADE, MOVERS = "made clutter", 4
TIME_LIMIT_S = 900.0
HEAD = ("way", "runs", "contacts", "touched in", "run into", "refused", "missed", "mean s")
PAIR_HEAD = ("first / second", "touched: first only", "second only", "pairs", "ratio of times")
SHORT_PAIR_HEAD = ("first / second", "touched: 1st", "2nd only", "pairs", "times")


class Way(StrEnum):
    """What is done about things that move."""

    HYBRID = "hybrid"
    """As the program comes: the planner knows nothing of them; the rover yields to what comes across."""
    YIELD = "yield only"
    """The same with ``vertex``: what ``vertex++`` is without moving obstacles and with one speed."""
    ONE_SPEED = "plan, one speed"
    """``vertex++``: paths past where they will be, at cruise speed; and it yields."""
    SPEEDS = "plan, speeds"
    """The same, with a speed for each piece of the path."""
    MOTIONS = "motions"
    """The controller plans motions among them."""


SETTINGS: dict[Way, dict[str, object]] = {
    Way.HYBRID: {},
    Way.YIELD: {"navigator": {"planner": "vertex"}},
    Way.ONE_SPEED: {"navigator": {"planner": "vertex++"}, "planner": {"vertex": {"speed_levels": 1}}},
    Way.SPEEDS: {"navigator": {"planner": "vertex++"}},
    Way.MOTIONS: {"guidance": {"controller": "motion-ga"}},
}
PAIRS = (
    (Way.ONE_SPEED, Way.YIELD),
    (Way.SPEEDS, Way.ONE_SPEED),
    (Way.SPEEDS, Way.YIELD),
    (Way.MOTIONS, Way.HYBRID),
)
"""What differs in one thing only: planning with motion, choosing speeds, both, and another controller."""


@dataclass(frozen=True, slots=True)
class TrafficDrive:
    """One drive."""

    course: str
    way: Way
    seed: int
    touched: int
    run_into: int
    """It stood, and something came along."""
    refused: int
    """Setpoints that the last look replaced."""
    missed: int
    """Targets not reached."""
    seconds: float
    """From the first movement to the last."""


def settings_for(way: Way) -> Settings:
    """The defaults, with what this way needs."""
    return parse_settings(SETTINGS[way], NAME)


def drive(course: Mission | str, way: Way, seed: int) -> TrafficDrive:
    """One drive. ``course``: a mission, or a kind of ground with ``MOVERS`` things that drive to and fro."""
    settings = settings_for(way)
    controller = settings.guidance.controller
    if isinstance(course, Mission):
        mission, scenario = course, scenario_from_mission(course)
        parameters = {**scenario.parameters, **parameters_for(mission.rover, controller)}
        scenario = replace(scenario, parameters=parameters)
    else:
        ground = made(course, seed, movers=MOVERS)
        mission = mission_on(ground, controller, seed)
        scenario = scenario_on(ground, mission.rover, controller)
    run = Drive(mission, scenario, settings, seed, NullRecorder(), TIME_LIMIT_S)
    report = run.run()
    hits = run.simulator.collisions
    run_into = sum(hit.was_run_into for hit in hits)
    missed = sum(status is not TargetStatus.REACHED for _, status in report.targets)
    name = mission.name if isinstance(course, Mission) else MADE
    return TrafficDrive(name, way, seed, len(hits) - run_into, run_into, report.refused, missed, report.driving_time_s)


@dataclass(frozen=True)
class TrafficReport(ExperimentReport):
    """See ``ExperimentReport``."""

    name: ClassVar[str] = NAME
    options: Options
    drives: tuple[TrafficDrive, ...]

    def tables(self) -> list[Table]:
        """Two for each course: a row a way, and a row a pair of ways."""
        return [
            terminal_table(f"{NAME}: {name}", head, without_intervals(rows))
            for name in self._courses()
            for head, rows in ((HEAD, self._rows(name)), (SHORT_PAIR_HEAD, self._pairs(name)))
        ]

    def as_json(self) -> dict[str, object]:
        """Every drive."""
        drives = [asdict(one) for one in self.drives]
        return {"experiment": NAME, "seed": self.options.seed, "runs": self.options.runs, "drives": drives}

    def _courses(self) -> list[str]:
        return list(dict.fromkeys(one.course for one in self.drives))

    def _of(self, course: str, way: Way) -> list[TrafficDrive]:
        return [one for one in self.drives if (one.course, one.way) == (course, way)]

    def _rows(self, course: str) -> list[list[str]]:
        return [_row(self._of(course, way)) for way in Way]

    def _pairs(self, course: str) -> list[list[str]]:
        return [
            [f"{one} / {other}", *_compared(self._of(course, one), self._of(course, other))] for one, other in PAIRS
        ]

    def section(self) -> str:
        """See ``ExperimentReport``."""
        tables = "\n\n".join(
            f"{name}:\n\n{markdown_table(HEAD, self._rows(name))}\n\n{markdown_table(PAIR_HEAD, self._pairs(name))}"
            for name in self._courses()
        )
        return f"""## Among things that move

`{self.options.command(NAME)}`

Wang et al. (2007) claim that a robot gets past moving obstacles sooner and more safely if it plans with their motion,
and chooses its speeds. Here a rover drives by such plans: each course with {self.options.runs} seeds in lock-step, the
same for all ways. `crossing` and `depot` as shipped; *{MADE}*: another ground for each seed, with {MOVERS} discs that
drive to and fro across the way and announce nothing. Nothing gives way to the rover.

The ways, all of which yield: the rover stops or moves aside before what comes across.

- *{Way.YIELD}*: the planner `vertex`. It is `vertex++` that knows nothing of motion and has one speed: without moving
  obstacles both give the same paths. What moves is an obstacle on its map while it is seen, where it is seen.
- *{Way.ONE_SPEED}*: `vertex++` plans paths past where things will be, at cruise speed.
- *{Way.SPEEDS}*: `vertex++` with a speed for each piece of the path.
- *{Way.HYBRID}*: the planner that the program has without settings, which knows nothing of motion either.
- *{Way.MOTIONS}*: `motion-ga` plans motions that know nothing of what moves; the planner is `hybrid`, with the guard
  on the autopilot.

*contacts*: while the rover moved; *touched in*: the share of the runs with such a contact; *run into*: it stood, and
something came along; *refused*: setpoints that the last look replaced; *missed*: targets not reached; *mean s*: driving
time where none was.

Below it, ways that differ in one thing, or in two, over the same seeds. *{Way.ONE_SPEED} / {Way.YIELD}* is what
planning with motion brings, *{Way.SPEEDS} / {Way.ONE_SPEED}* what choosing speeds brings, *{Way.SPEEDS} / {Way.YIELD}*
what both bring. *touched*: seeds with a contact in one way and none in the other. *ratio of times*: mean driving time
of the first way over the second's, of the *pairs*, seeds with which both missed no target; below 1 the first is
quicker. In brackets are 95 % intervals: of shares after Clopper and Pearson, of times by resampling seeds. A ratio
whose interval contains 1 shows no difference.

{tables}
"""


def _row(own: Sequence[TrafficDrive]) -> list[str]:
    contacts, *others = (
        sum(getattr(one, name) for one in own) for name in ("touched", "run_into", "refused", "missed")
    )
    touched_in = share_with_interval(sum(one.touched > 0 for one in own), len(own))
    times_s = [one.seconds for one in own if not one.missed]
    return [
        own[0].way,
        f"{len(own)}",
        f"{contacts}",
        touched_in,
        *map(str, others),
        mean_with_interval(times_s, digits=1),
    ]


def _compared(first: Sequence[TrafficDrive], second: Sequence[TrafficDrive]) -> list[str]:
    """Seeds with a contact in one way only, pairs in which both missed no target, and the ratio of their times."""
    both = list(zip(first, second, strict=True))
    only_first = sum(one.touched > 0 and other.touched == 0 for one, other in both)
    only_second = sum(other.touched > 0 and one.touched == 0 for one, other in both)
    times_s = [(one.seconds, other.seconds) for one, other in both if not one.missed + other.missed]
    ratio = ratio_with_interval(np.array(times_s, float).reshape(-1, 2))
    return [f"{only_first}", f"{only_second}", f"{len(times_s)}", ratio]


def run(options: Options, advance: Advance) -> TrafficReport:
    """Every way over every course, with each seed."""
    courses = [*(load_mission(file) for file in shipped_missions(options.maps, MISSIONS)), GroundKind.CLUTTER.value]
    seeds = range(options.seed, options.seed + options.runs)
    tasks = [(course, way, seed) for seed in seeds for course in courses for way in Way]
    drives: list[TrafficDrive] = []
    for done, one in enumerate(each(options.jobs, drive, tasks, options.keep), start=1):
        drives.append(one)
        advance(done, len(tasks))
    return TrafficReport(options, tuple(drives))
