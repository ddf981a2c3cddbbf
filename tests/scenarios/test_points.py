"""Obstacle points end to end: the simulator publishes them, the companion drives by them, replays repeat them."""

from __future__ import annotations

import shutil
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import pytest

from companion.mission.load import load_mission
from companion.recording.reader import load_record
from companion.recording.recorder import Recorder
from companion.replay.replay import replay
from companion.settings import Settings
from sitl.lockstep import Drive
from sitl.scenario import scenario_from_mission
from sitl.sensors.range_sensors import Lidar, SensorSuite
from tests.docs.test_docs import blocks
from tests.scenarios.test_doctor import Case
from tests.sitl.network.test_server import free_port
from tests.support.served import Served, mission_path, process, wait_until

MISSIONS = Path(__file__).resolve().parents[2] / "missions"
CAMERA = SensorSuite(lidar=Lidar(5.0, -42.5, 0.3, 6.0, rays=5, sectors=18, as_points=True))


@pytest.mark.thorough
def test_the_simulated_camera_drives_round_a_post_and_its_record_is_replayed_the_same(tmp_path: Path) -> None:
    mission = load_mission(MISSIONS / "first-drive" / "post.toml")
    scenario = replace(scenario_from_mission(mission), sensors=CAMERA)
    recorder = Recorder(tmp_path / "record", mission, Settings(), 0, arm=True)
    drive = Drive(mission, scenario, Settings(), 0, recorder, 120.0)
    assert drive.run().exit_code == 0
    recorder.close()
    assert drive.simulator.collisions == ()
    seen = drive.companion.vehicle.scan
    assert seen is not None and (seen.scan.source, seen.scan.sender) == ("obstacle points 0", 196)
    again = replay(load_record(tmp_path / "record"))
    assert again.differences == [] and again.heard > 1000


def test_the_doctor_knows_the_camera(tmp_path: Path) -> None:
    case = Case(tmp_path, sensors=CAMERA)  # type: ignore[arg-type]
    assert set(case.findings()) == {"gcs-failsafe"}
    (source,) = case.result.sources
    assert (source.message, source.component, source.frame, source.blind) == ("OBSTACLE_DISTANCE_3D", 196, 12, False)
    assert source.rate_hz == pytest.approx(10.0, abs=0.5) and source.max_m == pytest.approx(6.0)


# The publisher of docs/depth-cameras.md ----------------------------------------------------------------------------


def published_code() -> str:
    (code,) = (text for where, text in blocks("python") if where.startswith("depth-cameras.md"))
    return code


@contextmanager
def publisher(code: str, folder: Path, place: str) -> Iterator[subprocess.Popen[bytes]]:
    script = folder / "publish.py"
    script.write_text(code, encoding="utf-8")
    with subprocess.Popen([sys.executable, str(script), place]) as child:
        yield child
        child.kill()


def test_the_publisher_of_the_page_is_short() -> None:
    assert len([line for line in published_code().splitlines() if line.strip()]) <= 30


@pytest.mark.slow
def test_a_blind_rover_drives_by_the_publisher_of_the_page_and_stops_without_it(tmp_path: Path) -> None:
    """Three processes: the simulated rover, the companion, the camera's program. Nobody else sees anything."""
    shutil.copytree(MISSIONS / "first-drive", tmp_path / "first")
    mission = load_mission(tmp_path / "first" / "five-metres.toml")
    assert mission.sitl is not None
    blind = replace(mission, sitl=replace(mission.sitl, sensors="none"))
    port = free_port(socket.SOCK_DGRAM)
    served = Served(blind, f"udpout:127.0.0.1:{port}")
    try:
        run = ["run", mission_path(mission), "--connect", f"udpin:127.0.0.1:{port}", "--arm"]
        with process("companion", *run, watchdogs=True) as child:
            said = ""
            while "no range data ahead" not in said:
                said += child.stderr.readline()
            assert served.simulator.driven_m < 0.05
            with publisher(published_code(), tmp_path, f"udpout:127.0.0.1:{port}"):
                wait_until(lambda: served.simulator.driven_m > 0.4)
            while "Stopping" not in said:  # the camera is gone
                said += child.stderr.readline()
            assert served.simulator.driven_m < 4.0 and served.simulator.collisions == ()
    finally:
        served.close()


def test_a_wall_that_the_publisher_reports_is_one(tmp_path: Path) -> None:
    code = published_code().replace("return [MAX_M] * COLUMNS", "return [1.0] * COLUMNS")
    assert "return [1.0]" in code
    port = free_port(socket.SOCK_DGRAM)
    with socket.socket(type=socket.SOCK_DGRAM) as ear, publisher(code, tmp_path, f"udpout:127.0.0.1:{port}"):
        ear.bind(("127.0.0.1", port))
        ear.settimeout(60.0)
        from tests.companion.mavlink.test_points import Listener

        listener, scans = Listener(), []
        for tick in range(60):
            scans += listener.scans(ear.recv(1000), 10.0 + 0.001 * tick)
    assert any(len(scan.range_m) >= 17 and scan.looks_ahead and float(scan.range_m.max()) < 1.01 for scan in scans)
