"""What the autopilot's parameters tell."""

from __future__ import annotations

import math

import pytest

from companion.vehicle.motion_limits import full_throttle_m_s, velocity_lasts_s


@pytest.mark.parametrize(
    ("parameters", "lasts_s"),
    [({}, 3.0), ({"GUID_TIMEOUT": 1.0}, 1.0), ({"GUID_TIMEOUT": 10.0}, 10.0), ({"GUID_TIMEOUT": 0.0}, 0.1),
     ({"GUID_TIMEOUT": 60.0}, 30.0), ({"GUID_TIMEOUT": math.inf}, 30.0),
     ({"GUID_TIMEOUT": math.nan}, 3.0)],
)  # fmt: skip
def test_a_velocity_goes_on_for_as_long_as_told(parameters: dict[str, float], lasts_s: float) -> None:
    assert velocity_lasts_s(parameters, 3.0) == lasts_s


def test_the_throttle_fully_open_is_twice_cruise_speed_as_shipped() -> None:
    assert full_throttle_m_s({}) == 4.0 == full_throttle_m_s({"CRUISE_SPEED": 0.0, "CRUISE_THROTTLE": 80.0})
    assert full_throttle_m_s({"CRUISE_SPEED": 2.0, "CRUISE_THROTTLE": 80.0}) == 2.5
