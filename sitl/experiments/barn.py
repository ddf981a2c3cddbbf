"""The BARN benchmark: narrow ground that nobody has mapped, the challenge's rover, protocol and score.

Perille, Truong, Xiao & Stone 2020, and the rules of the challenge at ICRA: 10 m ahead, reached within 1 m, 100 s from
the moment when the rover has moved 0.1 m, any contact ends a run. In our simulator: no entry to the challenge.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from enum import StrEnum
from functools import cached_property
from typing import ClassVar

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray
from rich.table import Table

from companion.core.footprint import Footprint
from companion.lidar.models import NAMES, model_named
from companion.lidar.spec import LidarSpec, parsed
from companion.mission.mission import GridSpec, HomePoint, Mission, OnBlocked, RoverSpec, SitlSpec, Target
from companion.recording.recorder import NullRecorder
from companion.settings import Settings
from companion.settings.settings import CONTROLLERS
from companion.vehicle.motion_limits import TIMEOUT
from companion.vehicle.recommended_parameters import RECOMMENDED_PARAMETERS
from sitl.experiments import drawing
from sitl.experiments.barn_measures import SPREAD_HEAD, difficulty_of, spread_rows
from sitl.experiments.barn_worlds import GOAL_M, START_M, BarnWorld, made_world, read_worlds
from sitl.experiments.experiment import (
    GUARD,
    OFF_MODEL,
    POINTS,
    TIMEOUT_S,
    Advance,
    ExperimentError,
    ExperimentReport,
    Options,
    chosen_controllers,
    each,
    unknown,
)
from sitl.experiments.off_model import SHIPPED, Limits, off_model
from sitl.experiments.results_page import markdown_table, share_with_interval, terminal_table, without_intervals
from sitl.lockstep import Drive
from sitl.scenario import SOMEWHERE, Scenario, outline_of, with_lidars
from sitl.sensors.lidar_bytes import MAKES
from sitl.sensors.range_sensors import Lidar, SensorSuite
from sitl.world.truth import SimStart

NAME = "barn"
JACKAL = Footprint.rectangle(0.508, 0.430)
SPEED_M_S = 2.0
LIMIT_S = 100.0
REACHED_M = 1.0
MOVED_M = 0.1
FASTEST, SLOWEST = 2.0, 8.0
"""The score counts a time between so many optimal times (since 2026; before, from 4 on)."""
OLD_FASTEST = 4.0
LIDAR = Lidar(3.75, -135.0 + 0.5 * 3.75, 0.06, 10.0, 20.0, 10, 72)
"""270 degrees, 10 m, 720 rays. A MAVLink message has room for 72 distances: each is the shortest of ten rays."""
ON_COMPANION = "mask=135..225,max=10"
"""The part of a lidar that the companion reads itself which counts: no more than the challenge's lidar sees."""
WARM_S = 60.0
"""So long the rover may take until it moves."""
MADE = 50
"""So many worlds of our own making, if no file is given."""
STANDARD = range(0, 300, 6)
"""The numbers of the challenge's standard set: every sixth world."""
WORST = 10
HEAD = ("controller", "runs", "reached", "contact", "timeout", "score", "old score", "t / OT")


class Setup(StrEnum):
    """What is driven. Planned motions have the guard on the autopilot, but for ``STRICT``."""

    GUARDED = "guarded"
    """ArduRover's limits as shipped."""
    STRICT = "strict"
    """The same without the guard."""
    JACKAL = "jackal"
    """A Jackal's limits."""


JACKAL_LIMITS = Limits(20.0, 25.0, 4.0, 0.05)
"""As its own velocity controller is configured (jackal/jackal, jackal_control/config/control.yaml); the lag is ours."""


def limits_of(setup: Setup) -> Limits:
    """The limits that are driven with."""
    return JACKAL_LIMITS if setup is Setup.JACKAL else SHIPPED


class RunEnd(StrEnum):
    """How a run ends."""

    REACHED = "reached"
    CONTACT = "contact"
    TIMEOUT = "timeout"


