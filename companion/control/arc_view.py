"""What a rover that drives arcs sees of its ways at one moment, and how fast it may go on along one.

How it would go on is played through on the map: it never drives what is not seen free as far as it needs to stop, or as far as it would go
if it were left alone.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from companion.control.braking import blind_distance_m, braking_distance_m, fastest_blind_m_s, fastest_within_m
from companion.control.manoeuvre import Leg
from companion.control.point_controller import STOP, ControlCommand, Motion, speed_limit_m_s
from companion.control.reference_path import STEP_M
from companion.core.frames import Pose
from companion.core.rover_limits import RoverLimits
from companion.mapping.arc_kernels import BLOCKED, UNSEEN, Drive, Ground, Points, arc_clear, follow, kept_room, steered
from companion.mapping.evidence_map import EvidenceMap, clearance_m, ground_of, in_cells
from companion.settings import Settings
from companion.vehicle.commands import GuidedVelocity

TOUCH_M = 0.05
"""Room beside the rover's radius that is kept in any case."""
LEFT_ALONE_M_S = 0.15
"""A rover that may be left alone only with less than this is not driven."""
RATE_STEP_RAD_S = 0.02
"""Turn rates are told in steps of this, so that not every tick is a new setpoint."""


@dataclass(frozen=True, slots=True)
class Rolling:
    """How the rover moves: ``speed_m_s`` negative backwards, ``curvature_m`` (1/m) clockwise as seen in the direction of travel."""

    speed_m_s: float
    curvature_m: float


@dataclass(frozen=True, slots=True)
class Ahead:
    """How following a way will go: how it ends, how far it can be driven, how far it has been seen, what to steer now (1/m).

    Both lengths are inf where nothing is in the way to the way's end, or as far as guidance looks.
    """

    end: int
    clear_m: float
    seen_m: float
    curvature_m: float


