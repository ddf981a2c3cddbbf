"""The doctor at the simulated autopilot: each fault made and found; and nothing ever sent that could move a rover."""

from __future__ import annotations

import json
import socket
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from typer.testing import CliRunner

from companion.cli.commands import app
from companion.cli.doctor import _looked_at, _summary, mission_line, of_mission
from companion.control.following import Following
from companion.control.model_estimate import ModelEstimate
from companion.core.frames import LocalFrame, NedPoint
from companion.diagnosis.checks import PARAMETERS, diagnose
from companion.diagnosis.finding import Level
from companion.executive.open_gaps import map_at_start, open_gap_m
from companion.mavlink.byte_link import MemoryLink
from companion.mavlink.signing import Signer
from companion.mavlink.surveyor import Surveyor
from companion.mission.given import Given
from companion.mission.load import load_mission
from companion.settings import Settings, parse_settings
from sitl.scenario import scenario_from_mission
from tests.sitl.network.test_server import free_port
from tests.support.mavlink_vehicle import Station
from tests.support.party import KEY, TIME
from tests.support.quick import first_of
from tests.support.rig import yard
from tests.support.served import finished, mission_path, process
from tests.support.shared_data import SHARED, needs_shared
from tests.support.tlog import raw_packets

READY_S = 50.0
HARMLESS = {511, 512, 401}
"""SET_MESSAGE_INTERVAL, REQUEST_MESSAGE, RUN_PREARM_CHECKS."""
MANUAL, GUIDED = 0, 15


@dataclass
class Case:
    """A simulated rover and the doctor's line to it."""

    folder: Path
    values: Mapping[str, float] = field(default_factory=dict)
    sensors: str | None = None
    on_s: float = READY_S
    port: int = 0
    signer: Signer | None = None
    before: Callable[[Any, Any], None] = lambda simulator, pilot: None
    change: Callable[[Any], bool] = lambda message: True
    also: Callable[[int], bytes] = lambda tick: b""
    seconds: float = 12.0
    sent: list[Any] = field(default_factory=list)

    def findings(self) -> dict[str, Level]:
        scenario = scenario_from_mission(yard(self.folder))
        guarded = {"SCR_ENABLE": 1.0, "SCR_USER1": 300.0}
        parameters = {**scenario.parameters, "FS_GCS_ENABLE": 0.0, **guarded, **self.values}
        scenario = replace(scenario, parameters=parameters, sensors=self.sensors or scenario.sensors)
        simulator = scenario.simulator(0)
        simulator.advance_to_s(self.on_s)
        near, far = MemoryLink.pair()
        vehicle, pilot = simulator.connect(self.port), simulator.connect()
        self.before(simulator, pilot)
        simulator.advance_to_s(self.on_s + 0.2)
        modes = {(simulator.time_s, int(m.custom_mode), m.base_mode) for m in heartbeats(pilot.take())}
        vehicle.take()
        examination = Surveyor(near, Settings().link, PARAMETERS, self.signer)
        parser, listener = mavlink.MAVLink(None), mavlink.MAVLink(None)
        start_s = simulator.time_s
        while not examination.done and simulator.time_s - start_s < self.seconds:
            examination.step(simulator.time_s)
            said = far.read()
            self.sent += parser.parse_buffer(said) or []
            vehicle.receive(said)
            simulator.advance_to_s(simulator.time_s + 0.05)
            heard = listener.parse_buffer(vehicle.take()) or []
            far.write(b"".join(bytes(m.get_msgbuf()) for m in heard if self.change(m)) + self.also(len(self.sent)))
        after = heartbeats(pilot.take())
        assert len({(m.custom_mode, m.base_mode) for m in after} | {(mode, base) for _, mode, base in modes}) <= 1
        self.untouched(simulator)
        self.result = examination.result()
        return {finding.name: finding.level for finding in reversed(diagnose(self.result))}

    def untouched(self, simulator: Any) -> None:
        """Nothing went out that could move the rover, and it has not moved."""
        for message in self.sent:
            kind = message.get_type()
            assert kind in ("PARAM_REQUEST_READ", "COMMAND_LONG"), kind
            assert kind != "COMMAND_LONG" or message.command in HARMLESS
            assert (message.get_srcSystem(), message.get_srcComponent()) == (1, 192)
        assert simulator.driven_m < 0.01


