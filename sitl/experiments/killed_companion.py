"""A companion that is killed again and again and resumes its run: every shipped mission, with every suite of sensors.

Each drive is made with the firmware's own simulated rover, and with one that turns faster than it is told
(``EAGER``). The next death comes at a random moment; for as long as a program takes to start, nobody leads the rover.
With or without the guard on the autopilot, and with any controller.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict, dataclass, field, replace
from enum import StrEnum
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import ClassVar

import numpy as np
from rich.table import Table

from companion.checkpoint.checkpointer import Checkpointer, StateUpdate
from companion.checkpoint.state_directory import StateDirectory
from companion.checkpoint.state_writer import StateFile
from companion.executive.mission_progress import MissionProgress
from companion.mission.mission import DrivetrainSpec, Mission, SitlSpec
from companion.recording.recorder import NullRecorder
from companion.settings import Settings
from companion.settings.settings import ControllerKind
from companion.storage.files import OsDisk
from sitl.experiments.dead_companion import SUITES, shipped, with_suite
from sitl.experiments.experiment import (
    GUARD,
    OFF_MODEL,
    POINTS,
    Advance,
    ExperimentReport,
    Options,
    chosen_controllers,
    each,
    section_by_rule,
)
from sitl.experiments.off_model import scenario_off_model, taken_for
from sitl.experiments.person import Person
from sitl.experiments.results_page import markdown_table, share_with_interval, terminal_table
from sitl.lockstep import Drive
from sitl.world.truth import STOOD_M_S

NAME = "killed-companion"
EAGER = DrivetrainSpec(top_speed_m_s=3.46, lag_s=0.25, track_m=0.6)
"""Drives 0.9 of the top speed and turns 2.4 times as fast as the default gains are for (docs/sitl.md)."""


class Motors(StrEnum):
    """Which rover is driven."""

    OWN = "own"
    """The mission's."""
    EAGER = "eager"


TITLE_ENDS = {
    NAME: "",
    f"{NAME}-guarded": ", with the guard",
    f"{NAME}-strict": ", with planned motions and no guard",
}
HEAD = ("mission", "drives", "deaths", "touched", "run into", "ended", "person")
CONTACT_HEAD = ("drive", "seed", "at s", "N m", "E m", "m/s", "with", "s after a death")
TIME_LIMIT_S = 3600.0
LIVES_S = (2.0, 20.0)
"""A companion lives for so long, drawn evenly, from the moment at which it leads the rover."""
ABSENT_S = (1.0, 8.0)
"""So long it takes until another one listens: on the firmware, driving went on after 1.9 to 4.5 s."""


@dataclass(frozen=True, slots=True)
class Contact:
    """One contact, and what had happened before it."""

    time_s: float
    speed_m_s: float
    mover: str | None
    since_death_s: float | None
    """None before the first death."""
    north_m: float
    east_m: float
    """From where the rover began."""


@dataclass(slots=True)
class KilledDrive:
    """One drive."""

    mission: str
    suite: str
    motors: Motors
    seed: int
    controller: str = POINTS
    """What really led the rover: motions are not planned for every one."""
    deaths: list[float] = field(default_factory=list)
    """Seconds since the autopilot's start."""
    contacts: list[Contact] = field(default_factory=list)
    ended: bool = False
    """The mission ended by itself within the time limit."""
    person: int = 0

    @property
    def touched(self) -> int:
        """Contacts of the rover while it moved on, not those of things that ran into it."""
        return len(self.contacts) - self.run_into

    @property
    def touched_what_stands(self) -> int:
        """Contacts with what does not move."""
        return sum(one.mover is None for one in self.contacts)

    @property
    def run_into(self) -> int:
        """It stood, and something that moves came along."""
        return sum(one.mover is not None and abs(one.speed_m_s) < STOOD_M_S for one in self.contacts)


class _InlineStateWriter:
    """Writes at once: what a killed program has not handed over is lost."""

    busy = False

    def __init__(self, file: StateFile) -> None:
        self._file = file

    @property
    def problem(self) -> str:
        return self._file.problem

    def holds(self, progress: MissionProgress) -> bool:
        return self._file.holds(progress)

    def put(self, update: StateUpdate) -> None:
        self._file.apply(update)

    def close(self) -> None:
        """Nothing is left to write."""


def kept_in(directory: Path, mission: Mission) -> Checkpointer:
    """What ``run --resume --state DIR`` would start with."""
    place = StateDirectory(directory)
    previous = place.load(mission)
    place.close()  # a process that is killed loses its lock
    return Checkpointer(mission, _InlineStateWriter(StateFile(place.file, OsDisk())), previous)


