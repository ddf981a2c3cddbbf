"""Gates: a wall with one gap, met straight on and at an angle, by a rover that is off its model."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import ClassVar

import numpy as np
from rich.table import Table

from companion.core.footprint import Footprint
from companion.mission.mission import GridSpec, HomePoint, Mission, OnBlocked, RoverSpec, SitlSpec, Target
from companion.recording.recorder import NullRecorder
from sitl.experiments.experiment import (
    OFF_MODEL,
    TIMEOUT_S,
    Advance,
    ExperimentError,
    ExperimentReport,
    Options,
    chosen_controllers,
    each,
)
from sitl.experiments.off_model import off_model, parameters_for, taken_for
from sitl.experiments.results_page import markdown_table, share_with_interval, terminal_table
from sitl.lockstep import Drive, DriveOutcome
from sitl.scenario import SOMEWHERE, Scenario, outline_of
from sitl.world.truth import SimStart
from sitl.world.world import World

NAME = "gates"
GUARDED, STRICT = "guarded", "strict"
OUTLINE = Footprint.rectangle(0.9, 0.7)
SPEED_M_S = 2.0
SENSORS = "lidar-360"
MORE_M = (0.1, 0.2, 0.3, 0.5, 0.8)
"""The gates are so much wider than the rover."""
ANGLES_DEG = (0.0, 30.0, 60.0)
SIDE_M, FINE_M = 20.0, 0.025
THICK_M = 0.2
ASIDE_M = 2.0
"""The gate lies up to so far beside the line from start to goal."""
TIME_LIMIT_S = 240.0
HEAD = ("controller", "gate m", *(f"{angle:g} deg" for angle in ANGLES_DEG), "reached (95 %)", "contacts", "mean s")


@dataclass(frozen=True, slots=True)
class GateDrive:
    """One drive: whether it came through and to its goal, and how long it drove."""

    controller: str
    width_m: float
    angle_deg: float
    seed: int
    reached: bool
    contacts: int
    seconds: float


def outline_of_rover(options: Options) -> Footprint:
    """What was asked for, or our own."""
    return OUTLINE if options.outline_m is None else Footprint.rectangle(*options.outline_m)


def widths_m(outline: Footprint) -> list[float]:
    """Of the gates."""
    return [round(2.0 * outline.half_width_m + more_m, 3) for more_m in MORE_M]


def world_of(width_m: float, angle_deg: float, aside_m: float) -> World:
    """A walled yard, and across its middle a wall that is turned by an angle, with a gap."""
    along = (np.arange(round(SIDE_M / FINE_M)) + 0.5) * FINE_M - 0.5 * SIDE_M
    north_m, east_m = along[:, None] - aside_m, along[None, :]
    turn_rad = math.radians(angle_deg)
    beside_m = north_m * math.cos(turn_rad) + east_m * math.sin(turn_rad)
    through_m = east_m * math.cos(turn_rad) - north_m * math.sin(turn_rad)
    solid = (np.abs(through_m) < 0.5 * THICK_M) & (np.abs(beside_m) >= 0.5 * width_m)
    edge = round(0.2 / FINE_M)
    solid[:edge] = solid[-edge:] = True
    solid[:, :edge] = solid[:, -edge:] = True
    return World(solid, FINE_M)


def drive(
    controller: str,
    width_m: float,
    angle_deg: float,
    seed: int,
    off: float = OFF_MODEL,
    late_s: float = 0.0,
    outline: Footprint = OUTLINE,
    guarded: bool = True,
    timeout_s: float = TIMEOUT_S,
) -> GateDrive:
    """One drive from one side of the wall to the other. ``guarded``: planned motions have the guard.

    ``timeout_s``: the autopilot's GUID_TIMEOUT.
    """
    rover = RoverSpec(outline.radius_m, SPEED_M_S, 0.0, outline)
    rng = np.random.default_rng((seed, 53))
    world = world_of(width_m, angle_deg, float(rng.uniform(-ASIDE_M, ASIDE_M)))
    drivetrain, limits = off_model(rng, off)
    goal = Target("goal", HomePoint(0.0, SIDE_M - 6.0), 0.0, OnBlocked.SKIP)
    sitl = SitlSpec(heading_deg=90.0, sensors=SENSORS)
    grid = GridSpec(margin_m=9.0, by_footprint=True)
    mission = Mission(f"gate {width_m:g} m", (goal,), grid, rover, sitl=sitl)
    start = SimStart(0.5 * SIDE_M, 3.0, math.radians(90.0), SOMEWHERE)
    parameters = {**parameters_for(rover, controller, guarded=guarded, timeout_s=timeout_s), **limits}
    scenario = Scenario(world, start, SENSORS, outline_of(rover), parameters, drivetrain=drivetrain)
    settings = taken_for(controller, NAME)
    run = Drive(mission, scenario, settings, seed, NullRecorder(), TIME_LIMIT_S, late_s=late_s)
    report = run.run()
    reached = run.companion.outcome.complete and report.outcome in (DriveOutcome.REACHED, DriveOutcome.COLLISION)
    return GateDrive(controller, width_m, angle_deg, seed, reached, report.collisions, report.driving_time_s)


@dataclass(frozen=True)
class GatesReport(ExperimentReport):
    """See ``ExperimentReport``."""

    name: ClassVar[str] = NAME
    options: Options
    drives: tuple[GateDrive, ...]

    @property
    def section_name(self) -> str:
        """See ``ExperimentReport``."""
        size = "" if self.options.outline_m is None else "-" + "x".join(f"{one:g}" for one in self.options.outline_m)
        return super().section_name + ("" if _is_guarded(self.options) else f"-{STRICT}") + size

    def tables(self) -> list[Table]:
        """One, a row a controller and width."""
        return [terminal_table(f"{NAME}: reached of {self.options.runs}", HEAD, self._rows())]

    def as_json(self) -> dict[str, object]:
        """Every drive."""
        drives = [asdict(one) for one in self.drives]
        return {"experiment": NAME, "seed": self.options.seed, "runs": self.options.runs, "drives": drives}

    def _rows(self) -> list[list[str]]:
        rows = []
        for name in dict.fromkeys(one.controller for one in self.drives):
            for width_m in widths_m(outline_of_rover(self.options)):
                own = [one for one in self.drives if (one.controller, one.width_m) == (name, width_m)]
                reached = [sum(one.reached for one in own if one.angle_deg == angle) for angle in ANGLES_DEG]
                times_s = [one.seconds for one in own if one.reached]
                mean = f"{np.mean(times_s):.1f}" if times_s else "-"
                contacts = sum(one.contacts for one in own)
                share = share_with_interval(sum(reached), len(own))
                rows.append([name, f"{width_m:g}", *map(str, reached), share, f"{contacts}", mean])
        return rows

    def section(self) -> str:
        """See ``ExperimentReport``."""
        outline = outline_of_rover(self.options)
        size = f"{outline.front_m + outline.rear_m:g} x {2.0 * outline.half_width_m:g} m"
        guarded = _is_guarded(self.options)
        head = ("" if guarded else f", {STRICT}") + ("" if self.options.outline_m is None else f": a rover of {size}")
        return f"""## Gates{head}{self.options.timeout_title}

