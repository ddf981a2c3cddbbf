"""What happens when the companion fails: every shipped mission, cut off at a random moment until the rover stands.

The autopilot follows the last setpoint that it got, a position for ever and a velocity for three seconds. So no
setpoint may be one that the rover cannot be left alone with. With any controller, with or without the guard on the
autopilot.
"""

from __future__ import annotations

import os
import pickle
import warnings
from collections import deque
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import ClassVar, cast

import numpy as np
from rich.table import Table

from companion.mission.load import load_mission
from companion.mission.mission import Mission, SitlSpec
from companion.recording.recorder import NullRecorder
from companion.settings import Settings
from companion.settings.settings import ControllerKind
from sitl.experiments.experiment import (
    GUARD,
    POINTS,
    Advance,
    ExperimentReport,
    Options,
    chosen_controllers,
    each,
    section_by_rule,
    shipped_missions,
    unknown,
)
from sitl.experiments.off_model import scenario_off_model, taken_for
from sitl.experiments.results_page import markdown_table, terminal_table
from sitl.lockstep import Drive
from sitl.scenario import Scenario, scenario_from_mission
from sitl.simulator import Simulator
from sitl.world.truth import STOOD_M_S

NAME = "dead-companion"
MISSIONS = (
    "open.toml", "one-obstacle.toml", "clutter.toml", "rooms.toml", "complex.toml", "dead-end.toml", "sealed.toml",
    "field.plan", "field.waypoints", "ackermann.toml", "crossing.toml", "depot.toml",
)  # fmt: skip
SUITES = ("lidar-90", "lidar-360", "beams")
HEAD = ("mission", "led by", "runs", "moving", "touched", "run into", "m/s", "metres", "s")
FROM_A_DRIVE = 40
"""So many deaths at most: for more, the mission is driven again with another seed."""
TIME_LIMIT_S = 1800.0
STANDS_S, STANDS_M_S, STANDS_RAD_S = 4.0, 0.02, 0.02
"""A rover stands that has neither moved nor turned for longer than a velocity is remembered."""
WATCHED_S = 120.0
STEP_S = 0.25


@dataclass(frozen=True, slots=True)
class Death:
    """One run, and when its companion fell silent."""

    mission: str
    suite: str
    controller: str
    """What really led the rover."""
    seed: int
    time_s: float
    speed_m_s: float
    touched: int
    """Contacts of the rover while it moved on."""
    run_into: int
    """It stood, and something that moves came along."""
    went_m: float
    went_s: float
    with_what: tuple[str, ...] = ()
    """What it touched while it moved on, and how fast it was then."""


@dataclass(frozen=True, eq=False, slots=True)
class Told:
    """A whole drive, as what its companion said: until when the world moved on, and the bytes it got before that."""

    mission: Mission
    scenario: Scenario
    controller: str
    seed: int
    words: tuple[tuple[float, bytes], ...]
    begin_s: float
    """When the rover first moved."""
    end_s: float

    @property
    def suite(self) -> str:
        """The rover's sensors."""
        return str(self.mission.sitl.sensors) if self.mission.sitl is not None else ""


def overheard(mission: Mission, seed: int, settings: Settings | None = None, scenario: Scenario | None = None) -> Told:
    """Drive the mission with its companion alive, and keep what it says.

    ``settings``: None for the defaults. ``scenario``: None for the mission's own.
    """
    scenario = scenario or scenario_from_mission(mission)
    drive = Drive(mission, scenario, settings or Settings(), seed, NullRecorder(), TIME_LIMIT_S)
    words: list[tuple[float, bytes]] = []
    drive.clock.overhear = lambda time_s, said: words.append((time_s, said))
    report = drive.run()
    began_s = report.sim_time_s - report.driving_time_s
    executor = drive.companion.mission_run.executor
    led_by = POINTS if executor is None else executor.controller
    return Told(mission, scenario, led_by, seed, tuple(words), began_s, report.sim_time_s)


def die(told: Told, moments_s: Sequence[float]) -> list[Death]:
    """The same drive, but nothing more is said from a moment on; one death for each moment.

    The simulator does the same on hearing the same, so it hears all once: at each moment a copy of the process, a fork,
    goes on without a companion.
    """
    simulator = told.scenario.simulator(told.seed)
    link, words, deaths = simulator.connect(name="companion"), deque(told.words), dict[float, Death]()
    for moment_s in sorted(moments_s):
        while words and words[0][0] <= moment_s:
            until_s, said = words.popleft()
            link.receive(said)
            simulator.advance_to_s(until_s)
            link.take()
        deaths[moment_s] = _in_a_copy(partial(_death, told, moment_s, simulator))
    return [deaths[moment_s] for moment_s in moments_s]


