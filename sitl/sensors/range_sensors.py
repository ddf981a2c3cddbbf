"""Range sensors: lidars, rangefinders, proximity sectors, suites of them, and what they measure in a world.

``lidar-90`` and ``lidar-360`` are MAVLink components (196) that publish OBSTACLE_DISTANCE; ``beams`` are three narrow
rangefinders wired to the autopilot, which publishes them as DISTANCE_SENSOR.

Nouns: SensorSuite.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum, auto
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sitl.sensors.range_flaws import NO_FLAWS, Flaws, Sampler, with_flaws
from sitl.world.world import World

SECTORS = 72
UNKNOWN = 65535
FIRST_SECTOR_ID = 10
"""First DISTANCE_SENSOR id of the autopilot's proximity sectors."""
SECTOR_DEG = 45.0
UP, DOWN = 24, 25
LASER, NO_TYPE = 0, 4
"""MAV_DISTANCE_SENSOR: types that the firmware reports for proximity sectors and for wired sensors."""


def spread_rad(middle_deg: NDArray[np.float64], width_deg: float, rays: int) -> NDArray[np.float64]:
    """Shape (sectors, rays): bearings from straight ahead, spread evenly over each sector."""
    spread = (np.arange(rays) + 0.5) / rays - 0.5
    return np.asarray(np.radians(middle_deg[:, None] + spread[None, :] * width_deg), dtype=np.float64)


class Defect(Enum):
    """A defective sensor repeats its last reading, or the first that shows something, or gives none."""

    STUCK = auto()
    STUCK_IN_VIEW = auto()
    SILENT = auto()


@dataclass(frozen=True, slots=True)
class Lidar:
    """A lidar of up to 72 sectors; sector ``i`` looks to ``offset_deg + i * increment_deg``, clockwise from ahead."""

    increment_deg: float
    offset_deg: float
    min_m: float
    max_m: float
    rate_hz: float = 10.0
    rays: int = 1
    """Rays spread over a sector; the shortest counts."""
    sectors: int = SECTORS
    flaws: Flaws = NO_FLAWS
    as_points: bool = False
    """Whether it publishes a point for each sector, as depth cameras do (OBSTACLE_DISTANCE_3D)."""

    def bearings_rad(self) -> NDArray[np.float64]:
        """Shape (sectors, rays): every ray's bearing from straight ahead."""
        middle = np.arange(self.sectors, dtype=np.float64) * self.increment_deg + self.offset_deg
        return spread_rad(middle, self.increment_deg, self.rays)


@dataclass(frozen=True, slots=True)
class Beam:
    """A rangefinder; ``orientation``: eighths of a turn clockwise (0 ahead, 7 left-front), or 24 up, 25 down.

    Without ``rate_hz`` it measures whenever the autopilot sends; else at that rate, and the autopilot sends the
    newest reading. ``height_m``: mounting height, which is what it measures when looking down.
    """

    orientation: int
    min_m: float
    max_m: float
    rate_hz: float = 0.0
    width_deg: float = 0.0
    flaws: Flaws = NO_FLAWS
    height_m: float = 0.3

    def bearings_rad(self) -> NDArray[np.float64]:
        """Shape (1, rays): a ray per degree of its width, at least one; unused for one that looks up or down."""
        return spread_rad(np.array([45.0 * self.orientation]), self.width_deg, max(1, math.ceil(self.width_deg)))

    @property
    def fixed_m(self) -> float | None:
        """The constant range of one that looks up or down; None for others."""
        return {UP: math.inf, DOWN: self.height_m}.get(self.orientation)


@dataclass(frozen=True, slots=True)
class ProximitySectors:
    """Sectors of 45 degrees that the autopilot publishes as DISTANCE_SENSOR with ids from 10 on."""

    sectors: tuple[int, ...]
    min_m: float
    max_m: float
    rate_hz: float = 10.0
    flaws: Flaws = NO_FLAWS

    def bearings_rad(self) -> NDArray[np.float64]:
        """Shape (sectors, rays): a ray per degree."""
        return spread_rad(SECTOR_DEG * np.array(self.sectors, dtype=np.float64), SECTOR_DEG, round(SECTOR_DEG))


@dataclass(frozen=True, slots=True)
class SensorSuite:
    """The range sensors of a rover."""

    lidar: Lidar | None = None
    beams: tuple[Beam, ...] = ()
    proximity: ProximitySectors | None = None