@dataclass(frozen=True, eq=False, slots=True)
class BarnRun:
    """One run. ``seconds``: from the moment when the rover has moved; ``optimal_s``: of its world.

    ``track_m``: shape (n, 2), x and y of the benchmark's frame, four a second.
    """

    controller: str
    setup: Setup
    world: int
    seed: int
    end: RunEnd
    seconds: float
    optimal_s: float
    track_m: NDArray[np.float64]

    def score(self, fastest: float = FASTEST) -> float:
        """The challenge's score, at most 1 / ``fastest``."""
        return score(self.end is RunEnd.REACHED, self.seconds, self.optimal_s, fastest)


def score(reached: bool, seconds: float, optimal_s: float, fastest: float) -> float:
    """Of one run, as the challenge counts it."""
    return reached * optimal_s / min(max(seconds, fastest * optimal_s), SLOWEST * optimal_s)


def settings_for(controller: str, setup: Setup = Setup.GUARDED) -> Settings:
    """Fine evidence, and data as often as the lidar has it."""
    limits = limits_of(setup)
    keeps = "circle" if controller == POINTS else "outline"
    return Settings.model_validate(
        {
            "guidance": {"controller": controller},
            "mapping": {"evidence_m": 0.05, "hit_depth_m": 0.02, "keeps": keeps},
            "link": {"range_rate_hz": 20.0, "position_rate_hz": 20.0},
            # Set, so that they are not read from the autopilot: the rover is to be another than it is taken for.
            "motion": {
                "acceleration_m_s2": limits.acceleration_m_s2,
                "deceleration_m_s2": limits.acceleration_m_s2,
                "turn_acceleration_rad_s2": limits.turn_acceleration_rad_s2,
            },
        }
    )


def mission_of(world: BarnWorld) -> Mission:
    """10 m ahead."""
    goal = HomePoint(GOAL_M[1] - START_M[1], GOAL_M[0] - START_M[0])
    return Mission(
        f"world {world.number}", (Target("goal", goal, 0.0, OnBlocked.SKIP),), GridSpec(0.2, margin_m=2.6),
        RoverSpec(JACKAL.radius_m, SPEED_M_S, 0.0, JACKAL), sitl=SitlSpec(heading_deg=0.0),
    )  # fmt: skip


def drive(
    world: BarnWorld,
    controller: str,
    seed: int,
    setup: Setup = Setup.GUARDED,
    off: float = OFF_MODEL,
    late_s: float = 0.0,
    lidar: str | None = None,
    settings: Settings | None = None,
    timeout_s: float = TIMEOUT_S,
) -> BarnRun:
    """One run. ``off``: the rover differs by up to this share from what the companion takes it for.

    ``late_s``: so long each message takes over the link, each way. ``lidar``: the model of one that the companion reads
    itself; None: its distances come over MAVLink. ``timeout_s``: the autopilot's GUID_TIMEOUT.
    """
    start, mission = SimStart(START_M[1], START_M[0], 0.0, SOMEWHERE), mission_of(world)
    drivetrain, limits = off_model(np.random.default_rng((world.number, seed, 30)), off, limits_of(setup))
    guard = {} if controller == POINTS or setup is Setup.STRICT else GUARD
    parameters = {"WP_SPEED": SPEED_M_S, **RECOMMENDED_PARAMETERS, TIMEOUT: timeout_s, **limits, **guard}
    lidars = () if lidar is None else (_on_companion(lidar),)
    sensors = SensorSuite() if lidars else SensorSuite(LIDAR)
    plain = Scenario(world.world(), start, sensors, outline_of(mission.rover), parameters, drivetrain=drivetrain)
    given, limit_s = settings or settings_for(controller, setup), WARM_S + LIMIT_S
    scenario = with_lidars(plain, lidars)
    run = Drive(mission, scenario, given, seed, NullRecorder(), limit_s, late_s=late_s, lidars=lidars)
    simulator, began_s, track, end = run.simulator, math.inf, [(start.east_m, start.north_m)], None
    seconds = 0.0
    while end is None:
        run.companion.tick()
        truth, now_s = simulator.truth, simulator.time_s
        if math.isinf(began_s) and math.hypot(truth.north_m - start.north_m, truth.east_m - start.east_m) >= MOVED_M:
            began_s = now_s
        seconds = max(now_s - began_s, 0.0)
        if seconds >= 0.25 * len(track):
            track.append((truth.east_m, truth.north_m))
        if simulator.collisions:
            end = RunEnd.CONTACT
        elif math.hypot(truth.east_m - GOAL_M[0], truth.north_m - GOAL_M[1]) <= REACHED_M:
            end = RunEnd.REACHED
        elif seconds >= LIMIT_S or run.companion.done or now_s > WARM_S + LIMIT_S:
            end = RunEnd.TIMEOUT
    track.append((simulator.truth.east_m, simulator.truth.north_m))
    return BarnRun(controller, setup, world.number, seed, end, seconds, world.optimal_s, np.array(track))


