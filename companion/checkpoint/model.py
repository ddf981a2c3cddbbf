"""What is kept of a run, as plain values that can be checked."""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, model_validator

from companion.executive.mission_progress import MissionPhase, TargetStatus
from companion.mission.check import MAX_GRID_FIELDS
from companion.safety.mode_latch import Control
from companion.vehicle.rc_input import PULSES_US

Latitude = Annotated[float, Field(ge=-90.0, le=90.0)]
Longitude = Annotated[float, Field(ge=-180.0, le=180.0)]
Metres = Annotated[float, Field(ge=-1e7, le=1e7)]
LONGEST_S = 1e9
"""Stands for "for ever", too."""
Seconds = Annotated[float, Field(ge=0.0, le=LONGEST_S)]
Count = Annotated[int, Field(ge=0, lt=2**63)]
FieldNumber = Annotated[int, Field(ge=-(2**31), lt=2**31)]
Geo = tuple[Latitude, Longitude]
Pulse = Annotated[int, Field(ge=PULSES_US.start, lt=PULSES_US.stop)]

UNDER_WAY = (MissionPhase.TRAVEL, MissionPhase.STAY, MissionPhase.WAIT)
MAX_TARGETS = 1_000_000
MAX_PAST = 4_000_000


class Part(BaseModel):
    """A part of the state: immutable; unknown names and figures that are none are refused."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class SavedPlace(Part):
    """A place in the local frame of then: metres from the origin."""

    name: str = "start"
    north_m: Metres
    east_m: Metres


class SavedErrand(SavedPlace):
    """A place that somebody asked for on the way."""

    speed_m_s: Annotated[float, Field(gt=0.0, le=1000.0)] | None


class SavedProgress(Part):
    """The progress: where to return to, what has become of each target. Times are what was left of them."""

    start: SavedPlace
    statuses: tuple[TargetStatus, ...] = Field(min_length=1, max_length=MAX_TARGETS)
    index: Count
    leg: MissionPhase
    left_s: Seconds
    give_up_left_s: Seconds | None
    errand: SavedErrand | None = None

    @model_validator(mode="after")
    def _agree(self) -> SavedProgress:
        if self.index > len(self.statuses) or (self.leg in UNDER_WAY and self.index == len(self.statuses)):
            raise ValueError("there is no such target")
        return self


class SavedLeg(Part):
    """The navigator's memory on the way to the present target; fields count from the grid's south-west corner."""

    past: tuple[tuple[FieldNumber, FieldNumber], ...] = Field(min_length=1, max_length=MAX_PAST)
    returning: bool
    until_search: FieldNumber
    since_better: Count
    draws: Annotated[int, Field(ge=0, lt=2**64)]
    doubts_left: Count


class SavedGround(Part):
    """Where the map lies, metres from the mission's home, and its raster."""

    north_m: Metres
    east_m: Metres
    resolution_m: Annotated[float, Field(gt=0.0, le=1e4)]
    width: Annotated[int, Field(ge=1)]
    height: Annotated[int, Field(ge=1)]
    subdivisions: Annotated[int, Field(ge=1)]

    @model_validator(mode="after")
    def _bounded(self) -> SavedGround:
        if self.width * self.height > MAX_GRID_FIELDS or self.width * self.height * self.subdivisions**2 > 16_000_000:
            raise ValueError("the map is too large")
        return self


class SavedTally(Part):
    """Counts for the summary; ``epoch`` keeps random choices from being made again."""

    steps: Count = 0
    return_steps: Count = 0
    stuck: Count = 0
    epoch: Count = 0


class SavedDraws(Part):
    """A PCG-64 generator between two draws."""

    state: Annotated[int, Field(ge=0, lt=2**128)]
    inc: Annotated[int, Field(ge=0, lt=2**128)]
    has_uint32: Annotated[int, Field(ge=0, le=1)]
    uinteger: Annotated[int, Field(ge=0, lt=2**32)]


class SavedState(Part):
    """A run at one moment.

    ``control``, ``armed``: who had the rover, and whether its motors were on; ``released``: we had stopped it and put it into HOLD ourselves.
    ``boot_s``: the autopilot's own clock then; ``ahead_s``: by how much our clock was ahead of it, which stays so while both run.
    """

    mission: str
    mission_sha256: Annotated[str, Field(pattern="^[0-9a-f]{64}$")]
    ended: bool
    control: Control
    released: bool
    armed: bool
    boot_s: float
    ahead_s: float
    origin: Geo
    home: Geo
    progress: SavedProgress
    leg: SavedLeg | None
    trail: tuple[tuple[FieldNumber, FieldNumber], ...] = Field((), max_length=MAX_PAST)
    """The way from where the mission began to here, without its loops; fields as in ``leg``."""
    ground: SavedGround
    tally: SavedTally
    draws: SavedDraws | None
    sticks_us: tuple[Pulse, Pulse] | None = None
    """Where the pilot's sticks rested, steering and throttle; None where they were not seen."""

    @property
    def reached(self) -> int:
        """How many targets had been reached."""
        return sum(status is TargetStatus.REACHED for status in self.progress.statuses)
