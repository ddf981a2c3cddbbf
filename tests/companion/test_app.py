"""A whole companion on a desk: from the first heartbeat to the first setpoint."""

from __future__ import annotations

from companion.safety.reasons import Doubt, RunPhase, WaitReason
from companion.vehicle.commands import (
    Arm,
    GuidedHeading,
    GuidedPosition,
    SetMode,
)
from companion.vehicle.events import (
    AckSeen,
    RoverMode,
)
from tests.companion.safety.test_mode_latch import GUIDED
from tests.support.whole import Whole


def test_from_the_first_heartbeat_to_the_first_setpoint(whole: Whole) -> None:
    assert whole.tick(silent=True) == [] and whole.awaited() is WaitReason.HEARTBEAT
    assert whole.companion.executor is None and whole.companion.status().activity.phase is RunPhase.WAITING
    assert whole.tick() == [SetMode(RoverMode.GUIDED)] and whole.awaited() is WaitReason.GUIDED
    whole.mode = int(GUIDED)
    assert Arm() in whole.ticks(3.2) and whole.awaited() is WaitReason.ARMING
    whole.autopilot.ack = AckSeen(whole.clock.time_s, 400, 4)
    whole.tick()
    assert whole.companion.outcome.said[-1] == "The autopilot refuses to arm (failed): its own texts say why"
    whole.autopilot.ack = None
    sent = whole.drive()
    assert whole.companion.executor is not None and whole.companion.status().activity.phase is RunPhase.DRIVING
    assert any(isinstance(command, GuidedPosition | GuidedHeading) for command in sent)
    assert "Companion: Yard, 1 target" in whole.companion.outcome.said
    assert whole.memory.notes and not any(whole.memory.notes)


def test_another_companion_with_our_id_is_waited_for(whole: Whole) -> None:
    whole.autopilot.twin = True
    assert whole.tick() == [] and whole.awaited() is WaitReason.OTHER_COMPANION_SILENT


def test_a_computer_that_stood_still_believes_nothing_at_once(whole: Whole) -> None:
    whole.drive()
    sleep = whole.clock.sleep_until_s
    whole.clock.sleep_until_s = lambda time_s: sleep(time_s + 3.0)  # type: ignore[method-assign]
    whole.tick()
    whole.clock.sleep_until_s = sleep  # type: ignore[method-assign]
    whole.tick()
    assert f"Stopping: {Doubt.LOOP_STOOD_STILL.value}" in whole.companion.outcome.said
