"""Values of axes in words: a name, and what differs from what it means, like ``rooms least_door_m=1.4 movers=3``.

So every ground, sensor with its flaws, and fault can stand in a campaign's lists.
"""

from __future__ import annotations

import tomllib
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, NamedTuple, TypeVar

from pydantic import BaseModel, Field, ValidationError

from companion.mission.sensor_tables import Sensors, Share, is_blind, sensors_from, sensors_given
from companion.mission.tables import Table
from companion.storage.validation import describe_first
from sitl.faults.fault_file import FaultFileError, fault_of, load_faults
from sitl.faults.plan import FaultPlan
from sitl.generators.kinds import Parameters, is_kind, parameters_of
from sitl.generators.made_ground import ACROSS_M, NEAREST_TARGET_M, MadeGround, made
from sitl.sensors.range_sensors import SensorSuite
from sitl.sensors.suites import suite_of

NOTHING = "none"
"""No faults."""
OWN = "own"
"""The sensors that the mission names; generated ground is driven with ``USUAL_SENSORS``."""
BLIND = "the companion does not drive without range data"
BETWEEN_FAULTS = ";"
MOST_MOVERS = 50

Model = TypeVar("Model", bound=BaseModel)


class Worded(NamedTuple):
    """A name with values."""

    name: str
    values: dict[str, Any]

    @classmethod
    def of(cls, text: str) -> Worded:
        """Raises ValueError for a word without ``=``, and for one that stands there twice."""
        name, *words = text.split() or [""]
        values: dict[str, Any] = {}
        for word in words:
            key, equals, value = word.partition("=")
            if not equals or not key or not value:
                raise ValueError(f"{word:.40}: write NAME=VALUE after {name:.40}, without blanks")
            if key in values:
                raise ValueError(f"{key:.40} stands there twice")
            values[key] = _scalar(value)
        return cls(name, values)

    def __str__(self) -> str:
        return " ".join([self.name, *(f"{key}={_shown(value)}" for key, value in self.values.items())])


def _scalar(text: str) -> Any:
    """As TOML reads it; what is no number, true or false is a text."""
    try:
        value = tomllib.loads(f"value = {text}")["value"]
    except tomllib.TOMLDecodeError:
        return text
    return value if isinstance(value, bool | int | float) else text


def _shown(value: Any) -> str:
    return str(value).lower() if isinstance(value, bool) else f"{value:g}" if isinstance(value, float) else str(value)


@dataclass(frozen=True, slots=True)
class GroundSpec:
    """Ground that is made from a seed."""

    kind: str
    given: Parameters
    movers: int = 0
    target_east_m: float = ACROSS_M

    @classmethod
    def of(cls, text: str) -> GroundSpec | None:
        """None for a text whose first word is no kind of ground: a mission's file.

        Raises ValueError (OwnPartError is one).
        """
        if not is_kind(text.partition(" ")[0]):
            return None
        kind, values = Worded.of(text)
        movers = values.pop("movers", 0)
        if isinstance(movers, bool) or not isinstance(movers, int) or not 0 <= movers <= MOST_MOVERS:
            raise ValueError(f"movers={movers}: give a whole number from 0 to {MOST_MOVERS}")
        east_m = values.pop("target_east_m", ACROSS_M)
        if isinstance(east_m, bool | str) or not NEAREST_TARGET_M <= east_m <= ACROSS_M:
            raise ValueError(f"target_east_m={east_m}: give metres from {NEAREST_TARGET_M:g} to {ACROSS_M:g}")
        return cls(kind, _valid(parameters_of(kind), values), movers, float(east_m))

    def made(self, seed: int) -> MadeGround:
        """The ground of a seed. Raises NoWayError, OwnPartError."""
        return made(self.kind, seed, self.given, self.movers, self.target_east_m)


class SensorChanges(Table):
    """What may differ of a suite, for all its sensors."""

    max_m: Annotated[float, Field(gt=0.0, le=300.0)] | None = None
    noise_m: Annotated[float, Field(ge=0.0, le=10.0)] | None = None
    dropout: Share | None = None
    false_echo: Share | None = None
    latency_s: Annotated[float, Field(ge=0.0, le=5.0)] | None = None


@dataclass(frozen=True, slots=True)
class SensorSpec:
    """A suite, or a file that describes one, and what differs."""

    name: str
    changes: SensorChanges

    @classmethod
    def of(cls, text: str) -> SensorSpec:
        """Raises ValueError."""
        name, values = Worded.of(text)
        return cls(name, _valid(SensorChanges, values))

    def check(self, folder: Path) -> None:
        """Raises ValueError for sensors that are not there, and for none at all."""
        if is_blind(self.name):
            raise ValueError(f"{self.name!r}: {BLIND}; name a suite or a file with sensors")
        if self.name != OWN:
            sensors_from(sensors_given(self.name), folder, ValueError)

    def changed(self, sensors: Sensors | SensorSuite) -> SensorSuite:
        """The suite with the changes."""
        suite = sensors if isinstance(sensors, SensorSuite) else suite_of(sensors)
        return SensorSuite(
            None if suite.lidar is None else self._of_one(suite.lidar),
            tuple(self._of_one(beam) for beam in suite.beams),
            None if suite.proximity is None else self._of_one(suite.proximity),
        )

    def _of_one(self, sensor: Any) -> Any:
        values = self.changes.model_dump(exclude_none=True)
        far = {"max_m": max(values.pop("max_m"), sensor.min_m + 0.1)} if "max_m" in values else {}
        return replace(sensor, **far, flaws=replace(sensor.flaws, **values))


def faults_of(text: str, folder: Path) -> FaultPlan:
    """The plan of a file, or faults in words with ``;`` between them. Raises FaultFileError.

    Like ``link_outage start_s=10 since=driving duration_s=0.8; gps_noise start_s=60 deviation_m=0.5``.
    """
    if text.endswith(".toml"):
        return load_faults(folder / text)
    tables = []
    for piece in text.split(BETWEEN_FAULTS):
        try:
            kind, values = Worded.of(piece)
        except ValueError as error:
            raise FaultFileError(f"{piece.strip():.60}: {error}") from error
        tables.append({"kind": kind, **values})
    return FaultPlan(tuple(fault_of("faults", number, table) for number, table in enumerate(tables, 1)), 0, "faults")


def _valid(model: type[Model], values: dict[str, Any]) -> Model:
    """Raises ValueError with one line that names what there is."""
    try:
        return model.model_validate(values, strict=True)
    except ValidationError as error:
        reason = " ".join(describe_first(error, model).split())
        known = "" if "known here" in reason else f"; known here: {', '.join(model.model_fields)}"
        raise ValueError(f"{reason}{known}") from None