def _death(told: Told, time_s: float, simulator: Simulator) -> Death:
    """What happens from now on, with nobody who says anything."""
    speed_m_s, since_m = abs(simulator.truth.speed_m_s), simulator.driven_m
    before = len(simulator.collisions)
    went_s = watch_until_it_stands(simulator)
    hits = simulator.collisions[before:]
    moving = [one for one in hits if not one.was_run_into]
    return Death(
        told.mission.name,
        told.suite,
        told.controller,
        told.seed,
        time_s,
        speed_m_s,
        len(moving),
        len(hits) - len(moving),
        simulator.driven_m - since_m,
        went_s,
        tuple(f"{one.what} at {one.speed_m_s:.1f} m/s" for one in moving),
    )


def _in_a_copy(work: Callable[[], Death]) -> Death:
    """What ``work`` gives in a copy of this process; nothing changes here. Raises EOFError if the copy has failed."""
    read, write = os.pipe()
    with warnings.catch_warnings():
        # Python warns of forks beside other threads: these hold no lock that a simulator takes.
        warnings.simplefilter("ignore", DeprecationWarning)
        pid = os.fork()
    if not pid:
        try:
            os.write(write, pickle.dumps(work()))
        finally:
            os._exit(0)
    os.close(write)
    with open(read, "rb") as answer:
        data = answer.read()
    os.waitpid(pid, 0)
    return cast(Death, pickle.loads(data))


def watch_until_it_stands(simulator: Simulator) -> float:
    """Let time go on until the rover has stood for some seconds; gives the seconds until then."""
    began_s = since_s = simulator.time_s
    while simulator.time_s - since_s < STANDS_S and simulator.time_s - began_s < WATCHED_S:
        simulator.advance_to_s(simulator.time_s + STEP_S)
        truth = simulator.truth
        if max(abs(truth.speed_m_s), abs(truth.slide_m_s)) > STANDS_M_S or abs(truth.yaw_rate_rad_s) > STANDS_RAD_S:
            since_s = simulator.time_s
    return since_s - began_s


@dataclass(frozen=True)
class DeadReport(ExperimentReport):
    """See ``ExperimentReport``."""

    name: ClassVar[str] = NAME
    options: Options
    deaths: tuple[Death, ...]

    def tables(self) -> list[Table]:
        """One for each suite of sensors."""
        return [terminal_table(f"{NAME}: {suite}", HEAD, self._rows(suite)) for suite in self._suites()]

    @property
    def section_name(self) -> str:
        """See ``ExperimentReport``."""
        return section_by_rule(NAME, self.options.guard, self._planned) + self.options.timeout_suffix

    @property
    def _planned(self) -> int:
        """Deaths in drives in which motions were planned."""
        return sum(death.controller != POINTS for death in self.deaths)

    @property
    def failure(self) -> str:
        """Contacts."""
        touched = sum(death.touched for death in self.deaths)
        return f"{touched} contacts after the companion had fallen dead" if touched else ""

    def as_json(self) -> dict[str, object]:
        """Every run."""
        runs = [{name: getattr(death, name) for name in Death.__slots__} for death in self.deaths]
        return {"experiment": NAME, "seed": self.options.seed, "runs": self.options.runs, "deaths": runs}

    def _suites(self) -> list[str]:
        return list(dict.fromkeys(death.suite for death in self.deaths))

    def _rows(self, suite: str) -> list[list[str]]:
        own = [death for death in self.deaths if death.suite == suite]
        kinds = dict.fromkeys((death.mission, death.controller) for death in own)
        rows = [_row(*kind, [d for d in own if (d.mission, d.controller) == kind]) for kind in kinds]
        return [*rows, _row("all", "", own)]

    def section(self) -> str:
        """See ``ExperimentReport``."""
        tables = "\n\n".join(f"`{suite}`:\n\n{markdown_table(HEAD, self._rows(suite))}" for suite in self._suites())
        touched, run_into = sum(d.touched for d in self.deaths), sum(d.run_into for d in self.deaths)
        while_it = " while it plans motions" if self._planned else ""
        with_guard = ", with the guard" if self.options.guard else ""
        return f"""## A companion that falls dead{while_it}{with_guard}{self.options.timeout_title}

`{self.options.command(NAME)}`

{len(self.deaths)} runs: each mission driven with each suite of sensors, and the companion silent for ever at
{self.options.runs} moments drawn evenly from its drives (at most {FROM_A_DRIVE} from one); then watched until the
rover had stood for {STANDS_S:g} s. *moving* counts the runs in which it moved when that happened; *touched* the
contacts while it moved on: **{touched}**; *run into*: it stood already (slower than {STOOD_M_S:g} m/s), and something
that moves came along: {run_into}. *m/s*: the fastest it was; *metres*, *s*: how far and how long it went on at most.
{self._rover()}
{tables}
{self._contacts()}"""

    def _contacts(self) -> str:
        """Each contact while the rover moved on, as a list."""
        lines = [
            f"- {one.mission}, `{one.suite}`, seed {one.seed}, dead after {one.time_s:.1f} s "
            f"at {one.speed_m_s:.1f} m/s: {', '.join(one.with_what)}, {one.went_m:.1f} m farther"
            for one in self.deaths
            if one.touched
        ]
        return "\n".join(["\nWhat was touched:\n", *lines, ""]) if lines else ""

    def _rover(self) -> str:
        """What is not as usual, as a paragraph."""
        said = ""
        if self._planned:
            said = f"""
Motions were planned in the drives with {self._planned} of these deaths; speed, lag, turn rate and limits of a rover
that turns on the spot are {self.options.mismatch}. In the others points led the rover.
"""
        if self.options.guard:
            said += f"\nThe guard on the autopilot waits {GUARD['SCR_USER1']:g} ms.\n"
        return said


