"""What leads the rover: planned motions against points on Theta*'s way, over the same random grounds.

A pair is one ground and one rover off its model, driven by both. Times are compared where both reach the goal.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import ClassVar

import numpy as np
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
        """One for each kind of ground, and one for all."""
        return [terminal_table(f"{NAME}: {one}", SHORT, without_intervals(self._rows(one))) for one in self._kinds()]

    def as_json(self) -> dict[str, object]:
        """Every drive."""
        drives = [asdict(one) for one in self.drives]
        return {"experiment": NAME, "seed": self.options.seed, "runs": self.options.runs, "drives": drives}

    def _kinds(self) -> list[str]:
        return [*GROUNDS, ALL]

    def _rows(self, kind: str) -> list[list[str]]:
        own = [one for one in self.drives if kind in (ALL, one.kind)]
        reference = {(one.kind, one.seed): one for one in own if one.controller == POINTS}
        names = dict.fromkeys(one.controller for one in own)
        return [_row(name, [one for one in own if one.controller == name], reference) for name in names]

    def section(self) -> str:
        """See ``ExperimentReport``."""
        tables = "\n\n".join(f"{kind}:\n\n{markdown_table(HEAD, self._rows(kind))}" for kind in self._kinds())
        return f"""## Planned motions against points

`{self.options.command(NAME)}`

Random grounds of three kinds, {self.options.runs} of each: clutter, rooms with doors, a yard with fences and gates
(doors and gates of 1.3 to 2 m). A rover of {ROVER.radius_m:g} m radius at {SPEED_M_S:g} m/s with `{SENSORS}`, whose
speed, lag, turn rate and limits are {self.options.mismatch}.
`{POINTS}` drives on the way of `{REFERENCE_PLANNER}` on fields of {POINTS_RESOLUTION_M:g} m; the others plan motions,
on the way of the navigator as shipped, with the guard on the autopilot. *refused*: setpoints that the last look
replaced by a stop; *pairs*: grounds on which this controller and `{POINTS}` reach the goal; *mean s*, *points s*: their
mean driving times there; *ratio*: the one over the other, in brackets its 95 % interval by resampling pairs.

{tables}
"""


def _row(name: str, own: Sequence[GroundDrive], reference: dict[tuple[GroundKind, int], GroundDrive]) -> list[str]:
    others = [reference.get((one.kind, one.seed)) for one in own]
    pairs = np.array(
        [
            (one.seconds, other.seconds)
            for one, other in zip(own, others, strict=True)
            if other is not None and one.reached and other.reached
        ]
    ).reshape(-1, 2)
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
