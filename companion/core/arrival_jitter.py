"""Arrival jitter: how much later than at best a sender's messages come, by the time that it writes into them.

Messages are taken in tick by tick, and wait on the way now and then. A rover at 2 m/s drives 0.1 m in a tick: so far a
wall would jump to and fro on the map from scan to scan, and where a ray ends behind it the map forgets it.

What is late all the time is not jitter: see ``companion.vehicle.link_latency``, and for lidars on wires
``companion.lidar.device_clock``.

Nouns: arrival jitter.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

WINDOW_S = 1.0
"""The best of the present window and of the one before counts: a sender's clock may stand still for once, or jump. All
windows begin at the same moments, so that what two senders tell stays together where both come later from now on."""
LEAST_S, MOST_S, FAILS_S = 0.005, 0.25, 1.0
"""Less than the first is the rounding of clocks. What comes later than the second counts as so late, so that all that
was held up together stays together. What comes later than the third tells nothing: a link that fails."""
AGREE_S = 0.06
"""So well windows must agree: a tick, and a little. Times that stand still, or run more than 6 % off, never do."""


@dataclass(frozen=True, slots=True)
class ArrivalJitter:
    """Of one sender. Times by two clocks differ by a shift, which is least for what comes at once."""

    window: int = -2
    """The number of the present window; before all others at first."""
    least_s: float = math.inf
    """The least shift in it."""
    before_s: float = math.inf
    """In the one before."""
    earlier_s: float = -math.inf
    """In the one before that."""
    earliest_s: float = math.inf
    """In the one before that."""

    def after(self, time_s: float, told_s: float) -> ArrivalJitter:
        """One more message came at ``time_s``; its sender wrote ``told_s`` into it."""
        shift_s, window = time_s - told_s, math.floor(time_s / WINDOW_S)
        if window == self.window:
            return replace(self, least_s=min(self.least_s, shift_s))
        if window == self.window + 1:
            return ArrivalJitter(window, shift_s, self.least_s, self.before_s, self.earlier_s)
        return ArrivalJitter(window, shift_s)

    def late_s(self, time_s: float, told_s: float) -> float | None:
        """How much later than the best that message came; None where that is not known."""
        # One jump is forgiven.
        least_apart_s = min(abs(self.before_s - self.earlier_s), abs(self.earlier_s - self.earliest_s))
        late_s = time_s - told_s - min(self.least_s, self.before_s)
        if least_apart_s > AGREE_S or late_s > FAILS_S:
            return None
        return min(late_s, MOST_S) if late_s > LEAST_S else 0.0
