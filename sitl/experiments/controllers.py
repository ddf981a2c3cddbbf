"""What leads the rover: planned motions against points on Theta*'s way, over the same random grounds.

A pair is one ground and one rover off its model, driven by both. Times are compared where both reach the goal.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from itertools import combinations
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from rich.table import Table

from companion.mission.mission import GridSpec, HomePoint, Mission, OnBlocked, RoverSpec, SitlSpec, Target
from companion.recording.recorder import NullRecorder
from companion.settings import Settings
from companion.settings.settings import CONTROLLERS
from sitl.experiments.experiment import (
    OFF_MODEL,
    POINTS,
    Advance,
    ExperimentReport,
    Options,
    chosen_controllers,
    each,
)
from sitl.experiments.intervals import ratio_with_interval
from sitl.experiments.off_model import off_model, parameters_for, taken_for
from sitl.experiments.results_page import markdown_table, terminal_table, without_intervals
from sitl.generators.kinds import GroundKind
from sitl.generators.made_ground import MadeGround, made
from sitl.lockstep import Drive, DriveOutcome
from sitl.scenario import SOMEWHERE, Scenario, outline_of
from sitl.world.truth import SimStart

NAME = "controllers"
SPEED_M_S = 2.0
SENSORS = "lidar-360"
ROVER = RoverSpec(0.35, SPEED_M_S)
POINTS_RESOLUTION_M = 0.5
"""Fields for points, fine enough for gaps of 1.2 m; planned motions take what the outline needs."""
REFERENCE_PLANNER = "theta-star"
TIME_LIMIT_S = 600.0
ALL = "all"
GROUNDS = (GroundKind.CLUTTER, GroundKind.ROOMS, GroundKind.YARD)
SHORT = ("controller", "runs", "there", "touched", "refused", "pairs", "s", "points s", "ratio")
PAIR_HEAD = ("first / second", "contacts: first", "second", "pairs", "first: mean s", "second: mean s", "ratio")
SHORT_PAIR_HEAD = ("first / second", "touched: 1st", "2nd", "pairs", "1st: s", "2nd: s", "ratio")
HEAD = ("controller", "runs", "reached", "contacts", "refused", "pairs", "mean s", "points s", "ratio")


@dataclass(frozen=True, slots=True)
class GroundDrive:
    """One drive."""

    controller: str
    kind: GroundKind
    seed: int
    reached: bool
    contacts: int
    refused: int
    """Setpoints that the last look replaced."""
    seconds: float
    """From the first movement to the last."""


def settings_for(controller: str) -> Settings:
    """Points on Theta*'s way; motions on the way of the navigator as shipped."""
    navigator = {"navigator": {"planner": REFERENCE_PLANNER}} if controller == POINTS else {}
    return taken_for(controller, NAME, navigator)


def mission_on(ground: MadeGround, controller: str, seed: int) -> Mission:
    """From one side to the other."""
    place = HomePoint(ground.goal_m[0] - ground.start_m[0], ground.goal_m[1] - ground.start_m[1])
    grid = (
        GridSpec(POINTS_RESOLUTION_M, margin_m=30.0)
        if controller == POINTS
        else GridSpec(margin_m=30.0, by_footprint=True)
    )
    sitl = SitlSpec(heading_deg=90.0, sensors=SENSORS)
    return Mission(f"{ground.kind} {seed}", (Target("goal", place, 0.0, OnBlocked.SKIP),), grid, ROVER, sitl=sitl)


def scenario_on(ground: MadeGround, rover: RoverSpec, controller: str) -> Scenario:
    """The simulation of such a mission; with the guard where motions are planned."""
    start = SimStart(*ground.start_m, np.pi / 2.0, SOMEWHERE)
    return Scenario(ground.world, start, SENSORS, outline_of(rover), parameters_for(rover, controller))


def drive(kind: GroundKind, controller: str, seed: int, off: float = OFF_MODEL, late_s: float = 0.0) -> GroundDrive:
    """One drive. ``off``: the rover differs by up to this share from what the companion takes it for."""
    ground = made(kind, seed)
    mission = mission_on(ground, controller, seed)
    drivetrain, limits = off_model(np.random.default_rng((seed, 52)), off)
    scenario = scenario_on(ground, ROVER, controller)
    scenario = replace(scenario, parameters={**scenario.parameters, **limits}, drivetrain=drivetrain)
    run = Drive(mission, scenario, settings_for(controller), seed, NullRecorder(), TIME_LIMIT_S, late_s=late_s)
    report = run.run()
    reached = run.companion.outcome.complete and report.outcome in (DriveOutcome.REACHED, DriveOutcome.COLLISION)
    return GroundDrive(controller, kind, seed, reached, report.collisions, report.refused, report.driving_time_s)


