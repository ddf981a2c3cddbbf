"""What is told of a guard on the autopilot."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from companion.control.braking import GUARD_SLACK_S, for_silence
from companion.control.following import GUARDED_S
from companion.core.severity import Severity
from companion.safety.guard_monitor import GuardMonitor
from companion.settings import Settings
from companion.vehicle.commands import StatusText
from companion.vehicle.events import Event, GuardSeen, TextSeen
from companion.vehicle.guard import IN_TIME_S
from companion.vehicle.state import VehicleState, fold
from tests.support.whole import Whole


class Texts:
    def __init__(self) -> None:
        self.said: list[str] = []

    def tell(self, text: str, severity: Severity) -> None:
        self.said.append(text)


def run(*events: tuple[float, Event | None]) -> list[str]:
    """What is said as these come in; None for a tick without an event."""
    texts, state = Texts(), VehicleState()
    monitor = GuardMonitor(texts, 0.95)
    for now_s, event in events:
        if event is not None:
            state = fold(state, event)
            monitor.take(event, state)
        monitor.tick(now_s)
        assert monitor.doubt(now_s) is None
    return texts.said


def test_it_tells_once_that_there_is_one_and_that_it_is_gone() -> None:
    speaks = [(float(now_s), GuardSeen(float(now_s), 0.3, False)) for now_s in range(1, 9)]
    silent = [(10.0, None), (11.0, None), (12.0, None)]
    said = run((0.0, TextSeen(0.0, 6, "hello")), *speaks, *silent, (13.0, GuardSeen(13.0, 0.5, False)))
    assert [text.split()[0] for text in said] == ["Guarded:", "The", "Guarded:"]
    assert "0.3 s" in said[0] and "gone" in said[1] and "0.5 s" in said[2]


def test_it_tells_once_that_hold_was_the_guards() -> None:
    seen = [(float(now_s), GuardSeen(float(now_s), 0.3, now_s in (2, 3, 5))) for now_s in range(7)]
    assert [text for text in run(*seen) if "HOLD:" in text] == [
        "The guard on the autopilot has put HOLD: it heard nothing of the companion"
    ] * 2


def test_in_legs_of_auto_it_does_not_watch_and_counts_as_absent() -> None:
    state = replace(fold(VehicleState(), GuardSeen(1.0, 0.3, False)), in_auto=True)
    assert state.guard_at(1.1) is None and replace(state, in_auto=False).guard_at(1.1) is not None


def test_without_one_nothing_is_told() -> None:
    assert run((0.0, None), (5.0, TextSeen(5.0, 6, "hello"))) == []


@pytest.mark.parametrize(("waits_s", "says"), [(0.95, "Guarded: "), (0.951, "A late guard: "), (3.0, "A late guard: ")])
def test_a_guard_that_waits_long_is_not_called_guarded(waits_s: float, says: str) -> None:
    (text,) = run((1.0, GuardSeen(1.0, waits_s, False)))
    assert text.startswith(says) and f"HOLD {waits_s:g} s" in text
    assert ("set SCR_USER1 to 950 or less" in text) is (says != "Guarded: ")


@pytest.mark.parametrize(("waits_s", "says"), [(0.95, "Guarded: "), (1.0, "A late guard: ")])
def test_what_is_said_is_the_rule_in_force(tmp_path: Path, waits_s: float, says: str) -> None:
    """Said by the whole companion; a velocity that lasts longer than that is judged by the strict rule."""
    whole = Whole(tmp_path)
    whole.autopilot.events = [*whole.heard(), GuardSeen(whole.clock.time_s, waits_s, False)]
    whole.companion.tick()
    texts = [command.text for command in whole.autopilot.taken() if isinstance(command, StatusText)]
    assert [text.startswith(says) for text in texts if "guard" in text.lower()] == [True]
    lasts_s = for_silence(Settings(), 3.0, waits_s).guidance.velocity_lasts_s
    assert (lasts_s <= GUARDED_S) is (says == "Guarded: ")
    assert pytest.approx(GUARDED_S - GUARD_SLACK_S) == IN_TIME_S, "what is said is said by the same limit"