def heartbeats(data: bytes) -> list[Any]:
    heard = mavlink.MAVLink(None).parse_buffer(data) or []
    return [m for m in heard if m.get_type() == "HEARTBEAT" and m.get_srcComponent() == 1]


def said(*commands: Any) -> Callable[[Any, Any], None]:
    """A person does this before the doctor comes."""

    def before(simulator: Any, pilot: Any) -> None:
        mav = mavlink.MAVLink(None, 255, 190)
        for command in commands:
            if not isinstance(command, tuple):
                pilot.receive(command.pack(mav))
            else:
                values = [*command[1:], *[0.0] * (8 - len(command))]
                pilot.receive(mavlink.MAVLink_command_long_message(1, 1, command[0], 0, *values).pack(mav))

    return before


def test_a_rover_that_is_well(tmp_path: Path) -> None:
    case = Case(tmp_path)
    assert case.findings() == {"gcs-failsafe": Level.NOTE}
    assert case.result.version == (4, 7, 0)
    assert set(case.result.parameters) == set(PARAMETERS) - {"SYSID_MYGCS"}
    assert _summary(case.result)["guard_waits_s"] == 0.3
    assert {m.command for m in case.sent if m.get_type() == "COMMAND_LONG"} == HARMLESS


S, W, N = Level.STOP, Level.WARN, Level.NOTE


@first_of(4,
    ("values", "finding", "level"),
    [
        ({"OA_TYPE": 1}, "oa-type", S),
        ({"AVOID_ENABLE": 7}, "avoid-enable", S),
        ({"GUID_OPTIONS": 64}, "guid-options", S),
        ({"GUID_TIMEOUT": 10}, "guid-timeout", W),
        ({"WP_RADIUS": 3}, "wp-radius", W),
        ({"WP_SPEED": 0}, "wp-speed", W),
        ({"PRX1_TYPE": 2}, "echo", N),
        ({"FS_GCS_ENABLE": 1}, "gcs-failsafe", W),
        ({"FS_GCS_ENABLE": 1, "MAV_GCS_SYSID": 1}, "system-ids", S),
        ({"FENCE_ENABLE": 1}, "fence", N),
        ({"FS_ACTION": 1}, "failsafe-action", W),
        ({"FS_EKF_ACTION": 0}, "failsafe-action", W),
    ],
)  # fmt: skip
def test_a_parameter_that_is_set_wrong(tmp_path: Path, values: dict[str, float], finding: str, level: Level) -> None:
    assert Case(tmp_path, values).findings()[finding] is level


def test_just_switched_on(tmp_path: Path) -> None:
    case = Case(tmp_path, on_s=3.0, seconds=7.5)
    findings = case.findings()
    assert "LOCAL_POSITION_NED" in {one.name for one in case.result.slow} and "rate" not in findings
    assert {"ekf", "origin", "pre-arm"} <= findings.keys()
    assert set(findings.values()) >= {S}


def test_no_range_sensor(tmp_path: Path) -> None:
    assert Case(tmp_path, sensors="none").findings()["no-range-sensor"] is S


def test_somebody_is_driving(tmp_path: Path) -> None:
    assert Case(tmp_path, before=said((400, 1))).findings()["mode"] is S


def test_armed_in_guided(tmp_path: Path) -> None:
    findings = Case(tmp_path, before=said((176, 1, GUIDED), (400, 1))).findings()
    assert findings["armed"] is N and "mode" not in findings


def test_rates_that_do_not_arrive(tmp_path: Path) -> None:
    count = [0]

    def slow(message: Any) -> bool:
        if message.get_type() != "ATTITUDE":
            return True
        count[0] += 1
        return count[0] % 40 == 0

    assert Case(tmp_path, change=slow).findings()["rate"] is S


def test_another_companion(tmp_path: Path) -> None:
    station = Station(1, 191)
    beat = mavlink.MAVLink_heartbeat_message(18, 8, 0, 0, 4, 3)
    assert Case(tmp_path, also=lambda tick: station.pack(beat)).findings()["two-companions"] is S


