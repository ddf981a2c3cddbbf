"""Legs of AUTO: the autopilot drives the mission and hands single legs over to the companion (NAV_GUIDED_ENABLE).

Nouns: legs of AUTO.
"""

from __future__ import annotations

from companion.control.controller import ControlCommand, Purpose
from companion.control.local_view import LocalView
from companion.core.frames import GeoPoint, LocalFrame, NedPoint
from companion.core.severity import Severity, TextSink
from companion.executive.mission_executor import MissionExecutor
from companion.executive.mission_progress import MissionPhase, TargetStatus
from companion.vehicle.auto_leg import GuidedLeg, LegState
from companion.vehicle.commands import GuidedPosition
from companion.vehicle.state import VehicleState

SAME_M = 0.1
"""A place that is handed over and a target nearer to it than this are the same: both are whole 1e-7 degrees."""
WP_RADIUS_M = 2.0
"""ArduRover's default; the autopilot ends a leg when the rover is this near to its place."""
SLACK_M = 1.0
"""The rover drives on between the end of a leg and the news of it."""


class AutoModeLegs:
    """Follows what the autopilot hands over."""

    def __init__(self, notifier: TextSink) -> None:
        self._notifier = notifier
        self._leg: GuidedLeg | None = None
        self._parked = False

    def follow(self, vehicle: VehicleState, executor: MissionExecutor) -> bool:
        """To be called at every tick; True when every leg has been driven or ended, and none is under way."""
        if not vehicle.in_auto:
            return False
        if not self._parked:
            self._parked = True
            executor.park()
        leg, before = vehicle.leg, self._leg
        if leg is None:
            return False
        live = leg.state is LegState.LIVE
        if before is not None and (leg.state is LegState.OVER or (live and leg.point != before.point)):
            self._end(before, vehicle, executor)
        if live and self._leg is None:
            self._leg = leg
            self._begin(leg, executor)
        return self._leg is None and executor.progress.ended

    def guide(self, wanted: ControlCommand, executor: MissionExecutor, view: LocalView) -> ControlCommand:
        """What to do. Once the target is reached, the autopilot may want the rover nearer (a small WP_RADIUS).

        A rover that the ground holds waits until its throttle is closed.
        """
        progress = executor.progress
        if self._leg is None or wanted.purpose is not Purpose.STAND or progress.phase is not MissionPhase.STAY:
            return wanted
        if progress.statuses[progress.index] is not TargetStatus.REACHED:
            return wanted
        if view.further_m > 0.0:
            return wanted
        return ControlCommand(Purpose.DRIVE, GuidedPosition(progress.goal.point), view.settings.guidance.min_speed_m_s)

    def _begin(self, leg: GuidedLeg, executor: MissionExecutor) -> None:
        index = _index_of(leg.point, executor)
        if index is None:
            text = "AUTO hands over a place that is not in the mission as it was read: not driven"
            self._notifier.tell(text, Severity.WARNING)
            return
        executor.drive_leg(index)

    def _end(self, leg: GuidedLeg, vehicle: VehicleState, executor: MissionExecutor) -> None:
        self._leg = None
        executor.driver.leave()
        progress = executor.progress
        if _index_of(leg.point, executor) is None:
            return
        if progress.statuses[progress.index] is TargetStatus.REACHED and progress.phase is MissionPhase.STAY:
            executor.park()
            return
        name, place = progress.goal.name, progress.goal.point
        here = vehicle.position
        left_m = 0.0 if here is None else place.distance_m(NedPoint(here.north_m, here.east_m))
        if left_m <= vehicle.parameters.get("WP_RADIUS", WP_RADIUS_M) + SLACK_M:
            self._notifier.tell(f"Reached {name}", Severity.INFO)
            executor.end_leg(TargetStatus.REACHED)
        else:
            self._notifier.tell(f"AUTO has gone on {left_m:.1f} m before {name}", Severity.WARNING)
            executor.end_leg(TargetStatus.SKIPPED)


def _index_of(point: GeoPoint, executor: MissionExecutor) -> int | None:
    """The target at a place: the first one that has not had its turn, else the last one that had."""
    progress = executor.progress
    place = LocalFrame(executor.layout.origin).to_ned(point)
    there = [i for i, target in enumerate(progress.targets) if target.point.distance_m(place) <= SAME_M]
    pending = [i for i in there if progress.statuses[i] is TargetStatus.PENDING]
    return pending[0] if pending else there[-1] if there else None
