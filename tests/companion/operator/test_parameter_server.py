"""The parameter server: its list, its answers at its own rate, and changes that are accepted or refused."""

from __future__ import annotations

import math

import pytest

from companion.core.severity import Severity
from companion.operator.parameter_server import ANSWER_S, CHANGE_S, MOST_OPEN, ParameterServer
from companion.settings import Settings
from companion.settings.live_settings import LiveSettings
from companion.settings.tunable_parameters import TABLE
from companion.vehicle.commands import ParameterValue
from companion.vehicle.events import (
    EkfStatusSeen,
    Event,
    ParameterAsked,
    ParameterChangeAsked,
    ParametersAsked,
)
from companion.vehicle.state import VehicleState
from tests.support.notices import Notices

TICK_S = 0.05
LAST = len(TABLE) - 1


class Served:
    """A server, what it says and keeps, and the settings in force; a tick is 50 ms."""

    def __init__(self, *, keeps: bool = True) -> None:
        self.live, self.notices, self.now_s = LiveSettings(Settings()), Notices(), 0.0
        self.kept: list[Settings] = []
        self.server = ParameterServer(self.live, self.notices, self.kept.append if keeps else None)

    def ask(self, *events: Event) -> None:
        for event in events:
            self.server.take(event, VehicleState())

    def tick(self, seconds: float = TICK_S) -> list[ParameterValue]:
        self.now_s += seconds
        return [command for command in self.server.due(self.now_s) if isinstance(command, ParameterValue)]

    def answers(self, ticks: int) -> list[ParameterValue]:
        return [answer for _ in range(ticks) for answer in self.tick()]


def change(name: str, value: float, *, to_us: bool = True) -> ParameterChangeAsked:
    return ParameterChangeAsked(0.0, name, value, to_us)


def test_the_whole_list_is_sent_one_by_one() -> None:
    served = Served()
    assert served.tick() == []
    served.ask(ParametersAsked(0.0), ParametersAsked(0.0))
    assert len(served.tick()) == 1 and served.tick(ANSWER_S / 2.0) == []
    answers = served.answers(2 * len(TABLE))
    assert [answer.index for answer in answers] == list(range(1, len(TABLE))), "each once, however often it is asked"
    assert {answer.count for answer in answers} == {len(TABLE)}
    assert [answer.name for answer in answers] == [parameter.name for parameter in TABLE[1:]]
    assert {answer.name for answer in answers if answer.whole_number} == {"CMP_BETTER", "CMP_DOUBTS"}


@pytest.mark.parametrize(
    ("name", "index", "answered"),
    [
        ("", 0, 0),
        ("", LAST, LAST),
        ("", LAST + 1, None),
        ("CMP_SPD_MIN", -1, 1),
        ("CMP_SPD_MIN", LAST + 1, None),
        ("WP_SPEED", -1, None),
    ],
)
def test_one_is_read_by_name_or_by_its_place_in_the_list(name: str, index: int, answered: int | None) -> None:
    served = Served()
    served.ask(ParameterAsked(0.0, name, index))
    assert [answer.index for answer in served.answers(3)] == ([] if answered is None else [answered])


def test_other_events_are_ignored() -> None:
    served = Served()
    served.ask(EkfStatusSeen(0.0, 0))
    assert served.answers(3) == []


def test_a_change_counts_at_once_and_is_answered_kept_and_told() -> None:
    served = Served()
    served.ask(change("CMP_STALE", 0.5, to_us=False))
    assert served.tick() == [ParameterValue("CMP_STALE", 0.5, 18, len(TABLE))]
    assert served.live.current.safety.stale_s == 0.5 and served.kept == [served.live.current]
    assert served.notices.told == [("CMP_STALE 1 -> 0.5", Severity.INFO)]


def test_what_counts_only_later_is_told_so() -> None:
    served = Served(keeps=False)
    served.ask(change("CMP_DOUBTS", 1.0))
    served.tick()
    assert served.notices.texts[0].endswith("-> 1, from the next leg on")
    assert served.live.current.navigator.doubts == 1


def test_the_same_value_again_is_answered_and_neither_told_nor_kept() -> None:
    served = Served()
    served.ask(change("CMP_STALE", 1.0))
    assert [answer.value for answer in served.tick()] == [1.0]
    assert served.notices.told == [] and served.kept == []


@pytest.mark.parametrize("value", [math.nan, 0.0, 1e9])
def test_a_value_out_of_bounds_is_refused_and_answered_with_the_one_in_force(value: float) -> None:
    served = Served()
    served.ask(change("CMP_STALE", value))
    assert [answer.value for answer in served.tick()] == [1.0]
    assert served.live.changes == 0 and served.kept == []
    [(text, severity)] = served.notices.told
    assert text.startswith("CMP_STALE stays 1: ") and severity is Severity.WARNING


@pytest.mark.parametrize("to_us", [True, False])
def test_an_unknown_name_is_told_only_if_it_was_meant_for_the_companion(to_us: bool) -> None:
    served = Served()
    served.ask(change("A_NAME_LONGER_THAN_ANY", 1.0, to_us=to_us))
    assert served.tick() == []
    told = [("The companion has no parameter A_NAME_LONGER_TH", Severity.WARNING)]
    assert served.notices.told == (told if to_us else [])


def test_of_a_flood_for_one_parameter_the_newest_counts() -> None:
    served = Served()
    served.ask(*(change("CMP_STALE", 0.3 + 0.1 * i) for i in range(6)))
    served.answers(10)
    assert served.live.changes == 1 and served.live.current.safety.stale_s == 0.8


def test_changes_are_taken_in_one_after_the_other_at_their_own_rate() -> None:
    served = Served()
    served.ask(change("CMP_STALE", 0.5), change("CMP_JUMP", 3.0))
    served.tick()
    assert served.live.changes == 1
    served.tick(CHANGE_S - TICK_S)
    assert served.live.changes == 1
    served.tick()
    assert served.live.changes == 2 and served.live.current.safety.jump_m == 3.0


def test_a_flood_of_unknown_names_keeps_only_so_many_open() -> None:
    served = Served()
    served.ask(*(change(f"X{i}", 1.0) for i in range(MOST_OPEN)), change("CMP_STALE", 0.5))
    served.ask(change("X0", 2.0))
    for _ in range(2 * MOST_OPEN):
        served.tick(CHANGE_S)
    assert len(served.notices.told) == MOST_OPEN and served.live.changes == 0
