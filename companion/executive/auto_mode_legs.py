"""A mission that the autopilot drives in AUTO: the legs that it hands over (NAV_GUIDED_ENABLE) are driven, the others are its own."""

from __future__ import annotations

from companion.control.controller import ControlCommand, Purpose
from companion.core.frames import GeoPoint, LocalFrame, NedPoint
from companion.executive.mission_executor import MissionExecutor, Tell
from companion.executive.mission_progress import Leg, TargetStatus, ended_at, parked, sent_to
from companion.vehicle.commands import GuidedPosition
from companion.vehicle.events.targets import GuidedLeg, LegState
from companion.vehicle.state import VehicleState

INFO, WARNING = 6, 4
SAME_M = 0.1
"""A place that is handed over and one of the mission nearer to each other than this are one: both are whole 1e-7 degrees."""
WP_RADIUS_M = 2.0
"""ArduRover's default; the autopilot ends a leg when the rover is this near to its place."""
SLACK_M = 1.0
"""The rover drives on between the end of a leg and the news of it."""


class AutoModeLegs:
    """Follows what the autopilot hands over. ``tell`` says a text with its severity to the people."""

    def __init__(self, tell: Tell) -> None:
        self._tell = tell
        self._leg: GuidedLeg | None = None
        self._parked = False

    def follow(self, vehicle: VehicleState, executor: MissionExecutor) -> bool:
        """To be called at every tick; True when every leg has been driven or ended, and none is under way."""
        if not vehicle.in_auto:
            return False
        if not self._parked:
            self._parked = True
            executor.progress = parked(executor.progress)
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

    def guide(self, guide: ControlCommand | None, executor: MissionExecutor, slow_m_s: float) -> ControlCommand | None:
        """What to do: where the companion is content, the autopilot may want the rover nearer to the place (a small WP_RADIUS)."""
        progress = executor.progress
        if self._leg is None or guide is None or guide.purpose is not Purpose.STAND or progress.leg is not Leg.STAY:
            return guide
        if progress.statuses[progress.index] is not TargetStatus.REACHED:
            return guide
        return ControlCommand(Purpose.DRIVE, GuidedPosition(progress.goal.point), slow_m_s)

    def _begin(self, leg: GuidedLeg, executor: MissionExecutor) -> None:
        index = _index_of(leg.point, executor)
        if index is None:
            self._tell("AUTO hands over a place that is not in the mission as it was read: not driven", WARNING)
            return
        executor.progress = sent_to(executor.progress, index)
        executor.driver.leave()

    def _end(self, leg: GuidedLeg, vehicle: VehicleState, executor: MissionExecutor) -> None:
        self._leg = None
        executor.driver.leave()
        progress = executor.progress
        if _index_of(leg.point, executor) is None:
            return
        if progress.statuses[progress.index] is TargetStatus.REACHED and progress.leg is Leg.STAY:
            executor.progress = parked(progress)
            return
        name, place = progress.goal.name, progress.goal.point
        here = vehicle.position
        left_m = 0.0 if here is None else place.distance_m(NedPoint(here.north_m, here.east_m))
        if left_m <= vehicle.parameters.get("WP_RADIUS", WP_RADIUS_M) + SLACK_M:
            self._tell(f"Reached {name}", INFO)
            executor.progress = ended_at(progress, TargetStatus.REACHED)
        else:
            self._tell(f"AUTO has gone on {left_m:.1f} m before {name}", WARNING)
            executor.progress = ended_at(progress, TargetStatus.SKIPPED)


def _index_of(point: GeoPoint, executor: MissionExecutor) -> int | None:
    """The target at a place: the first one that has not had its turn, else the last one that had."""
    progress = executor.progress
    place = LocalFrame(executor.layout.origin).to_ned(point)
    there = [i for i, target in enumerate(progress.targets) if target.point.distance_m(place) <= SAME_M]
    pending = [i for i in there if progress.statuses[i] is TargetStatus.PENDING]
    return pending[0] if pending else there[-1] if there else None
