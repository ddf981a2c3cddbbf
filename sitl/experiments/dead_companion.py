"""What happens when the companion falls dead: every shipped mission, cut off at a random moment and watched until the rover stands.

The autopilot follows the last setpoint that it got, a position for ever and a velocity for three seconds. So no setpoint
may be one that the rover cannot be left alone with.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from joblib import Parallel, delayed
from rich.table import Table

from companion.mission.load import load_mission
from companion.mission.mission import Mission, SitlSpec
from companion.recorder import NullRecorder
from companion.settings import Settings
from sitl.experiments.experiment import Advance, ExperimentError, Options
from sitl.experiments.results_page import markdown_table, terminal_table, write_section
from sitl.lockstep import Drive
from sitl.scenario import scenario_from_mission
from sitl.simulator import Simulator

NAME = "dead-companion"
MISSIONS = (
    "open.toml", "one-obstacle.toml", "clutter.toml", "rooms.toml", "complex.toml", "dead-end.toml", "sealed.toml",
    "field.plan", "field.waypoints", "ackermann.toml", "crossing.toml", "depot.toml",
)  # fmt: skip
SUITES = ("lidar-90", "lidar-360", "beams")
HEAD = ("mission", "runs", "moving", "touched", "run into", "m/s", "metres", "s")
TIME_LIMIT_S = 1800.0
STANDS_S, STANDS_M_S, STANDS_RAD_S = 4.0, 0.02, 0.02
"""A rover stands that has neither moved nor turned for longer than a velocity is remembered."""
WATCHED_S = 120.0
STEP_S = 0.25


@dataclass(frozen=True, slots=True)
class Death:
    """One run. ``share``: the moment, as a share of the time that the first seed takes; nan ``time_s``: the mission ended first."""

    mission: str
    suite: str
    seed: int
    time_s: float = math.nan
    speed_m_s: float = 0.0
    touched: int = 0
    """Contacts of the rover while it moved on."""
    run_into: int = 0
    """It stood, and something that moves came along."""
    went_m: float = 0.0
    went_s: float = 0.0

    @property
    def died(self) -> bool:
        """Whether it came to that."""
        return not math.isnan(self.time_s)


def die(mission: Mission, seed: int, time_s: float, *, last_words: bool = True) -> Death:
    """Drive with a companion that is not heard of any more after ``time_s``; ``last_words``: what it said in its last tick arrives."""
    suite = mission.sitl.sensors if mission.sitl is not None else ""
    death = Death(mission.name, str(suite), seed)
    drive = Drive(mission, scenario_from_mission(mission), Settings(), seed, NullRecorder(), TIME_LIMIT_S)
    while drive.simulator.time_s < time_s:
        if drive.companion.done:
            return death
        drive.companion.tick()
    simulator = drive.simulator
    if last_words:
        drive.clock.deliver()
    speed_m_s, since_m = abs(simulator.truth.speed_m_s), simulator.driven_m
    before = len(simulator.collisions)
    went_s = watch_until_it_stands(simulator)
    hits = simulator.collisions[before:]
    standing = [one for one in hits if one.mover and abs(one.speed_m_s) < STANDS_M_S]
    return replace(
        death,
        time_s=time_s,
        speed_m_s=speed_m_s,
        touched=len(hits) - len(standing),
        run_into=len(standing),
        went_m=simulator.driven_m - since_m,
        went_s=went_s,
    )


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
class DeadReport:
    """See ``experiment.Report``."""

    options: Options
    deaths: tuple[Death, ...]

    def tables(self) -> list[Table]:
        """One for each suite of sensors."""
        return [terminal_table(f"{NAME}: {suite}", HEAD, self._rows(suite)) for suite in self._suites()]

    def as_json(self) -> dict[str, object]:
        """Every run."""
        runs = [{name: getattr(death, name) for name in Death.__slots__} for death in self.deaths if death.died]
        return {"experiment": NAME, "seed": self.options.seed, "runs": self.options.runs, "deaths": runs}

    def write_docs(self, folder: Path) -> list[Path]:
        """The section."""
        return [write_section(folder, NAME, self._section())]

    def _suites(self) -> list[str]:
        return list(dict.fromkeys(death.suite for death in self.deaths))

    def _rows(self, suite: str) -> list[list[str]]:
        own = [death for death in self.deaths if death.suite == suite and death.died]
        names = dict.fromkeys(death.mission for death in own)
        return [_row(name, [d for d in own if d.mission == name]) for name in names] + [_row("all", own)]

    def _section(self) -> str:
        died = [death for death in self.deaths if death.died]
        tables = "\n\n".join(f"`{suite}`:\n\n{markdown_table(HEAD, self._rows(suite))}" for suite in self._suites())
        touched, run_into = sum(d.touched for d in died), sum(d.run_into for d in died)
        return f"""## A companion that falls dead