def _on_companion(model: str) -> LidarSpec:
    return parsed(f"{model}:{ON_COMPANION}", "simulated")


@dataclass(frozen=True)
class BarnReport(ExperimentReport):
    """See ``ExperimentReport``."""

    name: ClassVar[str] = NAME
    options: Options
    worlds: tuple[BarnWorld, ...]
    series: dict[tuple[Setup, str], tuple[BarnRun, ...]]
    """By setup and controller."""

    @property
    def section_name(self) -> str:
        """See ``ExperimentReport``; other setups than the usual one, or one controller alone, stand beside it."""
        return super().section_name + "".join(f"-{one.lower()}" for one in self._others())

    def tables(self) -> list[Table]:
        """How hard the worlds are, and one a setup, with a row a controller."""
        driven = f"{self._driven()}, {_counted(self.options.runs, 'seed')} each"
        rows = {one: self._rows(one, plain=True) for one in self._setups()}
        return [
            terminal_table(f"{NAME}: {self._driven()}, how hard they are", SPREAD_HEAD, self._spread),
            *(terminal_table(f"{NAME}, {one}: {driven}", HEAD, own) for one, own in rows.items()),
        ]

    def as_json(self) -> dict[str, object]:
        """Every run."""
        runs = [
            {key: value for key, value in asdict(run).items() if key != "track_m"} | {"score": run.score()}
            for runs in self.series.values()
            for run in runs
        ]
        return {"experiment": NAME, "seed": self.options.seed, "runs": runs}

    @cached_property
    def _spread(self) -> list[list[str]]:
        """Of the worlds' measures."""
        return spread_rows([difficulty_of(world) for world in self.worlds])

    def _lidar(self) -> str:
        """What the rover sees with, in words."""
        if self.options.lidar is None:
            return (
                "Its lidar has 720 rays over 270 degrees that reach 10 m; the companion\n"
                f"gets {LIDAR.sectors} distances over MAVLink, each the shortest of {LIDAR.rays} rays."
            )
        spec = _on_companion(self.options.lidar)
        make = MAKES[spec.model.name]
        rays = round(0.75 * make.points_hz / make.turns_hz)
        return (
            f"The companion reads its lidar itself ({spec.model.name}, {make.turns_hz:g}\n"
            f"turns a second); 270 degrees and 10 m of it count: {rays} rays a turn; the challenge's lidar has 720."
        )

    def _driven(self) -> str:
        """Which worlds, in words."""
        number, archive = len(self.worlds), self.options.archive
        if archive is None:
            return f"{_counted(number, 'world')} of our own making"
        if is_standard(self.worlds):
            return f"the standard set of {_counted(number, 'world')}"
        return f"{_counted(number, 'world')} of {archive.name}, not the standard set"

    def _setups(self) -> list[Setup]:
        return [setup for setup in Setup if any(setup is one for one, _ in self.series)]

    def _others(self) -> list[str]:
        """The setups, where the usual one is not among them; the controller, where it is the only one; the lidar."""
        own_lidar = [self.options.lidar] if self.options.lidar else []
        if Setup.GUARDED not in self._setups():
            return [*map(str, self._setups()), *own_lidar]
        names = list(dict.fromkeys(name for _, name in self.series))
        return [*(names if len(names) == 1 else []), *own_lidar]

    def _rows(self, setup: Setup, *, plain: bool = False) -> list[list[str]]:
        """``plain``: without intervals."""
        rows = [_row(name, runs) for (one, name), runs in self.series.items() if one is setup]
        return without_intervals(rows) if plain else rows

    def pictures(self) -> dict[str, Figure]:
        """The worst runs of the best controller."""
        return {f"{self.section_name}-worst": _picture(self.worlds, worst(self.series[self._best()]))}

    def _best(self) -> tuple[Setup, str]:
        """Of the first setup."""
        own = [one for one in self.series if one[0] is self._setups()[0]]
        return max(own, key=lambda one: float(np.mean([run.score() for run in self.series[one]])))

    def section(self) -> str:
        """See ``ExperimentReport``."""
        driven = self._driven()
        shown = min(WORST, len(self.series[self._best()]))
        tables = "\n\n".join(f"{_told(one)}:\n\n{markdown_table(HEAD, self._rows(one))}" for one in self._setups())
        others = " and ".join(self._others())
        return f"""## Narrow ground (BARN){others and f": {others}"}{self.options.timeout_title}

`{self.options.command(NAME)}`

{driven[0].upper()}{driven[1:]}, {_counted(self.options.runs, "seed")} each.
Protocol and score are those of the BARN challenge at ICRA. **In our simulator, not an entry.** The rover has a Jackal's
outline (0.508 x 0.430 m) and drives at 2 m/s. {self._lidar()}
In each run the rover's speed, lag and turn rate, and its limits of acceleration, braking and turning, are
{self.options.mismatch}.

How hard the worlds are, along the shortest way among the posts ([measures](worlds.md#worlds-from-seeds)); so many
worlds have at most these figures:

{markdown_table(SPREAD_HEAD, self._spread)}

*score*: as counted since 2026, at most 0.5; *old score*: as before, at most 0.25; *t / OT*: mean time over the optimal
time, of runs that reached the goal. In brackets: 95 % intervals, by resampling worlds.

{tables}

![The worst runs](images/{self.section_name}-worst.png)

The {_counted(shown, "worst run")} of `{self._best()[1]}` with the way it drove: first those that ended badly, then the
slowest.
"""