def drive_with_deaths(
    mission: Mission,
    motors: Motors,
    seed: int,
    settings: Settings | None = None,
    *,
    guarded: bool = False,
    off: float = 0.0,
    late_s: float = 0.0,
) -> KilledDrive:
    """Drive a mission to its end while its companion is killed every few seconds.

    ``settings``: None for the defaults. ``guarded``: with the guard on the autopilot. ``off``: the mission's own rover
    differs by up to this share from what the companion takes it for, if it turns on the spot. ``late_s``: so long each
    message takes over the link, each way.
    """
    suite, settings = str(mission.sitl.sensors) if mission.sitl is not None else "", settings or Settings()
    result = KilledDrive(mission.name, suite, motors, seed)
    rng, person = np.random.default_rng((seed, 13)), Person()
    scenario = scenario_off_model(mission, seed, off if motors is Motors.OWN else 0.0, guarded=guarded)
    with TemporaryDirectory() as folder:
        place = Path(folder)
        drive = Drive(
            mission,
            scenario,
            settings,
            seed,
            NullRecorder(),
            TIME_LIMIT_S,
            kept_in(place, mission),
            late_s=late_s,
        )
        simulator = drive.simulator
        dies_s: float | None = None
        while not drive.companion.done and simulator.time_s < TIME_LIMIT_S:
            drive.companion.tick()
            person.look(drive, drive.companion.status().activity)
            if dies_s is None:
                leads = drive.companion.driver is not None and simulator.truth.speed_m_s != 0.0
                dies_s = simulator.time_s + float(rng.uniform(*LIVES_S)) if leads else None
            elif simulator.time_s >= dies_s:
                result.deaths.append(simulator.time_s)
                drive.kill_companion(float(rng.uniform(*ABSENT_S)), kept_in(place, mission))
                dies_s = None
        result.ended, result.person = drive.companion.done, person.helped
        executor = drive.companion.mission_run.executor
        result.controller = POINTS if executor is None else executor.controller
    for hit in simulator.collisions:
        before = [death_s for death_s in result.deaths if death_s <= hit.time_s]
        since_s = hit.time_s - before[-1] if before else None
        place_m = hit.north_m - scenario.start.north_m, hit.east_m - scenario.start.east_m
        result.contacts.append(Contact(hit.time_s, hit.speed_m_s, hit.mover, since_s, *place_m))
    return result


def deaths_of(
    mission: Mission,
    motors: Motors,
    seed: int,
    count: int,
    controller: ControllerKind = POINTS,
    guarded: bool = False,
    off: float = OFF_MODEL,
    late_s: float = 0.0,
) -> list[KilledDrive]:
    """As many drives as it takes to die so often. ``off``: where motions are planned."""
    drives: list[KilledDrive] = []
    settings = taken_for(controller, NAME)
    while sum(len(one.deaths) for one in drives) < count and len(drives) < count:
        own_off = 0.0 if controller == POINTS else off
        drives.append(
            drive_with_deaths(
                mission, motors, seed + len(drives), settings, guarded=guarded, off=own_off, late_s=late_s
            )
        )
    return drives


