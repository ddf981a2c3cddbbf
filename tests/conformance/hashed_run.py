"""Drives a mission in lock-step and prints a hash of all bytes, all decisions and the rover's true state.

``python -m tests.conformance.hashed_run MISSION SEED..``: a line for each seed. ``MISSION+SENSORS+FAULTS..`` adds a
file of sensors and plans of faults. ``auto:`` before it: the autopilot drives a mission of its own instead, and a
ground station listens.
"""

from __future__ import annotations

import hashlib
import sys
from pathlib import Path

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.core.tick_marks import Mark
from companion.mission.load import load_mission
from companion.mission.mission import Mission
from companion.navigation.field_step import Decision
from companion.recording.recorder import NullRecorder
from companion.settings import Settings
from sitl.faults.fault_file import load_faults
from sitl.faults.plan import FaultPlan
from sitl.lockstep import Drive
from sitl.scenario import Scenario, scenario_from_mission, with_faults, with_sensors
from tests.support.mission_client import at, do, in_auto

TIME_LIMIT_S = 65.0
WAYPOINT, RETURN = 16, 20


class HashingRecorder(NullRecorder):
    """Hashes what a recorder would have written, without the time of day."""

    def __init__(self) -> None:
        self.digest = hashlib.sha256()
        self.packets = 0

    def heard(self, time_s: float, packets: list[bytes], mark: Mark) -> None:
        """The packets of a tick."""
        for raw in packets:
            self.said(time_s, raw)

    def said(self, time_s: float, raw: bytes) -> None:
        """One packet of either direction."""
        self.packets += 1
        self.digest.update(repr(time_s).encode() + raw)

    def write_decision(self, time_s: float, target: str, decision: Decision) -> None:
        """One decision."""
        self.digest.update(repr((time_s, target, decision.reason, decision.path)).encode())


def laid_out(what: str) -> tuple[Mission, Scenario]:
    """The mission and all that goes with it."""
    mission_file, *more = what.split("+")
    mission = load_mission(Path(mission_file))
    mission = with_sensors(mission, more[0]) if more else mission
    plans = [load_faults(Path(plan)) for plan in more[1:]]
    faults = FaultPlan(tuple(fault for plan in plans for fault in plan.faults))
    return mission, with_faults(scenario_from_mission(mission), faults if plans else None)


def hashed(what: str, seed: int) -> str:
    """Hash, packets and metres of one run."""
    mission, scenario = laid_out(what)
    recorder = HashingRecorder()
    drive = Drive(mission, scenario, Settings(), seed, recorder, TIME_LIMIT_S)
    report = drive.run()
    recorder.digest.update(repr(drive.simulator.truth).encode())
    return f"{recorder.digest.hexdigest()} {recorder.packets} {report.distance_m:.3f}"


def hashed_auto(what: str, seed: int) -> str:
    """The same of a mission that the autopilot drives by itself: two places, and home."""
    simulator = laid_out(what)[1].simulator(seed)
    client = in_auto(simulator, [at(WAYPOINT, 0.0, 12.0), at(WAYPOINT, 4.0, 14.0), do(RETURN)])
    simulator.advance_to_s(TIME_LIMIT_S)
    data = client.link.take()
    digest = hashlib.sha256(repr(simulator.truth).encode() + data)
    return f"{digest.hexdigest()} {len(mavlink.MAVLink(None).parse_buffer(data))} {simulator.driven_m:.3f}"


def hashed_run(what: str, seed: int) -> str:
    """The line of one run."""
    return hashed_auto(what[5:], seed) if what.startswith("auto:") else hashed(what, seed)


if __name__ == "__main__":
    for number in sys.argv[2:]:
        print(hashed_run(sys.argv[1], int(number)))