def _counted(number: int, what: str) -> str:
    return f"{number} {what}{'' if number == 1 else 's'}"


def _told(setup: Setup) -> str:
    limits = limits_of(setup)
    figures = f"{limits.acceleration_m_s2:g} m/s² and {limits.turn_acceleration_rad_s2:.1f} rad/s²"
    whose = "a Jackal's limits" if setup is Setup.JACKAL else "the limits of ArduRover as shipped"
    guard = f"a guard on the autopilot that stops the rover {1e-3 * GUARD['SCR_USER1']:g} s after the last packet"
    with_it = "without a guard" if setup is Setup.STRICT else f"planned motions with {guard}"
    return f"`{setup}`: {whose} ({figures}), {with_it}"


def _row(name: str, runs: Sequence[BarnRun]) -> list[str]:
    ends = [run.end for run in runs]
    reached = [run for run in runs if run.end is RunEnd.REACHED]
    return [
        name,
        f"{len(runs)}",
        with_interval(runs, lambda run: run.end is RunEnd.REACHED),
        share_with_interval(ends.count(RunEnd.CONTACT), len(runs)),
        share_with_interval(ends.count(RunEnd.TIMEOUT), len(runs)),
        with_interval(runs, lambda run: run.score()),
        f"{np.mean([run.score(OLD_FASTEST) for run in runs]):.3f}",
        with_interval(reached, lambda run: run.seconds / run.optimal_s) if reached else "-",
    ]


def with_interval(runs: Sequence[BarnRun], figure: Callable[[BarnRun], float]) -> str:
    """The mean of a figure and its 95 % interval, from 2000 draws of as many worlds, with replacement."""
    numbers = sorted({run.world for run in runs})
    means = np.array([np.mean([figure(run) for run in runs if run.world == number]) for number in numbers])
    drawn = np.random.default_rng(0).integers(len(means), size=(2000, len(means)))
    low, high = np.percentile(means[drawn].mean(axis=1), (2.5, 97.5))
    return f"{np.mean([figure(run) for run in runs]):.3f} ({low:.3f} to {high:.3f})"


