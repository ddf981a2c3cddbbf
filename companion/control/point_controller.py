"""Controller of a rover that turns on the spot: from a path to one guided position ahead on it, and a speed.

The autopilot brakes for every guided position, so the position is moved on to the farthest place of the path that
can be reached straight and clear. It never lies beyond the ground seen free plus the stopping distance. Where the
next piece of the path has not been seen, the rover turns to look before it drives.

Nouns: point controller.
"""

from __future__ import annotations

import math
from collections import deque

from companion.control.braking import braking_distance_m, farthest_m, fastest_within_m, overshoot_m, stopping_distance_m
from companion.control.controller import ControlCommand, Purpose, stop_for
from companion.control.local_view import LocalView
from companion.control.reference_path import STEP_M, Points, ReferencePath
from companion.control.safe_reach import Reach, arc_is_free, farthest_clear, unseen_flank
from companion.core.frames import NedPoint, Pose, wrap_pi_rad
from companion.core.rover_limits import RoverLimits
from companion.mapping.map_queries import ArcQueries, Until, clearance_m, look_along
from companion.settings import GuidanceSettings
from companion.vehicle.commands import GuidedHeading, GuidedPosition

OVERSPEED = 1.15
"""A rover this much faster than its highest speed, as on leaving soft ground, is braked: room was kept for less."""
STRAIGHT_RAD = math.radians(2.0)
"""A target that is no farther aside is reached straight."""
ROLL_SHARES = (0.25, 0.5, 0.75, 1.0)
"""Directions, as shares of a turn, that are looked along before a rolling rover begins to turn."""
SWUNG_SHARE = 0.5
"""Below this share of guidance.swing_m_s2 a rover that swung counts as straight."""
OVERRUN_M = 0.3
"""A rover that stands so far beyond the last position may not have reached it, for the autopilot."""
STANDS_M_S = 0.1
CREEPS_M = 0.1
"""It does not creep less far."""
TOUCH_M = 0.05
"""The rover keeps so much more than its radius free where it would come to stand."""
TURNS_ON_RAD_S = 0.1
"""The steering of a rover that turns more slowly has not been opened far by ground that held it."""
SHOOTS_M = 0.1
"""A rover that the ground holds may go so much farther: then it counts as rolling, however slow it is."""
CREEPS_NARROW_M = 0.4
"""Near walls of which thin beams saw only points it creeps no farther at a time: the map may be off by as much."""
HIDDEN_M, HIDDEN_FROM_M = 0.3, 0.3
"""Ground that a look has not shown is not looked at again from so near; it lies behind something, or in it."""
HIDDEN_KEPT = 8
ANEW_S = 0.15
"""Longer than the 0.1 s after which ArduRover shapes a position target from where the rover is."""


