"""The autopilot brakes for every new setpoint: only what has changed, or is due again, goes out."""

from __future__ import annotations

import math
from itertools import pairwise

import pytest

from companion.control.controller import STOP, ControlCommand, Purpose
from companion.core.frames import NedPoint
from companion.executive.outbox import Outbox
from companion.settings import GuidanceSettings
from companion.vehicle.commands import ChangeSpeed, GuidedHeading, GuidedPosition, GuidedVelocity

SETTINGS = GuidanceSettings()


def drive(north_m: float, speed_m_s: float = 2.0) -> ControlCommand:
    return ControlCommand(Purpose.DRIVE, GuidedPosition(NedPoint(north_m, 0.0)), speed_m_s)


def look(heading_deg: float) -> ControlCommand:
    return ControlCommand(Purpose.LOOK, GuidedHeading(math.radians(heading_deg)), 0.5)


def times_sent(guides, confirmed: bool | None = True, kind: type = GuidedPosition) -> list[float]:
    """When setpoints of a kind went out; ``guides``: time and guide, tick by tick."""
    outbox = Outbox(SETTINGS)
    return [t for t, guide in guides if any(isinstance(c, kind) for c in outbox.due(guide, t, confirmed))]


def ticks(until_s: float, step_s: float = 0.05) -> list[float]:
    return [round(i * step_s, 3) for i in range(round(until_s / step_s))]


def test_a_target_that_stays_is_repeated_and_no_more():
    sent = times_sent([(t, drive(8.0)) for t in ticks(5.0)])
    assert sent == [0.0, 1.0, 2.0, 3.0, 4.0]


def test_a_target_that_rolls_ahead_is_sent_sooner_but_not_at_every_tick():
    sent = times_sent([(t, drive(8.0 + 2.0 * t)) for t in ticks(4.0)])
    gaps = [b - a for a, b in pairwise(sent)]
    assert all(SETTINGS.change_after_s - 1e-9 <= gap <= SETTINGS.resend_s for gap in gaps)
    assert len(sent) >= 8


def test_small_movements_of_a_target_wait_for_the_next_repetition():
    sent = times_sent([(t, drive(8.0 + 0.1 * t)) for t in ticks(3.0)])
    assert sent == [0.0, 1.0, 2.0]


@pytest.mark.parametrize(("confirmed", "count"), [(True, 3), (None, 3), (False, 6)])
def test_what_the_autopilot_does_not_follow_is_said_again_sooner(confirmed, count):
    assert len(times_sent([(t, drive(8.0)) for t in ticks(3.0)], confirmed)) == count


def test_stopping_goes_out_at_once_and_is_kept_alive():
    """The autopilot stops by itself 3 s after the last velocity."""
    sent = times_sent([(t, ControlCommand(Purpose.BRAKE, STOP, 0.0)) for t in ticks(2.0)], kind=GuidedVelocity)
    assert sent[0] == 0.0 and max(b - a for a, b in pairwise(sent)) < 1.0
    outbox = Outbox(SETTINGS)
    outbox.due(drive(8.0), 0.0, True)
    assert outbox.due(ControlCommand(Purpose.BRAKE, STOP, 0.0), 0.05, True) == [STOP]
    assert GuidedPosition(NedPoint(8.0, 0.0)) in outbox.due(drive(8.0), 0.1, True), "and so does driving on"


def test_a_changed_velocity_goes_out_at_once():
    outbox = Outbox(SETTINGS)
    outbox.due(ControlCommand(Purpose.BRAKE, STOP, 0.0), 0.0, None)
    back = GuidedVelocity(-0.4, 0.0)
    assert outbox.due(ControlCommand(Purpose.DRIVE, back, 0.0), 0.05, None) == [back]


def test_headings_are_repeated_slowly_and_followed_when_they_turn():
    assert len(times_sent([(t, look(90.0)) for t in ticks(3.0)], kind=GuidedHeading)) == 3
    assert len(times_sent([(t, look(90.0 + t)) for t in ticks(3.0)], kind=GuidedHeading)) == 3
    assert len(times_sent([(t, look(40.0 * t)) for t in ticks(3.0)], kind=GuidedHeading)) > 6
    assert len(times_sent([(t, look(179.0 + 2 * (i % 2))) for i, t in enumerate(ticks(3.0))], kind=GuidedHeading)) == 3


def test_speed_goes_with_positions_when_it_changes_and_now_and_then():
    def speeds(guides):
        outbox = Outbox(SETTINGS)
        return [
            (t, c.speed_m_s) for t, guide in guides for c in outbox.due(guide, t, True) if isinstance(c, ChangeSpeed)
        ]

    steady = speeds([(t, drive(8.0, 2.0)) for t in ticks(7.0)])
    assert [t for t, _ in steady] == [0.0, 3.0, 6.0]
    slower = speeds([(t, drive(8.0, 2.0 if t < 1.0 else 0.8)) for t in ticks(2.0)])
    assert slower == [(0.0, 2.0), (1.0, 0.8)]
    trembling = speeds([(t, drive(8.0, 2.0 + 0.1 * (i % 2))) for i, t in enumerate(ticks(2.0))])
    assert len(trembling) == 1
    assert not speeds([(0.0, look(10.0)), (0.1, ControlCommand(Purpose.BRAKE, STOP, 0.0))])


def test_after_a_reset_everything_is_new():
    outbox = Outbox(SETTINGS)
    outbox.due(drive(8.0), 0.0, True)
    assert outbox.due(drive(8.0), 0.1, True) == []
    outbox.reset()
    assert outbox.due(drive(8.0), 0.2, True) == [GuidedPosition(NedPoint(8.0, 0.0)), ChangeSpeed(2.0)]
