"""Standstill: when a rover that rolls must have stood before it is told to go on, and how it is kept from rolling back.

ArduRover's integral of the speed's error is full from braking. It is emptied only where the rover is told to stand and
has stopped (``ATC_STOP_SPEED``): else it drives the rover on, or back, for seconds, told to stand, at 0.2 m/s (2.2 s to
a third).

Nouns: standstill.
"""

from __future__ import annotations

import math

from companion.control.local_view import LocalView

STANDS_M_S = 0.05
STANDS_FIRST_M_S = 0.1
"""A rover that rolls faster is told to stand before it is told to go slower than this, or the other way."""
STOOD_S = 0.2
"""With a guard so long it must have stood then: what the autopilot aims at is zero a little later than the speed."""
STANDS_FIRST_MOST_S = 2.0
"""It waits no longer for that once it is as slow: on a slope, or by a noisy speed, it may never seem to stand."""
AGAINST_ROLL_M_S = 0.2
"""A rover that rolls the other way though it is told to stand is told to go against that so fast. One that brakes
better than ArduRover lets it stands before ArduRover aims at zero, and the integral then drives it back, by itself at
0.25 m/s for a second."""
BRAKES_AT_ONCE_M_S2 = 3.0
"""A rover that brakes so hard needs neither: the integral has no time to fill."""


class Standstill:
    """Remembers how the rover rolled, and what it was told. ``note`` is to be called in each tick, before the rest."""

    def __init__(self) -> None:
        self._now_s = -math.inf
        self._waits = False
        """Whether it was told to stand to have stood."""
        self._fast_s = -math.inf
        """When it last rolled faster than ``STANDS_FIRST_M_S``."""
        self._rolled_s, self._rolled_way = -math.inf, 1.0
        """When it rolled last, and the sign of its speed then."""
        self._sent_s, self._sent_way = -math.inf, 1.0
        """When it was told to go last, and which way."""
        self._told_s, self._onward = -math.inf, 1.0
        """When it was told to stand last, and which way it went when that began."""

    def note(self, view: LocalView) -> None:
        """How the rover rolls now."""
        self._now_s = view.pose.time_s
        if view.speed_m_s > STANDS_M_S:
            self._rolled_s, self._rolled_way = self._now_s, math.copysign(1.0, view.forward_m_s)
        if view.speed_m_s > STANDS_FIRST_M_S:
            self._fast_s = self._now_s

    def is_needed_for(self, speed_m_s: float, view: LocalView, *, guarded: bool) -> bool:
        """Whether it must have stood before it is told this speed."""
        # Without a guard such low speeds are how it gets through gaps: to stand each time took it 4 % longer.
        slowest_m_s = STANDS_FIRST_M_S if guarded else 0.0
        if speed_m_s * self._rolled_way >= slowest_m_s or _brakes_at_once(view):
            return False
        if not self._waits:
            return view.speed_m_s > STANDS_FIRST_M_S
        return self._now_s - self._rolled_s < STOOD_S and self._now_s - self._fast_s < STANDS_FIRST_MOST_S

    def against_roll_m_s(self, view: LocalView) -> float:
        """What a rover that is to stand may be told to go against its roll; 0 where it does not roll the other way."""
        if self._now_s - self._told_s > STOOD_S:
            # It may have rolled back already when it was told to go on. Others may have led it, and made it roll.
            was_led = self._now_s - self._sent_s <= STOOD_S
            self._onward = self._sent_way if was_led else math.copysign(1.0, view.forward_m_s)
        self._told_s = self._now_s
        rolls_back = -self._onward * view.forward_m_s > STANDS_FIRST_M_S
        return self._onward * AGAINST_ROLL_M_S if rolls_back and not _brakes_at_once(view) else 0.0

    def told(self, speed_m_s: float, view: LocalView, *, guarded: bool) -> None:
        """What the rover is told in this tick."""
        self._waits = self.is_needed_for(speed_m_s, view, guarded=guarded)
        if speed_m_s != 0.0:
            self._sent_s, self._sent_way = self._now_s, math.copysign(1.0, speed_m_s)


def _brakes_at_once(view: LocalView) -> bool:
    return view.following.deceleration_m_s2 > BRAKES_AT_ONCE_M_S2
