"""Drag watch: how much faster firm ground would let the rover go than it goes, by how far its throttle is open.

Such a rover is held by the ground: gravel, grass, a slope. ArduRover opens the throttle until the rover does what it
is told, and closes it slowly, also when it is told to stop. Where such ground ends the rover shoots ahead. So the more
it is held, the more room its positions get and the sooner it brakes.

Nouns: drag watch.
"""

from __future__ import annotations

import math

from companion.control.local_view import LocalView
from companion.vehicle.events import ThrottleSeen

SLACK_M_S = 0.3
"""A rover on firm ground is so much slower than its throttle says: it is read in whole per cent, and late."""
FORGOTTEN_S = 0.5
"""What it was held by falls off with this time constant: the throttle is read ten times a second."""
STALE_S = 0.5
"""An older reading of the throttle says nothing."""


class DragWatch:
    """Remembers for a moment how much the rover was held."""

    def __init__(self) -> None:
        self._time_s = -math.inf
        self._held_m_s = 0.0

    def held_m_s(self, throttle: ThrottleSeen | None, full_m_s: float, view: LocalView) -> float:
        """Once a tick: how much slower the rover is, or was just now, than firm ground would let it go.

        ``full_m_s``: its speed on firm ground with the throttle fully open.
        """
        now_s = view.pose.time_s
        kept = math.exp(-(now_s - self._time_s) / FORGOTTEN_S)
        self._time_s = now_s
        held_m_s = 0.0
        if throttle is not None and now_s - throttle.time_s < STALE_S:
            held_m_s = max(throttle.share * full_m_s - view.speed_m_s - SLACK_M_S, 0.0)
        self._held_m_s = max(held_m_s, kept * self._held_m_s)
        return self._held_m_s
