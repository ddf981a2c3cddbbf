"""After the warm-up nothing is compiled any more: a compiler at work in the middle of a drive would be a stall of seconds."""

import json
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
from companion.recorder import NullRecorder
from companion.settings import parse_settings
from sitl.lockstep import Drive
from sitl.scenario import scenario_from_mission

def compiled():
    modules = [module for name, module in list(sys.modules.items()) if name.startswith("companion.")]
    things = {id(thing): thing for module in modules for thing in vars(module).values() if isinstance(thing, Dispatcher)}
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
