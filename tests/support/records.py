"""Records of runs, made without driving, and ways to change or damage them."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from pathlib import Path

from companion.core.grid import Cell
from companion.core.tick_marks import Mark
from companion.mission.mission import Mission
from companion.navigation.field_step import Action, Decision, DecisionReason, Part, SearchKind
from companion.planning.problem import Path as FieldPath
from companion.recording.recorder import Recorder
from companion.settings import Settings
from sitl.faults.fault_file import load_faults
from sitl.lockstep import Drive
from sitl.scenario import scenario_from_mission, with_faults
from tests.support.mavlink_vehicle import Station
from tests.support.rig import yard

MISSIONS = Path(__file__).resolve().parents[2] / "missions"
START_US = 1_800_000_000_000_000
"""15 January 2027, 8:00 UTC."""
TICKS = 200
DECISION = Decision(
    action=Action.FOLLOW,
    part=Part.SEARCH,
    path=(Cell(0, 24), Cell(1, 24)),
    new_path=FieldPath((Cell(0, 24), Cell(1, 24)), 1.5),
    reason=DecisionReason.PATH_BLOCKED,
    searches=(SearchKind.THOROUGH,),
)
Change = Callable[[Path], None]
"""Changes a record."""


def recorded(
    folder: Path,
    mission: Mission,
    faults: str | Path | None = None,
    limit_s: float = 200.0,
    settings: Settings | None = None,
) -> Path:
    """A drive in lock-step with a record. ``faults``: a shipped plan by its name, or a file."""
    settings = settings or Settings()
    file = MISSIONS / "faults" / f"{faults}.toml" if isinstance(faults, str) else faults
    plan = None if file is None else load_faults(file)
    recorder = Recorder(folder, mission, settings, 0, arm=True, start_us=START_US)
    Drive(mission, with_faults(scenario_from_mission(mission), plan), settings, 0, recorder, limit_s).run()
    recorder.close()
    return folder


def write_record(folder: Path) -> Path:
    """A closed record of ten seconds; the mission's own files are gone afterwards."""
    recorder = Recorder(folder / "record", yard(folder), Settings(), 0, arm=True, start_us=0)
    rover, companion = Station(), Station(1, 191)
    recorder.begin(0.0, Mark.BEGIN)
    for number in range(1, TICKS):
        time_s = 0.05 * number
        recorder.heard(time_s, [rover.local_position(50 * number, 0.1 * number), rover.heartbeat()])
        recorder.said(time_s, companion.heartbeat(kind=18, autopilot=8))
        if number % 20 == 0:
            recorder.write_decision(time_s, "gate", DECISION)
    recorder.close()
    for name in ("yard.toml", "yard.png"):
        (folder / name).unlink()
    return recorder.directory


def unclosed(record: Path) -> None:
    """As if the run had been killed: no check sums of whole files."""
    meta = json.loads((record / "meta.json").read_text())
    (record / "meta.json").write_text(json.dumps(meta | {"end": None}))


def with_meta(key: str, value: object) -> Change:
    def change(record: Path) -> None:
        meta = json.loads((record / "meta.json").read_text())
        (record / "meta.json").write_text(json.dumps(meta | {key: value}))

    return change


def overwritten(name: str, data: bytes) -> Change:
    def change(record: Path) -> None:
        (record / name).write_bytes(data)

    return change


def with_flipped_bit(name: str, at: int) -> Change:
    def change(record: Path) -> None:
        data = bytearray((record / name).read_bytes())
        data[at] ^= 1
        (record / name).write_bytes(data)

    return change


def removed(name: str) -> Change:
    def change(record: Path) -> None:
        (record / name).unlink()

    return change


def huge(name: str) -> Change:
    """A sparse file of 3 GB."""

    def change(record: Path) -> None:
        unclosed(record)
        os.truncate(record / name, 3_000_000_000)

    return change


def linked(name: str, target: str) -> Change:
    def change(record: Path) -> None:
        unclosed(record)
        (record / name).unlink()
        (record / name).symlink_to(target)

    return change
