"""Motion prediction: where the rover will be in the next seconds if it brakes, drives on, follows a line or an arc.

Nouns: motion prediction.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from companion.control.reference_path import STEP_M
from companion.core.frames import Pose
from companion.settings import GuidanceSettings

Points = NDArray[np.float64]
"""Shape (n, 2): columns north_m and east_m, one row for each of the moments that are looked at."""

PERIOD_S = 0.2
"""From one moment to the next."""
TURN_RAD_S = 1.2
"""The turn rate that is assumed."""
AIM_M = 1.0
"""It steers for a place this far ahead on its line."""


def braked_m(speed_m_s: float, times_s: Points, settings: GuidanceSettings) -> Points:
    """How far the rover has rolled at each moment when it is stopped now."""
    brakes_s = np.clip(times_s - settings.brake_delay_s, 0.0, speed_m_s / settings.deceleration_m_s2)
    rolls_m = np.minimum(times_s, settings.brake_delay_s) * speed_m_s
    return np.asarray(rolls_m + speed_m_s * brakes_s - 0.5 * settings.deceleration_m_s2 * brakes_s**2)


def driven_m(speed_m_s: float, goal_m_s: float, goes_s: float, times_s: Points, settings: GuidanceSettings) -> Points:
    """How far it has driven at each moment when it goes on at the speed ``goal_m_s``, and stops after ``goes_s``."""
    rate = settings.deceleration_m_s2
    slows_s = np.maximum(times_s - settings.brake_delay_s, 0.0)
    fastest = (
        np.minimum(goal_m_s, speed_m_s + rate * times_s)
        if goal_m_s > speed_m_s
        else np.maximum(goal_m_s, speed_m_s - rate * slows_s)
    )
    going = times_s <= goes_s
    after_s = np.maximum(times_s - goes_s - settings.brake_delay_s, 0.0)
    slowed = np.maximum(float(fastest[going][-1]) - rate * after_s, 0.0)
    speeds = np.where(going, fastest, slowed)
    return np.concatenate(([0.0], np.cumsum((speeds[1:] + speeds[:-1]) / 2.0 * np.diff(times_s))))


def places_ahead(pose: Pose, along_m: Points) -> Points:
    """Places straight ahead of the rover."""
    return moved(np.tile((pose.north_m, pose.east_m), (len(along_m), 1)), pose.heading_rad, along_m)


def moved(places: Points, bearing_rad: float, along_m: Points) -> Points:
    """These places, each moved by its distance in one direction."""
    return np.asarray(places + along_m[:, None] * (math.cos(bearing_rad), math.sin(bearing_rad)))


def moved_on_arc(pose: Pose, course_rad: float, curvature_per_m: float, along_m: Points) -> Points:
    """Places on an arc from where the rover is; curvature clockwise positive, as seen in the direction of travel."""
    half_rad = 0.5 * curvature_per_m * along_m
    chord_m = along_m * np.sinc(half_rad / math.pi)
    bearing_rad = course_rad + half_rad
    return np.column_stack((pose.north_m + chord_m * np.cos(bearing_rad), pose.east_m + chord_m * np.sin(bearing_rad)))


def steered_along(points: Points, course_rad: float, along_m: Points, turning_radius_m: float) -> Points:
    """Places on the way along a line from where the rover is. It rolls to ``course_rad`` now, and has to turn first.

    ``turning_radius_m``: 0 for a rover that can turn on the spot.
    """
    points = points[: 3 + math.ceil((float(along_m[-1]) + AIM_M) / STEP_M)]
    reached_m = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))))
    along_m = np.minimum(along_m, reached_m[-1])
    aims_m = along_m + AIM_M
    aims = np.column_stack((np.interp(aims_m, reached_m, points[:, 0]), np.interp(aims_m, reached_m, points[:, 1])))
    most_rad = np.full(len(along_m) - 1, TURN_RAD_S * PERIOD_S)
    if turning_radius_m > 0.0:
        most_rad = np.minimum(most_rad, np.diff(along_m) / turning_radius_m)
    return steered(points[0, 0], points[0, 1], course_rad, aims, along_m, most_rad)


@njit(cache=True, nogil=True)
def steered(
    north_m: float, east_m: float, course_rad: float, aims: Points, along_m: Points, most_rad: Points
) -> Points:
    """Places of a vehicle that turns towards its aim by at most ``most_rad`` at each moment, as far as ``along_m``."""
    places = np.empty_like(aims)
    places[0, 0], places[0, 1] = north_m, east_m
    for i in range(1, len(aims)):
        to_n, to_e = aims[i - 1, 0] - north_m, aims[i - 1, 1] - east_m
        if to_n != 0.0 or to_e != 0.0:
            error_rad = (math.atan2(to_e, to_n) - course_rad + math.pi) % (2.0 * math.pi) - math.pi
            course_rad += min(max(error_rad, -most_rad[i - 1]), most_rad[i - 1])
        length_m = along_m[i] - along_m[i - 1]
        north_m += length_m * math.cos(course_rad)
        east_m += length_m * math.sin(course_rad)
        places[i, 0], places[i, 1] = north_m, east_m
    return places