def test_another_rover(tmp_path: Path) -> None:
    station = Station(7, 1)
    assert (
        Case(tmp_path, also=lambda tick: station.heartbeat() if tick > 10 else b"").findings()["several-autopilots"]
        is W
    )


def test_a_key_that_is_missing_or_another_one(tmp_path: Path) -> None:
    setup = said(mavlink.MAVLink_setup_signing_message(1, 1, list(KEY), TIME))
    assert Case(tmp_path, before=setup, port=1).findings()["signing"] is W
    other = Signer(b"o" * 32, lambda: TIME)
    wrong = Case(tmp_path, before=setup, port=1, signer=other)
    assert wrong.findings() == {"signing": S} and wrong.result.unbelieved == 1
    assert "name with --signing-key the key that the autopilot was given" in diagnose(wrong.result)[0].remedy
    right = Case(tmp_path, before=setup, port=1, signer=Signer(KEY, lambda: TIME + 2 * 6_000_000))
    assert right.findings() == {"gcs-failsafe": N}


def test_a_key_that_only_we_have(tmp_path: Path) -> None:
    case = Case(tmp_path, port=1, signer=Signer(KEY, lambda: TIME))
    assert case.findings() == {"signing": S} and case.result.unbelieved == 1
    (finding,) = diagnose(case.result)
    assert finding.remedy.startswith("give the autopilot the key") and "leave --signing-key out" in finding.remedy


@needs_shared
def test_what_real_firmware_said() -> None:
    """A recording of ArduRover 4.7 with three rangefinders, while another companion drove it."""
    near, far = MemoryLink.pair()
    examination = Surveyor(near, Settings().link, PARAMETERS)
    for number, raw in enumerate(raw_packets(SHARED / "data" / "ardurover-4.7-transcripts" / "rangefinders.tlog")):
        far.write(raw)
        examination.step(0.005 * number)
        if number == 20_000:
            break
    seen = examination.result()
    ahead = [one for one in seen.sources if one.orientation == 0]
    assert [(one.message, one.component, one.min_m, one.max_m) for one in ahead] == [("DISTANCE_SENSOR", 1, 0.2, 20.0)]
    names = {finding.name: finding.level for finding in diagnose(seen)}
    assert names["two-companions"] is S and names["armed"] is N
    assert not {"no-range-sensor", "not-ahead", "range-limits", "ekf", "no-position", "not-a-rover"} & names.keys()


def test_no_rover_but_a_copter_or_nobody() -> None:
    for data, finding in ((Station(1, 1).heartbeat(kind=2), "not-a-rover"), (b"", "no-autopilot")):
        near, far = MemoryLink.pair()
        examination = Surveyor(near, Settings().link, PARAMETERS)
        far.write(data)
        for tick in range(100):
            examination.step(0.05 * tick)
        assert [one.name for one in diagnose(examination.result())] == [finding]
        sent = mavlink.MAVLink(None).parse_buffer(far.read()) or []
        assert {(m.get_type(), m.command) for m in sent} == {("COMMAND_LONG", 512)}
        assert 4 <= len(sent) <= 6


@given(st.lists(st.binary(max_size=300), max_size=6))
def test_any_bytes_are_survived(pieces: list[bytes]) -> None:
    near, far = MemoryLink.pair()
    examination = Surveyor(near, Settings().link, PARAMETERS)
    far.write(Station().heartbeat())
    for tick, piece in enumerate(pieces):
        far.write(piece)
        examination.step(float(tick))
    assert all(finding.says for finding in diagnose(examination.result()))