class PointController:
    """Remembers the heading of a look, and whether it was braking or swinging.

    A look is kept until its heading is reached, and a longer clear reach is wanted before the rover drives off
    again, so that a narrow sensor looks to both sides once and not at every step.
    """

    backwards = False
    """It backs off only in a recovery or an avoidance, never along a path."""

    def __init__(self) -> None:
        self._looking_rad: float | None = None
        self._looked = False
        """It has looked, there was nothing, and it turns to where it drives: with as little reach as any other."""
        self._hidden: deque[tuple[NedPoint, NedPoint]] = deque(maxlen=HIDDEN_KEPT)
        """Places that were looked at and stayed unseen, and from where."""
        self._braking = False
        self._swinging = False
        self._anew_s: float | None = None
        """Since when the rover has been stopped so that its next position is begun anew."""

    def follow(self, path: ReferencePath, view: LocalView) -> ControlCommand:
        """The command for this moment. ``BLOCKED``: not even the next piece of the path is clear."""
        if view.speed_m_s > OVERSPEED * view.rover.fastest_m_s:
            return stop_for(Purpose.BRAKE)
        self._swinging = _is_swinging(view, was_swinging=self._swinging)
        command = self._begun_anew(self._command(path, view), view)
        self._braking = command.purpose is Purpose.BRAKE
        self._looking_rad = command.setpoint.heading_rad if isinstance(command.setpoint, GuidedHeading) else None
        self._looked = self._looked and self._looking_rad is not None
        return command

    def _begun_anew(self, command: ControlCommand, view: LocalView) -> ControlCommand:
        """The command; but a short stop first, if the rover stands beyond the last position and gets another one.

        More than WP_RADIUS beyond it the position is not reached for ArduRover, and the inner target, which the rover
        follows, stays there. For the next position it starts from behind the rover, which then overshoots by metres.
        """
        if not isinstance(command.setpoint, GuidedPosition):
            self._anew_s = None
            return command
        pose, told = view.pose, view.told
        if self._anew_s is None and isinstance(told, GuidedPosition) and view.speed_m_s < STANDS_M_S:
            before = told.point
            beyond_m = -pose.point.distance_m(before) * math.cos(pose.point.bearing_rad(before) - pose.heading_rad)
            self._anew_s = pose.time_s if beyond_m > OVERRUN_M else None
        if self._anew_s is not None and pose.time_s - self._anew_s < ANEW_S:
            return stop_for(Purpose.BRAKE)
        self._anew_s = None
        return command

    def line_ahead(self, path: ReferencePath | None) -> ReferencePath | None:
        """The path itself."""
        return path

    def foreseen(self, path: ReferencePath, view: LocalView, times_s: Points) -> Points | None:
        """It follows the line ahead."""
        return None

    def turned_stops(self, view: LocalView, times_s: Points) -> tuple[()]:
        """It is led by positions, and stops straight on."""
        return ()

    def reset(self) -> None:
        """It knows no manoeuvres; a look outlasts a change of path."""

    def _command(self, path: ReferencePath, view: LocalView) -> ControlCommand:
        pose, settings = view.pose, view.settings.guidance
        needed_m = braking_distance_m(view.speed_m_s, settings)
        if _would_touch(view, needed_m + view.further_m):
            return stop_for(Purpose.BRAKE)
        reach = farthest_clear(path, view)
        distance_m = pose.point.distance_m(path.end)
        at_end = _is_at_end(path)
        rolling = view.speed_m_s > settings.roll_out_m_s
        if rolling and reach.distance_m < min(
            needed_m + (settings.brake_on_m if self._braking else 0.0), distance_m - 0.1
        ):
            return stop_for(Purpose.BRAKE)
        looks = self._looking_rad is not None and not self._looked
        wanted_m = _reach_after_look_m(view) if looks else settings.least_reach_m
        short = reach.distance_m < min(wanted_m, distance_m - 0.1) and not at_end
        if short or reach.distance_m == 0.0:
            if self._looking_rad is not None and not _is_turned_to(self._looking_rad, pose, settings):
                return turn_to(self._looking_rad, view)
            look = self._look_or_blocked(path, view)
            has_looked = look.purpose in (Purpose.DRIVE, Purpose.BLOCKED)
            if not has_looked or reach.distance_m < settings.least_reach_m:
                return look
            self._looked = True
        return self._drive(path, reach, view)

    def _look_or_blocked(self, path: ReferencePath, view: LocalView) -> ControlCommand:
        """The next piece is not clear, or has not been seen: turn to it; when turned and still so, it is blocked."""
        pose, evidence, radius_m, settings = view.pose, view.evidence, view.rover.radius_m, view.settings.guidance
        ahead = path.point_ahead(settings.look_ahead_m)
        line = look_along(evidence, pose.point, ahead, radius_m)
        distance_m = pose.point.distance_m(ahead)
        unseen = self._unseen_beside(path, view) if line.seen_m >= distance_m - 0.05 else None
        if unseen is not None:
            bearing = pose.point.bearing_rad(unseen)
            if not _is_turned_to(bearing, pose, settings):
                return turn_to(bearing, view)
            self._hidden.append((unseen, pose.point))
        bearing = pose.point.bearing_rad(ahead)
        if unseen is None and not _is_turned_to(bearing, pose, settings):
            return turn_to(bearing, view)
        if line.clear_m >= distance_m - 0.05:
            # It has looked, and nothing is there but ground between the beams: creep, up to the next obstacle.
            creep_m = min(line.seen_m, distance_m) + braking_distance_m(settings.min_speed_m_s, settings)
            # A rover that made way may stand farther from its path than it may be sent.
            creep_m = min(creep_m, farthest_m(view.speed_m_s, settings, narrow=view.rover.narrow_sight))
            creep_m = _creeps_m(creep_m, bearing, view)
            if creep_m >= CREEPS_M:
                target = pose.point.moved(bearing, creep_m)
                return ControlCommand(Purpose.DRIVE, GuidedPosition(target), settings.min_speed_m_s)
        return stop_for(Purpose.BLOCKED)

    def _unseen_beside(self, path: ReferencePath, view: LocalView) -> NedPoint | None:
        """The first unseen place beside the next piece, unless a look from here has not shown it."""
        unseen = unseen_flank(view, path.point_ahead(view.settings.guidance.reach_after_look_m))
        if unseen is None:
            return None
        here = view.pose.point
        is_hidden = any(
            unseen.place.distance_m(place) < HIDDEN_M and here.distance_m(begun) < HIDDEN_FROM_M
            for place, begun in self._hidden
        )
        return None if is_hidden else unseen.place

    def _drive(self, path: ReferencePath, reach: Reach, view: LocalView) -> ControlCommand:
        """Drive to a place in reach: turn first where it lies far aside, then as fast as the surroundings allow."""
        pose, rover, settings = view.pose, view.rover, view.settings.guidance
        bearing = pose.point.bearing_rad(reach.target)
        error = abs(wrap_pi_rad(bearing - pose.heading_rad))
        beside_m = clearance_m(view.evidence, pose.point, settings.slow_within_m + rover.radius_m) - rover.radius_m
        close = beside_m < settings.slow_within_m
        # Thin beams do not see the flanks: near something the rover turns on the spot before it drives.
        turns_first = self._looking_rad is not None or (close and rover.narrow_sight)
        turn_first_rad = _turn_first_rad(close, turns_first, settings)
        if error > turn_first_rad and pose.point.distance_m(reach.target) > 0.5:
            if close or _would_touch_turning(view, bearing):
                return turn_to(bearing, view)
            return _turn_rolling(bearing, view)
        if self._swinging:
            return (
                turn_to(bearing, view) if close or _would_touch_turning(view, bearing) else _turn_rolling(bearing, view)
            )
        if error > STRAIGHT_RAD and not arc_is_free(view, reach.target):
            return turn_to(bearing, view)
        limit_m_s = speed_limit_m_s(min(beside_m, reach.room_m), error, rover, settings)
        if not _is_at_end(path):
            limit_m_s = min(limit_m_s, max(fastest_within_m(reach.distance_m, settings), settings.min_speed_m_s))
        limit_m_s = min(limit_m_s, _limit_by_heading(view))
        return ControlCommand(Purpose.DRIVE, GuidedPosition(reach.target), limit_m_s)


