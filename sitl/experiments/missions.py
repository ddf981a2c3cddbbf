"""Every shipped mission with every suite of sensors, by what leads the rover: contacts, refused setpoints, times."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict, dataclass
from typing import ClassVar

import numpy as np
from rich.table import Table

from companion.executive.mission_progress import TargetStatus
from companion.mission.mission import Mission
from companion.recording.recorder import NullRecorder
from companion.settings.settings import ControllerKind
from sitl.experiments.dead_companion import SUITES, shipped, with_suite
from sitl.experiments.experiment import (
    OFF_MODEL,
    POINTS,
    TIMEOUT_S,
    Advance,
    ExperimentReport,
    Options,
    chosen_controllers,
    each,
    unknown,
)
from sitl.experiments.intervals import mean_interval
from sitl.experiments.off_model import scenario_off_model, taken_for
from sitl.experiments.results_page import markdown_table, terminal_table
from sitl.lockstep import Drive

NAME = "missions"
NO_WAY = ("Sealed",)
"""Missions with a target that cannot be reached: the only ones in which a target may be called unreachable."""
TIME_LIMIT_S = 1800.0
HEAD = ("mission", "led by", "runs", "touched", "run into", "refused", "missed", "mean s", "95 % of the mean")


@dataclass(frozen=True, slots=True)
class MissionDrive:
    """One drive."""

    mission: str
    suite: str
    controller: str
    """What really led the rover."""
    seed: int
    touched: int
    run_into: int
    """It stood, and something that moves came along."""
    refused: int
    """Setpoints that the last look replaced."""
    missed: int
    """Targets not reached though there is a way."""
    seconds: float
    """From the first movement to the last."""


def drive(
    mission: Mission,
    controller: ControllerKind,
    seed: int,
    guarded: bool,
    off: float = OFF_MODEL,
    late_s: float = 0.0,
    timeout_s: float = TIMEOUT_S,
) -> MissionDrive:
    """One drive. ``guarded``: with the guard on the autopilot.

    ``off``: a rover that turns on the spot differs by up to this share from what the companion takes it for.
    ``late_s``: so long each message takes over the link, each way. ``timeout_s``: the autopilot's GUID_TIMEOUT.
    """
    suite = str(mission.sitl.sensors) if mission.sitl is not None else ""
    scenario = scenario_off_model(mission, seed, off, guarded=guarded, timeout_s=timeout_s)
    settings = taken_for(controller, NAME)
    run = Drive(mission, scenario, settings, seed, NullRecorder(), TIME_LIMIT_S, late_s=late_s)
    report, executor = run.run(), run.companion.mission_run.executor
    hits = run.simulator.collisions
    run_into = sum(hit.was_run_into for hit in hits)
    unreached = sum(status is not TargetStatus.REACHED for _, status in report.targets)
    led_by = POINTS if executor is None else executor.controller
    return MissionDrive(
        mission.name, suite, led_by, seed, len(hits) - run_into, run_into, report.refused,
        0 if mission.name in NO_WAY else unreached, report.driving_time_s,
    )  # fmt: skip


@dataclass(frozen=True)
class MissionsReport(ExperimentReport):
    """See ``ExperimentReport``."""

    name: ClassVar[str] = NAME
    options: Options
    drives: tuple[MissionDrive, ...]

    @property
    def section_name(self) -> str:
        """See ``ExperimentReport``. Later seeds, and parts, stand beside the whole: all at once take hours."""
        later = f"-from-{self.options.seed}" if self.options.seed else ""
        some = "".join(f"-{name}" for name in (*self.options.missions, *self.options.sensors))
        return super().section_name + ("-guarded" if self.options.guard else "") + later + some

    def tables(self) -> list[Table]:
        """One for each suite of sensors."""
        return [terminal_table(f"{NAME}: {suite}", HEAD, self._rows(suite)) for suite in _suites(self.options)]

    def as_json(self) -> dict[str, object]:
        """Every drive."""
        drives = [asdict(one) for one in self.drives]
        return {"experiment": NAME, "seed": self.options.seed, "runs": self.options.runs, "drives": drives}

    @property
    def _what(self) -> str:
        """Which missions, in words."""
        return " and ".join(f"`{name}`" for name in self.options.missions) or "Each mission"

    def _rows(self, suite: str) -> list[list[str]]:
        own = [one for one in self.drives if one.suite == suite]
        kinds = dict.fromkeys((one.mission, one.controller) for one in own)
        rows = [_row(*kind, [one for one in own if (one.mission, one.controller) == kind]) for kind in kinds]
        return [*rows, _row("all", "", own)] if rows else rows

    def section(self) -> str:
        """See ``ExperimentReport``."""
        suites = _suites(self.options)
        tables = "\n\n".join(f"`{suite}`:\n\n{markdown_table(HEAD, self._rows(suite))}" for suite in suites)
        guard = ", with the guard on the autopilot" if self.options.guard else ""
        first, after = self.options.seed, self.options.seed + self.options.runs
        later = f", seeds {first} to {after - 1}" if first else ""
        which = "Some shipped missions" if self.options.missions else "Every shipped mission"
        return f"""## {which}{guard}{later}{self.options.timeout_title}

`{self.options.command(NAME)}`

{self._what} with each suite of sensors below, {self.options.runs} seeds each{guard}.
Speed, lag, turn rate and limits of a rover that turns on the spot are {self.options.mismatch}.
*touched*: contacts while the rover moved; *run into*: it stood, and something that moves came along; *refused*:
setpoints that the last look replaced by a stop; *missed*: targets not reached though there is a way; *mean s*: driving
time, with its 95 % interval by resampling seeds. With thin beams, and on arcs, points lead the rover whatever
is asked for.

{tables}
"""


def _row(mission: str, controller: str, drives: Iterable[MissionDrive]) -> list[str]:
    own = list(drives)
    times_s = [one.seconds for one in own]
    low_s, high_s = mean_interval(times_s)
    counts = [sum(getattr(one, name) for one in own) for name in ("touched", "run_into", "refused", "missed")]
    spread = f"{low_s:.0f} to {high_s:.0f}" if controller else ""
    return [mission, controller, f"{len(own)}", *map(str, counts), f"{np.mean(times_s):.1f}", spread]


def _suites(options: Options) -> list[str]:
    """The suites of sensors that were asked for, or all. Raises ExperimentError for one that does not exist."""
    for name in options.sensors:
        if name not in SUITES:
            raise unknown("--sensors", name, SUITES)
    return [suite for suite in SUITES if suite in (options.sensors or SUITES)]


def run(options: Options, advance: Advance) -> MissionsReport:
    """Every mission, suite, controller and seed."""
    tasks = [
        (with_suite(mission, suite), controller, seed, options.guard, options.off, options.late_s, options.timeout_s)
        for controller in chosen_controllers(options, (POINTS,))
        for mission in shipped(options)
        for suite in _suites(options)
        for seed in range(options.seed, options.seed + options.runs)
    ]
    drives: list[MissionDrive] = []
    for done, one in enumerate(each(options.jobs, drive, tasks, options.keep), start=1):
        drives.append(one)
        advance(done, len(tasks))
    return MissionsReport(options, tuple(drives))