`{self.options.command(NAME)}`

{len(died)} runs: {self.options.runs} of each mission with each suite of sensors, cut off at a moment drawn from the whole drive, half of them before
what was said last has gone out; then watched until the rover has stood for {STANDS_S:g} s. *moving* counts the runs in which it moved when that happened;
*touched* counts contacts while it moved on: **{touched}**; *run into*: it stood already, and something that moves came along: {run_into}. *m/s*: the
fastest it was, *metres*, *s*: the farthest and longest it went on.

{tables}
"""


def _row(name: str, deaths: list[Death]) -> list[str]:
    def most(values: Iterable[float]) -> str:
        return f"{max(values, default=0.0):.1f}"

    return [
        name,
        f"{len(deaths)}",
        f"{sum(d.speed_m_s > 0.1 for d in deaths)}",
        f"{sum(d.touched for d in deaths)}",
        f"{sum(d.run_into for d in deaths)}",
        most(d.speed_m_s for d in deaths),
        most(d.went_m for d in deaths),
        most(d.went_s for d in deaths),
    ]


def run(options: Options, advance: Advance) -> DeadReport:
    """First a whole drive of each mission, to know how long it takes; then the others. Does not depend on ``jobs``."""
    missions = [with_suite(mission, suite) for mission in shipped(options) for suite in SUITES]
    total, done = len(missions) * (1 + options.runs), 0
    lengths: list[tuple[float, float]] = []
    with Parallel(n_jobs=options.jobs, return_as="generator") as pool:
        for span in pool(delayed(driven_span_s)(mission, options.seed) for mission in missions):
            lengths.append(span)
            advance(done := done + 1, total)
        calls = []
        for number, (mission, (begin_s, end_s)) in enumerate(zip(missions, lengths, strict=True)):
            for i in range(options.runs):
                rng = np.random.default_rng((options.seed + i, number))
                time_s = float(rng.uniform(begin_s, end_s))
                calls.append(delayed(die)(mission, options.seed + i, time_s, last_words=bool(rng.integers(2))))
        deaths: list[Death] = []
        for death in pool(calls):
            deaths.append(death)
            advance(done := done + 1, total)
    return DeadReport(options, tuple(deaths))


def driven_span_s(mission: Mission, seed: int) -> tuple[float, float]:
    """When the rover first and last moved in a whole drive."""
    drive = Drive(mission, scenario_from_mission(mission), Settings(), seed, NullRecorder(), TIME_LIMIT_S)
    report = drive.run()
    return report.sim_time_s - report.driving_time_s, report.sim_time_s


def with_suite(mission: Mission, suite: str) -> Mission:
    """The same mission with these sensors."""
    return replace(mission, sitl=replace(mission.sitl or SitlSpec(), sensors=suite))


def shipped(options: Options) -> list[Mission]:
    """All missions that ship with the project."""
    folder = options.maps.parent if options.maps else Path(__file__).parents[2] / "missions"
    for name in MISSIONS:
        if not (folder / name).is_file():
            raise ExperimentError(
                f"{folder / name}: no such mission; this experiment needs the source's missions folder"
            )
    return [load_mission(folder / name) for name in MISSIONS]
