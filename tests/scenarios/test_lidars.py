"""Missions with lidars that are wired to the companion: in lock-step with faults, and as processes of their own."""

from __future__ import annotations

import shutil
import socket
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from companion.cli.commands import app
from companion.lidar.spec import parsed
from companion.mapping.map_files import load_map
from companion.recording.reader import load_record
from companion.recording.recorder import NullRecorder, Recorder
from companion.replay.replay import replay
from companion.settings import Settings
from sitl.cli.commands import app as sitl_app
from sitl.faults.plan import Fault, FaultPlan, LidarFault, SensorFault
from sitl.lockstep import Drive, DriveOutcome
from sitl.scenario import scenario_from_mission, with_faults, with_lidars, with_sensors
from sitl.sensors.range_sensors import Defect
from sitl.sensors.serial_lidar import SerialLidar
from tests.sitl.network.test_server import free_port
from tests.support.quick import first_of
from tests.support.records import START_US
from tests.support.rig import yard
from tests.support.served import finished, mission_path, process, wait_until


def drive(
    folder: Path, *lidars: str, faults: tuple[Fault, ...] = (), record: bool = False, limit_s: float = 120.0
) -> Drive:
    """A drive across the yard, which has ended."""
    mission = with_sensors(yard(folder), "none")
    specs = tuple(parsed(text, "simulated") for text in lidars)
    plan = FaultPlan(faults) if faults else None
    scenario = with_lidars(with_faults(scenario_from_mission(mission), plan), specs)
    recorder: Recorder | NullRecorder = NullRecorder()
    if record:
        given = [one.text for one in specs]
        recorder = Recorder(folder / "record", mission, Settings(), 0, arm=True, start_us=START_US, lidars=given)
    run = Drive(mission, scenario, Settings(), 0, recorder, limit_s, lidars=specs)
    run.run()
    recorder.close()
    return run


@first_of(1, "name", ["LD19", "RPLIDAR-A1", "YDLIDAR-X4", "LD06", "RPLIDAR-C1"])
def test_every_model_leads_a_rover_round_the_wall(tmp_path: Path, name: str) -> None:
    report = drive(tmp_path, name).report
    assert (report.outcome, report.collisions) == (DriveOutcome.REACHED, 0)


@pytest.mark.thorough
@pytest.mark.parametrize(
    "mounting", [pytest.param("yaw=120,x=0.3,y=-0.2", marks=pytest.mark.thorough), "flip,yaw=-60,x=-0.3"]
)
def test_however_it_is_mounted_the_wall_is_mapped_where_it_stands(tmp_path: Path, mounting: str) -> None:
    run = drive(tmp_path, f"LD19:{mounting}")
    assert (run.report.outcome, run.report.collisions) == (DriveOutcome.REACHED, 0)
    assert run.companion.evidence is not None
    weights = run.companion.evidence.grid.weights
    assert weights[7, 8] >= 1.0 and weights[7, 4] < 1.0 and weights[7, 12] < 1.0


DRIVING_S = 3.0
"""So long after it has begun to drive a fault begins."""


@pytest.mark.parametrize(
    ("fault", "says"),
    [
        pytest.param(
            LidarFault(DRIVING_S, since="driving", unplugged=True), "lidar 1 (LD19)", marks=pytest.mark.thorough
        ),
        pytest.param(
            LidarFault(DRIVING_S, since="driving", stalled=True), "lidar 1 (LD19)", marks=pytest.mark.thorough
        ),
        pytest.param(
            SensorFault(DRIVING_S, since="driving", defect=Defect.SILENT), "lidar 1 (LD19)", marks=pytest.mark.thorough
        ),
        (SensorFault(DRIVING_S, since="driving", defect=Defect.STUCK), "lidar 1 (LD19)"),
    ],
    ids=["unplugged", "stalled", "silent", "stuck"],
)
def test_a_rover_whose_lidar_fails_stops_touches_nothing_and_says_so(tmp_path: Path, fault: Fault, says: str) -> None:
    run = drive(tmp_path, "LD19", faults=(fault,), limit_s=70.0)
    assert run.report.outcome is DriveOutcome.TIME_LIMIT and run.report.collisions == 0
    assert run.simulator.truth.speed_m_s == pytest.approx(0.0, abs=0.01)
    assert any(says in line for line in run.report.said), run.report.said


