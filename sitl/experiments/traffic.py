"""Moving obstacles: planning with their motion against making way only, choosing speeds against one speed.

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
from sitl.experiments.results_page import markdown_table, terminal_table, without_intervals
from sitl.generators.kinds import GroundKind
from sitl.generators.made_ground import made
from sitl.lockstep import Drive
from sitl.scenario import scenario_from_mission

NAME = "traffic"
MISSIONS = ("crossing.toml", "depot.toml")
MADE, MOVERS = "made clutter", 4
TIME_LIMIT_S = 900.0
HEAD = ("way", "runs", "touched", "run into", "refused", "missed", "mean s", "/ make way")
SHORT = ("way", "runs", "touched", "run into", "refused", "missed", "s", "/ first")


class Way(StrEnum):
    """What is done about things that move."""

    MAKE_WAY = "make way"
    """The planner knows nothing of them; the rover stops, or moves aside, before what comes across."""
    ONE_SPEED = "plan, one speed"
    """Paths past where they will be, at cruise speed; and it makes way."""
    SPEEDS = "plan, speeds"
    """The same, with a speed for each piece of the path."""
    MOTIONS = "motions"
    """The controller plans motions among them."""


SETTINGS: dict[Way, dict[str, object]] = {
    Way.MAKE_WAY: {},
    Way.ONE_SPEED: {"navigator": {"planner": "vertex++"}, "planner": {"vertex": {"speed_levels": 1}}},
    Way.SPEEDS: {"navigator": {"planner": "vertex++"}},
    Way.MOTIONS: {"guidance": {"controller": "motion-ga"}},
}


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
        """One for each course, a row a way."""
        return [
            terminal_table(f"{NAME}: {name}", SHORT, without_intervals(self._rows(name))) for name in self._courses()
        ]

    def as_json(self) -> dict[str, object]:
        """Every drive."""
        drives = [asdict(one) for one in self.drives]
        return {"experiment": NAME, "seed": self.options.seed, "runs": self.options.runs, "drives": drives}

    def _courses(self) -> list[str]:
        return list(dict.fromkeys(one.course for one in self.drives))

    def _rows(self, course: str) -> list[list[str]]:
        of_way = {way: [one for one in self.drives if (one.course, one.way) == (course, way)] for way in Way}
        return [_row(own, of_way[Way.MAKE_WAY]) for own in of_way.values()]

    def section(self) -> str:
        """See ``ExperimentReport``."""
        tables = "\n\n".join(f"{name}:\n\n{markdown_table(HEAD, self._rows(name))}" for name in self._courses())
        return f"""## Among things that move

`{self.options.command(NAME)}`

The claim of Wang et al. (2007) with a rover that drives: {self.options.runs} seeds of each course in lock-step, the
same for all ways. `crossing` and `depot` as shipped; *{MADE}*: another ground for each seed, with {MOVERS} discs that
drive to and fro across the way and announce nothing. *{Way.MAKE_WAY}*: the planner `hybrid` knows nothing of what
moves, and the rover stops or moves aside before it; *{Way.ONE_SPEED}*: `vertex++` plans paths past where things will
be, at cruise speed; *{Way.SPEEDS}*: with a speed for each piece of the path; *{Way.MOTIONS}*: `motion-ga` plans motions
among them, with the guard on the autopilot. All of them make way, too. *touched*: contacts while the rover moved; *run
into*: it stood, and something came along (nothing here gives way to a rover); *missed*: targets not reached; *mean s*:
driving time where none was, and */ {Way.MAKE_WAY}* that over the first way's, of the seeds with which both missed none;
in brackets 95 % intervals by resampling seeds.

{tables}
"""


def _row(own: Sequence[TrafficDrive], reference: Sequence[TrafficDrive]) -> list[str]:
    counts = [sum(getattr(one, name) for one in own) for name in ("touched", "run_into", "refused", "missed")]
    arrived = [(one, other) for one, other in zip(own, reference, strict=True) if not one.missed + other.missed]
    pairs = np.array([(one.seconds, other.seconds) for one, other in arrived], float).reshape(-1, 2)
    times_s = [one.seconds for one in own if not one.missed]
    ratio = "1" if own is reference else ratio_with_interval(pairs)
    return [own[0].way, f"{len(own)}", *map(str, counts), mean_with_interval(times_s, digits=1), ratio]


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
