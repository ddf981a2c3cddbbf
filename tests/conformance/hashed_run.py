"""Drives a mission in lock-step and prints one hash of all bytes in both directions, all decisions and the rover's truth.

``python -m tests.conformance.hashed_run MISSION SEED..``: a line for each seed. ``MISSION+SENSORS+FAULTS..`` adds a file of sensors and
plans of faults.
"""

from __future__ import annotations

import hashlib
import sys
from pathlib import Path

from companion.mission.load import load_mission
from companion.navigator import Decision
from companion.recorder import NullRecorder
from companion.settings import Settings
from sitl.fault_file import load_faults
from sitl.faults import FaultPlan
from sitl.lockstep import Drive
from sitl.scenario import scenario_from_mission, with_faults, with_sensors

TIME_LIMIT_S = 100.0


class HashingRecorder(NullRecorder):
    """Hashes what a recorder would have written, without the time of day."""

    def __init__(self) -> None:
        self.digest = hashlib.sha256()
        self.packets = 0

    def packet(self, time_s: float, raw: bytes) -> None:
        """One packet of either direction."""
        self.packets += 1
        self.digest.update(repr(time_s).encode() + raw)

    def write_decision(self, time_s: float, target: str, decision: Decision) -> None:
        """One decision."""
        self.digest.update(repr((time_s, target, decision.reason, decision.path)).encode())


def hashed(what: str, seed: int) -> str:
    """Hash, packets and metres of one run."""
    mission_file, *more = what.split("+")
    mission, recorder = load_mission(Path(mission_file)), HashingRecorder()
    mission = with_sensors(mission, more[0]) if more else mission
    plans = [load_faults(Path(plan)) for plan in more[1:]]
    faults = FaultPlan(tuple(fault for plan in plans for fault in plan.faults))
    scenario = with_faults(scenario_from_mission(mission), faults if plans else None)
    drive = Drive(mission, scenario, Settings(), seed, recorder, TIME_LIMIT_S)
    report = drive.run()
    recorder.digest.update(repr(drive.simulator.truth).encode())
    return f"{recorder.digest.hexdigest()} {recorder.packets} {report.distance_m:.3f}"


if __name__ == "__main__":
    for number in sys.argv[2:]:
        print(hashed(sys.argv[1], int(number)))