def worst(runs: Sequence[BarnRun]) -> list[BarnRun]:
    """The runs that ended badly, then the slowest."""
    order = sorted(runs, key=lambda run: (run.end is RunEnd.REACHED, -run.seconds / run.optimal_s))
    return order[:WORST]


def _picture(worlds: Sequence[BarnWorld], runs: Sequence[BarnRun]) -> Figure:
    named = {world.number: world for world in worlds}
    figure = Figure(figsize=(12.0, 11.0), layout="constrained", dpi=80)
    panels = list(figure.subplots(2, (len(runs) + 1) // 2, squeeze=False).flat)
    for panel, run in zip(panels, runs, strict=False):
        world = named[run.world].world()
        edges = (world.west_m, world.west_m + world.width_m, world.south_m, world.south_m + world.height_m)
        panel.imshow(~world.obstacles, cmap="gray", vmin=-0.3, vmax=1.0, origin="lower", extent=edges)
        panel.plot(run.track_m[:, 0], run.track_m[:, 1], color=drawing.BLUE, linewidth=1.0)
        if run.end is not RunEnd.REACHED:
            panel.plot(*run.track_m[-1], marker="x", color=drawing.RED, markersize=9, markeredgewidth=2.5)
        panel.set_title(f"world {run.world}, seed {run.seed}\n{run.end}, {run.seconds:.1f} s", fontsize=9)
        panel.tick_params(labelsize=7, length=2)
    for panel in panels[len(runs) :]:
        panel.set_axis_off()
    return figure


def standard(worlds: Sequence[BarnWorld]) -> tuple[BarnWorld, ...]:
    """The challenge's standard set, or all worlds where a file does not have the whole of it."""
    chosen = [world for world in worlds if world.number in STANDARD]
    return tuple(chosen if is_standard(chosen) else worlds)


def is_standard(worlds: Sequence[BarnWorld]) -> bool:
    """Whether the numbers are those of the challenge's standard set."""
    return sorted(world.number for world in worlds) == list(STANDARD)


def run(options: Options, advance: Advance) -> BarnReport:
    """Every world with every controller, as many times as there are runs."""
    chosen = chosen_controllers(options, CONTROLLERS)
    if options.lidar is not None:
        model = model_named(options.lidar)
        if model is None:
            raise ExperimentError(f"--lidar {options.lidar!r:.40}: is no model; models are {NAMES}")
        options = replace(options, lidar=model.name)
    # Positions need no guard, and the autopilot drives to them as it likes.
    pairs: list[tuple[Setup, str]] = [
        (setup, name)
        for setup in _chosen_setups(options)
        for name in chosen
        if name != POINTS or setup is Setup.GUARDED
    ]
    if not pairs:
        raise ExperimentError(f"--setups: {POINTS} is driven with {Setup.GUARDED} only; name another controller")
    if options.archive is None:
        worlds = tuple(made_world(number) for number in range(MADE))
    else:
        worlds = standard(read_worlds(options.archive))
        for world in worlds:
            difficulty_of(world)  # one without a way is said before hours of driving
    tasks = [
        (world, name, seed, setup, options.off, options.late_s, options.lidar, None, options.timeout_s)
        for setup, name in pairs
        for seed in range(options.seed, options.seed + options.runs)
        for world in worlds
    ]
    runs: list[BarnRun] = []
    for done, one in enumerate(each(options.jobs, drive, tasks, options.keep), start=1):
        runs.append(one)
        advance(done, len(tasks))
    series = {
        (setup, name): tuple(run for run in runs if (run.setup, run.controller) == (setup, name))
        for setup, name in pairs
    }
    return BarnReport(options, worlds, series)


def _chosen_setups(options: Options) -> tuple[Setup, ...]:
    """Raises ExperimentError for one that does not exist."""
    for name in options.setups:
        if name not in tuple(Setup):
            raise unknown("--setups", name, Setup)
    return tuple(one for one in Setup if one in options.setups) or (Setup.GUARDED,)
