"""The command of a controller, and that both controllers forget what they began."""

from __future__ import annotations

import pytest

from companion.control.arc_controller import ArcController
from companion.control.controller import STANDSTILL, STOP, Controller, Purpose, stop_for
from companion.control.point_controller import PointController
from companion.vehicle.commands import GuidedVelocity
from tests.companion.control.test_arc_controller import path


@pytest.mark.parametrize("purpose", list(Purpose))
def test_to_stop_is_velocity_zero_whatever_for(purpose: Purpose) -> None:
    command = stop_for(purpose)
    assert (command.purpose, command.setpoint, command.speed_m_s) == (purpose, GuidedVelocity(0.0, 0.0), 0.0)


def test_standing_still_has_no_other_purpose() -> None:
    assert stop_for(Purpose.STAND) == STANDSTILL and STANDSTILL.setpoint == STOP


@pytest.mark.parametrize("controller", [PointController(), ArcController()])
def test_a_controller_that_has_begun_nothing_leads_along_the_path_itself(controller: Controller) -> None:
    line = path((0, 0), (5, 0))
    controller.reset()
    assert not controller.backwards
    assert controller.line_ahead(line) is line and controller.line_ahead(None) is None
