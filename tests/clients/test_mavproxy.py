"""MAVProxy as the ground station beside a companion that drives: it types what a person types."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from pymavlink import mavwp

from companion.settings.tunable_parameters import TABLE
from tests.clients.program import Program, installed, program
from tests.clients.scene import HOME_DEG, PLACES, Scene, metres_from_home, scene
from tests.scenarios.test_mavwp import send
from tests.support.rig import GUIDED, HOLD

AROUND = ((-1e-3, -1e-3), (1e-3, -1e-3), (1e-3, 1e-3), (-1e-3, 1e-3))
CORNERS = [(HOME_DEG[0] + north, HOME_DEG[1] + east) for north, east in AROUND]
GEOFENCE = 1 << 20
BUSY = "AP: Mission upload timeout"
"""Simulated time runs five times as fast: a client that gets no turn for two seconds is late."""


@contextmanager
def mavproxy(folder: Path, port: int) -> Iterator[Program]:
    """MAVProxy with its own modules, without windows, all its files in the folder."""
    installed("MAVProxy", "MAVProxy")
    place = folder / "mavproxy"
    place.mkdir()
    arguments = ["--master", f"tcp:127.0.0.1:{port}", "--logfile", place / "mav.tlog", "--state-basedir", place]
    with program(place, "-m", "MAVProxy.mavproxy", *arguments) as running:
        running.says("online system 1")
        yield running


def write_files(folder: Path) -> tuple[Path, Path, Path]:
    """A mission, rally points and a fence, each in the form that MAVProxy's help tells of."""
    mission, rally, fence = folder / "way.txt", folder / "rally.txt", folder / "fence.txt"
    home, *rows = (f"{lat:.7f}\t{lon:.7f}\t0" for lat, lon in (HOME_DEG, *PLACES))
    lines = [f"0\t1\t0\t16\t0\t0\t0\t0\t{home}\t1"]
    lines += [f"{seq}\t0\t3\t16\t{seq}\t0\t0\t0\t{row}\t1" for seq, row in enumerate(rows, 1)]
    mission.write_text("\n".join(["QGC WPL 110", *lines, ""]))
    rally.write_text("".join(f"RALLY {lat:.7f} {lon:.7f} 0 0 0 0\n" for lat, lon in PLACES))
    ring = [HOME_DEG, *CORNERS, CORNERS[0]]  # where to go first, then the corners, the first one again at the end
    fence.write_text("".join(f"{lat:.7f}\t{lon:.7f}\n" for lat, lon in ring))
    return mission, rally, fence


def units(places: tuple[tuple[float, float], ...] | list[tuple[float, float]]) -> list[tuple[int, int]]:
    return [(round(lat * 1e7), round(lon * 1e7)) for lat, lon in places]


def lists_up_and_down(ground: Program, here: Scene, folder: Path) -> None:
    """Mission, rally points and fence: sent, read back by MAVProxy, and looked at by somebody else."""
    mission, rally, fence = write_files(folder)
    ground.told(f"wp load {mission}", "AP: Flight plan received", again=BUSY)
    back = folder / "back.txt"
    ground.told("wp list", "Saved 3 waypoints")
    ground.told(f"wp save {back}", "Saved 3 waypoints")
    loader = mavwp.MAVWPLoader()
    assert loader.load(str(back)) == 3
    assert [(loader.wp(seq).x, loader.wp(seq).y) for seq in (1, 2)] == [pytest.approx(place) for place in PLACES]
    found = here.witness.items(0)
    assert [(one.x, one.y) for one in found[1:]] == units(PLACES)
    assert [one.param1 for one in found[1:]] == [1, 2]
    ground.told("wp set 2", "DO_SET_MISSION_CURRENT: ACCEPTED")

    # A tool of pymavlink's mavutil and mavwp puts another mission there meanwhile; MAVProxy fetches that one.
    loader.add_latlonalt(*PLACES[0], 0.0)
    loader.target_system = loader.target_component = 1
    assert send(here.witness.link, loader, 0) == 0
    ground.told("wp list", "Saved 4 waypoints")

    ground.told(f"rally load {rally}", "AP: Rally points received", again=BUSY)
    ground.told("rally list", "Saved 2 rally items")
    assert [(one.x, one.y) for one in here.witness.items(2)] == units(PLACES)

    ground.told(f"fence load {fence}", "TYPE_FENCE: ACCEPTED", again=BUSY)
    ground.told("fence list", "Saved 5 fence items")
    assert [(one.x, one.y) for one in here.witness.items(1) if one.command == 5001] == units(CORNERS)
    for order, enabled in (("enable", True), ("disable", False)):
        ground.told(f"fence {order}", "DO_FENCE_ENABLE: ACCEPTED")
        here.witness.wait(
            lambda m, enabled=enabled: (
                m.get_type() == "SYS_STATUS" and bool(m.onboard_control_sensors_enabled & GEOFENCE) == enabled
            )
        )


