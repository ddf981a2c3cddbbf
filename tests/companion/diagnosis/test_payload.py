"""What a mission's commands need, and whether the autopilot has it."""

from __future__ import annotations

from dataclasses import replace

from companion.diagnosis.payload import parameters_of, payload
from companion.vehicle.survey import Survey
from tests.companion.diagnosis.test_diagnosis import WELL

COMMANDS = [(183, 9.0), (183, 3.0), (181, 0.0), (182, 1.0), (211, 0.0), (216, 1.0), (203, 0.0), (201, 0.0), (218, 1.0)]


def seen(**parameters: float) -> Survey:
    return replace(WELL, parameters={**WELL.parameters, **parameters})


def test_only_what_matters_is_asked_for() -> None:
    assert parameters_of([(183, 9.0), (183, 9.0), (181, 0.0), (218, 5.0)]) == (
        "SERVO9_FUNCTION", "RELAY1_FUNCTION", "RELAY1_PIN",
    )  # fmt: skip


def test_what_would_be_refused_is_found() -> None:
    bare = dict.fromkeys(("GRIP_ENABLE", "SPRAY_ENABLE", "CAM1_TYPE", "MNT1_TYPE", "RELAY2_FUNCTION"), 0.0)
    table = {**bare, "SERVO9_FUNCTION": 0.0, "SERVO3_FUNCTION": 74.0, "RELAY1_FUNCTION": 1.0, "RELAY1_PIN": -1.0}
    found = {one.parameter: one.says for one in payload(seen(**table), COMMANDS)}
    assert set(found) == {
        "SERVO3_FUNCTION", "RELAY1_PIN", "RELAY2_FUNCTION", "GRIP_ENABLE", "SPRAY_ENABLE", "CAM1_TYPE", "MNT1_TYPE",
    }  # fmt: skip
    assert found["SERVO3_FUNCTION"].startswith("The mission sets servo 3")


def test_a_rover_that_has_all_and_one_that_says_nothing_are_fine() -> None:
    fitted = {"SERVO9_FUNCTION": 28.0, "RELAY1_FUNCTION": 1.0, "RELAY1_PIN": 54.0, "GRIP_ENABLE": 1.0, "CAM1_TYPE": 1.0}
    assert list(payload(seen(**fitted), [(183, 9.0), (181, 0.0), (211, 0.0), (203, 0.0)])) == []
    assert list(payload(WELL, COMMANDS)) == []
