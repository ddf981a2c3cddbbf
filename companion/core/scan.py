"""One set of range readings, whatever message it came from.

Nouns: scan.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

AHEAD_RAD = np.radians(20.0)
NARROW_RAD = np.radians(30.0)
"""A scan that covers less is a beam, not a view."""
KNOWN_SHARE = 0.01
WIRED = 0
"""The sender of scans that came over no link: of a lidar on a serial port of the companion's own."""


@dataclass(frozen=True, eq=False, slots=True)
class RangeScan:
    """Ranges in the rover's own frame.

    ``bearing_rad``: shape (n,), clockwise from straight ahead. ``range_m``: shape (n,), metres; ``inf`` = nothing seen
    up to ``max_range_m``; ``nan`` = unknown, says nothing. ``beam_width_rad`` is the width that each reading speaks
    for. ``time_s`` is the companion's clock when the scan arrived.
    """

    time_s: float
    bearing_rad: NDArray[np.float64]
    range_m: NDArray[np.float64]
    min_range_m: float
    max_range_m: float
    beam_width_rad: float
    source: str
    """What it came in: the kind of message, and the number of the sensor if that bears one."""
    sender: int = 1
    """Component id of who sent it; 1 is the autopilot, WIRED a lidar of the companion's own."""
    age_s: NDArray[np.float64] | None = None
    """How long before ``time_s`` each reading was taken, shape (n,); None: all at once, or nobody knows."""
    empty_m: float = math.inf
    """So far a ray that met nothing is known to be free, if that is less than ``max_range_m``; 0: there are none."""
    origin_m: tuple[float, float] = (0.0, 0.0)
    """Where the rays begin: metres forward and right of the rover's middle. Readings still count from the middle."""
    told_s: float | None = None
    """The time that the sender has written into it, by a clock of its own."""
    late_s: float | None = None
    """How late it came by the sensor's own clock; None: nobody knows. Over MAVLink compared with the best of the last
    one to two seconds (``ArrivalJitter``), of a wired lidar with the best of the run (``DeviceClock``)."""

    @property
    def sight_m(self) -> float:
        """How far ground that is free is known to be so."""
        return min(self.max_range_m, self.empty_m) if self.empty_m > 0.0 else self.max_range_m

    @property
    def voice(self) -> tuple[int, str]:
        """Who speaks here: two components may send the same kind of message, and one component for several sensors."""
        return self.sender, self.source

    @property
    def is_narrow(self) -> bool:
        """Whether this is one thin beam, which leaves most of the rover's own width unseen."""
        return bool(len(self.bearing_rad) * self.beam_width_rad < NARROW_RAD)

    @property
    def tells(self) -> bool:
        """Whether more than a stray reading is not unknown."""
        known = np.count_nonzero(~np.isnan(self.range_m))
        return bool(known >= max(KNOWN_SHARE * len(self.range_m), 1.0))

    @property
    def looks_ahead(self) -> bool:
        """Whether a reading that is not unknown lies within AHEAD_RAD of straight ahead."""
        turned = np.abs((self.bearing_rad + np.pi) % (2.0 * np.pi) - np.pi)
        return bool(((turned <= AHEAD_RAD) & ~np.isnan(self.range_m)).any())
