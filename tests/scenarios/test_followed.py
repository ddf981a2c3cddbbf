"""Whether the autopilot follows the places that it is sent, as people are told of it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from companion.operator.notifications import NOT_FOLLOWED_S
from tests.support.rig import GATE, GUIDED, HOLD, Rig, yard

ANOTHER = "The autopilot follows another target than the one sent: does another program steer it?"


@pytest.mark.thorough
def test_a_target_that_is_not_taken_is_told_of(tmp_path: Path) -> None:
    rig = Rig(yard(tmp_path, GATE + "speed_m_s = 0.8\n"), late_s=45.0)

    def elsewhere(message: Any) -> Any:
        if message.get_type() == "POSITION_TARGET_GLOBAL_INT":
            message.lat_int += 5000
        return message

    rig.change = elsewhere
    rig.until_driven(2.0)
    rig.run_for(NOT_FOLLOWED_S + 8.0)
    assert rig.texts().count(ANOTHER) == 1


@pytest.mark.thorough
def test_nothing_is_said_of_targets_while_somebody_else_has_the_rover(tmp_path: Path) -> None:
    rig = Rig(yard(tmp_path), late_s=45.0)
    rig.until_driven(2.0)
    rig.pilot_mode(HOLD)
    rig.run_for(2.0 * NOT_FOLLOWED_S + 5.0)
    rig.pilot_mode(GUIDED)
    rig.finish()
    assert rig.companion.outcome.complete and ANOTHER not in rig.texts()
