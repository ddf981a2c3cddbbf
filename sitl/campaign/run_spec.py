"""Single runs of a campaign: which there are, and what came out of one.

Nouns: run spec, run result.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator
from dataclasses import asdict, dataclass, fields
from itertools import product

from sitl.campaign.campaign_file import CampaignTable
from sitl.generators.measures import Difficulty

ID_LENGTH = 12


@dataclass(frozen=True, slots=True)
class RunSpec:
    """One run: a value of each axis, and the seed. It says all that a run is a function of, but for the code."""

    world: str
    """A kind of generated ground, or a mission file, from the campaign's folder on."""
    planner: str
    controller: str
    sensors: str
    faults: str
    guard: bool
    off_model: float
    late_s: float
    settings: str
    """The name of the variant."""
    seed: int
    time_limit_s: float
    person: bool
    """Whether somebody sets GUIDED and arms where the companion waits for that."""
    changes: str
    """The variant's values, as JSON."""
    autopilot_on_s: float = 0.0
    """So long the autopilot is switched on when the companion starts."""

    @property
    def id(self) -> str:
        """A short name that no other run has. A run of before ``autopilot_on_s`` keeps its own."""
        values = asdict(self)
        if not self.autopilot_on_s:
            del values["autopilot_on_s"]
        return hashlib.sha256(json.dumps(values, sort_keys=True).encode()).hexdigest()[:ID_LENGTH]

    def without(self, axis: str) -> tuple[object, ...]:
        """All values but that of one axis: the same for runs that are a pair."""
        left_out = {axis, "changes"} if axis == "settings" else {axis}
        return tuple(getattr(self, one.name) for one in fields(self) if one.name not in left_out)


AXES = ("world", "planner", "controller", "sensors", "faults", "guard", "off_model", "late_s", "settings")


@dataclass(frozen=True, slots=True)
class RunResult:
    """What came out of one run."""

    led_by: str
    """What really led the rover: points, where a rover or its sensors do not let motions be planned."""
    outcome: str
    """That of ``rover-sitl drive``, or ``error``."""
    reached: int = 0
    """Targets reached, of ``targets``."""
    targets: int = 0
    touched: int = 0
    """Contacts while the rover moved."""
    run_into: int = 0
    """Contacts while it stood, and something that moves came along."""
    refused: int = 0
    """Setpoints that the last look replaced by a stop."""
    unreachable: int = 0
    """Targets that were called unreachable."""
    called_wrongly: int = 0
    """Those of them to which a way leads (``true_ways``)."""
    left_out: int = 0
    """Targets that a mission has left out that ended though none was called unreachable and the battery was not low."""
    seconds: float = 0.0
    """Driving time, from the first movement to the last."""
    bound_s: float = 0.0
    """The least driving time on known ground (``time_bound``); 0: there is none."""
    metres: float = 0.0
    drawn_ah: float = 0.0
    """Drawn from the battery."""
    clearance_m: float = 0.0
    """The least distance of its outline from anything while it moved, of all ticks; at most 5, 0 where it touched."""
    against_pilot: int = 0
    """Setpoints, modes and arming that were sent while a person or a failsafe had the rover."""
    blind_s: float = 0.0
    """So long it moved on without range data and did not brake as it must."""
    waits_for: str = ""
    """What it waited for at its end; empty if it waited for nothing."""
    helped: int = 0
    """How often a person set GUIDED and armed."""
    steps: int = 0
    searches: int = 0
    genetic_searches: int = 0
    """Those that the genetic algorithm answered."""
    cpu_s: float = 0.0
    """Of the processor; the only figure that differs from machine to machine."""
    said: str = ""
    """The last thing that the companion said, or the error."""
    dwelt: tuple[tuple[int, int, float], ...] = ()
    """Where the time went: metres north and east of the world's corner, rounded down, and seconds, 1 or more."""
    ground: Difficulty | None = None
    """How difficult the generated ground was; None: a mission's file says where it is driven, or an error ended
    the run."""

    @property
    def complete(self) -> bool:
        """Whether every target was reached, and nothing touched."""
        return 0 < self.targets == self.reached and self.touched == 0


def specs_of(campaign: CampaignTable) -> Iterator[RunSpec]:
    """Every run; seed after seed, so that what is done after a while is a fair sample."""
    for seed in range(campaign.seed, campaign.seed + campaign.runs):
        for world, planner, controller, sensors, faults, guard, off_model, late_s, settings in product(
            campaign.worlds, campaign.planners, campaign.controllers, campaign.sensors, campaign.faults, campaign.guard,
            campaign.off_model, campaign.late_s, campaign.settings,
        ):  # fmt: skip
            changes = json.dumps(campaign.settings[settings], sort_keys=True)
            yield RunSpec(
                world, planner, controller, sensors, faults, guard, off_model, late_s, settings, seed,
                campaign.time_limit_s, campaign.person, changes, campaign.autopilot_on_s,
            )  # fmt: skip
