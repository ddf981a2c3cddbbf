"""Drag watch: how much faster firm ground would let the rover go than it goes, by how far its throttle is open.

Such a rover is held by the ground: gravel, grass, a slope. ArduRover opens the throttle until the rover does what it
is told, and closes it slowly, also when it is told to stop. Where such ground ends the rover shoots ahead. So the more
it is held, the more room its positions get and the sooner it brakes.

Nouns: drag watch.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from companion.control.local_view import LocalView
from companion.vehicle.events import ThrottleSeen
from companion.vehicle.motion_limits import CRUISE, CRUISE_THROTTLE

SLACK_M_S = 0.3
"""A rover on firm ground is so much slower than its throttle says: it is read in whole per cent, and late."""
FORGOTTEN_S = 0.5
STALE_S = 1.0
"""An older reading of the throttle says nothing."""
CRUISE_M_S, CRUISE_PERCENT = 2.0, 50.0
"""``CRUISE_SPEED`` and ``CRUISE_THROTTLE`` as ArduRover is shipped."""


def full_throttle_m_s(parameters: Mapping[str, float]) -> float:
    """How fast the rover goes on firm ground with its throttle fully open: 100 CRUISE_SPEED / CRUISE_THROTTLE."""
    speed_m_s, percent = parameters.get(CRUISE, 0.0), parameters.get(CRUISE_THROTTLE, 0.0)
    if speed_m_s <= 0.0 or percent <= 0.0:
        speed_m_s, percent = CRUISE_M_S, CRUISE_PERCENT
    return 100.0 * speed_m_s / percent


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
