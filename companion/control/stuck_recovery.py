"""Stuck recovery: notices that the rover makes no progress, backs it out, and marks the place as costly.

A rover that stands is stuck soon. One that goes to and fro before a gap which it hardly fits through moves all the
time: it is stuck when it has not left a circle for a time that grows with the circle.

Nouns: stuck recovery.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from companion.control.blind_behind import backwards_m_s
from companion.control.controller import STANDSTILL, ControlCommand, Purpose
from companion.control.following import GUARDED_S
from companion.control.local_view import LocalView
from companion.control.safe_reach import BACK_LEAST_M_S, backing_speed_m_s
from companion.core.frames import NedPoint, Pose, wrap_pi_rad
from companion.mapping.evidence_map import penalise
from companion.vehicle.commands import GuidedVelocity

MOVED_M = 0.3
TURNED_RAD = math.radians(15.0)
FRESH_PENALTY = 0.15
FINAL_PENALTY = 1.0
TRIES_AT_ONE_PLACE = 3
SAME_PLACE_M = 0.5
"""Places nearer to each other than this count as one; where fields are smaller, those nearer than a field's side: among
posts half a metre apart, other gaps would be closed with them."""
CIRCLES_M = (1.0, 2.0, 4.0)
LINGERS_PER_M = 4.0
"""In a circle the rover may stay for so many times ``stuck_after_s`` for each metre of its radius."""
PATIENT = 5.0
"""Motions planned without a guard have so many times longer: into a gap of 0.2 m more than its width a rover creeps a
few centimetres a second."""
ELSEWHERE_M = 2.0
"""A rover that is stuck so far from where it was stuck before is stuck somewhere else."""
TURNS_RAD_S, ROLLS_M_S = 0.3, 0.1
"""A rover that turns slower goes back straight; one that rolls ahead slower stands at once."""


@dataclass(frozen=True, slots=True)
class Progress:
    """Where the rover last made progress; when it last moved; when it last moved or turned."""

    pose: Pose
    moved_s: float
    changed_s: float


class StuckRecovery:
    """Watches one rover on one map, and remembers the places before which it was stuck."""

    def __init__(self) -> None:
        self._progress: Progress | None = None
        self._centres: dict[float, Pose] = {}  # of the circles, by radius
        self._back_until_s = -math.inf
        self._stuck_places: list[NedPoint] = []
        self._here: NedPoint | None = None
        self.times_here = 0
        """How often it was stuck where it was stuck last."""

    def begin(self, pose: Pose) -> None:
        """From here and now on progress is expected."""
        self._progress = Progress(pose, pose.time_s, pose.time_s)
        self._centres = {}

    def pause(self) -> None:
        """The rover stands still for a good reason."""
        self._progress = None
        self._centres = {}

    def is_stuck(self, view: LocalView, command: ControlCommand) -> bool:
        """No movement (turning counts for a while) for ``stuck_after_s``, or to and fro; to be asked at every tick."""
        stays = self._stays(view, command)
        return self._lingers(view) or stays

    def _lingers(self, view: LocalView) -> bool:
        """Whether the rover has not left one of the circles in time."""
        pose, limit_s = view.pose, LINGERS_PER_M * view.settings.guidance.stuck_after_s
        for radius_m in CIRCLES_M:
            centre = self._centres.get(radius_m)
            if centre is None or pose.point.distance_m(centre.point) >= radius_m:
                self._centres[radius_m] = pose
        return any(pose.time_s - centre.time_s >= limit_s * radius_m for radius_m, centre in self._centres.items())

    def _stays(self, view: LocalView, command: ControlCommand) -> bool:
        pose, last = view.pose, self._progress
        if last is None or pose.point.distance_m(last.pose.point) >= MOVED_M:
            self._progress = Progress(pose, pose.time_s, pose.time_s)
            return False
        limit_s = _patience_s(view)
        if abs(wrap_pi_rad(pose.heading_rad - last.pose.heading_rad)) >= TURNED_RAD:
            here = replace(pose, north_m=last.pose.north_m, east_m=last.pose.east_m)
            self._progress = Progress(here, last.moved_s, pose.time_s)
            return pose.time_s - last.moved_s >= 3.0 * limit_s
        return pose.time_s - last.changed_s >= (limit_s / 3.0 if command.purpose is Purpose.BLOCKED else limit_s)

    def back_out(self, view: LocalView, ahead: NedPoint) -> None:
        """Remember the place ahead as costly, in the end as an obstacle, and from now on back out."""
        settings = view.settings.guidance
        if self._here is None or view.pose.point.distance_m(self._here) >= ELSEWHERE_M:
            self._here, self.times_here = view.pose.point, 0
        self.times_here += 1
        self._stuck_places.append(ahead)
        near_m = min(SAME_PLACE_M, view.evidence.base.resolution_m)
        tries = sum(place.distance_m(ahead) <= near_m for place in self._stuck_places)
        final = tries >= TRIES_AT_ONE_PLACE
        penalise(view.evidence, view.evidence.base.cell_at(ahead), FINAL_PENALTY if final else FRESH_PENALTY)
        self._back_until_s = view.pose.time_s + settings.back_out_m / settings.back_out_speed_m_s
        self.pause()

    def is_backing(self, now_s: float) -> bool:
        """Whether the rover is being backed out."""
        return now_s < self._back_until_s

    def backing(self, view: LocalView) -> ControlCommand | None:
        """Straight back over ground that is known to be free, and no farther; None when not under way.

        Where much of that ground was never seen it creeps. A rover that still turns stands first: it would not go
        straight. So does one that still rolls ahead: ArduRover's integral is full from braking.
        """
        if not self.is_backing(view.pose.time_s):
            return None
        self._progress = None
        if abs(view.yaw_rate_rad_s) > TURNS_RAD_S or view.forward_m_s > ROLLS_M_S:
            return STANDSTILL
        speed_m_s = backing_speed_m_s(view)
        if speed_m_s < BACK_LEAST_M_S:
            self._back_until_s = view.pose.time_s
            return STANDSTILL
        speed_m_s = backwards_m_s(speed_m_s, view)
        return ControlCommand(Purpose.LOOK, GuidedVelocity(-speed_m_s, 0.0), speed_m_s)


def _patience_s(view: LocalView) -> float:
    """How long the rover may make no progress. In a narrow gap no more than a creep may be told without a guard."""
    guidance = view.settings.guidance
    creeps = guidance.controller != "points" and guidance.velocity_lasts_s > GUARDED_S
    return (PATIENT if creeps else 1.0) * guidance.stuck_after_s
