"""Noticing that the rover is stuck, and getting it unstuck: back out, and remember the place as costly."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from companion.control.point_controller import STANDSTILL, ControlCommand, Motion
from companion.control.safe_reach import BACK_LEAST_M_S, backing_speed_m_s
from companion.core.frames import NedPoint, Pose, wrap_pi_rad
from companion.core.grid import Cell
from companion.mapping.evidence_map import EvidenceMap, penalise
from companion.settings import GuidanceSettings
from companion.vehicle.commands import GuidedVelocity

MOVED_M = 0.3
TURNED_RAD = math.radians(15.0)
FRESH_PENALTY = 0.15
FINAL_PENALTY = 1.0
TRIES_AT_ONE_PLACE = 3


@dataclass(frozen=True, slots=True)
class Progress:
    """Where the rover last got on."""

    pose: Pose
    moved_s: float
    changed_s: float


class StuckRecovery:
    """Watches one rover on one map. ``radius_m`` is the rover's."""

    def __init__(self, evidence: EvidenceMap, radius_m: float, settings: GuidanceSettings) -> None:
        self._evidence = evidence
        self._radius_m = radius_m
        self._settings = settings
        self._progress: Progress | None = None
        self._back_until_s = -math.inf
        self._stuck_places: dict[Cell, int] = {}

    def retune(self, settings: GuidanceSettings) -> None:
        """Other settings from now on."""
        self._settings = settings

    def begin(self, pose: Pose) -> None:
        """From here and now on progress is expected."""
        self._progress = Progress(pose, pose.time_s, pose.time_s)

    def pause(self) -> None:
        """The rover stands still for a good reason."""
        self._progress = None

    def is_stuck(self, pose: Pose, now: ControlCommand) -> bool:
        """No movement (turning counts for a while) for ``stuck_after_s``; to be asked at every tick."""
        last = self._progress
        if last is None or pose.point.distance_m(last.pose.point) >= MOVED_M:
            self._progress = Progress(pose, pose.time_s, pose.time_s)
            return False
        limit_s = self._settings.stuck_after_s
        if abs(wrap_pi_rad(pose.heading_rad - last.pose.heading_rad)) >= TURNED_RAD:
            here = replace(pose, north_m=last.pose.north_m, east_m=last.pose.east_m)
            self._progress = Progress(here, last.moved_s, pose.time_s)
            return pose.time_s - last.moved_s >= 3.0 * limit_s
        return pose.time_s - last.changed_s >= (limit_s / 3.0 if now.motion is Motion.BLOCKED else limit_s)

    def back_out(self, pose: Pose, ahead: NedPoint) -> None:
        """Remember the place ahead as costly, in the end as an obstacle, and from now on back out."""
        cell = self._evidence.base.cell_at(ahead)
        self._stuck_places[cell] = self._stuck_places.get(cell, 0) + 1
        final = self._stuck_places[cell] >= TRIES_AT_ONE_PLACE
        penalise(self._evidence, cell, FINAL_PENALTY if final else FRESH_PENALTY)
        self._back_until_s = pose.time_s + self._settings.back_out_m / self._settings.back_out_speed_m_s
        self._progress = None

    def backing(self, pose: Pose) -> ControlCommand | None:
        """Straight back over ground that is known to be free, and not a step farther; None when done, or not at it."""
        if pose.time_s >= self._back_until_s:
            return None
        self._progress = None
        speed_m_s = backing_speed_m_s(pose, self._evidence, self._radius_m, self._settings)
        if speed_m_s < BACK_LEAST_M_S:
            self._back_until_s = pose.time_s
            return STANDSTILL
        return ControlCommand(Motion.LOOK, GuidedVelocity(-speed_m_s, 0.0), speed_m_s)