def _row(name: str, controller: str, deaths: list[Death]) -> list[str]:
    def most(values: Iterable[float]) -> str:
        return f"{max(values, default=0.0):.1f}"

    return [
        name,
        controller,
        f"{len(deaths)}",
        f"{sum(d.speed_m_s > 0.1 for d in deaths)}",
        f"{sum(d.touched for d in deaths)}",
        f"{sum(d.run_into for d in deaths)}",
        most(d.speed_m_s for d in deaths),
        most(d.went_m for d in deaths),
        most(d.went_s for d in deaths),
    ]


def run(options: Options, advance: Advance) -> DeadReport:
    """Each mission with each suite and controller, with as many deaths as there are runs.

    Does not depend on ``jobs``. Chosen missions have the seeds that they have among all, so parts add up.
    """
    chosen = {mission.source for mission in shipped(options)}
    drives = [
        (with_suite(mission, suite), controller, options.guard, options.off, options.timeout_s)
        for controller in chosen_controllers(options, (POINTS,))
        for mission in shipped(replace(options, missions=()))
        for suite in SUITES
    ]
    shares = [min(FROM_A_DRIVE, options.runs - first) for first in range(0, options.runs, FROM_A_DRIVE)]
    tasks = [
        (*one, options.seed + number + len(drives) * again, count)
        for number, one in enumerate(drives)
        for again, count in enumerate(shares)
        if one[0].source in chosen
    ]
    deaths: list[Death] = []
    for done, some in enumerate(each(options.jobs, deaths_of, tasks, options.keep), start=1):
        deaths += some
        advance(done, len(tasks))
    return DeadReport(options, tuple(deaths))


def deaths_of(
    mission: Mission, controller: ControllerKind, guarded: bool, off: float, timeout_s: float, seed: int, count: int
) -> list[Death]:
    """One drive, cut off at so many moments, drawn evenly from it. ``off``: where motions are planned."""
    off = 0.0 if controller == POINTS else off
    scenario = scenario_off_model(mission, seed, off, guarded=guarded, timeout_s=timeout_s)
    settings = taken_for(controller, NAME)
    told = overheard(mission, seed, settings, scenario)
    moments_s = np.random.default_rng((seed, count)).uniform(told.begin_s, told.end_s, count)
    return die(told, moments_s.tolist())


def with_suite(mission: Mission, suite: str) -> Mission:
    """The same mission with these sensors."""
    return replace(mission, sitl=replace(mission.sitl or SitlSpec(), sensors=suite))


def shipped(options: Options) -> list[Mission]:
    """The missions that ship with the project, or those of them that were chosen. Raises ExperimentError."""
    named = {file.removesuffix(".toml"): file for file in MISSIONS}
    for name in options.missions:
        if name not in named:
            raise unknown("--missions", name, named)
    chosen = tuple(file for name, file in named.items() if name in options.missions)
    return [load_mission(file) for file in shipped_missions(options.maps, chosen or MISSIONS)]