class ArcView:
    """What the rover sees of its ways at one moment. ``told_m``: the curvature that it has last been told, 1/m."""

    def __init__(
        self,
        evidence: EvidenceMap,
        rover: RoverLimits,
        settings: Settings,
        pose: Pose,
        rolling: Rolling,
        told_m: float,
    ) -> None:
        self.told_m = told_m
        self.pose, self.rolling, self.rover = pose, rolling, rover
        self.needed_m = braking_distance_m(abs(rolling.speed_m_s), settings.guidance)
        self._evidence = evidence
        self._settings = settings
        self._ground: Ground = ground_of(evidence, pose)
        self._here = in_cells(np.array([[pose.north_m, pose.east_m]]), evidence)[0]
        self._x, self._y = float(self._here[0]), float(self._here[1])
        self._scale = 1.0 / evidence.evidence_m

    def would_touch(self) -> bool:
        """Whether the rover, going on in its present arc, would touch something before it could stop."""
        speed_m_s = self.rolling.speed_m_s
        if abs(speed_m_s) <= self._settings.guidance.roll_out_m_s:
            return False
        course_rad = self.pose.heading_rad + (math.pi if speed_m_s < 0.0 else 0.0)
        needed, room = self.needed_m * self._scale, self._room(TOUCH_M)
        curvature = self.rolling.curvature_m / self._scale
        return arc_clear(self._ground, self._x, self._y, course_rad, curvature, room, needed, BLOCKED) < needed - 1e-6

    def _room(self, clearance_m: float) -> float:
        """Room to keep, in cells."""
        radius_m = self.rover.radius_m
        wanted, least = (radius_m + clearance_m) * self._scale, (radius_m - 0.05) * self._scale
        return float(kept_room(self._ground, self._x, self._y, wanted, least))

    def follow(self, points: Points, progress: int, clearance_m: float, *, backwards: bool) -> Ahead:
        """How following a line would go with so much room beside the rover's radius."""
        settings, scale = self._settings.steering, self._scale
        speed_m_s = max(abs(self.rolling.speed_m_s), self._settings.guidance.min_speed_m_s)
        sharpest_m = 1.0 / self.rover.turning_radius_m
        drive = Drive(
            backwards=backwards,
            sharpest=sharpest_m / scale,
            steering=sharpest_m / max(settings.steer_time_s * speed_m_s, 0.05) / scale**2,
            ahead=self._ahead(),
            room=self._room(clearance_m),
            flank=(self.rover.radius_m + 0.05) * scale,
            near=(self.rover.radius_m + 0.2) * scale,
            astray=settings.astray_m * scale,
        )
        stop = progress + math.ceil(2.0 * self._settings.guidance.horizon_m / STEP_M)
        line = in_cells(points[progress:stop], self._evidence)
        length = self._settings.guidance.horizon_m * scale
        end, clear, seen, curvature = follow(
            self._ground,
            drive,
            line,
            0,
            self._x,
            self._y,
            self.pose.heading_rad,
            self.rolling.curvature_m / scale,
            length,
        )
        return Ahead(end, clear / scale, seen / scale, curvature * scale)

    def _ahead(self) -> float:
        settings = self._settings.steering
        return (settings.ahead_m + settings.ahead_s * abs(self.rolling.speed_m_s)) * self._scale

    def along(self, leg: Leg, progress: int) -> tuple[int, float]:
        """Where on a leg the rover is, and what is left of it."""
        line = in_cells(leg.points, self._evidence)
        course_rad = self.pose.heading_rad + (math.pi if leg.backwards else 0.0)
        at, _, aside = steered(line, progress, self._x, self._y, course_rad, STEP_M * self._scale)
        if at == len(line) - 1:
            beyond = abs(aside) > 0.5 * math.pi
            return at, 0.0 if beyond else float(np.hypot(*(line[-1] - self._here))) / self._scale
        rest = line[at:] - np.vstack((self._here, line[at:-1]))
        return at, float(np.hypot(*rest.T).sum()) / self._scale

    def brake(self) -> ControlCommand:
        """Stop with the wheels as they are: the arc that the rover is on has been looked along.

        To tell it the arc it really drives would open that arc more and more if it drives wider ones than it is told.
        """
        if abs(self.rolling.speed_m_s) <= self._settings.guidance.roll_out_m_s:
            return ControlCommand(Motion.BRAKE, STOP, 0.0)
        return ControlCommand(Motion.BRAKE, GuidedVelocity(0.0, self._turn_rate(self.told_m)), 0.0)

    def drive(self, ahead: Ahead, *, backwards: bool, left_m: float) -> ControlCommand:
        """Go on along a way, as fast as may be; BRAKE or BLOCKED where that is not at all."""
        guidance, steering = self._settings.guidance, self._settings.steering
        slowest_m_s = guidance.min_speed_m_s if not backwards else guidance.back_out_speed_m_s
        creep_m = braking_distance_m(slowest_m_s, guidance)
        reach_m = min(ahead.clear_m, ahead.seen_m + creep_m)
        if reach_m < max(self.needed_m, creep_m) + 0.1:
            stopped = abs(self.rolling.speed_m_s) <= steering.stopped_m_s
            return ControlCommand(Motion.BLOCKED, STOP, 0.0) if stopped else self.brake()
        limit_m_s = fastest_within_m(min(reach_m, left_m), guidance)
        bend_m_s = math.sqrt(steering.lateral_m_s2 / max(abs(ahead.curvature_m), 1e-3))
        beside_m = clearance_m(self._evidence, self.pose.point, guidance.slow_within_m + self.rover.radius_m)
        beside_m_s = speed_limit_m_s(beside_m - self.rover.radius_m, 0.0, self.rover, guidance)
        speed_m_s = max(min(limit_m_s, bend_m_s, beside_m_s), slowest_m_s)
        if backwards:
            speed_m_s = min(speed_m_s, 2.0 * slowest_m_s)
        speed_m_s = self._left_alone_m_s(speed_m_s, ahead.curvature_m, backwards=backwards)
        if speed_m_s <= 0.0:
            return self.brake()
        self.told_m = ahead.curvature_m
        told_m_s = math.floor(10.0 * speed_m_s + 1e-6) / 10.0  # never rounded up: that would lead farther
        setpoint = GuidedVelocity(-told_m_s if backwards else told_m_s, self._turn_rate(ahead.curvature_m))
        return ControlCommand(Motion.DRIVE, setpoint, speed_m_s)

    def _left_alone_m_s(self, wanted_m_s: float, curvature_m: float, *, backwards: bool) -> float:
        """As fast as wanted, or so fast as the rover may be left alone with; 0 where that is too slow to drive at all.

        It would go on with the turn rate that it is told, gathering speed, until it has forgotten that: on an arc as wide as the speed
        makes it.
        """
        guidance = self._settings.guidance
        course_rad = self.pose.heading_rad + (math.pi if backwards else 0.0)
        rate, now_m_s = self._turn_rate(curvature_m), abs(self.rolling.speed_m_s)
        room, speed_m_s = self._room(TOUCH_M), wanted_m_s
        while speed_m_s > LEFT_ALONE_M_S:
            reach = (blind_distance_m(max(speed_m_s, now_m_s), guidance) + TOUCH_M) * self._scale
            free = math.inf
            for arc_m_s in (now_m_s, speed_m_s):
                arc = rate / max(arc_m_s, self._settings.steering.scale_base_m_s) / self._scale
                free = min(free, arc_clear(self._ground, self._x, self._y, course_rad, arc, room, reach, UNSEEN))
            if free >= reach - 1e-6:
                return speed_m_s
            speed_m_s = min(speed_m_s - 0.1, fastest_blind_m_s(free / self._scale - TOUCH_M, guidance))
        return 0.0

    def _turn_rate(self, curvature_m: float) -> float:
        """What to tell the autopilot for an arc: below MOT_SPD_SCA_BASE it steers for a turn rate as if it drove that fast."""
        base_m_s = max(abs(self.rolling.speed_m_s), self._settings.steering.scale_base_m_s)
        return round(curvature_m * base_m_s / RATE_STEP_RAD_S) * RATE_STEP_RAD_S
