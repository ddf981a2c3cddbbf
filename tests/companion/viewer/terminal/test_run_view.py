"""The terminal of a real run: what is old does not look fresh."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import pytest

from companion.safety.mode_latch import Control
from companion.vehicle.events import RoverMode
from companion.viewer.terminal.facts import Fact
from companion.viewer.terminal.run_view import RunView


def facts_at(now_s: float, *, heard: bool = True) -> dict[str, Fact]:
    """The rover's facts, of an autopilot that was heard at 10 s, and never again."""
    seen: Any = SimpleNamespace(time_s=10.0, mode=RoverMode.GUIDED, armed=True) if heard else None
    vehicle = SimpleNamespace(
        heartbeat=seen, position=seen, scan=None, battery=None, gps=None, forward_m_s=0.8, is_ours=True
    )
    run = SimpleNamespace(latch=SimpleNamespace(control=Control.COMPANION))
    view = RunView(cast(Any, SimpleNamespace(vehicle=vehicle, mission_run=run)), "yard")
    return {fact.name: fact for fact in view._rover_section(cast(Any, SimpleNamespace(time_s=now_s))).facts}


@pytest.mark.parametrize(
    ("now_s", "mode", "driver", "speed"),
    [
        (11.0, "GUIDED, armed", "companion", "0.80 m/s"),
        (12.0, "GUIDED, armed", "companion", "0.80 m/s, 2 s ago"),
        (22.0, "GUIDED, armed, 12 s ago", "companion, 12 s ago", "0.80 m/s, 12 s ago"),
    ],
)
def test_mode_and_speed_that_are_old_say_so(now_s: float, mode: str, driver: str, speed: str) -> None:
    facts = facts_at(now_s)
    assert [facts[name].value for name in ("mode", "driven by", "speed")] == [mode, driver, speed]
    assert [facts[name].alarm for name in ("mode", "speed")] == ["ago" in mode, "ago" in speed]


def test_before_anything_was_heard_there_is_no_speed() -> None:
    facts = facts_at(1.0, heard=False)
    assert (facts["mode"].value, facts["speed"].value) == ("-", "-")
