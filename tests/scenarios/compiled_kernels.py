"""Kernels that a drive compiles: ``python -m tests.scenarios.compiled_kernels WHAT,MISSION,MORE..`` prints JSON lines.

A case is ``drive,MISSION,PLANNER,CONTROLLER,SECONDS`` or ``serve,MISSION,SENSORS``. Each has a process of its own,
which has loaded the program and no kernel; all are forked from one interpreter.
"""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path
from typing import Any

from companion.cli import kernel_cache

kernel_cache.use_cache(os.environ)  # before numba is imported

from numba.core.dispatcher import Dispatcher  # noqa: E402
from pymavlink.dialects.v20 import ardupilotmega as mavlink  # noqa: E402

from companion.mission.load import load_mission  # noqa: E402
from companion.recording.recorder import NullRecorder  # noqa: E402
from companion.settings import parse_settings  # noqa: E402
from sitl.lockstep import Drive  # noqa: E402
from sitl.scenario import scenario_from_mission, with_sensors  # noqa: E402

MISSIONS = Path(__file__).resolve().parents[2] / "missions"


def compiled(package: str) -> dict[str, int]:
    """How many signatures each kernel of a package has been compiled for, or loaded with."""
    modules = [module for name, module in list(sys.modules.items()) if name.startswith(f"{package}.")]
    values = (value for module in modules for value in vars(module).values())
    found = {id(value): value for value in values if isinstance(value, Dispatcher)}
    return {f"{kernel.__module__}.{kernel.__name__}": len(kernel.signatures) for kernel in found.values()}


def told(package: str, before: dict[str, int], said: list[str]) -> dict[str, Any]:
    """What is printed of a case: how many kernels were there before, which are new, and what was said."""
    new = [name for name, count in compiled(package).items() if count > before.get(name, 0)]
    return {"kernels": sum(before.values()), "new": new, "said": said}


def drive(mission_file: str, planner: str, controller: str, limit_s: str) -> dict[str, Any]:
    """A drive in lock-step, no longer than so many seconds; says for how many it drove."""
    mission = load_mission(MISSIONS / mission_file)
    chosen = {"navigator": {"planner": planner}, "guidance": {"controller": controller}}
    settings = parse_settings(chosen, "test")
    whole = Drive(mission, scenario_from_mission(mission), settings, 1, NullRecorder(), float(limit_s))
    before = compiled("companion")
    report = whole.run()
    return told("companion", before, [f"{report.driving_time_s:.1f}"])


def serve(mission_file: str, sensors: str) -> dict[str, Any]:
    """Every kind of drive over a link: guided positions, speeds and headings, a mission with a circle, the way home."""
    scenario = scenario_from_mission(with_sensors(load_mission(MISSIONS / mission_file), sensors))
    scenario.simulator(0).rehearse()
    before = compiled("sitl")
    simulator = scenario.simulator(0)
    link, packer = simulator.connect(), mavlink.MAVLink(None, 255, 190)

    def say(message: Any, seconds: float) -> None:
        link.receive(message.pack(packer))
        simulator.advance_to_s(simulator.time_s + seconds)

    def order(command: int, *parameters: float, seconds: float = 0.2) -> None:
        filled = (*parameters, *[0.0] * (7 - len(parameters)))
        say(mavlink.MAVLink_command_long_message(1, 1, command, 0, *filled), seconds)

    def target(mask: int, *fields: float) -> None:
        say(mavlink.MAVLink_set_position_target_local_ned_message(0, 1, 1, 1, mask, *fields), 1.0)

    simulator.advance_to_s(45.0)
    order(176, 1, 15)
    order(400, 1)
    target(3580, 2, 2, 0, 0, 0, 0, 0, 0, 0, 0, 0)
    order(178, 1, 0.3)
    target(3559, 0, 0, 0, 0.5, 0, 0, 0, 0, 0, 0, 0)
    target(2559, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1, 0)
    lat, lon = (round(degrees * 1e7) for degrees in (scenario.start.home.lat_deg, scenario.start.home.lon_deg))
    places = (
        (16, 0, 0, 0),
        (16, 100, 100, 0),
        (16, 200, 100, 0),
        (16, 200, 300, 1),
        (18, 200, 300, 1),
        (20, 0, 0, 0),
    )
    say(mavlink.MAVLink_mission_count_message(1, 1, len(places), 0), 0.1)
    for seq, (command, north, east, first) in enumerate(places):
        head = (1, 1, seq, 3, command, 0, 1, first, 0, 1, 0)
        say(mavlink.MAVLink_mission_item_int_message(*head, lat + north, lon + east, 0, 0), 0.1)
    order(176, 1, 10, seconds=90.0)
    order(176, 1, 12, seconds=2.0)
    heard = mavlink.MAVLink(None).parse_buffer(link.take()) or []
    return told("sitl", before, [message.text for message in heard if message.get_type() == "STATUSTEXT"])


if __name__ == "__main__":
    for case in sys.argv[1:]:
        what, *given = case.split(",")
        if (child := os.fork()) == 0:
            print(json.dumps({"drive": drive, "serve": serve}[what](*given)), flush=True)
            os._exit(0)
        if os.waitpid(child, 0)[1] != 0:
            sys.exit(1)