@pytest.mark.thorough
def test_a_rover_whose_lidar_gets_no_echo_any_more_stops_and_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The laser is dead, or the window covered; the motor turns and the bytes come."""
    measure = SerialLidar._measure

    def dark(self: SerialLidar, *given: Any) -> Any:
        return measure(self, *given) * (given[-1] < 48.0)

    monkeypatch.setattr(SerialLidar, "_measure", dark)
    run = drive(tmp_path, "LD19", limit_s=70.0)
    assert run.report.outcome is DriveOutcome.TIME_LIMIT and run.report.collisions == 0
    assert run.simulator.truth.speed_m_s == pytest.approx(0.0, abs=0.01)
    assert any("lidar 1 (LD19) has seen nothing" in line for line in run.report.said), run.report.said


@pytest.mark.thorough
def test_it_goes_on_when_the_cable_is_in_again(tmp_path: Path) -> None:
    fault = LidarFault(DRIVING_S, DRIVING_S + 1.5, since="driving", unplugged=True)
    report = drive(tmp_path, "RPLIDAR-C1", faults=(fault,)).report
    assert (report.outcome, report.collisions) == (DriveOutcome.REACHED, 0)
    assert any("lidar 1 (RPLIDAR-C1)" in line for line in report.said)


@pytest.mark.thorough
def test_poor_lines_and_noise_are_borne_and_replayed_bit_by_bit(tmp_path: Path) -> None:
    faults = (LidarFault(lost=0.0005, damaged=0.0005), LidarFault(noise_m=0.03), LidarFault(60.0, 60.3, unplugged=True))
    run = drive(tmp_path, "LD19:yaw=10", "RPLIDAR-A1:yaw=180,x=-0.3", faults=faults, record=True)
    assert (run.report.outcome, run.report.collisions) == (DriveOutcome.REACHED, 0)
    record = load_record(tmp_path / "record")
    assert record.meta.format == 4 and record.complete
    assert record.meta.lidars == ["LD19:simulated:yaw=10", "RPLIDAR-A1:simulated:yaw=180,x=-0.3"]
    assert (tmp_path / "record" / "lidars.bin").stat().st_size > 500_000
    again = replay(record)
    assert again.differences == [] and again.decisions > 5
    assert again.companion is not None and again.companion.evidence is not None
    assert run.companion.evidence is not None
    assert np.array_equal(again.companion.evidence.log_odds, run.companion.evidence.log_odds)


@pytest.fixture(scope="module")
def record(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("lidar")
    drive(folder, "LD19", record=True, limit_s=55.0)
    return folder / "record"


@pytest.mark.thorough
def test_a_record_whose_lidar_bytes_are_cut_is_replayed_as_far_as_they_go(record: Path, tmp_path: Path) -> None:
    copy = Path(shutil.copytree(record, tmp_path / "copy"))
    data = (copy / "lidars.bin").read_bytes()
    (copy / "lidars.bin").write_bytes(data[: len(data) // 2])
    loaded = load_record(copy)
    result = replay(loaded)
    assert result.differences == [] and not loaded.complete
    assert 10.0 < result.seconds < 40.0
    assert any("lidars.bin: ends after" in note for note in loaded.notes)


def test_a_record_whose_lidar_bytes_are_changed_is_refused(record: Path, tmp_path: Path) -> None:
    copy = Path(shutil.copytree(record, tmp_path / "copy"))
    data = bytearray((copy / "lidars.bin").read_bytes())
    data[1000] ^= 1
    (copy / "lidars.bin").write_bytes(data)
    found = CliRunner().invoke(app, ["replay", str(copy)])
    assert found.exit_code == 2 and "lidars.bin: damaged or changed since the run" in found.output


def test_a_record_says_which_lidars_there_were(record: Path, tmp_path: Path) -> None:
    copy = Path(shutil.copytree(record, tmp_path / "copy"))
    meta = (copy / "meta.json").read_text()
    (copy / "meta.json").write_text(meta.replace("LD19:simulated", "LD19:simulated:yaw=5"))
    found = CliRunner().invoke(app, ["replay", str(copy)])
    assert found.exit_code == 2 and "seed, arm or lidars changed since the run" in found.output


@pytest.mark.parametrize(
    ("command", "says"),
    [
        (["drive", "MISSION", "--lidar", "LD20"], "lidar 'LD20': 'LD20' is no model; models are LD06"),
        (["drive", "MISSION", "--lidar", "LD19:up=1"], "lidar 'LD19:up=1': 'up=1' is no option"),
        (["drive", "MISSION", "--lidar", "LD19:/dev/ttyUSB0"], "'LD19:/dev/ttyUSB0': names a port; a simulated lidar"),
        (
            ["serve", "MISSION", "--lidar-pty", "LD19:./tty", "--lidar-pty", "C1:tty:yaw=3"],
            "--lidar-pty 'C1:tty:yaw=3': 'LD19:./tty' has the same path; give each its own",
        ),
        (
            ["drive", "MISSION", "--faults", "FAULTS"],
            "fault 1: there are 0 lidars on serial lines; give them",
        ),
        (["serve", "MISSION", "--lidar-pty", "LD19:/no/such/place"], "--lidar-pty: /no/such/place: No such file"),
    ],
)
def test_what_cannot_be_used_is_told_in_one_line(tmp_path: Path, command: list[str], says: str) -> None:
    mission = mission_path(yard(tmp_path))
    faults = tmp_path / "faults.toml"
    faults.write_text('[[fault]]\nkind = "lidar_stalled"\nstart_s = 1.0\n')
    places = {"MISSION": str(mission), "FAULTS": str(faults)}
    listen = ["--listen", f"tcp:127.0.0.1:{free_port()}"] if command[0] == "serve" else []
    found = CliRunner().invoke(sitl_app, [places.get(word, word) for word in command] + listen)
    assert found.exit_code == 2 and says in found.output
    assert len(found.output.strip().splitlines()) == 1


@pytest.mark.slow
def test_a_whole_mission_in_two_processes_with_a_lidar_on_a_pseudo_terminal(tmp_path: Path) -> None:
    """The cable is pulled for a moment while the autopilot starts."""
    path = mission_path(yard(tmp_path))
    faults = tmp_path / "faults.toml"
    faults.write_text('[[fault]]\nkind = "lidar_unplugged"\nstart_s = 20.0\nduration_s = 2.0\n')
    port, tty, record = free_port(socket.SOCK_STREAM), tmp_path / "tty", tmp_path / "record"
    serve = ("--listen", f"tcp:127.0.0.1:{port}", "--lidar-pty", f"LD19:{tty}:yaw=15", "--faults", faults)
    with process("sitl", "serve", path, *serve) as world:
        wait_until(tty.exists)
        lidar = ("--lidar", f"LD19:{tty}:yaw=15")
        arguments = ("--connect", f"tcp:127.0.0.1:{port}", "--arm", "--record", record)
        with process("companion", "run", path, *lidar, *arguments) as run:
            code, out, err = finished(run)
        world.kill()
    assert code == 0, err
    assert "gate: reached" in out and "Traceback" not in err
    loaded = load_record(record)
    again = replay(loaded)
    assert again.differences == [] and again.decisions > 10
    known = load_map(record / "map.yaml")
    assert known.weights[7, 8] >= 1.0, "the wall"


def test_run_refuses_a_lidar_that_is_not_there_before_anything_is_sent(tmp_path: Path) -> None:
    mission = mission_path(yard(tmp_path))
    place = tmp_path / "none"
    command = ["run", str(mission), "--connect", f"udpin:127.0.0.1:{free_port(socket.SOCK_DGRAM)}"]
    found = CliRunner().invoke(app, [*command, "--lidar", f"LD19:{place}", "--state", str(tmp_path / "state")])
    assert found.exit_code == 2
    assert f"lidar 'LD19:{place}': {place} cannot be opened: there is no such device" in found.output
    twice = ["--lidar", f"LD19:{place}", "--lidar", f"C1:{place}"]
    found = CliRunner().invoke(app, [*command, *twice, "--state", str(tmp_path / "state")])
    assert found.exit_code == 2 and f"{place} is another lidar's port" in found.output


@pytest.mark.parametrize("command", ["run", "doctor"])
def test_one_device_under_two_names_is_told_as_that(tmp_path: Path, command: str) -> None:
    """Names below /dev/serial/by-id are symbolic links."""
    device, by_id = tmp_path / "ttyUSB0", tmp_path / "usb-CP2102"
    device.touch()
    by_id.symlink_to(device)
    given = [command, str(mission_path(yard(tmp_path))), "--connect", f"serial:{device}:115200"]
    found = CliRunner().invoke(app, [*given, "--lidar", f"LD19:{by_id}", "--state", str(tmp_path / "state")])
    says = f"lidar 'LD19:{by_id}': {by_id} and {device} are one device: the autopilot's port (--connect serial:{device}"
    assert found.exit_code == 2 and says in found.output and len(found.output.splitlines()) == 1
    given[-1] = "udpin:127.0.0.1:1"
    lidars = ["--lidar", f"LD19:{device}", "--lidar", f"LD19:{by_id}"]
    found = CliRunner().invoke(app, [*given, *lidars, "--state", str(tmp_path / "state")])
    assert found.exit_code == 2 and f"{by_id} and {device} are one device: another lidar's port" in found.output
