"""Controller of a rover that cannot turn on the spot: velocities by pure pursuit, manoeuvres back to the path.

It is told velocities and not positions: a guided position would leave it to the autopilot which arc is driven, and
only an arc that is known can be looked along. How the rover would go on is played through on the map. It never
drives farther than it has seen free for what it needs to stop, or for what it would drive if it were told nothing
more.

Nouns: arc controller.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

import numpy as np

from companion.control.braking import blind_distance_m, braking_distance_m, fastest_blind_m_s, fastest_within_m
from companion.control.controller import ControlCommand, Purpose, stop_for
from companion.control.local_view import LocalView
from companion.control.manoeuvre import ArcSegment, Manoeuvre, Try, find_manoeuvre, tries
from companion.control.point_controller import speed_limit_m_s
from companion.control.reference_path import STEP_M, Points, ReferencePath
from companion.control.safe_reach import FLANK_M, FLANK_NEAR_M, tail_reach_m
from companion.core.frames import Pose, wrap_pi_rad
from companion.core.rover_limits import RoverLimits
from companion.mapping.map_queries import ArcQueries, Followed, FollowLimits, Until, clearance_m
from companion.vehicle.commands import GuidedVelocity

MEMORY_S = 0.3
"""Direction of travel and curvature are taken from the poses of the last moments, this long."""
LEAST_M = 0.3
"""A manoeuvre with less clear way ahead than this is given up."""
SEGMENT_ENDS_M = 0.15
GOES_ON_M = 1.5
"""With less than this left of a manoeuvre that ends tail first the next one is looked for."""
OFF_PATH_RADII = 1.0
"""A manoeuvre that ends farther from the path than this, in turning radii, is void."""
TOUCH_M = 0.05
"""Room beside the rover's radius that is kept in any case."""
NARROW_SHARE = 0.5
"""With thin beams arcs are driven at this share of the speed that is allowed to a rover that drives straight."""
NARROW_ROOM_M = 0.15
"""With thin beams this room is kept beside the radius of a rover that is left alone: its position is off by more."""
GAP_M = 0.7
"""Thin beams leave gaps in a wall: unseen ground that is nearer to an obstacle than this may be wall."""
BESIDE_GAP_M_S = 0.2
"""A rover that would come beside such ground, left alone, is driven at no more than this."""
LEFT_ALONE_M_S = 0.15
"""A rover that could only be left alone at less than this is not driven."""
RATE_STEP_RAD_S = 0.02
"""Turn rates are told in steps of this, so that not every tick is a new setpoint."""


@dataclass(frozen=True, slots=True)
class Rolling:
    """How the rover moves: ``speed_m_s`` negative backwards, curvature clockwise as seen in the direction of travel."""

    speed_m_s: float
    curvature_per_m: float


