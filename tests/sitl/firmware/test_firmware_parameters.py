"""What the real firmware is told of our rover."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from companion.vehicle.recommended_parameters import RECOMMENDED_PARAMETERS
from sitl.autopilot.parameters import DEFAULTS, steered_wheels
from sitl.firmware.firmware_parameters import firmware_parameters, parameter_file
from sitl.firmware.parameter_files import ParameterFile
from sitl.firmware.physics import servo_output
from sitl.sensors.range_sensors import SUITES

MISSION = {"WP_SPEED": 2.0, **RECOMMENDED_PARAMETERS}


@pytest.mark.parametrize("suite", ["none", "beams", "lidar-360"])
def test_a_skid_rover_is_tuned_as_the_simulated_autopilot(suite: str) -> None:
    told = firmware_parameters(MISSION, SUITES[suite], steered=False)
    ours = {name: value for name, (value, _) in DEFAULTS.items()} | MISSION
    shared = {name for name in told if name in ours and not name.startswith("RNGFND")}
    assert {name: told[name] for name in shared} == {name: ours[name] for name in shared}
    assert shared >= {
        "SERVO1_FUNCTION",
        "SERVO3_FUNCTION",
        "CRUISE_SPEED",
        "CRUISE_THROTTLE",
        "ATC_STR_RAT_FF",
        *MISSION,
    }


def test_steered_wheels_have_steering_and_one_throttle() -> None:
    told = firmware_parameters(MISSION | steered_wheels(2.5), SUITES["none"], steered=True)
    assert (told["SERVO1_FUNCTION"], told["SERVO3_FUNCTION"], told["TURN_RADIUS"]) == (26.0, 70.0, 2.5)


def test_a_users_own_parameters_count_but_where_the_plant_is_wired() -> None:
    own = {
        "SERVO1_FUNCTION": 74.0,
        "SERVO3_FUNCTION": 73.0,
        "SERVO1_REVERSED": 1.0,
        "CRUISE_SPEED": 1.5,
        "RNGFND1_TYPE": 10.0,
    }
    told = firmware_parameters(own, SUITES["beams"], steered=False)
    wired = ("SERVO1_FUNCTION", "SERVO3_FUNCTION", "SERVO1_REVERSED", "CRUISE_SPEED", "RNGFND1_TYPE")
    assert [told[name] for name in wired] == [73.0, 74.0, 0.0, 1.5, 100.0]


def test_what_becomes_of_a_users_own_parameters_is_told() -> None:
    own = {"SERVO1_FUNCTION": 74.0, "SERVO3_FUNCTION": 74.0, "FOO": 3.0, "CRUISE_SPEED": 200.0, "RNGFND1_TYPE": 10.0}
    own |= {"OA_TYPE": 1.0, "WP_JERK": 3.0}
    file = ParameterFile(Path("x.parm"), own, {})
    told = firmware_parameters(own, SUITES["beams"], steered=False)
    assert file.firmware_notes(told, RECOMMENDED_PARAMETERS) == (
        "x.parm: outside the range that ArduRover documents: CRUISE_SPEED 200 (0 to 100); is that intended?",
        "x.parm: SERVO1_FUNCTION 74 becomes 73, as the simulated rover is built",
        "x.parm: RNGFND1_TYPE 10 becomes 100, as the simulated rover is built",
        "x.parm: OA_TYPE 1: the companion wants 0 (see rover-companion doctor)",
        "x.parm: unknown and passed on unchanged: FOO",
    )
    (note,) = ParameterFile(Path("x.parm"), {"FOO": 3.0}, {}).firmware_notes(None, {})
    assert "--write-params FILE writes the other parameters" in note


def test_every_parameter_that_is_written_is_in_the_manual() -> None:
    """As its own row, or with others by their common beginning."""
    manual = (Path(__file__).parents[3] / "docs" / "sitl.md").read_text(encoding="utf-8")
    table = manual[manual.index("| parameter | value | why |") : manual.index("How it answers:")]
    for name in firmware_parameters(MISSION, SUITES["beams"], steered=False):
        row = re.sub(r"RNGFND\d", "RNGFNDn", name)
        end = re.sub(r"SERVO[13]", "", name)
        assert f"`{row}`" in table or f"`{end}`" in table or f"`{name.replace('3', '1')}`" in table, name


@pytest.mark.parametrize("servo", [1, 3])
def test_pulses_span_what_the_plant_takes(servo: int) -> None:
    told = firmware_parameters({}, SUITES["none"], steered=False)
    pulses = [int(told[f"SERVO{servo}_{end}"]) for end in ("MIN", "TRIM", "MAX")]
    assert [servo_output(pulse) for pulse in pulses] == [-1.0, 0.0, 1.0]


def test_every_rangefinder_is_switched_on_where_it_looks() -> None:
    told = firmware_parameters({}, SUITES["beams"], steered=False)
    for number, beam in enumerate(SUITES["beams"].beams, 1):
        values = [told[f"RNGFND{number}_{what}"] for what in ("TYPE", "ORIENT", "MIN", "MAX")]
        assert values == [100.0, beam.orientation, beam.min_m, beam.max_m]
    assert "RNGFND4_TYPE" not in told


def test_the_file_has_one_parameter_a_line() -> None:
    assert parameter_file({"WP_SPEED": 2.0, "RNGFND1_MIN": 0.2, "AVOID_ENABLE": 0.0}) == (
        "WP_SPEED 2\nRNGFND1_MIN 0.2\nAVOID_ENABLE 0\n"
    )