def turn_to(bearing_rad: float, view: LocalView) -> ControlCommand:
    """Turn on the spot; a rover that still rolls brakes first, so that it does not drive an arc.

    So does one that the ground holds, until it could not shoot into anything: its throttle closes while it brakes.
    """
    settings = view.settings.guidance
    shoots = view.further_m >= SHOOTS_M and _would_touch_turning(view, bearing_rad)
    if view.speed_m_s > settings.roll_out_m_s or shoots:
        return stop_for(Purpose.BRAKE)
    return ControlCommand(Purpose.LOOK, GuidedHeading(bearing_rad), settings.min_speed_m_s)


def _turn_rolling(bearing_rad: float, view: LocalView) -> ControlCommand:
    """Turn while the rover rolls out: the autopilot brakes on a heading."""
    return ControlCommand(Purpose.LOOK, GuidedHeading(bearing_rad), view.settings.guidance.min_speed_m_s)


def _is_swinging(view: LocalView, *, was_swinging: bool) -> bool:
    """Whether the rover turns so fast while it rolls that a position given now would make it swing past.

    Once it does, it must come nearly straight: a position in between would set it swinging again.

    ArduRover begins to shape a position target with the acceleration a that the rover has. In a turn that points to the
    side, speed times turn rate, and falls off with WP_JERK j: until then it has become a speed of a² / 2j to that side.
    """
    limit_m_s2 = view.settings.guidance.swing_m_s2 * (SWUNG_SHARE if was_swinging else 1.0)
    return view.speed_m_s * abs(view.yaw_rate_rad_s) > limit_m_s2


def speed_limit_m_s(beside_m: float, bearing_error_rad: float, rover: RoverLimits, settings: GuidanceSettings) -> float:
    """Cruise speed; less where the sensor sees too short, something is close beside, or the rover is still turning."""
    sight = fastest_within_m(rover.sight_m - rover.radius_m - settings.clearance_m, settings)
    share = min(max(beside_m / settings.slow_within_m, 0.0), 1.0)
    beside = settings.min_speed_m_s + share * max(rover.cruise_speed_m_s - settings.min_speed_m_s, 0.0)
    turning = rover.cruise_speed_m_s if bearing_error_rad < math.radians(20.0) else 2.0 * settings.min_speed_m_s
    narrow = settings.narrow_speed_m_s if rover.narrow_sight else rover.cruise_speed_m_s
    return min(max(min(sight, beside, turning, narrow), settings.min_speed_m_s), rover.cruise_speed_m_s)


def _is_at_end(path: ReferencePath) -> bool:
    """Whether less than a metre of the path is left."""
    return len(path.points) - 1 - path.progress <= int(1.0 / STEP_M)


def _turn_first_rad(close: bool, turning: bool, settings: GuidanceSettings) -> float:
    """The bearing error from which the rover turns on the spot; with less it drives an arc.

    For a position far to the side the autopilot would pivot too, but with the integrator of its speed controller still
    winding up for the old target. So a heading is told first, until the rest is small.
    """
    if turning:
        return math.radians(settings.turn_until_close_deg if close else settings.turn_until_deg)
    return math.radians(settings.turn_first_close_deg if close else settings.turn_first_deg)