class ArcController:
    """Remembers the manoeuvre under way, the last few poses, and the curvature that it told last."""

    def __init__(self) -> None:
        self.manoeuvre: Manoeuvre | None = None
        self._poses: deque[Pose] = deque()
        self._looked_s = -math.inf
        self._tries: deque[Try] = deque()
        self._backwards = False
        self._told_per_m = 0.0

    @property
    def backwards(self) -> bool:
        """Whether the rover rolls tail first."""
        return self._backwards

    def reset(self) -> None:
        """No manoeuvre is under way."""
        self.manoeuvre = None
        self._looked_s = -math.inf

    def line_ahead(self, path: ReferencePath | None) -> ReferencePath | None:
        """What is left of the manoeuvre under way, else the path."""
        return path if self.manoeuvre is None else self.manoeuvre.as_path()

    def foreseen(self, path: ReferencePath, view: LocalView, times_s: Points) -> Points | None:
        """It follows the line ahead."""
        return None

    def turned_stops(self, view: LocalView, times_s: Points) -> tuple[()]:
        """Its wheels stay as they are while it stops."""
        return ()

    def follow(self, path: ReferencePath, view: LocalView) -> ControlCommand:
        """The command for this moment: on with the manoeuvre, on along the path, or stop."""
        rolling = self._rolling(view)
        self._backwards = rolling.speed_m_s < 0.0
        ways = _Ways(view, rolling, self._told_per_m)
        command = self._command(ways, path)
        self._told_per_m = ways.told_per_m
        return command

    def _command(self, ways: _Ways, path: ReferencePath) -> ControlCommand:
        view, steering = ways.view, ways.view.settings.steering
        if ways.would_touch():
            self.manoeuvre = None
            return ways.brake()
        self._drop_void_manoeuvre(path, view.rover)
        if self.manoeuvre is not None:
            command = self._go_on(self.manoeuvre, ways, path)
            if command is not None:
                return command
        if ways.rolling.speed_m_s < -steering.stopped_m_s:
            return ways.brake()
        room_m = steering.narrow_clearance_m if view.rover.narrow_sight else steering.clearance_m
        ahead = ways.follow(path.points, path.progress, room_m, backwards=False)
        if ahead.clear_m < steering.drives_on_m + ways.needed_m:
            self._look_for_manoeuvre(path, ways)
            if self.manoeuvre is not None:
                command = self._go_on(self.manoeuvre, ways, path)
                if command is not None:
                    return command
        return ways.drive(ahead, backwards=False, left_m=path.left_m)

    def _rolling(self, view: LocalView) -> Rolling:
        """From the poses of the last moments."""
        pose, speed_m_s = view.pose, view.speed_m_s
        if self._poses and not 0.0 < pose.time_s - self._poses[-1].time_s < 1.0:
            self._poses.clear()
        self._poses.append(pose)
        while pose.time_s - self._poses[0].time_s > MEMORY_S:
            self._poses.popleft()
        first = self._poses[0]
        moved_m = first.point.distance_m(pose.point)
        if moved_m < 0.02 or speed_m_s < 0.05:
            return Rolling(speed_m_s, 0.0)
        forwards = math.cos(first.point.bearing_rad(pose.point) - pose.heading_rad) >= 0.0
        turned_rad = wrap_pi_rad(pose.heading_rad - first.heading_rad)
        return Rolling(speed_m_s if forwards else -speed_m_s, turned_rad / max(moved_m, 0.1))

    def _drop_void_manoeuvre(self, path: ReferencePath, rover: RoverLimits) -> None:
        """A manoeuvre that ends off the path, which may be another one by now, is given up."""
        if self.manoeuvre is None:
            return
        end = self.manoeuvre.end
        ahead = path.points[path.progress :]
        off_m = float(np.hypot(ahead[:, 0] - end.north_m, ahead[:, 1] - end.east_m).min())
        if off_m > OFF_PATH_RADII * rover.turning_radius_m:
            self.manoeuvre = None

    def _go_on(self, manoeuvre: Manoeuvre, ways: _Ways, path: ReferencePath) -> ControlCommand | None:
        """The next moment of the manoeuvre; None when it is over, or cannot be driven any more."""
        segment, stopped = manoeuvre.segment, ways.is_stopped
        if not stopped and segment.backwards != (ways.rolling.speed_m_s < 0.0):
            return ways.brake()
        progress, left_m = ways.along(segment, manoeuvre.progress)
        if segment.backwards and len(manoeuvre.segments) == 1 and left_m < GOES_ON_M:
            found = self._look_for_manoeuvre(path, ways)
            if found is not None:
                manoeuvre, segment = found, found.segment
                progress, left_m = ways.along(segment, 0)
        if left_m <= SEGMENT_ENDS_M:
            self.manoeuvre = manoeuvre.after_segment()
            if self.manoeuvre is None and not segment.backwards:
                return None
            return ways.brake()
        self.manoeuvre = manoeuvre.at(progress)
        ahead = ways.follow(segment.points, progress, TOUCH_M, backwards=segment.backwards)
        if ahead.clear_m < ways.needed_m + LEAST_M:
            self.manoeuvre = None
            return None if stopped else ways.brake()
        command = ways.drive(ahead, backwards=segment.backwards, left_m=left_m)
        if stopped and segment.backwards and command.purpose is not Purpose.DRIVE:
            self.manoeuvre = None  # it would stand before unseen ground for ever
        return command

    def _look_for_manoeuvre(self, path: ReferencePath, ways: _Ways) -> Manoeuvre | None:
        """A new one, if there is one; it is then under way. One try each time, so that no tick takes long.

        While the rover rolls, the manoeuvre must begin in the direction in which it rolls.
        """
        view, steering, speed_m_s = ways.view, ways.view.settings.steering, ways.rolling.speed_m_s
        if view.pose.time_s - self._looked_s >= steering.manoeuvre_every_s:
            self._tries = deque(tries(path, view.rover, steering))
        if not self._tries:
            return None
        self._looked_s = view.pose.time_s
        first_way = 0 if ways.is_stopped else 1 if speed_m_s > 0.0 else -1
        found = find_manoeuvre(path, view, self._tries.popleft(), first_way)
        if found is not None:
            self.manoeuvre = found
            self._tries.clear()
        return found


