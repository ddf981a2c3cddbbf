"""Many missions on random ground with random faults, in one process: does the rover touch anything, does memory grow?

A person stands by, as the safety page asks for: where the companion says that it waits for one, the person looks for a
while, arms if need be, and sets GUIDED again.
"""

from __future__ import annotations

import gc
import os
import traceback
from collections import Counter
from collections.abc import Iterable
from dataclasses import asdict, dataclass, replace
from enum import StrEnum
from pathlib import Path
from typing import ClassVar

import numpy as np
from rich.table import Table

from companion.executive.mission_progress import TargetStatus
from companion.recording.recorder import NullRecorder
from companion.settings import Settings
from companion.vehicle.recommended_parameters import RECOMMENDED_PARAMETERS
from sitl.experiments import soak_faults, soak_worlds
from sitl.experiments.experiment import Advance, ExperimentReport, Options, each, where_measured
from sitl.experiments.person import PERSON_S, Person
from sitl.experiments.results_page import markdown_table, terminal_table
from sitl.lockstep import Drive
from sitl.scenario import SOMEWHERE, Scenario
from sitl.world.truth import SimStart

NAME = "soak"
SUITES = ("lidar-90", "lidar-360")
TIME_LIMIT_S = 1800.0
GROWTH_MB = 20.0
"""More than this is growth: what the interpreter keeps for later varies by some megabytes."""
WARM_UP = 10
"""Memory is compared from this run on: until then caches fill."""
HEAD = ("ground", "runs", "faults", "reached", "policy", "left", "coll.", "errors", "person", "metres")


class Ended(StrEnum):
    """How a mission ended."""

    REACHED = "reached"
    POLICY = "policy"
    """Targets were missed on purpose: see the safety page."""
    UNFINISHED = "unfinished"


class Policy(StrEnum):
    """Why targets were missed on purpose."""

    LOW_BATTERY = "it came back with a low battery"
    NOT_ARMED = "the autopilot did not let it be armed"


@dataclass(frozen=True, slots=True)
class Soaked:
    """One mission."""

    seed: int
    ground: str
    suite: str
    faults: tuple[str, ...] = ()
    ended: Ended = Ended.UNFINISHED
    policy: Policy | None = None
    why: str = ""
    """In the words of companion or autopilot."""
    last_text: str = ""
    collisions: int = 0
    refused: int = 0
    error: str = ""
    person: int = 0
    """How often the person had to help."""
    driven_m: float = 0.0
    time_s: float = 0.0
    memory_mb: float = 0.0
    """Of the process, after it."""


def soaked(seed: int) -> Soaked:
    """Draw a ground, a mission, a suite of sensors and a plan of faults, and drive."""
    rng = np.random.default_rng([seed, 5])
    ground = soak_worlds.drawn(rng)
    suite = SUITES[int(rng.integers(len(SUITES)))]
    mission = soak_worlds.mission_on(ground, suite, f"soak {seed}", rng)
    plan = soak_faults.plan_of(rng)
    assert mission.sitl is not None
    start = SimStart(*ground.start_m, np.radians(mission.sitl.heading_deg), SOMEWHERE)
    parameters = {"WP_SPEED": 2.0, **RECOMMENDED_PARAMETERS, "BATT_LOW_VOLT": 10.5}
    scenario = Scenario(ground.world, start, suite, parameters=parameters, faults=plan)
    result = Soaked(seed, ground.kind, suite, tuple(type(fault).__name__ for fault in plan.faults))
    try:
        return _driven(Drive(mission, scenario, Settings(), seed, NullRecorder(), TIME_LIMIT_S), result)
    except Exception:  # whatever it is, it is a finding, and the other runs go on
        return replace(result, error=traceback.format_exc(limit=-1).strip().splitlines()[-1], memory_mb=memory_mb())


def _driven(drive: Drive, result: Soaked) -> Soaked:
    person = Person()
    report = drive.run(lambda status: person.look(drive, status.activity))
    missed = [name for name, status in report.targets if status is not TargetStatus.REACHED]
    broken_off = drive.companion.outcome.broken_off
    policy = Policy.LOW_BATTERY if broken_off is not None else Policy.NOT_ARMED if person.gave_up else None
    ended = Ended.REACHED if missed in ([], ["sealed"]) else Ended.POLICY if policy else Ended.UNFINISHED
    if not drive.companion.done:
        ended, policy = Ended.UNFINISHED, None
    return replace(
        result,
        ended=ended,
        policy=policy,
        why="" if policy is None else person.gave_up if broken_off is None else str(broken_off),
        last_text=report.said[-1] if report.said else "",
        collisions=report.collisions,
        refused=report.refused,
        person=person.helped,
        driven_m=report.distance_m,
        time_s=report.sim_time_s,
        memory_mb=memory_mb(),
    )


def memory_mb() -> float:
    """What this process has in memory now."""
    gc.collect()
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