@given(st.data())
def test_any_values_in_what_it_looks_at_are_survived(data: st.DataObject) -> None:
    """Whole packets with any bytes for their fields, of anybody."""
    near, far = MemoryLink.pair()
    examination = Surveyor(near, Settings().link, PARAMETERS)
    far.write(Station().heartbeat())
    for tick in range(4):
        number = data.draw(st.sampled_from([0, 1, 22, 132, 148, 173, 193, 242, 253, 330]))
        kind = mavlink.mavlink_map[number]
        payload = data.draw(st.binary(min_size=kind.unpacker.size, max_size=kind.unpacker.size))
        who = data.draw(st.sampled_from([1, 2, 255])), data.draw(st.sampled_from([1, 191, 196]))
        head = bytes([len(payload), 0, 0, tick, *who]) + number.to_bytes(3, "little")
        check = int(mavlink.x25crc(head + payload + bytes([kind.crc_extra])).crc)
        far.write(b"\xfd" + head + payload + check.to_bytes(2, "little"))
        examination.step(float(tick))
    for finding in diagnose(examination.result()):
        assert finding.says


# Processes ----------------------------------------------------------------------------------------------------------


@contextmanager
def simulator(folder: Path, *options: object) -> Iterator[str]:
    url = f"tcp:127.0.0.1:{free_port()}"
    with process("sitl", "serve", mission_path(yard(folder)), "--listen", url, "--speedup", 10, *options) as serve:
        assert serve.stdout is not None
        yield url


@pytest.mark.thorough
@pytest.mark.slow
def test_a_parameter_file_with_faults_as_people_see_them(tmp_path: Path) -> None:
    wrong = tmp_path / "wrong.param"
    wrong.write_text("OA_TYPE,1\nAVOID_ENABLE,7\nWP_RADIUS,3\n")
    with (
        simulator(tmp_path, "--params", wrong) as url,
        process("companion", "doctor", "--connect", url, "--json", "--seconds", 40) as child,
    ):
        code, out, err = finished(child)
    assert code == 3, err
    findings = {one["name"]: one for one in json.loads(out)["findings"]}
    assert (findings["oa-type"]["parameter"], findings["oa-type"]["wanted"]) == ("OA_TYPE", 0.0)
    assert {"avoid-enable", "wp-radius"} <= findings.keys()


@pytest.mark.parametrize("as_json", [True, False])
def test_a_rover_that_is_not_believed_has_been_heard(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, as_json: bool
) -> None:
    key = tmp_path / "key"
    key.write_text("words\n")
    key.chmod(0o600)
    near, far = MemoryLink.pair()
    far.write(Station(3, 1).heartbeat())
    monkeypatch.setattr("companion.cli.doctor.open_link", lambda url: near)
    options = ["--connect", "here", "--seconds", "1", "--signing-key", str(key), "--state", str(tmp_path / "state")]
    answer = CliRunner().invoke(app, ["doctor", *options, *(["--json"] if as_json else [])])
    assert answer.exit_code == 3
    if as_json:
        heard = json.loads(answer.output)["heard"]
        assert (heard["rover"], heard["unbelieved"]) == (False, 3)
    else:
        assert "\nrover: system 3, on " in answer.output and "heard but not believed" in answer.output
        assert "give the autopilot" in answer.output and "--signing-key out" in answer.output


def test_nobody_there(tmp_path: Path) -> None:
    url = f"udpin:127.0.0.1:{free_port(socket.SOCK_DGRAM)}"
    answer = CliRunner().invoke(app, ["doctor", "--connect", url, "--seconds", "1", "--state", str(tmp_path)])
    assert answer.exit_code == 4
    assert "Nothing is heard" in answer.output


def test_how_the_rover_followed_in_the_last_run_is_among_the_figures(monkeypatch: pytest.MonkeyPatch) -> None:
    estimate: ModelEstimate | None = ModelEstimate(Following(), Following(turn_gain=1.25), 60.0, 60.0, 60.0)
    monkeypatch.setattr("companion.cli.doctor.last_estimate", lambda directory: estimate)
    ask = ["doctor", "--connect", f"udpin:127.0.0.1:{free_port(socket.SOCK_DGRAM)}", "--seconds", "1", "--json"]
    followed = json.loads(CliRunner().invoke(app, ask).output)["followed"]
    assert (followed["known"], followed["turn_gain"], followed["dead_s"]) == (1.0, 1.25, 0.3)
    estimate = ModelEstimate(Following(), Following())
    assert json.loads(CliRunner().invoke(app, ask).output)["followed"] is None