def tuned(ground: Program, here: Scene, folder: Path) -> None:
    """The companion's parameters, by MAVProxy and by pymavlink; they are kept in the state directory."""
    kept = folder / "state" / "tuned.toml"
    ground.told("set target_component 191", rf"Received {len(TABLE)} parameters")
    ground.told("param show CMP_HORIZON", r"CMP_HORIZON +8\.0")
    ground.told("param set CMP_HORIZON 6", r"AP: CMP_HORIZON 8 -> 6")
    ground.told("param fetch CMP_HORIZON", r"CMP_HORIZON = 6\.0")
    ground.told("param set CMP_HORIZON 600", r"Failed to set CMP_HORIZON to 600 \(invalid returned value 6\.0\)")
    ground.says("AP: CMP_HORIZON stays 6: 600 not in 2..30")
    ground.tell("set target_component 1")
    here.companion.says("CMP_HORIZON stays 6")
    assert tomllib.loads(kept.read_text()) == {"guidance": {"horizon_m": 6.0}}

    mav = here.witness.link.mav
    mav.param_set_send(1, 191, b"CMP_STUCK", 9.0, 9)
    answer = here.witness.wait(lambda m: m.get_type() == "PARAM_VALUE" and m.get_srcComponent() == 191)
    assert (answer.param_id, answer.param_value, answer.param_count) == ("CMP_STUCK", 9.0, len(TABLE))
    mav.param_request_read_send(1, 191, b"CMP_HORIZON", -1)
    assert here.witness.wait(lambda m: m.get_type() == "PARAM_VALUE" and m.param_id == "CMP_HORIZON").param_value == 6.0


def requested_goal(ground: Program, here: Scene) -> None:
    """A place for the companion, which it drives to first; one that is too far away; both as a person types them."""
    place = PLACES[0]
    ground.tell("set target_component 191")
    later = "DO_REPOSITION: TEMPORARILY_REJECTED"  # it stands for a moment where the computer is busy
    ground.told(f"guided {place[0] + 0.1} {place[1]} 0", "DO_REPOSITION: DENIED", again=later)
    ground.says("AP: Requested goal refused: .* m away, farther than 300 m")
    ground.told(f"guided {place[0]} {place[1]} 0", "DO_REPOSITION: ACCEPTED", again=later)
    ground.says("AP: Requested goal 1: .* m away, then the mission goes on")
    ground.tell("set target_component 1")
    here.companion.says("Reached requested goal 1")
    assert math.dist(here.witness.place_m(), metres_from_home(*place)) < 5.0
    here.driving()


@pytest.mark.slow
def test_mavproxy_beside_the_companion(tmp_path: Path) -> None:
    with scene(tmp_path, companion_on="udp") as here, mavproxy(tmp_path, here.tcp) as ground:
        ground.says(r"Received \d+ parameters")
        here.may_be_armed()
        tuned(ground, here, tmp_path)
        ground.told("mode guided", "DO_SET_MODE: ACCEPTED")
        ground.told("arm throttle", "AP: Throttle armed")
        here.driving()
        figure = here.witness.wait(lambda m: m.get_type() == "NAMED_VALUE_FLOAT")
        assert figure.get_srcComponent() == 191

        assert float(ground.told("param show WP_SPEED", r"WP_SPEED +([\d.]+)")[1]) == pytest.approx(0.4)
        ground.tell("param set RTL_SPEED 0.25")  # it does not answer
        here.witness.until(lambda: here.witness.told.get("RTL_SPEED") == 0.25)
        ground.told("param fetch RTL_SPEED", r"RTL_SPEED = 0\.25")
        lists_up_and_down(ground, here, tmp_path)
        here.driving()

        # The person takes over, and gives the rover back: the companion goes on where it was.
        ground.told("mode hold", "Mode HOLD")
        here.witness.until(lambda: here.witness.mode == HOLD and here.witness.speed_m_s < 0.05)
        here.companion.says("mode is not GUIDED")
        ground.told("mode guided", "Mode GUIDED")
        here.driving()
        requested_goal(ground, here)
        here.arrived()

        # Nobody else drives any more: MAVProxy does.
        place = PLACES[0]
        ground.told("mode guided", "DO_SET_MODE: ACCEPTED")
        ground.told("arm throttle", "COMPONENT_ARM_DISARM: ACCEPTED")
        ground.told(f"guided {place[0]} {place[1]} 0", "DO_REPOSITION: ACCEPTED")
        here.witness.until(lambda: math.dist(metres_from_home(*here.witness.truth_deg), metres_from_home(*place)) < 1.5)
        assert here.witness.mode == GUIDED
        here.untouched()
        assert "Traceback" not in ground.output


@pytest.mark.thorough
@pytest.mark.slow
def test_mavproxy_gives_the_vehicle_the_key_that_the_companion_has(tmp_path: Path) -> None:
    """The companion is on a port where the vehicle believes only signed packets."""
    key = tmp_path / "key"
    key.write_text("green-meadow\n")
    key.chmod(0o600)
    with scene(tmp_path, "udp", "--signing-key", key) as here, mavproxy(tmp_path, here.tcp) as ground:
        here.companion.says("has the autopilot been given the key?")
        ground.told("signing setup green-meadow", "Setup signing key")
        here.companion.says("a person to arm")
        here.witness.until(lambda: here.witness.mode == GUIDED)
        ground.told("set target_component 191", rf"Received {len(TABLE)} parameters")
        ground.told("param set CMP_HORIZON 6", "AP: CMP_HORIZON 8 -> 6")
        assert int((tmp_path / "state" / "signing-time").read_text()) > 0
