"""Tables of simulated range sensors: ``[sitl.sensors]`` of a mission, or a separate file with the same content."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from pydantic import BeforeValidator, Field, ValidationError, model_validator

from companion.mission.tables import Positive, Table
from companion.storage.toml_file import read_table
from companion.storage.validation import describe_first

NONE = "none"
BEAMS = "beams"
NAMED = ("lidar-90", "lidar-360", BEAMS, NONE)
"""Named suites."""

Share = Annotated[float, Field(ge=0.0, le=1.0)]
RateHz = Annotated[float, Field(gt=0.0, le=50.0)]
Degrees = Annotated[float, Field(ge=-360.0, le=360.0)]


class SunTable(Table):
    """Low sun: sensors that face it have a shorter range. ``bearing_deg``: the sun's bearing, clockwise from north."""

    bearing_deg: Degrees = 0.0
    width_deg: Annotated[float, Field(gt=0.0, le=360.0)] = 360.0
    range_share: Share


class SensorTable(Table):
    """The keys of every range sensor, with its flaws."""

    min_m: Annotated[float, Field(ge=0.0, le=300.0)]
    max_m: Annotated[float, Field(gt=0.0, le=300.0)]
    rate_hz: RateHz = 10.0
    noise_m: Annotated[float, Field(ge=0.0, le=10.0)] | None = None
    dropout: Share = 0.0
    false_echo: Share = 0.0
    latency_s: Annotated[float, Field(ge=0.0, le=5.0)] = 0.0
    sun: SunTable | None = None

    @model_validator(mode="after")
    def _limits(self) -> SensorTable:
        if self.max_m <= self.min_m:
            raise ValueError("max_m must be more than min_m")
        return self


class LidarTable(SensorTable):
    """``[lidar]``: sectors clockwise; the first faces ``first_deg`` from ahead."""

    first_deg: Degrees
    increment_deg: Annotated[float, Field(gt=0.0, le=180.0)]
    sectors: Annotated[int, Field(ge=1, le=72)] = 72
    rays: Annotated[int, Field(ge=1, le=20)] = 1
    message: Literal["sectors", "points"] = "sectors"

    @model_validator(mode="after")
    def _round(self) -> LidarTable:
        if self.sectors * self.increment_deg > 360.0 + 1e-6:
            raise ValueError("sectors times increment_deg is more than a full turn")
        return self


def _number(value: object) -> object:
    """Refuses true and false, which Python counts as numbers. Raises ValueError."""
    if isinstance(value, bool):
        raise ValueError("a number is needed, not true or false")
    return value


class BeamTable(SensorTable):
    """``[[beam]]``: a rangefinder.

    ``orientation``: 0 to 7 in eighths of a turn clockwise from ahead, 24 up, 25 down.
    """

    orientation: Annotated[Literal[0, 1, 2, 3, 4, 5, 6, 7, 24, 25], BeforeValidator(_number)]
    width_deg: Annotated[float, Field(ge=0.0, le=90.0)] = 2.0
    height_m: Positive = 0.3


class ProximityTable(SensorTable):
    """``[proximity]``: the autopilot's own sectors of 45 degrees, 0 ahead, clockwise."""

    sectors: Annotated[list[Annotated[int, Field(ge=0, le=7)]], Field(min_length=1, max_length=8)] = Field(
        default_factory=lambda: list(range(8))
    )


class SensorsTable(Table):
    """All range sensors of a rover."""

    lidar: LidarTable | None = None
    beam: Annotated[list[BeamTable], Field(max_length=10, default_factory=list)]
    proximity: ProximityTable | None = None

    @property
    def is_empty(self) -> bool:
        """Whether there is none."""
        return not (self.lidar or self.beam or self.proximity)

    def __str__(self) -> str:
        """The sensors in words."""
        sensors = ["a lidar"] if self.lidar else []
        sensors += [f"{len(self.beam)} beams" if len(self.beam) > 1 else "a beam"] if self.beam else []
        sensors += ["proximity sectors"] if self.proximity else []
        return " and ".join(sensors) or NONE


Sensors = str | SensorsTable
"""The name of a suite, or a description."""


def is_blind(sensors: Sensors) -> bool:
    """Whether a rover with these sensors has none."""
    return sensors.is_empty if isinstance(sensors, SensorsTable) else sensors == NONE


def sensors_given(value: object) -> Sensors:
    """A name or a file's name as it is, a table as ``SensorsTable``. Raises ValueError with one line."""
    if isinstance(value, dict):
        try:
            return SensorsTable.model_validate(value)
        except ValidationError as error:
            raise ValueError(describe_first(error, SensorsTable)) from None
    if isinstance(value, str) and (value in NAMED or value.endswith(".toml")):
        return value
    raise ValueError(f"unknown sensors {value!r:.60} (known: {', '.join(NAMED)}, a .toml file, or a table)")


def sensors_from(value: Sensors, folder: Path, error: type[Exception]) -> Sensors:
    """The sensors, read from their file if they are given as one. Raises ``error`` for a bad file."""
    if isinstance(value, str) and value.endswith(".toml"):
        sensors = read_table(folder / value, SensorsTable, error, "docs/worlds.md describes range sensors")
        if sensors.is_empty:
            raise error(
                f"{folder / value}: describes no sensor; "
                "give a [lidar], [[beam]] or [proximity], or write sensors = 'none'"
            )
        return sensors
    return value
