"""Drag watch: how much faster firm ground would let the rover go than it goes, by how far its throttle is open.

Such a rover is held by the ground: gravel, grass, a slope. ArduRover opens the throttle until the rover does what it
is told, and closes it slowly, also when it is told to stop. Where such ground ends the rover shoots ahead. So the more
it is held, the more room its positions get and the sooner it brakes.

A rover that such ground holds, or has just let go, rolls on for seconds after it was told to stand, until the throttle
is closed. Told to roll back, it stands after half the way. It turns on for seconds, too: such ground also holds its
turning, and ArduRover opens the steering as it does the throttle.

Nouns: drag watch.
"""

from __future__ import annotations

import math

from companion.control.controller import ControlCommand, Purpose
from companion.control.local_view import LocalView, is_held_much
from companion.control.setpoint_check import fault_of
from companion.mission.bounds import Bounds
from companion.vehicle.commands import GuidedVelocity
from companion.vehicle.events import ThrottleSeen

SLACK_M_S = 0.3
"""A rover on firm ground is so much slower than its throttle says: it is read in whole per cent, and late."""
FORGOTTEN_S = 0.5
"""What it was held by falls off with this time constant: the throttle is read ten times a second."""
DRAGS_S = 1.0
"""Ground drags a rover that is held much for so long."""
HELD_M_S = 0.2
"""A rover that is held by less stands soon enough."""
ROLLS_M_S = 0.1
"""Below it ArduRover closes the throttle of a rover that is told to stand (ATC_STOP_SPEED as shipped)."""
BACK_M_S = (1.0, 0.5, 0.25)
"""How fast it is told to roll back, tried in turn. Slower ones brake less, faster ones no better."""
STALE_S = 0.5
"""An older reading of the throttle says nothing."""
CLOSES_S = 3.0
"""So long ArduRover may take to close the throttle of a rover that the ground has let go."""


class DragWatch:
    """Remembers for a moment how much the rover was held."""

    def __init__(self) -> None:
        self._time_s = -math.inf
        self._held_m_s = 0.0
        self._held_until_s = self._dragged_until_s = -math.inf
        self._light_s: float | None = None

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
        if self._held_m_s >= HELD_M_S:
            self._held_until_s = now_s
        if self._light_s is None or not is_held_much(self._held_m_s, view.speed_m_s):
            self._light_s = now_s
        if self.dragged_m_s() > 0.0:
            self._dragged_until_s = now_s
        return self._held_m_s

    def dragged_m_s(self) -> float:
        """By how much the ground has dragged it for some time; 0 where it does not."""
        drags = self._light_s is not None and self._time_s - self._light_s >= DRAGS_S
        return self._held_m_s if drags else 0.0

    def closes(self) -> bool:
        """Whether throttle and steering may still be open from when the ground held the rover."""
        return self._time_s - self._held_until_s < CLOSES_S

    def misleads(self) -> bool:
        """Whether the ground drags the rover, or lately did: what it does then tells nothing of it on firm ground."""
        return self._time_s - self._dragged_until_s < CLOSES_S


def braked_harder(command: ControlCommand, view: LocalView, bounds: Bounds) -> ControlCommand:
    """The command; or, where it tells a rover to stand that the ground holds or held and that rolls on, to roll back.

    It turns as told, and only as fast as it may be left alone with.
    """
    told = command.setpoint
    if not isinstance(told, GuidedVelocity) or not view.lately_held or view.forward_m_s < ROLLS_M_S:
        return command
    if told.forward_m_s != 0.0 or (told.yaw_rate_rad_s != 0.0 and command.purpose is not Purpose.BRAKE):
        return command
    for speed_m_s in BACK_M_S:
        back = GuidedVelocity(-speed_m_s, told.yaw_rate_rad_s)
        if fault_of(back, view, bounds) is None:
            return ControlCommand(command.purpose, back, 0.0)
    return command
