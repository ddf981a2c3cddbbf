"""``rover-companion params``: files that ground stations take, and the comparison with the simulated autopilot."""

from __future__ import annotations

import json
import socket
from pathlib import Path
from typing import Any

import pytest
from pymavlink import mavparm
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from typer.testing import CliRunner

from companion.cli.commands import app
from companion.mavlink.byte_link import MemoryLink
from companion.mavlink.parameter_reader import ParameterReader
from companion.mavlink.signing import Signer
from companion.settings import LinkSettings
from companion.vehicle.wanted_parameters import for_rover, wanted_parameters
from sitl.firmware.parameter_files import load_parameters
from tests.sitl.network.test_server import free_port
from tests.support.mavlink_vehicle import Station
from tests.support.party import KEY, TIME
from tests.support.rig import yard
from tests.support.served import Served

MISSION = "[[target]]\nnorth_m = 5.0\neast_m = 0.0\n[rover]\ncruise_speed_m_s = 0.5\n"
ALL = {one.name: one.value for one in for_rover(wanted_parameters(0.5), guard=True, station=True)}


def params(*words: object) -> Any:
    return CliRunner().invoke(app, ["params", *map(str, words)])


@pytest.mark.parametrize("suffix", [".param", ".parm", ".params"])
def test_a_file_is_what_ground_stations_read(tmp_path: Path, suffix: str) -> None:
    mission, file = tmp_path / "way.toml", tmp_path / f"rover{suffix}"
    mission.write_text(MISSION)
    answer = params("--write", file, "--mission", mission, "--guard", "--station")
    assert answer.exit_code == 0 and answer.output.startswith(f"wrote {file}: {len(ALL)} parameters"), answer.output
    read = load_parameters(file)
    assert read.values == pytest.approx(ALL)
    if suffix == ".params":
        assert set(read.types) == set(ALL)
    else:
        loaded = mavparm.MAVParmDict()
        assert loaded.load(str(file), use_excludes=False) and dict(loaded) == pytest.approx(ALL)


def test_what_is_not_for_this_rover_is_a_comment(tmp_path: Path) -> None:
    assert params("--write", tmp_path / "rover.param").exit_code == 0
    assert "FS_GCS_ENABLE" not in load_parameters(tmp_path / "rover.param").values
    assert "only with a ground station (--station): FS_GCS_ENABLE 1" in (tmp_path / "rover.param").read_text()


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["--write", "rover.txt"], "rover.txt: end its name in .param"),
        (
            ["--write", "nowhere/rover.param"],
            "nowhere/rover.param: there is no folder nowhere; make it, or name another",
        ),
        (["--connect", "udpin:127.0.0.1:1"], "--connect and --json go with --check"),
        (["--check"], "name the rover with --connect"),
        (["--mission", "none.toml"], "none.toml"),
        (["--check", "--connect", "bluetooth:1"], "is not a link"),
    ],
)
def test_bad_input_is_one_line(words: list[str], says: str) -> None:
    answer = params(*words)
    assert answer.exit_code == 2 and says in answer.output and answer.output.count("\n") == 1


def test_the_table_alone() -> None:
    answer = params()
    assert answer.exit_code == 0 and "WP_RADIUS" in answer.output and "SCR_ENABLE" not in answer.output


@pytest.mark.slow
def test_compared_with_the_rover(tmp_path: Path) -> None:
    """As it comes, the simulated rover has what is wanted; then one is set wrong."""
    served = Served(yard(tmp_path))
    try:
        check = ["--check", "--connect", served.url, "--state", tmp_path / "state"]
        answer = params(*check)
        assert answer.exit_code == 0 and answer.output.endswith("all 11 are as wanted\n"), answer.output
        assert served.simulator._vehicle.parameters.set("GUID_OPTIONS", 64.0)
        answer = params(*check, "--guard", "--json")
    finally:
        served.close()
    assert answer.exit_code == 3
    rows = {row["name"]: row for row in json.loads(answer.output)["parameters"]}
    assert [name for name, row in rows.items() if not row["fine"]] == ["GUID_OPTIONS", "SCR_ENABLE"]
    assert (rows["GUID_OPTIONS"]["wanted"], rows["GUID_OPTIONS"]["is"]) == ("without 64", 64.0)


def test_nobody_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("companion.cli.params.HEARD_S", 0.3)
    answer = params("--check", "--connect", f"udpin:127.0.0.1:{free_port(socket.SOCK_DGRAM)}", "--state", tmp_path)
    assert answer.exit_code == 4 and "no rover is heard" in answer.output


# The reader --------------------------------------------------------------------------------------------------------


class Rover:
    """An autopilot that answers some parameters, each only when asked for the third time."""

    def __init__(self, values: dict[str, float], signer: Signer | None = None) -> None:
        self.near, self.far = MemoryLink.pair()
        self.reader = ParameterReader(self.near, LinkSettings(), ["WP_SPEED", "OA_TYPE"], signer)
        self.values, self.asked = values, list[str]()
        self.sent: list[Any] = []
        self._station, self._parser = Station(1, 1), mavlink.MAVLink(None)

    def run(self, limit_s: float) -> float:
        """Until the reader is done; gives the time."""
        now_s = 0.0
        while not self.reader.done(now_s) and now_s < limit_s:
            self.far.write(self._station.heartbeat())
            self.reader.step(now_s)
            for message in self._parser.parse_buffer(self.far.read()) or []:
                self.sent.append(message)
                if message.get_type() == "PARAM_REQUEST_READ":
                    self._answer(message.param_id)
            now_s += 0.05
        return now_s

    def _answer(self, name: str) -> None:
        self.asked.append(name)
        if self.asked.count(name) == 3 and name in self.values:
            value = mavlink.MAVLink_param_value_message(name.encode(), self.values[name], 9, 1, 0)
            self.far.write(self._station.pack(value))


def test_a_line_that_loses_requests_is_asked_again_and_what_is_unknown_ends() -> None:
    rover = Rover({"WP_SPEED": 1.5, "OA_TYPE": 0.0})
    assert rover.run(20.0) < 2.0 and rover.reader.values == {"WP_SPEED": 1.5, "OA_TYPE": 0.0}
    silent = Rover({"WP_SPEED": 1.5})
    assert silent.run(20.0) < 3.0 and silent.reader.values == {"WP_SPEED": 1.5}
    assert silent.asked.count("OA_TYPE") == 5


def test_it_only_reads() -> None:
    rover = Rover({})
    rover.run(5.0)
    assert {m.get_type() for m in rover.sent} == {"PARAM_REQUEST_READ"}
    assert {(m.get_srcSystem(), m.get_srcComponent()) for m in rover.sent} == {(1, 192)}


def test_a_rover_that_does_not_sign_is_not_believed() -> None:
    rover = Rover({}, Signer(KEY, lambda: TIME))
    rover.run(2.0)
    assert not rover.reader.rover_heard and rover.reader.signing_trouble
