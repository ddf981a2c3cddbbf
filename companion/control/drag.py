"""How much slower the rover is than it was told to be, for longer than it takes to get going: it is held by the ground.

ArduRover then opens the throttle ever wider. Where the rough ground ends the rover shoots ahead, past its position. So
the more it is held, the more room its positions get.
"""

from __future__ import annotations

import math

from companion.control.controller import ControlCommand
from companion.control.local_view import LocalView
from companion.core.frames import wrap_pi_rad
from companion.vehicle.commands import GuidedPosition

SLACK_M_S = 0.3
"""A rover that gets going is so much slower than the ramp that it was told."""
APPROACH_M = 1.0
"""ArduRover approaches a place d metres away with at most sqrt(d - 1) m/s."""
AHEAD_RAD = math.radians(30.0)
"""A position farther aside is not driven to at full speed."""
FORGOTTEN_S = 2.0
PAUSE_S = 0.5
"""After so long without a command the one before counts no more."""
MOST_M = 1.5


class DragWatch:
    """Follows what the rover was told and what it does."""

    def __init__(self) -> None:
        self._time_s: float | None = None
        self._expected_m_s = 0.0
        self._held_m_s = 0.0

    def overshoot_m(self, told: ControlCommand | None, view: LocalView) -> float:
        """Once a tick: how much farther the rover may shoot past a position. ``told``: the command before."""
        now_s, speed_m_s = view.pose.time_s, view.speed_m_s
        passed_s = 0.0 if self._time_s is None else max(now_s - self._time_s, 0.0)
        self._time_s = now_s
        if passed_s > PAUSE_S:
            told = None  # somebody else had the rover meanwhile, or it stayed at a target
        wanted_m_s = 0.0 if told is None else _wanted_m_s(told, view)
        ramp_m_s = self._expected_m_s + view.settings.guidance.deceleration_m_s2 * passed_s
        self._expected_m_s = max(min(wanted_m_s, ramp_m_s), speed_m_s)
        held_m_s = max(min(wanted_m_s, self._expected_m_s) - speed_m_s - SLACK_M_S, 0.0)
        self._held_m_s = max(held_m_s, self._held_m_s * math.exp(-passed_s / FORGOTTEN_S))
        return min(view.settings.guidance.held_overshoot_s * self._held_m_s, MOST_M)


def _wanted_m_s(told: ControlCommand, view: LocalView) -> float:
    """How fast ArduRover drives to a position, if nothing holds the rover; 0 for any other command."""
    if not isinstance(told.setpoint, GuidedPosition):
        return 0.0
    pose, place = view.pose, told.setpoint.point
    if abs(wrap_pi_rad(pose.point.bearing_rad(place) - pose.heading_rad)) > AHEAD_RAD:
        return 0.0
    return min(told.speed_m_s, math.sqrt(max(pose.point.distance_m(place) - APPROACH_M, 0.0)))