def _would_touch(view: LocalView, needed_m: float) -> bool:
    """Whether the rover, going straight on, would touch something before it could stop; slow or not, if it is held."""
    pose = view.pose
    if view.speed_m_s <= view.settings.guidance.roll_out_m_s and view.further_m < SHOOTS_M:
        return False
    radius_m = view.rover.radius_m
    ahead = pose.point.moved(pose.heading_rad, needed_m)
    if look_along(view.evidence, pose.point, ahead, radius_m + TOUCH_M).clear_m < needed_m - 1e-6:
        return True
    turns_on = view.lately_held and abs(view.yaw_rate_rad_s) >= TURNS_ON_RAD_S
    return turns_on and _would_touch_turning_on(view, needed_m)


def _would_touch_turning_on(view: LocalView, needed_m: float) -> bool:
    """Whether the rover would touch something if its turn rate lasts while it stops: the way bends more and more.

    On average it then bends twice as much as now. Where ground ends that holds it, it goes and turns faster alike.
    """
    radius_m, arcs = view.rover.radius_m, ArcQueries(view.evidence, view.pose)
    sharpest_per_m = 2.0 * view.yaw_rate_rad_s / max(view.speed_m_s, STANDS_M_S)
    room_m = arcs.kept_room_m(radius_m + TOUCH_M, radius_m - TOUCH_M)
    return not all(
        arcs.arc_is_clear(view.pose.heading_rad, share * sharpest_per_m, room_m, needed_m, Until.BLOCKED)
        for share in ROLL_SHARES
    )


def _would_touch_turning(view: LocalView, bearing_rad: float) -> bool:
    """Whether the rover could touch something if it turns to the bearing while it still rolls: it stops in between."""
    pose, roll_m = view.pose, braking_distance_m(view.speed_m_s, view.settings.guidance) + view.further_m
    turn_rad = wrap_pi_rad(bearing_rad - pose.heading_rad)
    for share in ROLL_SHARES:
        there = pose.point.moved(pose.heading_rad + share * turn_rad, roll_m)
        if look_along(view.evidence, pose.point, there, view.rover.radius_m + TOUCH_M).clear_m < roll_m - 1e-6:
            return True
    return False


def _is_turned_to(bearing_rad: float, pose: Pose, settings: GuidanceSettings) -> bool:
    return abs(wrap_pi_rad(bearing_rad - pose.heading_rad)) <= math.radians(settings.turned_deg)


def _reach_after_look_m(view: LocalView) -> float:
    """With how much clear way ahead a rover that has looked sets off; with thin beams none is longer."""
    settings = view.settings.guidance
    longest_m = farthest_m(0.0, settings, narrow=view.rover.narrow_sight)
    return min(settings.reach_after_look_m, longest_m - STEP_M)


def _creeps_m(distance_m: float, bearing_rad: float, view: LocalView) -> float:
    """How far to creep, at most ``distance_m``. Single thin beams: with wide room, or else a little at a time."""
    settings = view.settings.guidance
    if not view.rover.narrow_sight:
        return _stops_before(distance_m, bearing_rad, settings.clearance_m, view)
    wide_m = _stops_before(distance_m, bearing_rad, settings.narrow_clearance_m, view)
    if wide_m >= CREEPS_M:
        return wide_m
    return _stops_before(min(distance_m, CREEPS_NARROW_M), bearing_rad, settings.clearance_m, view)


def _stops_before(distance_m: float, bearing_rad: float, clearance_m: float, view: LocalView) -> float:
    """That far, or less if the rover would otherwise overshoot into something that stands there."""
    pose = view.pose
    beyond_m = overshoot_m(distance_m, view.speed_m_s, view.settings.guidance) + view.further_m
    there = pose.point.moved(bearing_rad, distance_m + beyond_m)
    radius_m = view.rover.radius_m
    # No nearer to a wall than it stands, to half a cell of the map: the position may be wrong by some centimetres.
    room_m = ArcQueries(view.evidence, pose).kept_room_m(radius_m + clearance_m, radius_m)
    half_width_m = max(room_m - 0.5 * view.evidence.evidence_m, radius_m)
    clear_m = look_along(view.evidence, pose.point, there, half_width_m).clear_m
    return min(distance_m, clear_m - beyond_m)


def _limit_by_heading(view: LocalView) -> float:
    """The speed from which the rover can stop before its flanks enter unseen ground, if it goes on as it points.

    A target a few degrees aside is reached on an arc, and the ground beside that arc was not looked at on the way
    to the target.
    """
    pose, cruise_m_s, settings = view.pose, view.rover.cruise_speed_m_s, view.settings.guidance
    unseen = unseen_flank(view, pose.point.moved(pose.heading_rad, stopping_distance_m(cruise_m_s, settings)))
    if unseen is None:
        return cruise_m_s
    return min(max(fastest_within_m(unseen.along_m, settings), settings.min_speed_m_s), cruise_m_s)
