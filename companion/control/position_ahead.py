"""Position ahead: without a guard a guided position may lead on faster than any velocity that may be told.

A velocity goes on for seconds after the last word; a position ends by itself. So where a position straight ahead may
be told that the rover drives to faster, it is told that position, chosen as ``PointController`` does.

Nouns: position ahead.
"""

from __future__ import annotations

import math

import numpy as np

from companion.control.braking import fastest_within_m
from companion.control.controller import ControlCommand, Purpose
from companion.control.following import GUARDED_S
from companion.control.local_view import LocalView
from companion.control.point_controller import PointController
from companion.control.reference_path import ReferencePath
from companion.control.turning_room import may_turn_to
from companion.core.frames import wrap_pi_rad
from companion.mapping.map_queries import look_along
from companion.vehicle.commands import GuidedPosition

MOST_ASIDE_RAD = math.radians(60.0)
"""A place farther aside is no place ahead: the rover would turn for it."""
LEAST_M = 0.5
"""Nor is one that is nearer."""
STRAIGHT_RAD = math.radians(20.0)
GOES_ON_RAD, GOES_ON_S = (math.radians(30.0), math.radians(60.0)), (2.85, 1.9)
"""For a place that lies farther aside a rolling rover first goes on as it points, for so long at most (ArduRover at
2 m/s: 5.7 m for a place 30 degrees aside, 3.8 m for 60): that way must be clear, too, and it must be able to turn."""
SLOWER_M_S = 0.3
"""Once positions lead they may be slower than the velocity by this: they do not take turns."""


class PositionAhead:
    """Remembers whether positions lead, and what ``PointController`` does."""

    def __init__(self) -> None:
        self._points = PointController()
        self._leads = False

    def faster_than(self, speed_m_s: float, path: ReferencePath, view: LocalView) -> ControlCommand | None:
        """The command with a position on which the rover gets faster than this; None where there is none."""
        command = self._ahead(speed_m_s - (SLOWER_M_S if self._leads else 0.0), path, view)
        self._leads = command is not None
        return command

    def _ahead(self, wanted_m_s: float, path: ReferencePath, view: LocalView) -> ControlCommand | None:
        guidance, pose = view.settings.guidance, view.pose
        if guidance.velocity_lasts_s <= GUARDED_S or view.rolls_back:
            return None
        command = self._points.follow(path, view)
        if command.purpose is not Purpose.DRIVE or not isinstance(command.setpoint, GuidedPosition):
            return None
        place = command.setpoint.point
        bearing_rad, distance_m = pose.point.bearing_rad(place), pose.point.distance_m(place)
        aside_rad = abs(wrap_pi_rad(bearing_rad - pose.heading_rad))
        if distance_m < LEAST_M or aside_rad > MOST_ASIDE_RAD:
            return None
        if aside_rad > STRAIGHT_RAD and not (_may_go_on(aside_rad, view) and may_turn_to(bearing_rad, view)):
            return None
        return command if min(command.speed_m_s, fastest_within_m(distance_m, guidance)) > wanted_m_s else None


def _may_go_on(aside_rad: float, view: LocalView) -> bool:
    """Whether nothing stands where the rover rolls on to before it turns."""
    pose, goes_on_m = view.pose, float(np.interp(aside_rad, GOES_ON_RAD, GOES_ON_S)) * view.speed_m_s
    there = pose.point.moved(pose.heading_rad, goes_on_m)
    return look_along(view.evidence, pose.point, there, view.rover.radius_m).clear_m >= goes_on_m - 1e-6