@dataclass(frozen=True)
class ControllersReport(ExperimentReport):
    """See ``ExperimentReport``."""

    name: ClassVar[str] = NAME
    options: Options
    drives: tuple[GroundDrive, ...]

    def tables(self) -> list[Table]:
        """One for each kind of ground, and one for all; the same of pairs, where there are any."""
        return [
            terminal_table(f"{NAME}: {kind}", head, without_intervals(rows))
            for kind in self._kinds()
            for head, rows in ((SHORT, self._rows(kind)), (SHORT_PAIR_HEAD, self._pair_rows(kind)))
            if rows or head is SHORT
        ]

    def as_json(self) -> dict[str, object]:
        """Every drive."""
        drives = [asdict(one) for one in self.drives]
        return {"experiment": NAME, "seed": self.options.seed, "runs": self.options.runs, "drives": drives}

    def _kinds(self) -> list[str]:
        return [*GROUNDS, ALL]

    def _rows(self, kind: str) -> list[list[str]]:
        own = self._by_controller(kind)
        return [_row(name, drives, own.get(POINTS, [])) for name, drives in own.items()]

    def _pair_rows(self, kind: str) -> list[list[str]]:
        """Each two controllers that plan motions."""
        own = {name: drives for name, drives in self._by_controller(kind).items() if name != POINTS}
        return [_pair_row(one, other, own[one], own[other]) for one, other in combinations(own, 2)]

    def _by_controller(self, kind: str) -> dict[str, list[GroundDrive]]:
        own = [one for one in self.drives if kind in (ALL, one.kind)]
        names = dict.fromkeys(one.controller for one in own)
        return {name: [one for one in own if one.controller == name] for name in names}

    def _section_of(self, kind: str) -> str:
        pairs = self._pair_rows(kind)
        compared = f"\n\n{markdown_table(PAIR_HEAD, pairs)}" if pairs else ""
        return markdown_table(HEAD, self._rows(kind)) + compared

    def section(self) -> str:
        """See ``ExperimentReport``."""
        tables = "\n\n".join(f"{kind}:\n\n{self._section_of(kind)}" for kind in self._kinds())
        harder = "" if self.options.usual else ", harder rovers and links"
        return f"""## Planned motions against points{harder}

`{self.options.command(NAME)}`

Random grounds of three kinds, {self.options.runs} of each: clutter, rooms with doors, a yard with fences and gates
(doors and gates of 1.3 to 2 m). A rover of {ROVER.radius_m:g} m radius at {SPEED_M_S:g} m/s with `{SENSORS}`, whose
speed, lag, turn rate and limits are {self.options.mismatch}.
`{POINTS}` drives on the way of `{REFERENCE_PLANNER}` on fields of {POINTS_RESOLUTION_M:g} m; the others plan motions,
on the way of the navigator as shipped, with the guard on the autopilot. *refused*: setpoints that the last look
replaced by a stop; *pairs*: grounds on which this controller and `{POINTS}` reach the goal; *mean s*, *points s*: their
mean driving times there; *ratio*: the one over the other, in brackets its 95 % interval by resampling pairs. The second
table of each kind of ground compares two controllers that plan motions in the same way: *pairs* are the grounds on
which both reach the goal, contacts those on all grounds.

{tables}
"""


def _row(name: str, own: Sequence[GroundDrive], reference: Sequence[GroundDrive]) -> list[str]:
    pairs = _pairs(own, reference)
    row = [
        name,
        f"{len(own)}",
        f"{sum(one.reached for one in own)}",
        f"{sum(one.contacts for one in own)}",
        f"{sum(one.refused for one in own)}",
        f"{len(pairs)}",
    ]
    if not len(pairs):
        return [*row, "-", "-", "-"]
    return [*row, f"{pairs[:, 0].mean():.1f}", f"{pairs[:, 1].mean():.1f}", ratio_with_interval(pairs)]


def _pair_row(one: str, other: str, first: Sequence[GroundDrive], second: Sequence[GroundDrive]) -> list[str]:
    pairs = _pairs(first, second)
    means = ["-", "-"] if not len(pairs) else [f"{mean:.1f}" for mean in pairs.mean(axis=0)]
    contacts = [f"{sum(drive.contacts for drive in own)}" for own in (first, second)]
    return [f"{one} / {other}", *contacts, f"{len(pairs)}", *means, ratio_with_interval(pairs)]


def _pairs(first: Sequence[GroundDrive], second: Sequence[GroundDrive]) -> NDArray[np.float64]:
    """The seconds of both on the grounds where both reach the goal, shape (n, 2)."""
    others = {(one.kind, one.seed): one for one in second if one.reached}
    both = [(one, others[one.kind, one.seed]) for one in first if one.reached and (one.kind, one.seed) in others]
    return np.array([(one.seconds, other.seconds) for one, other in both]).reshape(-1, 2)


def run(options: Options, advance: Advance) -> ControllersReport:
    """Every controller on every ground; the reference among them."""
    chosen = chosen_controllers(options, CONTROLLERS)
    names = dict.fromkeys((POINTS, *chosen))
    tasks = [
        (kind, name, seed, options.off, options.late_s)
        for name in names
        for kind in GROUNDS
        for seed in range(options.seed, options.seed + options.runs)
    ]
    drives: list[GroundDrive] = []
    for done, one in enumerate(each(options.jobs, drive, tasks, options.keep), start=1):
        drives.append(one)
        advance(done, len(tasks))
    return ControllersReport(options, tuple(drives))
