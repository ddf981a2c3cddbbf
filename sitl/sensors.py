"""Range sensors by suite name, and what they measure in a world.

``lidar-90`` and ``lidar-360`` are scanners of their own (component 196) that publish OBSTACLE_DISTANCE; ``beams`` are three
narrow rangefinders wired to the autopilot, which publishes them as DISTANCE_SENSOR.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from sitl.world import World

SECTORS = 72
UNKNOWN = 65535

Defect = Literal["", "stuck", "silent"]
"""What is wrong with a sensor: it repeats its last reading, or gives none."""


@dataclass(frozen=True, slots=True)
class Lidar:
    """A scanner of 72 sectors; sector ``i`` looks to ``offset_deg + i * increment_deg``, clockwise from ahead."""

    increment_deg: float
    offset_deg: float
    min_m: float
    max_m: float
    rate_hz: float = 10.0
    rays: int = 1
    """Rays spread over a sector; the nearest counts."""

    def bearings_rad(self) -> NDArray[np.float64]:
        """Shape (72, rays): every ray's bearing from straight ahead."""
        middle = np.arange(SECTORS) * self.increment_deg + self.offset_deg
        spread = (np.arange(self.rays) + 0.5) / self.rays - 0.5
        return np.asarray(np.radians(middle[:, None] + spread[None, :] * self.increment_deg), dtype=np.float64)


@dataclass(frozen=True, slots=True)
class Beam:
    """A narrow rangefinder; ``orientation`` in eighths of a turn clockwise (0 ahead, 1 right-front, 7 left-front)."""

    orientation: int
    min_m: float
    max_m: float


@dataclass(frozen=True, slots=True)
class SensorSuite:
    """What a rover carries."""

    lidar: Lidar | None = None
    beams: tuple[Beam, ...] = ()


SUITES = {
    "lidar-90": SensorSuite(lidar=Lidar(1.25, -45.0 + 0.625, 0.1, 4.5)),
    "lidar-360": SensorSuite(lidar=Lidar(5.0, 0.0, 0.1, 8.0, rays=5)),
    "beams": SensorSuite(beams=(Beam(0, 0.2, 6.0), Beam(7, 0.2, 6.0), Beam(1, 0.2, 6.0))),
    "none": SensorSuite(),
}


def suite_named(name: str) -> SensorSuite:
    """The suite of this name. Raises ValueError naming the known ones."""
    if name not in SUITES:
        raise ValueError(f"unknown sensors '{name}' (known: {', '.join(SUITES)})")
    return SUITES[name]


class RangeSensing:
    """Measures with one suite: the truth of the world, noise, rounding to centimetres."""

    def __init__(self, suite: SensorSuite, world: World, noise_m: float, rng: np.random.Generator) -> None:
        """``noise_m`` is the standard deviation of one range."""
        self.suite = suite
        self.time_s = 0.0
        """The world's time at which is measured; the simulator keeps it."""
        self.lidar_fault: Defect = ""
        self.beam_faults: dict[int, Defect] = {}
        """What is wrong with which rangefinder, by its place in the suite."""
        self._last_scan_cm: list[int] = []
        self._last_beams_cm: list[int] = []
        self._world = world
        self._noise_m = noise_m
        self._rng = rng
        self._lidar_rad = suite.lidar.bearings_rad() if suite.lidar else np.zeros((0, 1))
        self._beam_rad = np.array([[math.radians(45.0 * beam.orientation)] for beam in suite.beams]).reshape(-1, 1)

    def scan_cm(self, north_m: float, east_m: float, heading_rad: float) -> list[int]:
        """The scanner's 72 ranges; maximum + 1 where nothing was seen."""
        lidar = self.suite.lidar
        assert lidar is not None
        if self.lidar_fault == "stuck" and self._last_scan_cm:
            return list(self._last_scan_cm)
        true_m = self._world.rays_m(north_m, east_m, self._lidar_rad + heading_rad, lidar.max_m, self.time_s)
        seen_m = true_m + self._noise(SECTORS)
        nothing = round(lidar.max_m * 100) + 1
        cells = np.clip(np.rint(seen_m * 100.0), 0, nothing - 1)
        cells[(true_m >= lidar.max_m) | (seen_m >= lidar.max_m)] = nothing
        self._last_scan_cm = [int(cell) for cell in cells.tolist()]
        return list(self._last_scan_cm)

    def beams_cm(self, north_m: float, east_m: float, heading_rad: float) -> list[int]:
        """Each rangefinder's range; its maximum where nothing was seen."""
        if not self.suite.beams:
            return []
        reach_m = max(beam.max_m for beam in self.suite.beams)
        true_m = self._world.rays_m(north_m, east_m, self._beam_rad + heading_rad, reach_m, self.time_s)
        seen_m = true_m + self._noise(len(self.suite.beams))
        limits = [round(beam.max_m * 100) for beam in self.suite.beams]
        readings = [
            limit if true >= limit / 100 else min(max(round(float(seen) * 100), 0), limit)
            for limit, true, seen in zip(limits, true_m, seen_m, strict=True)
        ]
        for number, before in enumerate(self._last_beams_cm):
            if self.beam_faults.get(number) == "stuck":
                readings[number] = before
        self._last_beams_cm = readings
        return list(readings)

    def beam_is_silent(self, number: int) -> bool:
        """Whether this rangefinder gives no readings now."""
        return self.beam_faults.get(number) == "silent"

    def _noise(self, count: int) -> NDArray[np.float64]:
        return self._rng.standard_normal(count) * self._noise_m