class _Ways:
    """The ways ahead at one moment, and how fast the rover may go on along one.

    ``told_per_m``: the curvature that it has been told last. ``needed_m``: what it needs to stop.
    """

    def __init__(self, view: LocalView, rolling: Rolling, told_per_m: float) -> None:
        self.view, self.rolling, self.told_per_m = view, rolling, told_per_m
        self.needed_m = braking_distance_m(abs(rolling.speed_m_s), view.settings.guidance)
        self._arcs = ArcQueries(view.evidence, view.pose)

    @property
    def is_stopped(self) -> bool:
        """Whether the rover is slow enough to change its direction of travel."""
        return abs(self.rolling.speed_m_s) <= self.view.settings.steering.stopped_m_s

    def would_touch(self) -> bool:
        """Whether the rover, going on in its present arc, would touch something before it could stop."""
        speed_m_s = self.rolling.speed_m_s
        if abs(speed_m_s) <= self.view.settings.guidance.roll_out_m_s:
            return False
        course_rad, room_m = self._course_rad(backwards=speed_m_s < 0.0), self._room_m(TOUCH_M)
        curvature_per_m = self.rolling.curvature_per_m
        return not self._arcs.arc_is_clear(course_rad, curvature_per_m, room_m, self.needed_m, Until.BLOCKED)

    def follow(self, points: Points, progress: int, clearance_m: float, *, backwards: bool) -> Followed:
        """How following a line would go with this room beside the rover's radius."""
        view, steering = self.view, self.view.settings.steering
        speed_m_s = max(abs(self.rolling.speed_m_s), view.settings.guidance.min_speed_m_s)
        sharpest_per_m, radius_m = 1.0 / view.rover.turning_radius_m, view.rover.radius_m
        limits = FollowLimits(
            backwards=backwards,
            sharpest_per_m=sharpest_per_m,
            steering_per_m2=sharpest_per_m / max(steering.steer_time_s * speed_m_s, 0.05),
            lookahead_m=steering.ahead_m + steering.ahead_s * abs(self.rolling.speed_m_s),
            room_m=self._room_m(clearance_m),
            flank_m=radius_m + FLANK_M,
            near_m=radius_m + FLANK_NEAR_M,
            tail_m=tail_reach_m(radius_m, backwards=backwards),
            astray_m=steering.astray_m,
        )
        horizon_m = view.settings.guidance.horizon_m
        stop = progress + math.ceil(2.0 * horizon_m / STEP_M)
        return self._arcs.follow(points[progress:stop], self.rolling.curvature_per_m, limits, horizon_m)

    def along(self, segment: ArcSegment, progress: int) -> tuple[int, float]:
        """Where on a segment the rover is, and the length that is left of it."""
        course_rad = self._course_rad(backwards=segment.backwards)
        return self._arcs.progress_along(segment.points, progress, course_rad, STEP_M)

    def brake(self) -> ControlCommand:
        """Stop with the wheels as they were last told: that arc has been checked.

        The measured curvature is not used. A rover that drives wider arcs than it is told would drive wider and wider
        ones.
        """
        if abs(self.rolling.speed_m_s) <= self.view.settings.guidance.roll_out_m_s:
            return stop_for(Purpose.BRAKE)
        return ControlCommand(Purpose.BRAKE, GuidedVelocity(0.0, self._turn_rate(self.told_per_m)), 0.0)

    def drive(self, ahead: Followed, *, backwards: bool, left_m: float) -> ControlCommand:
        """Go on along a way as fast as is safe; BRAKE or BLOCKED where no speed is."""
        view, guidance, steering = self.view, self.view.settings.guidance, self.view.settings.steering
        slowest_m_s = guidance.min_speed_m_s if not backwards else guidance.back_out_speed_m_s
        creep_m = braking_distance_m(slowest_m_s, guidance)
        # Tail first it does not creep over unseen ground: no look shows what is there.
        reach_m = min(ahead.clear_m, ahead.seen_m + (0.0 if backwards else creep_m))
        if reach_m < max(self.needed_m, creep_m) + 0.1:
            return stop_for(Purpose.BLOCKED) if self.is_stopped else self.brake()
        limit_m_s = fastest_within_m(min(reach_m, left_m), guidance)
        bend_m_s = math.sqrt(steering.lateral_m_s2 / max(abs(ahead.curvature_per_m), 1e-3))
        radius_m = view.rover.radius_m
        beside_m = clearance_m(view.evidence, view.pose.point, guidance.slow_within_m + radius_m)
        beside_m_s = speed_limit_m_s(beside_m - radius_m, 0.0, view.rover, guidance)
        speed_m_s = max(min(limit_m_s, bend_m_s, beside_m_s), slowest_m_s)
        if backwards:
            speed_m_s = min(speed_m_s, 2.0 * slowest_m_s)
        if view.rover.narrow_sight:
            # A velocity lasts for seconds, and thin beams do not look along arcs.
            speed_m_s = min(speed_m_s, max(NARROW_SHARE * guidance.narrow_speed_m_s, LEFT_ALONE_M_S))
        speed_m_s = self._left_alone_m_s(speed_m_s, ahead.curvature_per_m, backwards=backwards)
        if speed_m_s <= 0.0:
            return self.brake()
        self.told_per_m = ahead.curvature_per_m
        told_m_s = math.floor(10.0 * speed_m_s + 1e-6) / 10.0  # never rounded up: that would lead farther
        setpoint = GuidedVelocity(-told_m_s if backwards else told_m_s, self._turn_rate(ahead.curvature_per_m))
        return ControlCommand(Purpose.DRIVE, setpoint, speed_m_s)

    def _course_rad(self, *, backwards: bool) -> float:
        """The direction of travel."""
        return self.view.pose.heading_rad + (math.pi if backwards else 0.0)

    def _room_m(self, clearance_m: float) -> float:
        """The room to keep round the rover's middle."""
        radius_m = self.view.rover.radius_m
        return self._arcs.kept_room_m(radius_m + clearance_m, radius_m - 0.05)

    def _left_alone_m_s(self, wanted_m_s: float, curvature_per_m: float, *, backwards: bool) -> float:
        """The wanted speed, or the highest at which the rover may be left alone; 0 where that is too slow to drive.

        If the link fails, the rover keeps the turn rate that it was told and gathers speed until the command expires.
        Its arc widens as its speed grows.
        """
        guidance, steering = self.view.settings.guidance, self.view.settings.steering
        course_rad = self._course_rad(backwards=backwards)
        rate, now_m_s = self._turn_rate(curvature_per_m), abs(self.rolling.speed_m_s)
        narrow = self.view.rover.narrow_sight
        room_m, speed_m_s = self._room_m(NARROW_ROOM_M if narrow else TOUCH_M), wanted_m_s
        tail_m = tail_reach_m(self.view.rover.radius_m, backwards=backwards)
        while speed_m_s > LEFT_ALONE_M_S:
            reach_m = blind_distance_m(max(speed_m_s, now_m_s), guidance) + TOUCH_M
            gap_m = GAP_M if narrow and speed_m_s > BESIDE_GAP_M_S else 0.0
            free_m = math.inf
            for arc_m_s in (now_m_s, speed_m_s):
                arc_per_m = rate / max(arc_m_s, steering.scale_base_m_s)
                arc_m = self._arcs.arc_clear_m(course_rad, arc_per_m, room_m, reach_m, Until.UNSEEN, gap_m, tail_m)
                free_m = min(free_m, arc_m)
            if free_m >= reach_m - 1e-6:
                return speed_m_s
            slower_m_s = min(speed_m_s - 0.1, fastest_blind_m_s(free_m - TOUCH_M, guidance))
            speed_m_s = max(slower_m_s, BESIDE_GAP_M_S) if gap_m > 0.0 else slower_m_s
        return 0.0

    def _turn_rate(self, curvature_per_m: float) -> float:
        """The turn rate to tell for an arc: below MOT_SPD_SCA_BASE the autopilot steers as if it drove that fast."""
        base_m_s = max(abs(self.rolling.speed_m_s), self.view.settings.steering.scale_base_m_s)
        return round(curvature_per_m * base_m_s / RATE_STEP_RAD_S) * RATE_STEP_RAD_S
