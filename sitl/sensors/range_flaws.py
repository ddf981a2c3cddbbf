"""Flaws of range sensors: noise, dropouts, false echoes, sunlight, latency; and sensors with their own rate.

Glass and black surfaces are part of the world.

Nouns: Flaws.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, replace

import numpy as np

from sitl.world.world import Floats, World


@dataclass(frozen=True, slots=True)
class Sun:
    """Sunlight: within half of ``width_rad`` of its bearing a sensor sees only this share of its maximum range."""

    bearing_rad: float
    width_rad: float
    range_share: float


@dataclass(frozen=True, slots=True)
class Flaws:
    """Flaws of one sensor. ``noise_m``: standard deviation of a range (None: the simulator's).

    ``dropout``: probability that a range is unknown; ``false_echo``: probability of an echo in front of the true one.
    ``latency_s``: age of a range when it is sent.
    """

    noise_m: float | None = None
    dropout: float = 0.0
    false_echo: float = 0.0
    latency_s: float = 0.0
    sun: Sun | None = None


NO_FLAWS = Flaws()


def with_flaws(
    true_m: Floats, bearings_rad: Floats, limits_m: tuple[float, float], flaws: Flaws, noise_m: float,
    rng: np.random.Generator,
) -> Floats:  # fmt: skip
    """Ranges as the sensor reports them: ``inf`` where it sees nothing, ``nan`` where the range is unknown.

    ``bearings_rad``: of the ranges, in the world frame; ``limits_m``: the sensor's minimum and maximum. The number of
    random draws does not depend on the flaws, so that one flaw does not change the draws of another.
    """
    least_m, most_m = limits_m
    noise, echo, place, dropout = (rng.standard_normal(true_m.size), *rng.random((3, true_m.size)))
    seen_m = true_m + noise * (noise_m if flaws.noise_m is None else flaws.noise_m)
    reach_m = np.full(true_m.size, most_m)
    if flaws.sun is not None:
        aside_rad = (bearings_rad - flaws.sun.bearing_rad + math.pi) % (2.0 * math.pi) - math.pi
        reach_m[np.abs(aside_rad) <= 0.5 * flaws.sun.width_rad] *= flaws.sun.range_share
    seen_m[(true_m >= reach_m) | (seen_m >= reach_m)] = math.inf
    nearer_m = least_m + place * (np.minimum(true_m, most_m) - least_m)
    false = (echo < flaws.false_echo) & (nearer_m < np.minimum(true_m, most_m))
    seen_m[false] = nearer_m[false]
    seen_m[dropout < flaws.dropout] = math.nan
    return seen_m


class Sampler:
    """A sensor that measures at its own rate, from the start on; its readings are at least ``latency_s`` old."""

    def __init__(
        self, bearings_rad: Floats, limits_m: tuple[float, float], rate_hz: float, flaws: Flaws, noise_m: float,
        rng: np.random.Generator, fixed_m: float | None = None,
    ) -> None:  # fmt: skip
        """``bearings_rad``: shape (sectors, rays), from straight ahead; ``fixed_m``: a constant range."""
        self._bearings_rad = bearings_rad
        self._limits_m = limits_m
        self._period_s = 1.0 / rate_hz
        self._flaws = flaws if fixed_m is None else replace(flaws, sun=None)
        self._noise_m = noise_m
        self._rng = rng
        self._fixed_m = fixed_m
        self._count = 0
        self._waiting: deque[tuple[float, Floats]] = deque()
        self._newest_m: Floats | None = None

    @property
    def due_s(self) -> float:
        """Time of the next measurement."""
        return self._count * self._period_s

    def sample(self, world: World, time_s: float, north_m: float, east_m: float, heading_rad: float) -> None:
        """Measure, if that is due."""
        if time_s < self.due_s - 1e-9:
            return
        self.newest_m(time_s)
        self._count = math.floor(time_s / self._period_s + 1e-6) + 1
        bearings_rad = self._bearings_rad + heading_rad
        max_m = self._limits_m[1]
        if self._fixed_m is None:
            true_m = world.rays_m(north_m, east_m, bearings_rad, max_m, time_s)
        else:
            true_m = np.full(len(bearings_rad), min(self._fixed_m, max_m))
        seen_m = with_flaws(true_m, bearings_rad.mean(axis=1), self._limits_m, self._flaws, self._noise_m, self._rng)
        self._waiting.append((time_s + self._flaws.latency_s, seen_m))

    def newest_m(self, time_s: float) -> Floats | None:
        """The newest ranges that are at least ``latency_s`` old; None before the first."""
        while self._waiting and self._waiting[0][0] <= time_s + 1e-9:
            self._newest_m = self._waiting.popleft()[1]
        return self._newest_m