@pytest.mark.parametrize("warm", [True, False])
def test_kernels_that_are_not_compiled_are_told_of(monkeypatch: pytest.MonkeyPatch, warm: bool) -> None:
    monkeypatch.setattr("companion.cli.doctor.kernels_warm", lambda settings: warm)
    url = f"udpin:127.0.0.1:{free_port(socket.SOCK_DGRAM)}"
    answer = CliRunner().invoke(app, ["doctor", "--connect", url, "--seconds", "1", "--json"])
    names = [one["name"] for one in json.loads(answer.output)["findings"]]
    assert names == ["no-autopilot", *([] if warm else ["kernels-cold"])]


def test_a_link_that_is_none() -> None:
    answer = CliRunner().invoke(app, ["doctor", "--connect", "bluetooth:1"])
    assert answer.exit_code == 2 and "udpin:HOST:PORT" in answer.output


def test_a_mission_is_looked_at_from_where_the_rovers_home_is(tmp_path: Path) -> None:
    case = Case(tmp_path)
    case.findings()
    home = case.result.vehicle.home
    assert home is not None
    far = LocalFrame(home.point).to_geo(NedPoint(0.0, 1200.0))
    place = f"lat_deg = {far.lat_deg}\nlon_deg = {far.lon_deg}\n"
    for text, found in (
        ("[[target]]\nnorth_m = 30\neast_m = 0\n", [("fields", N)]),
        (f"[[target]]\n{place}", [("far-target", W), ("fields", N)]),
        (f"[[target]]\n{place}[grid]\nresolution_m = 0.2\n", [("mission", S)]),
        ("[[target]]\nnorth_m = 30\neast_m = 0\n[grid]\nresolution_m = 1\n", []),
    ):
        (tmp_path / "m.toml").write_text(text)
        mission = load_mission(tmp_path / "m.toml")
        findings = of_mission(mission, case.result, Settings())
        line = mission_line(mission, case.result, findings)
        is_so = "it can be laid out round the rover's home" if all(level is N for _, level in found) else "see below"
        assert line == f"mission m: 1 target; {is_so}"
        assert [(one.name, one.level) for one in findings] == found
        assert all("\n" not in one.says and one.remedy for one in findings)


@pytest.mark.parametrize("turning_radius_m", [0.0, 2.0])
def test_gaps_are_those_of_the_map_that_the_run_would_lay(tmp_path: Path, turning_radius_m: float) -> None:
    """On large ground cells are larger than they are wanted; for a rover that needs arcs no motions are planned."""
    case = Case(tmp_path)
    case.findings()
    home = case.result.vehicle.home
    assert home is not None
    rover = f"[rover]\nturning_radius_m = {turning_radius_m}\n"
    (tmp_path / "m.toml").write_text(f"{rover}[[target]]\nnorth_m = 250\neast_m = 250\n")
    mission, settings = load_mission(tmp_path / "m.toml"), Settings()
    planned = parse_settings({"guidance": {"controller": "motion-ga"}}, "test")
    led = settings if turning_radius_m else planned
    (fields,) = of_mission(mission, case.result, planned)
    gap_m = open_gap_m(mission.rover, map_at_start(mission, led, home.point, narrow_sight=False))
    assert f"through gaps of {gap_m:.1f} m or more" in fields.says


def test_what_run_would_refuse_of_a_mission_is_found_and_options_are_those_of_run(tmp_path: Path) -> None:
    file = tmp_path / "m.waypoints"
    home, place, camera = (
        "0\t1\t0\t16\t0\t0\t0\t0\t53.1325\t23.1688\t0\t1",
        "1\t0\t3\t16\t0\t0\t0\t0\t53.1326\t23.1689\t0\t1",
        "2\t0\t3\t530\t0\t0\t0\t0\t0\t0\t0\t1",
    )
    file.write_text("\n".join(("QGC WPL 110", home, place, camera, "")))
    mission, found = _looked_at(file, Given(radius_m=0.6), skip=False)
    assert mission.rover.radius_m == 0.6 and len(mission.targets) == 1
    (one,) = found
    assert (one.name, one.level) == ("mission-items", S) and "530" in one.says and "--skip-unknown" in one.says
    assert _looked_at(file, Given(), skip=True)[1] == []
