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
    changes: str
    """The variant's values, as JSON."""

    @property
    def id(self) -> str:
        """A short name that no other run has."""
        return hashlib.sha256(json.dumps(asdict(self), sort_keys=True).encode()).hexdigest()[:ID_LENGTH]

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
    reached: int
    """Targets reached, of ``targets``."""
    targets: int
    touched: int
    """Contacts while the rover moved."""
    run_into: int
    """Contacts while it stood, and something that moves came along."""
    refused: int
    """Setpoints that the last look replaced by a stop."""
    unreachable: int
    """Targets that were called unreachable."""
    seconds: float
    """Driving time, from the first movement to the last."""
    metres: float
    drawn_ah: float
    """Drawn from the battery."""
    steps: int
    searches: int
    cpu_s: float
    """Of the processor; the only figure that differs from machine to machine."""
    said: str
    """The last thing that the companion said, or the error."""
    dwelt: tuple[tuple[int, int, int], ...] = ()
    """Where the time went: metres north and east of the world's corner, rounded down, and seconds, 2 or more."""

    @property
    def complete(self) -> bool:
        """Whether every target was reached, and nothing touched."""
        return self.reached == self.targets and self.touched == 0


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
                campaign.time_limit_s, changes,
            )  # fmt: skip
