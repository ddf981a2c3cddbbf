"""A run as those see it who watch: what it does at this moment, and what has become of its targets."""

from __future__ import annotations

from companion.executive.mission_executor import Pursuit
from companion.executive.mission_progress import TargetStatus
from companion.mission.mission import Mission
from companion.operator.reporting import Reporter, Status
from companion.vehicle.state import VehicleState


def statuses_of(mission: Mission, pursuit: Pursuit | None) -> list[tuple[str, TargetStatus]]:
    """Every target's name and what has become of it so far. ``pursuit``: None before the mission has begun."""
    if pursuit is None:
        return [(target.name, TargetStatus.PENDING) for target in mission.targets]
    return pursuit.statuses()


def status_of(
    now_s: float, vehicle: VehicleState, mission: Mission, pursuit: Pursuit | None, reporter: Reporter
) -> Status:
    """A picture of this moment."""
    return Status(
        time_s=now_s,
        doing=reporter.doing,
        pose=vehicle.pose_at(now_s),
        decision=pursuit.driver.decision if pursuit else None,
        target=pursuit.itinerary.goal.name if pursuit and not pursuit.itinerary.ended else "",
        targets_reached=pursuit.reached if pursuit else 0,
        targets=len(mission.targets),
        steps=pursuit.driver.tally.steps if pursuit else 0,
        news=tuple(reporter.news),
    )
