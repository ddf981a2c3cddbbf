"""The figures for ground stations: which, how often, and none before the mission has begun."""

from __future__ import annotations

from pathlib import Path

import pytest

from companion.core.grid import Cell
from companion.executive.mission_progress import on_reached
from companion.navigation.field_step import Action, Decision, DecisionReason, Part
from companion.operator.figures import Telemetry, figures
from companion.vehicle.commands import NamedValue
from tests.support.desk import Desk

NAMES = ["NAV_PART", "PATH_COST", "SEARCH_MS", "PROGRESS"]
TWO = '[[target]]\nname = "a"\nfield = [3, 7]\n[[target]]\nname = "b"\nfield = [5, 7]\n'


def decision(part: Part, *path: Cell) -> Decision:
    return Decision(Action.FOLLOW, part, path, None, DecisionReason.FOLLOWING)


def test_before_the_first_step_there_is_no_part_and_no_path(tmp_path: Path) -> None:
    executor = Desk(tmp_path).begin()
    assert figures(executor) == {"NAV_PART": 0.0, "PATH_COST": -1.0, "SEARCH_MS": 0.0, "PROGRESS": 0.0}


@pytest.mark.parametrize(("part", "number"), [(Part.RETURN, 1.0), (Part.EXPLORE, 2.0), (Part.SEARCH, 3.0)])
def test_the_part_of_the_last_step_and_the_cost_of_its_path(tmp_path: Path, part: Part, number: float) -> None:
    executor = Desk(tmp_path).begin()
    executor.driver.decision = decision(part, Cell(2, 7), Cell(3, 7), Cell(4, 8))
    executor.driver.step_s = 0.25
    told = figures(executor)
    assert (told["NAV_PART"], told["SEARCH_MS"]) == (number, 250.0)
    assert told["PATH_COST"] == pytest.approx(0.5 + 0.5 * 2.0**0.5), "ground that nobody has seen costs half"
    executor.driver.decision = decision(part)
    assert figures(executor)["PATH_COST"] == -1.0


def test_progress_is_the_share_of_the_targets_that_were_reached(tmp_path: Path) -> None:
    executor = Desk(tmp_path, TWO).begin()
    executor.progress = on_reached(executor.progress, 10.0)
    assert figures(executor)["PROGRESS"] == 50.0


def test_they_are_sent_at_their_rate_and_never_before_the_mission_has_begun(tmp_path: Path) -> None:
    telemetry = Telemetry(2.0)
    assert telemetry.due(None, 0.0) == []
    executor = Desk(tmp_path).begin()
    sent = [telemetry.due(executor, 0.05 * tick) for tick in range(21)]
    assert [tick for tick, values in enumerate(sent) if values] == [0, 10, 20]
    assert sent[0] == [NamedValue(name, value) for name, value in figures(executor).items()]
    assert [value.name for value in sent[0]] == NAMES


def test_a_rate_of_zero_switches_them_off(tmp_path: Path) -> None:
    executor = Desk(tmp_path).begin()
    assert [Telemetry(0.0).due(executor, now_s) for now_s in (0.0, 1e9)] == [[], []]