class Reading(NamedTuple):
    """One range as sent in DISTANCE_SENSOR; centimetres, ``max_cm`` means nothing was seen."""

    number: int
    orientation: int
    min_cm: int
    max_cm: int
    range_cm: int
    kind: int = NO_TYPE


SUITES = {
    "lidar-90": SensorSuite(lidar=Lidar(1.25, -45.0 + 0.625, 0.1, 4.5)),
    "lidar-360": SensorSuite(lidar=Lidar(5.0, 0.0, 0.1, 8.0, rays=5)),
    "beams": SensorSuite(beams=(Beam(0, 0.2, 6.0), Beam(7, 0.2, 6.0), Beam(1, 0.2, 6.0))),
    "none": SensorSuite(),
}


def suite_named(name: str) -> SensorSuite:
    """The suite with this name. Raises ValueError that lists the known ones."""
    if name not in SUITES:
        raise ValueError(f"unknown sensors '{name}' (known: {', '.join(SUITES)})")
    return SUITES[name]


class RangeSensing:
    """Measurements of one suite: true ranges, flaws, noise, rounding to centimetres."""

    def __init__(self, suite: SensorSuite, world: World, noise_m: float, rng: np.random.Generator) -> None:
        """``noise_m``: standard deviation of a range, for sensors without a value of their own."""
        self.suite = suite
        self.time_s = 0.0
        """The world's time, set by the simulator."""
        self.lidar_fault: Defect | None = None
        self.beam_faults: dict[int, Defect] = {}
        """Defects of rangefinders and proximity sectors, by the number with which they are reported."""
        self._last_scan_cm: list[int] = []
        self._last_readings: dict[int, Reading] = {}
        self._world = world
        self._noise_m = noise_m
        self._rng = rng
        # Sensors with flaws have generators of their own, so that the draws of the others do not depend on them.
        *beam_rngs, sector_rng, self._lidar_rng = rng.spawn(len(suite.beams) + 2)
        self._lidar_rad = suite.lidar.bearings_rad() if suite.lidar else np.zeros((0, 1))
        numbered = list(enumerate(suite.beams))
        self._plain = [(number, beam) for number, beam in numbered if beam.rate_hz == 0.0]
        self._beam_rad = np.array([[math.radians(45.0 * beam.orientation)] for _, beam in self._plain]).reshape(-1, 1)
        self._sampled = [
            (number, beam, _sampler(beam, noise_m, beam_rngs[number], beam.fixed_m))
            for number, beam in numbered
            if beam.rate_hz > 0.0
        ]
        self._sectors = _sampler(suite.proximity, noise_m, sector_rng) if suite.proximity else None
        self._samplers = [sampler for _, _, sampler in self._sampled] + ([self._sectors] if self._sectors else [])
        self.samples = bool(self._samplers)
        """Whether a sensor measures at its own rate, so that ``sample`` must be called when that is due."""

    def next_due_s(self) -> float:
        """When a sensor with its own rate measures next, in the world's time."""
        return min(sampler.due_s for sampler in self._samplers)

    def sample(self, north_m: float, east_m: float, heading_rad: float) -> None:
        """Measure with every sensor that is due."""
        for sampler in self._samplers:
            sampler.sample(self._world, self.time_s, north_m, east_m, heading_rad)

    def scan_cm(self, north_m: float, east_m: float, heading_rad: float) -> list[int]:
        """The lidar's 72 ranges; maximum + 1 where nothing was seen, 65535 where the range is unknown."""
        lidar = self.suite.lidar
        assert lidar is not None
        nothing = round(lidar.max_m * 100) + 1
        if self._last_scan_cm and _repeats(self.lidar_fault, min(self._last_scan_cm) < nothing):
            return list(self._last_scan_cm)
        true_m = self._world.rays_m(north_m, east_m, self._lidar_rad + heading_rad, lidar.max_m, self.time_s)
        if lidar.flaws != NO_FLAWS:
            middle_rad = self._lidar_rad.mean(axis=1) + heading_rad
            limits_m = (lidar.min_m, lidar.max_m)
            seen_m = with_flaws(true_m, middle_rad, limits_m, lidar.flaws, self._noise_m, self._lidar_rng)
            cells = np.clip(np.rint(np.where(np.isfinite(seen_m), seen_m, 0.0) * 100.0), 0, nothing - 1)
            cells[np.isinf(seen_m)] = nothing
            cells[np.isnan(seen_m)] = UNKNOWN
        else:
            seen_m = true_m + self._noise(lidar.sectors)
            cells = np.clip(np.rint(seen_m * 100.0), 0, nothing - 1)
            cells[(true_m >= lidar.max_m) | (seen_m >= lidar.max_m)] = nothing
        self._last_scan_cm = cells.astype(np.int64).tolist() + [UNKNOWN] * (SECTORS - lidar.sectors)
        return list(self._last_scan_cm)

    def beams_cm(self, north_m: float, east_m: float, heading_rad: float) -> list[int]:
        """Ranges of the rangefinders without their own rate; their maximum where nothing was seen."""
        if not self._plain:
            return []
        reach_m = max(beam.max_m for _, beam in self._plain)
        true_m = self._world.rays_m(north_m, east_m, self._beam_rad + heading_rad, reach_m, self.time_s)
        seen_m = true_m + self._noise(len(self._plain))
        limits = [round(beam.max_m * 100) for _, beam in self._plain]
        return [
            limit if true >= limit / 100 else min(max(round(float(seen) * 100), 0), limit)
            for limit, true, seen in zip(limits, true_m, seen_m, strict=True)
        ]

    def wired(self, north_m: float, east_m: float, heading_rad: float) -> list[Reading]:
        """Readings of the rangefinders at this moment; one without a range is left out, as in the firmware."""
        if not self.suite.beams:
            return []
        ranges_cm = self.beams_cm(north_m, east_m, heading_rad)
        found = [
            Reading(number, beam.orientation, round(beam.min_m * 100), round(beam.max_m * 100), range_cm)
            for (number, beam), range_cm in zip(self._plain, ranges_cm, strict=True)
        ]
        for number, beam, sampler in self._sampled:
            newest_m = sampler.newest_m(self.time_s)
            if newest_m is not None and not math.isnan(newest_m[0]):
                found.append(_reading(number, beam.orientation, beam, float(newest_m[0]), NO_TYPE))
        return self._with_faults(sorted(found, key=lambda reading: reading.number))

    def numbers(self) -> list[int]:
        """The numbers of all rangefinders and proximity sectors."""
        sectors = self.suite.proximity.sectors if self.suite.proximity else ()
        return [*range(len(self.suite.beams)), *(FIRST_SECTOR_ID + sector for sector in sectors)]

    def _with_faults(self, readings: list[Reading]) -> list[Reading]:
        """The readings without those of silent sensors; a stuck one repeats its last reading."""
        kept = []
        for reading in readings:
            fault = self.beam_faults.get(reading.number)
            last = self._last_readings.get(reading.number, reading)
            if _repeats(fault, last.range_cm < last.max_cm):
                kept.append(last)
            elif fault is not Defect.SILENT:
                self._last_readings[reading.number] = reading
                kept.append(reading)
        return kept

    def sectors(self) -> list[Reading]:
        """Readings of the proximity sectors; one without a range shows its maximum, as in the firmware."""
        near = self.suite.proximity
        if near is None or self._sectors is None:
            return []
        newest_m = self._sectors.newest_m(self.time_s)
        if newest_m is None:
            return []
        readings = [
            _reading(FIRST_SECTOR_ID + sector, sector, near, float(range_m), LASER)
            for sector, range_m in zip(near.sectors, np.nan_to_num(newest_m, nan=math.inf), strict=True)
        ]
        return self._with_faults(readings)

    def _noise(self, count: int) -> NDArray[np.float64]:
        return self._rng.standard_normal(count) * self._noise_m


def _repeats(defect: Defect | None, in_view: bool) -> bool:
    """Whether a sensor repeats its last reading; ``in_view``: whether that reading shows something."""
    return defect is Defect.STUCK or (defect is Defect.STUCK_IN_VIEW and in_view)


def _sampler(
    sensor: Beam | ProximitySectors, noise_m: float, rng: np.random.Generator, fixed_m: float | None = None
) -> Sampler:
    limits_m = (sensor.min_m, sensor.max_m)
    return Sampler(sensor.bearings_rad(), limits_m, sensor.rate_hz, sensor.flaws, noise_m, rng, fixed_m)


def _reading(number: int, orientation: int, sensor: Beam | ProximitySectors, range_m: float, kind: int) -> Reading:
    most_cm = round(sensor.max_m * 100)
    range_cm = most_cm if range_m >= sensor.max_m else min(max(round(range_m * 100), 0), most_cm)
    return Reading(number, orientation, round(sensor.min_m * 100), most_cm, range_cm, kind)
