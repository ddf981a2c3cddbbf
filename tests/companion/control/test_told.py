"""What was told lately."""

from __future__ import annotations

from companion.control.told import KEPT_S, Told, after, in_force
from companion.core.frames import NedPoint
from companion.vehicle.commands import GuidedPosition, GuidedVelocity


def test_the_velocity_in_force_is_the_newest_told_until_then() -> None:
    told = Told()
    for tick in range(4):
        told = after(told, GuidedVelocity(float(tick), 0.1), 0.1 * tick)
    assert in_force(told, -0.01) is None
    assert [in_force(told, time_s).speed_m_s for time_s in (0.0, 0.15, 9.0)] == [0.0, 1.0, 3.0]


def test_old_ones_are_forgotten_and_so_are_all_after_another_kind_of_setpoint() -> None:
    told = after(Told(), GuidedVelocity(1.0, 0.0), 0.0)
    assert len(after(told, GuidedVelocity(2.0, 0.0), 0.5 * KEPT_S)) == 2
    assert len(after(told, GuidedVelocity(2.0, 0.0), KEPT_S)) == 1
    assert after(told, GuidedPosition(NedPoint(1.0, 2.0)), 0.1) == after(told, None, 0.1) == ()