`{self.options.command(NAME)}`

A wall across a yard of {SIDE_M:g} m with one gap, straight on and turned by 30 and 60 degrees, up to {ASIDE_M:g} m
beside the line to the goal. The rover's outline is {size},
with `{SENSORS}`, at 2 m/s. Its speed, lag, turn rate and limits are {self.options.mismatch}.
The mission has nothing but a target. Planned motions have {"the" if guarded else "no"} guard on the autopilot. Drives
of {self.options.runs} that reached the goal, all contacts, and the mean driving time:

{markdown_table(HEAD, self._rows())}
"""


def _is_guarded(options: Options) -> bool:
    """Raises ExperimentError for a setup that does not exist, or for both."""
    if options.setups not in ((), (GUARDED,), (STRICT,)):
        raise ExperimentError(f"--setups {','.join(options.setups):.60}: gates take {GUARDED} or {STRICT}")
    return options.setups != (STRICT,)


def run(options: Options, advance: Advance) -> GatesReport:
    """Every controller through every gate. Raises ExperimentError for setups that there are not."""
    outline, guarded = outline_of_rover(options), _is_guarded(options)
    tasks = [
        (name, width_m, angle_deg, seed, options.off, options.late_s, outline, guarded, options.timeout_s)
        for name in chosen_controllers(options, ("motion-ga",))
        for width_m in widths_m(outline)
        for angle_deg in ANGLES_DEG
        for seed in range(options.seed, options.seed + options.runs)
    ]
    drives: list[GateDrive] = []
    for done, one in enumerate(each(options.jobs, drive, tasks, options.keep), start=1):
        drives.append(one)
        advance(done, len(tasks))
    return GatesReport(options, tuple(drives))