@dataclass(frozen=True)
class KilledReport(ExperimentReport):
    """See ``ExperimentReport``."""

    name: ClassVar[str] = NAME
    options: Options
    drives: tuple[KilledDrive, ...]

    @property
    def section_name(self) -> str:
        """See ``ExperimentReport``."""
        return section_by_rule(NAME, self.options.guard, self._planned)

    @property
    def _planned(self) -> int:
        """Deaths in drives in which motions were planned."""
        return sum(len(drive.deaths) for drive in self.drives if drive.controller != POINTS)

    def tables(self) -> list[Table]:
        """One for each suite of sensors, and one of contacts."""
        suites = [terminal_table(f"{NAME}: {suite}", HEAD, self._rows(suite)) for suite in SUITES]
        contacts = self._contacts()
        return [*suites, terminal_table(f"{NAME}: contacts", CONTACT_HEAD, contacts)] if contacts else suites

    @property
    def failure(self) -> str:
        """Contacts."""
        touched = sum(drive.touched for drive in self.drives)
        return f"{touched} contacts of a rover whose companion was killed and resumed" if touched else ""

    def as_json(self) -> dict[str, object]:
        """Every drive."""
        drives = [asdict(drive) for drive in self.drives]
        return {"experiment": NAME, "seed": self.options.seed, "runs": self.options.runs, "drives": drives}

    def _rows(self, suite: str) -> list[list[str]]:
        own = [drive for drive in self.drives if drive.suite == suite]
        kinds = dict.fromkeys(map(_kind, own))
        return [*(_row(kind, [drive for drive in own if _kind(drive) == kind]) for kind in kinds), _row("all", own)]

    def _contacts(self) -> list[list[str]]:
        return [
            [
                f"{_kind(drive)}, {drive.suite}",
                f"{drive.seed}",
                f"{one.time_s:.1f}",
                f"{one.north_m:.1f}",
                f"{one.east_m:.1f}",
                f"{one.speed_m_s:.2f}",
                one.mover or "what stands",
                "-" if one.since_death_s is None else f"{one.since_death_s:.1f}",
            ]
            for drive in self.drives
            for one in drive.contacts
        ]

    def section(self) -> str:
        """See ``ExperimentReport``."""
        tables = "\n\n".join(f"`{suite}`:\n\n{markdown_table(HEAD, self._rows(suite))}" for suite in SUITES)
        contacts = self._contacts()
        if contacts:
            tables += f"\n\nContacts:\n\n{markdown_table(CONTACT_HEAD, contacts)}"
        deaths = sum(len(drive.deaths) for drive in self.drives)
        touched, run_into = sum(d.touched for d in self.drives), sum(d.run_into for d in self.drives)
        guard = f"The guard on the autopilot waits {GUARD['SCR_USER1']:g} ms.\n\n" if self.options.guard else ""
        if self._planned:
            touched_planned = sum(d.touched_what_stands for d in self.drives if d.controller != POINTS)
            guard += f"""Motions were planned in the drives with {self._planned} of these deaths;
with thin beams and on arcs `{POINTS}` leads the rover whatever is asked for. The missions' own rovers are
{self.options.mismatch}. Contacts of planned rovers with what
stands, a death: {share_with_interval(touched_planned, self._planned)}.

"""
        return f"""## A companion that is killed and resumed{TITLE_ENDS[self.section_name]}

`{self.options.command(NAME)}`

{deaths} deaths in {len(self.drives)} drives: each mission with each suite of sensors, with the firmware's own
simulated rover and with an eager one ({EAGER.top_speed_m_s:g} m/s, {EAGER.lag_s:g} s, {EAGER.track_m:g} m: it turns
faster than it is told), until the companion had died {self.options.runs} times. It lives for {LIVES_S[0]:g} to
{LIVES_S[1]:g} s from when the rover moves, and is missing for {ABSENT_S[0]:g} to {ABSENT_S[1]:g} s. *touched*: contacts
while the rover moved: **{touched}**; *run into*: it stood, and something that moves came along: {run_into}; *ended*:
drives whose mission ended by itself within {TIME_LIMIT_S:g} s; *person*: how often somebody had to set GUIDED or arm.

{guard}{tables}
"""


def _kind(drive: KilledDrive) -> str:
    leads = "" if drive.controller == POINTS else f", {drive.controller}"
    return f"{drive.mission}, {drive.motors}{leads}"


def _row(name: str, drives: Iterable[KilledDrive]) -> list[str]:
    own = list(drives)
    return [
        name,
        f"{len(own)}",
        f"{sum(len(d.deaths) for d in own)}",
        f"{sum(d.touched for d in own)}",
        f"{sum(d.run_into for d in own)}",
        f"{sum(d.ended for d in own)}",
        f"{sum(d.person for d in own)}",
    ]


def run(options: Options, advance: Advance) -> KilledReport:
    """Each mission with each suite and both rovers, killed as many times as there are runs."""
    missions = [
        (with_motors(with_suite(mission, suite), motors), motors, controller)
        for controller in chosen_controllers(options, (POINTS,))
        for mission in shipped(options)
        for suite in SUITES
        for motors in Motors
        if motors is Motors.OWN or mission.rover.turning_radius_m <= 0.0
    ]
    drives: list[KilledDrive] = []
    seeds = range(options.seed, options.seed + 100 * len(missions), 100)
    tasks = (
        (mission, motors, seed, options.runs, controller, options.guard, options.off, options.late_s)
        for (mission, motors, controller), seed in zip(missions, seeds, strict=True)
    )
    for done, some in enumerate(each(options.jobs, deaths_of, tasks, options.keep), start=1):
        drives += some
        advance(done, len(missions))
    return KilledReport(options, tuple(drives))


def with_motors(mission: Mission, motors: Motors) -> Mission:
    """The same mission with the eager rover, if that is wanted."""
    if motors is Motors.OWN:
        return mission
    return replace(mission, sitl=replace(mission.sitl or SitlSpec(), drivetrain=EAGER))
