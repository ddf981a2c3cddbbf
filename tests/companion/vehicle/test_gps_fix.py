"""The fix of a GPS receiver, by the number in its message."""

from __future__ import annotations

import pytest

from companion.settings import SafetySettings, Settings
from companion.vehicle.gps_fix import NEEDED, GpsFix, gps_fix_of


@pytest.mark.parametrize(
    ("fix_type", "fix"),
    [
        *((fix.value, fix) for fix in GpsFix),
        (7, GpsFix.DGPS),
        (8, GpsFix.DGPS),
        (9, GpsFix.NO_FIX),
        (255, GpsFix.NO_FIX),
    ],
)
def test_what_is_not_known_is_no_fix(fix_type: int, fix: GpsFix) -> None:
    assert gps_fix_of(fix_type) is fix
    assert fix.text


def test_only_what_an_autopilot_navigates_with_is_a_position() -> None:
    assert [fix for fix in GpsFix if fix.is_position] == [*NEEDED.values()]


def test_the_setting_asks_for_every_fix_that_is_a_position_or_for_any() -> None:
    for name in ("any", *NEEDED):
        assert Settings.model_validate({"safety": {"gps_fix": name}}).safety.gps_fix == name
    assert SafetySettings().gps_fix == "any"
