"""Drag watch: how much slower the rover is than it was told, for longer than it takes to get going.

Such a rover is held by the ground. ArduRover then opens the throttle ever wider. Where the rough ground ends the rover
shoots ahead, past its position. So the more it is held, the more room its positions get.

Nouns: drag watch.
"""

from __future__ import annotations

import math

from companion.control.controller import ControlCommand
from companion.control.local_view import LocalView
from companion.core.frames import wrap_pi_rad
from companion.vehicle.commands import GuidedPosition

SLACK_M_S = 0.3
"""A rover on firm ground may be so much slower than expected."""
GAINS_M_S2 = 0.5
"""A rover on firm ground gains speed at least this fast once it rolls."""
SETS_OFF_S = 1.0
"""So long after the first position it may go on as before: braking, or standing."""
APPROACH_M = 1.0
"""ArduRover approaches a place d metres away with at most sqrt(d - 1) m/s."""
AHEAD_RAD = math.radians(30.0)
"""A position farther aside is not driven to at full speed."""
FORGOTTEN_S = 2.0
PAUSE_S = 0.5
"""After so long without a command the one before counts no more."""
DOES_M_S = 0.15
"""A rover so little slower than told does what it was told."""


class DragWatch:
    """Compares what the rover does with what it was told."""

    def __init__(self) -> None:
        self._time_s = -math.inf
        self._idle_s = -math.inf
        self._expected_m_s = 0.0
        self._held_m_s = 0.0

    def held_m_s(self, told: ControlCommand | None, view: LocalView) -> float:
        """Once a tick: how much slower than it should be the rover has been, lately or until it does as it is told.

        ``told``: what it was told in the tick before; None for nothing that drives it.
        """
        now_s, speed_m_s = view.pose.time_s, view.speed_m_s
        passed_s = now_s - self._time_s
        self._time_s = now_s
        # After a pause somebody else had the rover meanwhile, or it stayed at a target.
        told = None if passed_s > PAUSE_S else told
        wanted_m_s = 0.0 if told is None else _wanted_m_s(told, view)
        if wanted_m_s == 0.0:
            self._idle_s = now_s
        sets_off = now_s - self._idle_s < SETS_OFF_S
        ramp_m_s = 0.0 if sets_off else self._expected_m_s + GAINS_M_S2 * passed_s
        self._expected_m_s = max(min(wanted_m_s, ramp_m_s), speed_m_s)
        held_m_s = max(min(wanted_m_s, self._expected_m_s) - speed_m_s - SLACK_M_S, 0.0)
        kept = 1.0 if speed_m_s < wanted_m_s - DOES_M_S else math.exp(-passed_s / FORGOTTEN_S)
        self._held_m_s = max(held_m_s, kept * self._held_m_s)
        return self._held_m_s


def _wanted_m_s(told: ControlCommand, view: LocalView) -> float:
    """How fast ArduRover drives to a position, if nothing holds the rover; 0 for any other command."""
    if not isinstance(told.setpoint, GuidedPosition):
        return 0.0
    pose, place = view.pose, told.setpoint.point
    if abs(wrap_pi_rad(pose.point.bearing_rad(place) - pose.heading_rad)) > AHEAD_RAD:
        return 0.0
    return min(told.speed_m_s, math.sqrt(max(pose.point.distance_m(place) - APPROACH_M, 0.0)))
