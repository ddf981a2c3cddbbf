"""A run as those see it who watch: what it does at this moment, and what has become of its targets."""

from __future__ import annotations

from companion.executive.mission_executor import MissionExecutor
from companion.executive.mission_progress import TargetStatus
from companion.mission.mission import Mission
from companion.operator.reporting import Reporter, Status
from companion.vehicle.state import VehicleState


def statuses_of(mission: Mission, executor: MissionExecutor | None) -> list[tuple[str, TargetStatus]]:
    """Every target's name and what has become of it so far. ``executor``: None before the mission has begun."""
    if executor is None:
        return [(target.name, TargetStatus.PENDING) for target in mission.targets]
    return executor.statuses()


def status_of(
    now_s: float, vehicle: VehicleState, mission: Mission, executor: MissionExecutor | None, reporter: Reporter
) -> Status:
    """A picture of this moment."""
    return Status(
        time_s=now_s,
        doing=reporter.doing,
        pose=vehicle.pose_at(now_s),
        decision=executor.driver.decision if executor else None,
        target=executor.progress.goal.name if executor and not executor.progress.ended else "",
        targets_reached=executor.reached if executor else 0,
        targets=len(mission.targets),
        steps=executor.driver.tally.steps if executor else 0,
        news=tuple(reporter.news),
    )
