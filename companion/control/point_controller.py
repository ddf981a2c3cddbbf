"""From the navigator's path to one guided setpoint and a speed.

The autopilot brakes for every guided point, so the point is rolled to the farthest place of the route that can be reached
straight and clear. It never lies beyond the ground seen free plus the stopping distance. Where the next piece of
the route has not been seen, the rover turns to look before it drives.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum

from companion.control.braking import braking_distance_m, fastest_within_m, stopping_distance_m
from companion.control.reference_path import STEP_M, Route
from companion.control.safe_reach import arc_is_free, farthest_clear, unseen_flank
from companion.core.frames import Pose, wrap_pi_rad
from companion.core.rover_limits import RoverLimits
from companion.mapping.evidence_map import EvidenceMap, clearance_m, look_along
from companion.settings import GuidanceSettings
from companion.vehicle.commands import GuidedHeading, GuidedPosition, GuidedVelocity, Setpoint

STOP = GuidedVelocity(0.0, 0.0)
STRAIGHT_RAD = math.radians(2.0)
"""A target that is no farther aside is reached straight."""
ROLL_SHARES = (0.25, 0.5, 0.75, 1.0)
"""Directions, as shares of a turn, that are looked along before a rolling rover begins to turn."""


class Motion(StrEnum):
    """What the setpoint is for."""

    DRIVE = "drive"
    LOOK = "look"
    BRAKE = "brake"
    BLOCKED = "blocked"


@dataclass(frozen=True, slots=True)
class ControlCommand:
    """What to tell the autopilot now."""

    motion: Motion
    setpoint: Setpoint
    speed_m_s: float


STANDSTILL = ControlCommand(Motion.BLOCKED, STOP, 0.0)


def guide(
    route: Route,
    pose: Pose,
    speed_m_s: float,
    evidence: EvidenceMap,
    rover: RoverLimits,
    settings: GuidanceSettings,
    *,
    looking_rad: float | None = None,
    braking: bool = False,
) -> ControlCommand:
    """The setpoint and speed for this moment. ``BLOCKED`` means that not even the next piece of the route is clear.

    ``looking_rad``: the heading of the last answer if that was LOOK. It is kept until reached, and a longer clear reach is wanted
    before driving off, so that a narrow sensor looks to both sides once, not at every step.
    """
    needed_m = braking_distance_m(speed_m_s, settings)
    if _would_touch(pose, speed_m_s, needed_m, evidence, rover, settings):
        return ControlCommand(Motion.BRAKE, STOP, 0.0)
    target, reach_m, room_m = farthest_clear(route, pose, speed_m_s, evidence, rover, settings)
    distance_m = pose.point.distance_m(route.end)
    at_end = len(route.points) - 1 - route.progress <= int(1.0 / STEP_M)
    rolling = speed_m_s > settings.roll_out_m_s
    if rolling and reach_m < min(needed_m + (settings.brake_on_m if braking else 0.0), distance_m - 0.1):
        return ControlCommand(Motion.BRAKE, STOP, 0.0)
    wanted_m = settings.least_reach_m if looking_rad is None else settings.reach_after_look_m
    if reach_m < min(wanted_m, distance_m - 0.1) and not (at_end and reach_m > 0.0):
        if looking_rad is not None and not _is_turned_to(looking_rad, pose, settings):
            return turn_to(looking_rad, speed_m_s, settings)
        look = _look_or_blocked(route, pose, speed_m_s, evidence, rover, settings)
        if look.motion is not Motion.DRIVE or reach_m < settings.least_reach_m:
            return look
    bearing = pose.point.bearing_rad(target)
    error = abs(wrap_pi_rad(bearing - pose.heading_rad))
    beside_m = clearance_m(evidence, pose.point, settings.slow_within_m + rover.radius_m) - rover.radius_m
    close = beside_m < settings.slow_within_m
    if error > _turn_first_rad(close, looking_rad is not None, settings) and pose.point.distance_m(target) > 0.5:
        close = close or _would_touch_turning(pose, speed_m_s, bearing, evidence, rover, settings)
        return turn_to(bearing, speed_m_s if close else 0.0, settings)
    if error > STRAIGHT_RAD and not arc_is_free(pose, target, evidence, rover):
        return turn_to(bearing, speed_m_s, settings)
    limit_m_s = speed_limit_m_s(min(beside_m, room_m), error, rover, settings)
    if not at_end:
        limit_m_s = min(limit_m_s, max(fastest_within_m(reach_m, settings), settings.min_speed_m_s))
    limit_m_s = min(limit_m_s, _limit_by_heading(pose, evidence, rover, settings))
    return ControlCommand(Motion.DRIVE, GuidedPosition(target), limit_m_s)


def _turn_first_rad(close: bool, turning: bool, settings: GuidanceSettings) -> float:
    """The bearing error from which the rover turns on the spot instead of driving an arc, which it must not near something.

    A position far to the side would make the autopilot pivot too, but with its old target still winding up behind the scenes; so
    a heading is given first, until the rest is small.
    """
    if turning:
        return math.radians(settings.turn_until_close_deg if close else settings.turn_until_deg)
    return math.radians(settings.turn_first_close_deg if close else settings.turn_first_deg)


def _would_touch(
    pose: Pose, speed_m_s: float, needed_m: float, evidence: EvidenceMap, rover: RoverLimits, settings: GuidanceSettings
) -> bool:
    """Whether the rover, going straight on, would touch something before it could stop."""
    if speed_m_s <= settings.roll_out_m_s:
        return False
    ahead = pose.point.moved(pose.heading_rad, needed_m)
    return look_along(evidence, pose.point, ahead, rover.radius_m + 0.05).clear_m < needed_m - 1e-6


def _would_touch_turning(
    pose: Pose,
    speed_m_s: float,
    bearing_rad: float,
    evidence: EvidenceMap,
    rover: RoverLimits,
    settings: GuidanceSettings,
) -> bool:
    """Whether the rover, turning to the bearing while it still rolls, could touch something: it comes to stand in between."""
    roll_m = braking_distance_m(speed_m_s, settings)
    turn_rad = wrap_pi_rad(bearing_rad - pose.heading_rad)
    for share in ROLL_SHARES:
        there = pose.point.moved(pose.heading_rad + share * turn_rad, roll_m)
        if look_along(evidence, pose.point, there, rover.radius_m + 0.05).clear_m < roll_m - 1e-6:
            return True
    return False


def _is_turned_to(bearing_rad: float, pose: Pose, settings: GuidanceSettings) -> bool:
    return abs(wrap_pi_rad(bearing_rad - pose.heading_rad)) <= math.radians(settings.turned_deg)


def turn_to(bearing_rad: float, speed_m_s: float, settings: GuidanceSettings) -> ControlCommand:
    """Turn on the spot; a rover that still rolls brakes first, lest it drives an arc."""
    if speed_m_s > settings.roll_out_m_s:
        return ControlCommand(Motion.BRAKE, STOP, 0.0)
    return ControlCommand(Motion.LOOK, GuidedHeading(bearing_rad), settings.min_speed_m_s)


def _look_or_blocked(
    route: Route,
    pose: Pose,
    speed_m_s: float,
    evidence: EvidenceMap,
    rover: RoverLimits,
    settings: GuidanceSettings,
) -> ControlCommand:
    """The next piece is not clear, or has not been seen: turn to it; when turned and still so, it is blocked."""
    ahead = route.point_ahead(settings.look_ahead_m)
    line = look_along(evidence, pose.point, ahead, rover.radius_m)
    distance_m = pose.point.distance_m(ahead)
    unseen = unseen_flank(pose, route.point_ahead(settings.reach_after_look_m), evidence, rover)
    view = ahead if line.seen_m < distance_m - 0.05 or unseen is None else unseen.place
    bearing = pose.point.bearing_rad(view)
    if not _is_turned_to(bearing, pose, settings):
        return turn_to(bearing, speed_m_s, settings)
    if line.clear_m >= distance_m - 0.05:
        # Looked at, and nothing there, but between the beams: creep, up to what stands farther on.
        bearing = pose.point.bearing_rad(ahead)
        creep_m = min(line.seen_m, distance_m) + braking_distance_m(settings.min_speed_m_s, settings)
        clear_m = look_along(evidence, pose.point, pose.point.moved(bearing, creep_m), rover.radius_m).clear_m
        target = pose.point.moved(bearing, min(creep_m, clear_m))
        return ControlCommand(Motion.DRIVE, GuidedPosition(target), settings.min_speed_m_s)
    return ControlCommand(Motion.BLOCKED, STOP, 0.0)


def speed_limit_m_s(beside_m: float, bearing_error_rad: float, rover: RoverLimits, settings: GuidanceSettings) -> float:
    """Cruise speed; less where the sensor sees too short, something is close beside, or the rover is still turning."""
    sight = fastest_within_m(rover.sight_m - rover.radius_m - settings.clearance_m, settings)
    share = min(max(beside_m / settings.slow_within_m, 0.0), 1.0)
    beside = settings.min_speed_m_s + share * max(rover.cruise_speed_m_s - settings.min_speed_m_s, 0.0)
    turning = rover.cruise_speed_m_s if bearing_error_rad < math.radians(20.0) else 2.0 * settings.min_speed_m_s
    narrow = settings.narrow_speed_m_s if rover.narrow_sight else rover.cruise_speed_m_s
    return min(max(min(sight, beside, turning, narrow), settings.min_speed_m_s), rover.cruise_speed_m_s)


def _limit_by_heading(pose: Pose, evidence: EvidenceMap, rover: RoverLimits, settings: GuidanceSettings) -> float:
    """The speed from which the rover can stop before its flanks enter unseen ground, should it go on as it points.

    A target a few degrees aside is reached on an arc, and what stands beside that arc was not looked at on the way to the target.
    """
    ahead = pose.point.moved(pose.heading_rad, stopping_distance_m(rover.cruise_speed_m_s, settings))
    unseen = unseen_flank(pose, ahead, evidence, rover)
    if unseen is None:
        return rover.cruise_speed_m_s
    return min(max(fastest_within_m(unseen.along_m, settings), settings.min_speed_m_s), rover.cruise_speed_m_s)
