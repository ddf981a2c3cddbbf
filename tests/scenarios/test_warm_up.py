"""After the warm-up no kernel is compiled: a compiler in the middle of a drive would stall it for seconds."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

MISSIONS = Path(__file__).resolve().parents[2] / "missions"

# A process of its own: in this one, earlier tests have compiled all there is.
LOOK = """
import json, sys
from pathlib import Path
from numba.core.dispatcher import Dispatcher
from companion.mission.load import load_mission
from companion.recording.recorder import NullRecorder
from companion.settings import parse_settings
from sitl.lockstep import Drive
from sitl.scenario import scenario_from_mission

def compiled():
    modules = [module for name, module in list(sys.modules.items()) if name.startswith("companion.")]
    values = (value for module in modules for value in vars(module).values())
    things = {id(value): value for value in values if isinstance(value, Dispatcher)}
    return {f"{thing.__module__}.{thing.__name__}": len(thing.signatures) for thing in things.values()}

mission = load_mission(Path(sys.argv[1]))
settings = parse_settings({"navigator": {"planner": sys.argv[2]}}, "test")
drive = Drive(mission, scenario_from_mission(mission), settings, 1, NullRecorder())
before = compiled()
report = drive.run()
after = compiled()
new = [name for name in after if after[name] > before.get(name, 0)]
print(json.dumps({"outcome": report.outcome, "kernels": sum(before.values()), "new": new}))
"""


@pytest.mark.parametrize(
    ("mission", "planner"),
    [
        ("rooms.toml", "hybrid"),
        ("one-obstacle.toml", "theta-star"),
        ("crossing.toml", "vertex++"),
        ("ackermann.toml", "hybrid"),
    ],
)
def test_a_drive_compiles_nothing(mission: str, planner: str) -> None:
    command = [sys.executable, "-c", LOOK, str(MISSIONS / mission), planner]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert found["outcome"] == "reached" and found["kernels"] >= 5
    assert found["new"] == []


# Every kind of drive over a link: guided positions, speeds and headings, a mission with a circle, the way home.
SERVED = """
import json, sys
from pathlib import Path
from numba.core.dispatcher import Dispatcher
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from companion.mission.load import load_mission
from sitl.scenario import scenario_from_mission, with_sensors

def compiled():
    modules = [module for name, module in list(sys.modules.items()) if name.startswith("sitl.")]
    values = (value for module in modules for value in vars(module).values())
    things = {id(value): value for value in values if isinstance(value, Dispatcher)}
    return {f"{thing.__module__}.{thing.__name__}": len(thing.signatures) for thing in things.values()}

scenario = scenario_from_mission(with_sensors(load_mission(Path(sys.argv[1])), sys.argv[2]))
scenario.simulator(0).rehearse()
before = compiled()
simulator = scenario.simulator(0)
link, packer = simulator.connect(), mavlink.MAVLink(None, 255, 190)

def say(message, seconds):
    link.receive(message.pack(packer))
    simulator.advance_to_s(simulator.time_s + seconds)

def order(command, *parameters, seconds=0.2):
    say(mavlink.MAVLink_command_long_message(1, 1, command, 0, *parameters, *[0] * (7 - len(parameters))), seconds)

def target(mask, *fields):
    say(mavlink.MAVLink_set_position_target_local_ned_message(0, 1, 1, 1, mask, *fields), 1.0)

simulator.advance_to_s(45.0)
order(176, 1, 15)
order(400, 1)
target(3580, 2, 2, 0, 0, 0, 0, 0, 0, 0, 0, 0)
order(178, 1, 0.3)
target(3559, 0, 0, 0, 0.5, 0, 0, 0, 0, 0, 0, 0)
target(2559, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1, 0)
lat, lon = (round(degrees * 1e7) for degrees in (scenario.start.home.lat_deg, scenario.start.home.lon_deg))
places = ((16, 0, 0, 0), (16, 100, 100, 0), (16, 200, 100, 0), (16, 200, 300, 1), (18, 200, 300, 1), (20, 0, 0, 0))
say(mavlink.MAVLink_mission_count_message(1, 1, len(places), 0), 0.1)
for seq, (command, north, east, first) in enumerate(places):
    head = (1, 1, seq, 3, command, 0, 1, first, 0, 1, 0)
    say(mavlink.MAVLink_mission_item_int_message(*head, lat + north, lon + east, 0, 0), 0.1)
order(176, 1, 10, seconds=90.0)
order(176, 1, 12, seconds=2.0)
after = compiled()
said = [m.text for m in mavlink.MAVLink(None).parse_buffer(link.take()) if m.get_type() == "STATUSTEXT"]
new = [name for name in after if after[name] > before.get(name, 0)]
print(json.dumps({"said": said, "kernels": sum(before.values()), "new": new}))
"""


@pytest.mark.parametrize(
    ("mission", "sensors"), [("open.toml", "beams"), ("ackermann.toml", "lidar-360"), ("crossing.toml", "none")]
)
def test_a_vehicle_that_is_served_compiles_nothing(mission: str, sensors: str) -> None:
    """A client that starts the first mission would wait for a compiler, without heartbeats of the vehicle."""
    command = [sys.executable, "-c", SERVED, str(MISSIONS / mission), sensors]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert any("Mission: 4" in text for text in found["said"]), "the circle was begun"
    assert found["kernels"] >= 5
    assert found["new"] == []


WARM = """
import sys
from companion.settings import Settings
from companion.executive.warm_up import kernels_warm, warm_up
if sys.argv[1] == "warm":
    warm_up(Settings())
print(kernels_warm(Settings()))
"""


def test_it_is_known_whether_the_kernels_are_warm_and_asking_compiles_nothing(tmp_path: Path) -> None:
    for place, told in ((tmp_path / "new", "False"), (None, "True")):
        command = [sys.executable, "-c", WARM, "cold" if place else "warm"]
        environment = {**os.environ, **({"NUMBA_CACHE_DIR": str(place)} if place else {})}
        done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False, env=environment)
        assert (done.returncode, done.stdout.strip()) == (0, told), done.stderr
    assert not list(tmp_path.rglob("*.nbc"))
