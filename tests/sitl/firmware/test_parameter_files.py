"""Parameter files of ground stations: read, refused with the line, loaded into the simulator, read back by a client."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from typer.testing import CliRunner

from companion.mission.load import load_mission
from companion.mission.mission import MissionError
from sitl.autopilot.parameters import DEFAULTS
from sitl.cli.commands import app
from sitl.firmware.parameter_files import ParameterFile, ParameterFileError, load_parameters
from sitl.firmware.parameter_ranges import RANGES, outside
from sitl.scenario import Scenario, ScenarioError, scenario_from_mission, with_parameter_file
from tests.support.sitl_client import Client

MISSION = "[grid]\nsize = [20, 20]\nhome = [1, 1]\n[[target]]\nfield = [9, 9]\n"


def written(tmp_path: Path, text: str | bytes, name: str = "rover.param") -> Path:
    path = tmp_path / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


@pytest.mark.parametrize(
    "text",
    [
        "#NOTE: 21.11.2026 Rover\nWP_SPEED,1.5\nWP_RADIUS,2\n",
        "WP_SPEED         1.500000\nWP_RADIUS        2.000000  # metres\n",
        "# Vehicle-Id Component-Id Name Value Type\n1\t1\tWP_SPEED\t1.500000000000000000\t9\n1\t1\tWP_RADIUS\t2\t9\n",
        b"\xef\xbb\xbfWP_SPEED,1.5\r\n\r\n  # a remark\r\nWP_RADIUS , 2\r\n",
        "WP_RADIUS 9\nWP_SPEED 1.5 @READONLY\nWP_RADIUS 2",
    ],
    ids=["Mission Planner", "MAVProxy", "QGroundControl", "Windows", "defaults file"],
)
def test_every_ground_stations_file_is_read(tmp_path: Path, text: str | bytes) -> None:
    assert load_parameters(written(tmp_path, text)).values == {"WP_SPEED": 1.5, "WP_RADIUS": 2.0}


def test_types_are_taken_and_other_components_left_out(tmp_path: Path) -> None:
    file = load_parameters(written(tmp_path, "1\t1\tNEW_THING\t7\t4\n1\t154\tGMB_RATE\t3\t9\n1\t1\tODD_TYPE\t7\t99\n"))
    assert file.values == {"NEW_THING": 7.0, "ODD_TYPE": 7.0}
    assert file.types == {"NEW_THING": 4} and file.others == 1


@pytest.mark.parametrize(
    ("text", "place", "reason"),
    [
        ("WP_SPEED,1\nWP_RADIUS\n", ":2:", "not NAME,VALUE"),
        ("WP_SPEED 1 2\n", ":1:", "not NAME,VALUE"),
        ("\n# x\nWP_SPEED,fast\n", ":3:", "WP_SPEED: 'fast' is not a number"),
        ("WP_SPEED nan\n", ":1:", "is not a number"),
        ("WP_SPEED,1e39\n", ":1:", "is not a number"),
        ("WP_SPEED inf\n", ":1:", "write one such as 1.5"),
        ("MAV_SYSID 300\n", ":1:", "MAV_SYSID: 300: a MAVLink system id is 1 to 255; choose one"),
        ("WP_SPEED 1\nMAV_SYSID,0\n", ":2:", "MAV_SYSID: 0: a MAVLink system"),
        ("wp_speed 1\n", ":1:", "'wp_speed' is not a parameter name"),
        ("A_NAME_THAT_IS_TOO_LONG 1\n", ":1:", "not a parameter name"),
        ("<html>,1\n", ":1:", "not a parameter name"),
        ("# nothing\n", ":", "no parameters"),
        (b"WP_SPEED,\xff\n", ":", "not UTF-8 text"),
        (b"WP_SPEED,1\n" * 100_000, ":", "larger than"),
    ],
)
def test_a_bad_line_is_named(tmp_path: Path, text: str | bytes, place: str, reason: str) -> None:
    path = written(tmp_path, text)
    with pytest.raises(ParameterFileError) as caught:
        load_parameters(path)
    assert str(caught.value).startswith(f"{path}{place}") and reason in str(caught.value)
    assert "\n" not in str(caught.value)


@given(st.binary(max_size=200))
def test_any_bytes_are_read_or_refused(tmp_path_factory: pytest.TempPathFactory, data: bytes) -> None:
    path = tmp_path_factory.getbasetemp() / "any.param"
    path.write_bytes(data)
    try:
        assert load_parameters(path).values
    except ParameterFileError as error:
        assert "\n" not in str(error)


def scenario(tmp_path: Path, parameters: str, mission: str = MISSION) -> Scenario:
    file = written(tmp_path, mission, "mission.toml")
    return scenario_from_mission(with_parameter_file(load_mission(file), written(tmp_path, parameters)))


def value_of(client: Client, name: str) -> tuple[float, int]:
    client.send(mavlink.MAVLink_param_request_read_message(1, 1, name.encode(), -1))
    values = [m for m in client.run_for(0.2) if m.get_type() == "PARAM_VALUE" and m.param_id == name]
    assert len(values) == 1
    return values[0].param_value, values[0].param_type


def test_known_ones_count_and_unknown_ones_are_kept(tmp_path: Path) -> None:
    loaded = scenario(tmp_path, "WP_SPEED,1.25\n1 1 FOO_BAR 3.7 4\nNEW_ONE 0.5\nMIS_TOTAL 12\n")
    note = "2 of 4 parameters are not simulated and only stored to be read back: FOO_BAR, NEW_ONE"
    assert loaded.notes == (f"{tmp_path / 'rover.param'}: {note}",)
    client = Client(loaded.simulator(0))
    client.run_for(1.0)
    assert value_of(client, "WP_SPEED") == (1.25, 9)
    assert value_of(client, "FOO_BAR") == (4.0, 4)
    assert value_of(client, "NEW_ONE") == (0.5, 9)
    assert value_of(client, "MIS_TOTAL") == (0.0, 4)
    client.send(mavlink.MAVLink_param_set_message(1, 1, b"NEW_ONE", 0.75, 9))
    client.run_for(0.1)
    client.command(246, 1)
    client.run_for(0.5)
    again = Client(client.simulator)
    again.run_for(1.0)
    assert value_of(again, "NEW_ONE") == (0.75, 9) and value_of(again, "WP_SPEED") == (1.25, 9)


def test_only_the_first_unknown_names_are_told() -> None:
    file = ParameterFile(Path("x.param"), {f"NO_{n}": 1.0 for n in range(700)} | {"WP_SPEED": 1.0}, {})
    assert file.note() == (
        "x.param: 700 of 701 parameters are not simulated and only stored to be read back: "
        "NO_0, NO_1, NO_2, NO_3, NO_4, ..."
    )


def test_values_that_are_most_likely_slips_are_told_in_one_line(tmp_path: Path) -> None:
    odd = "WP_SPEED -3\nATC_DECEL_MAX -5\nTURN_RADIUS -1\nSCHED_LOOP_RATE 0\nWP_RADIUS 1e38\nCRUISE_SPEED 101\n"
    (note,) = scenario(tmp_path, odd).notes
    assert note == (
        f"{tmp_path / 'rover.param'}: outside the range that ArduRover documents: ATC_DECEL_MAX -5 (0 to 10), "
        "CRUISE_SPEED 101 (0 to 100), SCHED_LOOP_RATE 0 (50 to 400), TURN_RADIUS -1 (0 to 10), "
        "WP_RADIUS 1e+38 (0 to 100), ...; is that intended?"
    )
    client = Client(scenario(tmp_path, odd).simulator(0))
    client.run_for(1.0)
    assert value_of(client, "WP_SPEED") == (-3.0, 9)


def test_values_that_contradict_each_other_are_told(tmp_path: Path) -> None:
    (note,) = scenario(tmp_path, "WP_SPEED 1\nWP_RADIUS 2\nWP_SPEED 1.5\nWP_RADIUS 2\n").notes
    assert note == f"{tmp_path / 'rover.param'}: WP_SPEED: given more than once; the last value counts"


def test_nothing_that_the_simulator_starts_with_lies_outside_of_its_range() -> None:
    assert outside({name: value for name, (value, _) in DEFAULTS.items()}) == []
    assert RANGES.keys() <= DEFAULTS.keys()


def test_steered_wheels_without_a_turning_radius_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match=r"rover\.param: TURN_RADIUS -1: steered wheels need"):
        scenario(tmp_path, "SERVO1_FUNCTION 26\nSERVO3_FUNCTION 70\nTURN_RADIUS -1\n")


def test_the_file_says_what_kind_of_rover_it_is_for(tmp_path: Path) -> None:
    wheels = "SERVO1_FUNCTION 26\nSERVO3_FUNCTION 70\nTURN_RADIUS 1.4\nATC_STR_RAT_FF 1.1\n"
    loaded = scenario(tmp_path, wheels)
    assert loaded.turning_radius_m == 1.4 and loaded.parameters["ATC_STR_RAT_FF"] == 1.1 and not loaded.notes
    car = "[rover]\nturning_radius_m = 2.0\n" + MISSION
    assert scenario(tmp_path, wheels, car).turning_radius_m == 2.0
    assert scenario(tmp_path, "WP_SPEED 1\n", car).turning_radius_m == 2.0
    skid = "SERVO1_FUNCTION 73\nSERVO3_FUNCTION 74\n"
    assert scenario(tmp_path, skid, car).turning_radius_m == 0.0
    with pytest.raises(ScenarioError, match=r"skid steering, the mission says steering ackermann"):
        scenario(tmp_path, skid, car + "[sitl]\nsteering = 'ackermann'\n")
    with pytest.raises(ScenarioError, match=r"steered wheels, the mission says steering skid"):
        scenario(tmp_path, wheels, MISSION + "[sitl]\nsteering = 'skid'\n")


def test_motors_that_are_wired_otherwise_are_told_of(tmp_path: Path) -> None:
    (note,) = scenario(tmp_path, "SERVO1_FUNCTION 74\nSERVO3_FUNCTION 73\nSERVO3_REVERSED 1\n").notes
    assert "SERVO1_FUNCTION 74, SERVO3_FUNCTION 73, SERVO3_REVERSED 1: the simulated motors" in note


def test_a_mission_may_name_its_parameters(tmp_path: Path) -> None:
    written(tmp_path, "WP_SPEED 0.7\n")
    mission = load_mission(written(tmp_path, MISSION + "[sitl]\nparameters = 'rover.param'\n", "mission.toml"))
    assert scenario_from_mission(mission).parameters["WP_SPEED"] == 0.7


@pytest.mark.parametrize("command", ["drive", "serve"])
def test_a_bad_file_gets_one_line(tmp_path: Path, command: str) -> None:
    mission, bad = written(tmp_path, MISSION, "mission.toml"), written(tmp_path, "WP_SPEED fast\n", "bad.param")
    result = CliRunner().invoke(app, [command, str(mission), "--params", str(bad)])
    assert result.exit_code == 2 and result.output == (
        f"{bad}:1: WP_SPEED: 'fast' is not a number for a parameter; write one such as 1.5, or put # before the line\n"
    )
    result = CliRunner().invoke(app, [command, str(mission), "--params", str(tmp_path / "none.param")])
    assert result.exit_code == 2 and result.output.count("\n") == 1 and "cannot be read" in result.output


def test_a_companion_is_not_let_loose_on_wheels_that_it_does_not_know_of(tmp_path: Path) -> None:
    mission = written(tmp_path, MISSION, "mission.toml")
    wheels = written(tmp_path, "SERVO1_FUNCTION 26\nSERVO3_FUNCTION 70\nTURN_RADIUS 1.4\n")
    result = CliRunner().invoke(app, ["drive", str(mission), "--params", str(wheels)])
    assert result.exit_code == 2 and "[rover] turning_radius_m = 1.4" in result.output


def test_an_unknown_key_is_still_refused(tmp_path: Path) -> None:
    with pytest.raises(MissionError, match="params"):
        load_mission(written(tmp_path, MISSION + "[sitl]\nparams = 'x'\n", "mission.toml"))
