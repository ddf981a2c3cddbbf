"""Faults that leave the data fresh, in lock-step: readings that repeat, a link that is late, clocks that jump, work that takes too long."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from tests.rig import HOLD, SET_MODE, Rig, yard

TICK_S = 0.05


@pytest.fixture
def rig(tmp_path: Path) -> Rig:
    """A rover at full speed, with a wall ahead."""
    rig = Rig(yard(tmp_path))
    rig.until_driven(3.0)
    return rig


def first_stop_s(rig: Rig, since_s: float) -> float:
    """When the first velocity of zero went out."""
    return next(one.time_s for one in rig.sent_since(since_s) if one.is_standstill)


def modes_asked_for(rig: Rig, since_s: float) -> list[float]:
    return [one.message.param2 for one in rig.sent_since(since_s) if one.command == SET_MODE]


class Repeated:
    """The lidar says again and again what it said when this began; its clock and its checksum are right."""

    def __init__(self) -> None:
        self._cells: Any = None

    def __call__(self, message: Any) -> Any:
        if message.get_type() == "OBSTACLE_DISTANCE":
            self._cells = self._cells or list(message.distances)
            message.distances = self._cells
        return message


# --- range data that repeats itself ---------------------------------------------------------------------------------


def test_a_lidar_that_repeats_itself_stops_the_rover_and_lets_it_go_on_when_it_sees_again(rig: Rig) -> None:
    rig.change, since_s = Repeated(), rig.now_s()
    rig.run_for(1.8)
    assert first_stop_s(rig, since_s) - since_s <= 0.8
    assert "Stopping: obstacle distance repeats itself" in rig.texts()
    rig.change = None
    rig.finish()
    assert rig.companion.outcome.complete and rig.simulator.collisions == ()
    assert modes_asked_for(rig, since_s) == [HOLD], "only the one at the end"


def test_a_lidar_that_repeats_itself_for_ever_ends_in_hold_however_often_a_person_tries(rig: Rig) -> None:
    rig.change, since_s = Repeated(), rig.now_s()
    for _ in range(3):
        rig.until(lambda: rig.mode == HOLD, 5.0)
        rig.pilot_mode(15)
        rig.until(lambda: rig.mode == 15, 2.0)
    assert rig.simulator.collisions == ()
    assert rig.simulator.driven_m < 7.0
    assert modes_asked_for(rig, since_s) == [HOLD] * 3
