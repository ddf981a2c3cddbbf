"""Full throttle: how fast the rover goes with its throttle fully open, from throttle and speed of steady driving.

``CRUISE_SPEED`` and ``CRUISE_THROTTLE`` say it, too. By them the companion notices ground that holds the rover; where
they are far off, the rover is slow, or such ground is not noticed. Nothing is driven by what is found here: gravel
everywhere looks the same as a wrong scale, so a person is told.

Nouns: full throttle.
"""

from __future__ import annotations

import math

from companion.control.local_view import LocalView
from companion.vehicle.events import ThrottleSeen

STEADY_S, SAME_M_S, SAME_SHARE = 1.0, 0.1, 0.05
"""Speed and throttle belong together when neither has changed by more for so long."""
LEAST_M_S, LEAST_SHARE, STRAIGHT_RAD_S = 0.2, 0.15, 0.2
"""Slower, with less throttle, or turning faster they tell nothing: wheels that slip, one side of a rover that turns."""
STALE_S = 0.5
ENOUGH_S = 10.0
"""So much steady driving tells enough."""
OFF_SHARE, MOSTLY = 0.4, 0.8
"""A scale is doubted that is so far off what is seen, in so much of that driving."""


class FullThrottle:
    """Remembers the steady driving of a run."""

    def __init__(self) -> None:
        self._since_s = self._time_s = -math.inf
        self._speed_m_s = self._share = 0.0
        self._seconds = self._slow_s = self._fast_s = 0.0
        self._sum_m = 0.0

    @property
    def m_s(self) -> float | None:
        """The rover's speed with its throttle fully open; None before enough was seen."""
        return self._sum_m / self._seconds if self._seconds >= ENOUGH_S else None

    @property
    def doubted(self) -> bool:
        """Whether the rover is mostly much slower, or mostly much faster, than its scale says."""
        return self.m_s is not None and max(self._slow_s, self._fast_s) >= MOSTLY * self._seconds

    def note(self, throttle: ThrottleSeen | None, full_m_s: float, view: LocalView) -> None:
        """Once a tick. ``full_m_s``: what the autopilot's parameters say."""
        now_s, before_s = view.pose.time_s, self._time_s
        self._time_s = now_s
        led_s = now_s - before_s  # the rover may not have been led meanwhile
        stale = throttle is None or max(now_s - throttle.time_s, led_s) > STALE_S
        if throttle is None or stale or not _tells(throttle.share, view):
            self._since_s = math.inf
            return
        changed_m_s, changed_share = abs(view.speed_m_s - self._speed_m_s), abs(throttle.share - self._share)
        if math.isinf(self._since_s) or changed_m_s > SAME_M_S or changed_share > SAME_SHARE:
            self._since_s, self._speed_m_s, self._share = now_s, view.speed_m_s, throttle.share
        elif now_s - self._since_s >= STEADY_S:
            seen_m_s = view.speed_m_s / throttle.share
            self._seconds += led_s
            self._sum_m += led_s * seen_m_s
            self._slow_s += led_s if seen_m_s < (1.0 - OFF_SHARE) * full_m_s else 0.0
            self._fast_s += led_s if (1.0 - OFF_SHARE) * seen_m_s > full_m_s else 0.0


def _tells(share: float, view: LocalView) -> bool:
    return share >= LEAST_SHARE and view.speed_m_s >= LEAST_M_S and abs(view.yaw_rate_rad_s) <= STRAIGHT_RAD_S