@dataclass(frozen=True)
class SoakReport(ExperimentReport):
    """See ``ExperimentReport``."""

    name: ClassVar[str] = NAME
    page: ClassVar[str] = "safety.md"
    options: Options
    runs: tuple[Soaked, ...]

    def tables(self) -> list[Table]:
        """A row for each kind of ground, and one line for each run that is worth a look."""
        odd = [[str(run.seed), run.ground, ", ".join(run.faults), _trouble(run)] for run in self.runs if _trouble(run)]
        summary = terminal_table(f"{NAME}: {self._memory()}", HEAD, self._rows())
        if not odd:
            return [summary]
        head, texts = ("seed", "ground", "faults", "what"), ("faults", "what")
        return [summary, terminal_table(f"{NAME}: worth a look", head, odd, texts)]

    def as_json(self) -> dict[str, object]:
        """Every run."""
        return {
            "experiment": NAME,
            "seed": self.options.seed,
            "runs": self.options.runs,
            "growth_mb": self.growth_mb,
            "results": [asdict(run) for run in self.runs],
        }

    @property
    def failure(self) -> str:
        """Contacts, errors, targets left without a reason, memory that grows."""
        left = Counter({
            "with a contact": sum(run.collisions > 0 for run in self.runs),
            "with an error": sum(run.error != "" for run in self.runs),
            "left unfinished": sum(run.ended is Ended.UNFINISHED for run in self.runs),
        })  # fmt: skip
        found = [f"{count} runs {what}" for what, count in left.items() if count]
        if self.growth_mb is not None and self.growth_mb > GROWTH_MB:
            found.append(f"memory grew by {self.growth_mb:.0f} MB")
        return ", ".join(found)

    @property
    def growth_mb(self) -> float | None:
        """By how much the memory of the last runs is more than that of the first after the caches have filled; None:
        too few runs, or more than one process."""
        after = [run.memory_mb for run in self.runs[WARM_UP:]]
        if self.options.jobs > 1 or len(after) < 2 * WARM_UP:
            return None
        return float(np.median(after[-WARM_UP:]) - np.median(after[:WARM_UP]))

    def _memory(self) -> str:
        growth_mb = self.growth_mb
        if growth_mb is None:
            return "memory not compared (fewer than 30 runs, or several processes)"
        return f"memory {self.runs[-1].memory_mb:.0f} MB, {growth_mb:+.1f} MB since run {WARM_UP}"

    def _rows(self) -> list[list[str]]:
        kinds = sorted({run.ground for run in self.runs})
        return [_row(kind, [r for r in self.runs if r.ground == kind]) for kind in kinds] + [_row("all", self.runs)]

    def section(self) -> str:
        """See ``ExperimentReport``."""
        met = Counter(fault for run in self.runs for fault in run.faults)
        policies = Counter(run.policy for run in self.runs if run.policy is not None and run.ended is Ended.POLICY)
        by_policy = "; ".join(f"{text} ({count})" for text, count in sorted(policies.items())) or "none"
        return f"""## Soak

`{self.options.command(NAME)}` (`make soak`)

{len(self.runs)} missions on random ground ({", ".join(sorted({run.ground for run in self.runs}))}; rough and slippery
patches), with two or three targets that can be reached, in a quarter of them one that cannot, a lidar of 90 or 360
degrees, and none to {soak_faults.MOST} faults each at random times: {_named(met)}. A person stands by who sets GUIDED
again, and arms, {PERSON_S:g} s after the companion has asked for one. *reached*: every target that can be reached;
*policy*: targets missed as this page says ({by_policy}); *left*: missed without such a reason, or not at the end after
{TIME_LIMIT_S:g} s; *coll.*: contacts; *errors*: exceptions that nobody caught; *person*: how often the person helped. A
sensor gets stuck only with something in view (of the other case see [what it does not do](#what-it-does-not-do)). The
process's {self._memory()}. {where_measured()}.

{markdown_table(HEAD, self._rows())}
"""


def _named(met: Counter[str]) -> str:
    return ", ".join(f"{name} {count}" for name, count in sorted(met.items()))


def _trouble(run: Soaked) -> str:
    if run.error:
        return run.error
    if run.collisions:
        return f"{run.collisions} collisions"
    if run.ended is Ended.UNFINISHED:
        return f"unfinished: {run.last_text}"
    return f"{run.refused} setpoints refused" if run.refused else ""


def _row(name: str, runs: Iterable[Soaked]) -> list[str]:
    own = list(runs)
    return [
        name,
        f"{len(own)}",
        f"{sum(len(run.faults) for run in own)}",
        *(f"{sum(run.ended is ended for run in own)}" for ended in Ended),
        f"{sum(run.collisions for run in own)}",
        f"{sum(run.error != '' for run in own)}",
        f"{sum(run.person for run in own)}",
        f"{sum(run.driven_m for run in own):.0f}",
    ]


def run(options: Options, advance: Advance) -> SoakReport:
    """One mission a seed."""
    done: list[Soaked] = []
    for result in each(options.jobs, soaked, ((options.seed + number,) for number in range(options.runs))):
        done.append(result)
        advance(len(done), options.runs)
    return SoakReport(options, tuple(done))
