"""Footprint: the rover's outline on the ground, a rectangle or a circle round the place that the autopilot reports.

Nouns: footprint.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

DISC_EXCESS, DISC_EXCESS_M = 0.03, 0.01
"""The discs that cover a rectangle reach so much farther aside than it: a share of its half width, and at most the
second. Else a long or wide rover would not fit through gaps that its outline fits through."""
MOST_DISCS = 24
"""Discs take time: an outline more than six times as long as wide is covered by this many, which reach farther."""


@dataclass(frozen=True, slots=True)
class Footprint:
    """How far the outline reaches ahead, back, and to either side, in metres; a circle is as far everywhere."""

    front_m: float
    rear_m: float
    half_width_m: float
    is_circle: bool = False

    @classmethod
    def circle(cls, radius_m: float) -> Footprint:
        """A circle round the place that the autopilot reports."""
        return cls(radius_m, radius_m, radius_m, is_circle=True)

    @classmethod
    def rectangle(cls, length_m: float, width_m: float, centre_forward_m: float = 0.0) -> Footprint:
        """A rectangle whose middle lies so far ahead of the place that the autopilot reports."""
        half_m = 0.5 * length_m
        return cls(half_m + centre_forward_m, half_m - centre_forward_m, 0.5 * width_m)

    @property
    def radius_m(self) -> float:
        """Radius of the circle round the reported place that the whole outline lies in."""
        return self.front_m if self.is_circle else math.hypot(max(self.front_m, self.rear_m), self.half_width_m)

    @property
    def inscribed_m(self) -> float:
        """Radius of the largest circle round the reported place that lies in the outline."""
        return min(self.front_m, self.rear_m, self.half_width_m)

    def discs(self) -> tuple[NDArray[np.float64], float]:
        """Discs that cover the outline: their places ahead of the reported one, shape (n,), and their radius."""
        if self.is_circle:
            return np.zeros(1), self.front_m
        length_m, half_m = self.front_m + self.rear_m, self.half_width_m
        beyond_m = min(DISC_EXCESS * half_m, DISC_EXCESS_M)
        needed = math.ceil(length_m / (2.0 * math.sqrt((half_m + beyond_m) ** 2 - half_m**2)) - 1e-9)
        count = min(max(needed, 1), MOST_DISCS)
        piece_m = length_m / count
        ahead_m = -self.rear_m + piece_m * (np.arange(count) + 0.5)
        return ahead_m.astype(np.float64), math.hypot(half_m, 0.5 * piece_m)
