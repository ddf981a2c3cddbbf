"""The pace of the field step."""

from __future__ import annotations

import pytest

from companion.core.clock import stopwatch_s
from companion.settings.live_settings import LiveSettings
from companion.supervision.pace import Pace
from tests.support.notices import HandClock
from tests.support.whole import SETTINGS


def test_the_pace_is_that_of_the_settings_and_does_not_catch_up_after_a_stall() -> None:
    clock, live = HandClock(10.0), LiveSettings(SETTINGS)
    pace, period_s = Pace(clock, live), 1.0 / SETTINGS.link.tick_hz
    assert [pace.sleep(), pace.sleep()] == pytest.approx([10.0 + period_s, 10.0 + 2.0 * period_s])
    assert pace.late_s == 0.0
    clock.sleep_until_s = lambda time_s: setattr(clock, "time_s", 20.0)  # type: ignore[method-assign]
    assert pace.sleep() == 20.0 and pace.late_s > 1.0
    del clock.sleep_until_s  # type: ignore[attr-defined]
    assert pace.sleep() == pytest.approx(20.0 + period_s) and pace.late_s == 0.0
    assert 0.0 <= pace.elapsed_s <= stopwatch_s()
