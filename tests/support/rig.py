"""Companion and simulator in lock-step with a hand on everything between them: bytes, modes, time.

What the companion says is taken apart with pymavlink alone, and kept with what it could know when it said it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.app import Companion
from companion.checkpoint.checkpointer import Checkpointer, StateUpdate
from companion.checkpoint.state_directory import StateDirectory
from companion.checkpoint.state_writer import StateFile
from companion.executive.mission_executor import MissionExecutor
from companion.executive.mission_progress import MissionProgress
from companion.executive.warm_up import warm_up
from companion.mavlink.autopilot_link import AutopilotLink
from companion.mavlink.codec import Codec
from companion.mavlink.signing import Signer
from companion.mavlink.transport import MemoryLink
from companion.mission.load import load_mission
from companion.mission.mission import Mission
from companion.navigation.field_step import Action, Decision
from companion.navigation.step_runner import InlineRunner
from companion.recording.recorder import NullRecorder, Recorder
from companion.safety.reasons import Activity, Doubt, RunPhase, WaitReason
from companion.settings import Settings
from companion.storage.files import OsDisk
from companion.vehicle.commands import GuidedPosition
from sitl.faults.plan import Fault, FaultPlan
from sitl.scenario import scenario_from_mission, with_faults
from sitl.simulator import Simulator

MANUAL, HOLD, AUTO, RTL, GUIDED = 0, 4, 10, 11, 15
SET_MODE, ARM, SPEED, REPOSITION, REBOOT = 176, 400, 178, 192, 246
ARMED = 128
ON_FOR_S = 45.0
"""After so long a vehicle that was switched on can be armed."""

HEAD = """
name = "Yard"
[grid]
size = [24, 15]
home = [2, 7]
[rover]
cruise_speed_m_s = 2.0
[sitl]
world = "yard.png"
heading_deg = 90.0
sensors = "lidar-360"
"""
GATE = '[[target]]\nname = "gate"\nfield = [15, 7]\n'


def yard(folder: Path, targets: str = GATE, *, sealed: bool = False) -> Mission:
    """24 x 15 fields with a wall across the straight way; ``sealed``: field 15, 7 is walled in as well."""
    picture = Image.new("L", (24, 15), 255)
    for y in range(5, 10):
        picture.putpixel((8, y), 0)
    if sealed:
        for x, y in ((x, y) for x in range(13, 18) for y in range(5, 10) if x in (13, 17) or y in (5, 9)):
            picture.putpixel((x, y), 0)
    picture.save(folder / "yard.png")
    path = folder / "yard.toml"
    path.write_text(HEAD + targets)
    return load_mission(path)


@dataclass(frozen=True)
class Sent:
    """A packet of the companion, and the newest heartbeat that had been delivered to it by then."""

    time_s: float
    mode: int | None
    armed: bool
    message: Any

    @property
    def kind(self) -> str:
        return str(self.message.get_type())

    @property
    def command(self) -> int | None:
        return self.message.command if self.kind in ("COMMAND_LONG", "COMMAND_INT") else None

    @property
    def is_setpoint(self) -> bool:
        targets = ("SET_POSITION_TARGET_LOCAL_NED", "SET_POSITION_TARGET_GLOBAL_INT", "MISSION_ITEM_INT")
        return self.kind in targets or self.command == REPOSITION

    @property
    def moves_or_changes(self) -> bool:
        """A setpoint, or a command for mode, arming or speed."""
        return self.is_setpoint or self.command in (SET_MODE, ARM, SPEED)

    @property
    def is_standstill(self) -> bool:
        m = self.message
        return self.kind == "SET_POSITION_TARGET_LOCAL_NED" and m.type_mask == 1511 and m.vx == m.yaw_rate == 0.0


class Log(NullRecorder):
    """Keeps what the navigator decided, by target."""

    def __init__(self) -> None:
        self.decided: list[tuple[str, Action]] = []

    def write_decision(self, time_s: float, target: str, decision: Decision) -> None:
        self.decided.append((target, decision.action))


Change = Callable[[Any], Any]
"""Takes a message of the vehicle; gives it back, perhaps changed in place, or None to lose it."""


class Rig:
    """One run.

    ``change``: the line from the vehicle to the companion, message by message; ``garble``: the same in bytes.
    ``lose``: whether a packet of the companion is lost. ``cut``: no line in either direction.
    """

    def __init__(
        self,
        mission: Mission,
        settings: Settings | None = None,
        *,
        seed: int = 0,
        arm: bool = True,
        late_s: float = ON_FOR_S,
        state: Path | None = None,
        port: int = 0,
        signer: Signer | None = None,
        prepare: Callable[[Simulator], None] = lambda simulator: None,
        faults: tuple[Fault, ...] = (),
    ) -> None:
        """``late_s``: how long the vehicle has been switched on when the companion starts.

        ``state``: the companion's state directory. ``port``: the vehicle's serial port that the companion is on.
        ``prepare``: what others did with the vehicle before.
        """
        settings = settings or Settings()
        warm_up(settings, mission.rover.turning_radius_m)
        self.settings = settings
        self.simulator = with_faults(scenario_from_mission(mission), FaultPlan(faults)).simulator(seed)
        self.simulator.advance_to_s(late_s)
        prepare(self.simulator)
        self.change: Change | None = None
        self.garble: Callable[[bytes], bytes] | None = None
        self.lose: Callable[[], bool] | None = None
        self.cut = False
        self.stall_s = 0.0
        """The companion's computer stands still for this long, once."""
        self.sent: list[Sent] = []
        self.activities: list[Activity] = []
        """What the companion did, one after the other."""
        self.goals: list[str] = []
        """Where it was heading for, one after the other."""
        self.beyond_m: list[float] = []
        """How far each guided position reached beyond the ground seen free, in metres."""
        self._now_s = self.simulator.time_s
        self._mode: int | None = None
        self._armed = False
        self._vehicle = self.simulator.connect(port)
        self.signer = signer
        self._pilot = self.simulator.connect()
        self._pilot_mav = mavlink.MAVLink(None, 255, 190)
        self._up, self._down = mavlink.MAVLink(None), mavlink.MAVLink(None)
        self.log = Log()
        self.recorder: NullRecorder | Recorder = self.log
        self._arm, self._seed, self._state = arm, seed, state
        self.state_file = None if state is None else state / "mission.state"
        self.restart_companion(mission)

    def restart_companion(self, mission: Mission, *, resume: bool = False) -> None:
        """A new companion takes the place of the one before; with ``resume`` it resumes that run."""
        checkpointer = None if self._state is None else kept_in(self._state, mission, resume=resume)
        near, self._far = MemoryLink.pair()
        self.link = AutopilotLink(
            near, Codec(self.settings.link, signer=self.signer), self.settings.link, self.recorder
        )
        self.companion = Companion(
            self.link,
            self,
            mission,
            self.settings,
            InlineRunner(),
            self.recorder,
            seed=self._seed,
            arm=self._arm,
            checkpointer=checkpointer,
        )
        self._watch_positions()

    # The clock -----------------------------------------------------------------------------------------------------

    def now_s(self) -> float:
        return self._now_s

    def sleep_until_s(self, time_s: float) -> None:
        self._watch_activity()
        time_s, self.stall_s = time_s + self.stall_s, 0.0
        said = self._far.read()
        for message in self._up.parse_buffer(said) or []:
            self.sent.append(Sent(self._now_s, self._mode, self._armed, message))
            if not self.cut and not (self.lose is not None and self.lose()):
                self._vehicle.receive(bytes(message.get_msgbuf()))
        self.simulator.advance_to_s(time_s)
        self._pilot.take()
        heard = self._vehicle.take()
        if self._vehicle.dropped:
            self._vehicle, self._pilot = self.simulator.connect(), self.simulator.connect()
        if not self.cut:
            data = self._delivered(heard)
            self._far.write(data if self.garble is None else self.garble(data))
        self._now_s = time_s

    def _delivered(self, heard: bytes) -> bytes:
        if self.change is None:
            for packet in heartbeats_in(heard):
                self._note(self._down.decode(bytearray(packet)))
            return heard
        kept = []
        for message in self._down.parse_buffer(heard) or []:
            changed = self.change(message)
            if changed is not None:
                kept.append(repacked(changed))
                self._note(changed)
        return b"".join(kept)

    def _note(self, message: Any) -> None:
        if message.get_type() == "HEARTBEAT" and message.get_srcComponent() == 1:
            self._mode, self._armed = message.custom_mode, bool(message.base_mode & ARMED)

    # Driving --------------------------------------------------------------------------------------------------------

    def until(self, done: Callable[[], bool], limit_s: float = 300.0) -> None:
        """Tick until something is so; fails after ``limit_s``."""
        stop_s = self.now_s() + limit_s
        while not done():
            assert self.now_s() < stop_s, (self.companion.status(), self.companion.outcome.said)
            self.companion.tick()

    def run_for(self, seconds: float) -> None:
        stop_s = self.now_s() + seconds
        while self.now_s() < stop_s - 1e-9 and not self.companion.done:
            self.companion.tick()

    def until_driven(self, metres: float) -> None:
        self.until(lambda: self.simulator.driven_m >= metres)

    def finish(self, limit_s: float = 300.0) -> None:
        self.until(lambda: self.companion.done, limit_s)

    def pilot(self, command: int, *parameters: float) -> None:
        """A person at the ground station."""
        filled = [*parameters, *([0.0] * (7 - len(parameters)))]
        message = mavlink.MAVLink_command_long_message(1, 1, command, 0, *filled)
        self._pilot.receive(message.pack(self._pilot_mav))

    def station(self, message: Any) -> None:
        """Anything else that a ground station sends."""
        self._pilot.receive(message.pack(self._pilot_mav))

    def pilot_mode(self, mode: int) -> None:
        self.pilot(SET_MODE, 1, mode)

    # Looking --------------------------------------------------------------------------------------------------------

    @property
    def mode(self) -> int | None:
        """As the companion has been told."""
        return self._mode

    @property
    def armed(self) -> bool:
        return self._armed

    @property
    def speed_m_s(self) -> float:
        return self.simulator.truth.speed_m_s

    def sent_since(self, time_s: float) -> list[Sent]:
        return [sent for sent in self.sent if sent.time_s >= time_s]

    @property
    def activity(self) -> Activity:
        """What the companion does now."""
        return self.companion.status().activity

    @property
    def executor(self) -> MissionExecutor:
        """The mission under way."""
        assert self.companion.executor is not None
        return self.companion.executor

    def does(self, phase: RunPhase) -> bool:
        return self.activity.phase is phase

    def awaits(self, *kinds: WaitReason) -> bool:
        """Whether it says that it waits for one of these."""
        return self.activity.awaited is not None and self.activity.awaited.kind in kinds

    @property
    def awaits_guided(self) -> bool:
        """Whether it says that it waits for a person to set GUIDED."""
        kinds = (WaitReason.PERSON_SETS_GUIDED, WaitReason.PERSON_SETS_GUIDED_AGAIN, WaitReason.PERSON_SETS_MODE)
        return self.awaits(*kinds)

    def gave(self, kind: Enum, *figures: object) -> bool:
        """Whether this was ever its reason not to drive; ``figures``: the first of the reason's."""
        self._watch_activity()
        reasons = (activity.reason for activity in self.activities)
        return any(
            reason is not None and reason.kind is kind and reason.figures[: len(figures)] == figures
            for reason in reasons
        )

    @property
    def was_stopped(self) -> bool:
        """Whether it ever doubted that the rover may move."""
        self._watch_activity()
        return any(one.reason is not None and isinstance(one.reason.kind, Doubt) for one in self.activities)

    def times_decided(self, action: Action, target: str) -> int:
        """How often the navigator decided so on the way to a target."""
        return self.log.decided.count((target, action))

    def has_reached(self, target: str) -> bool:
        return self.times_decided(Action.REACHED, target) > 0

    def _watch_activity(self) -> None:
        """Once a tick."""
        if not hasattr(self, "companion"):
            return
        status = self.companion.status()
        if not self.activities or self.activities[-1] != status.activity:
            self.activities.append(status.activity)
        if status.target and (not self.goals or self.goals[-1] != status.target):
            self.goals.append(status.target)

    def texts(self) -> list[str]:
        return self.companion.outcome.said

    def _watch_positions(self) -> None:
        """Look at every guided position at the moment it is sent, with the map as it is then."""
        send = self.link.send

        def watched(command: Any, now_s: float) -> None:
            if isinstance(command, GuidedPosition):
                self.beyond_m.append(self._beyond_m(command, now_s))
            send(command, now_s)

        self.link.send = watched  # type: ignore[method-assign]

    def _beyond_m(self, command: GuidedPosition, now_s: float) -> float:
        evidence = self.companion.evidence
        pose = self.companion.vehicle.pose_at(now_s)
        assert evidence is not None and pose is not None
        distance_m, corner = pose.point.distance_m(command.point), evidence.base.south_west
        for s in np.arange(0.0, distance_m, 0.05):
            share = s / distance_m
            north_m = pose.north_m + share * (command.point.north_m - pose.north_m) - corner.north_m
            east_m = pose.east_m + share * (command.point.east_m - pose.east_m) - corner.east_m
            y, x = math.floor(north_m / evidence.evidence_m), math.floor(east_m / evidence.evidence_m)
            if not evidence.log_odds[y, x] < 0.0:
                return distance_m - float(s)
        return 0.0


class QuickDisk(OsDisk):
    """Does not wait for the disk: nothing here takes its power away."""

    def sync(self, handle: int) -> None:
        pass

    def sync_directory(self, path: Path) -> None:
        pass


class InlineStateWriter:
    """Writes immediately: equal runs leave equal files at every moment."""

    busy = False

    def __init__(self, file: StateFile) -> None:
        self._file = file

    @property
    def problem(self) -> str:
        return self._file.problem

    def holds(self, progress: MissionProgress) -> bool:
        return self._file.holds(progress)

    def put(self, update: StateUpdate) -> None:
        self._file.apply(update)

    def close(self) -> None:
        pass


def kept_in(directory: Path, mission: Mission, *, resume: bool) -> Checkpointer:
    """The checkpointer that ``rover-companion run`` makes for its state directory."""
    place = StateDirectory(directory)
    previous = place.load(mission) if resume else None
    place.close()  # a process that is killed loses its lock
    return Checkpointer(mission, InlineStateWriter(StateFile(place.file, QuickDisk())), previous)


def heartbeats_in(data: bytes) -> Iterator[bytes]:
    """The heartbeats among whole MAVLink 2 packets; to decode the others, too, costs more than the drive itself."""
    at = 0
    while at < len(data):
        assert data[at] == 0xFD, "a whole packet begins here"
        end = at + 12 + data[at + 1] + (13 if data[at + 2] & 1 else 0)
        if data[at + 7 : at + 10] == bytes(3):
            yield data[at:end]
        at = end


def repacked(message: Any) -> bytes:
    """The bytes of a message whose fields may have been changed, under its old number and sender."""
    mav = mavlink.MAVLink(None, message.get_srcSystem(), message.get_srcComponent())
    mav.seq = message.get_seq()
    return bytes(message.pack(mav))


def without(*kinds: str) -> Change:
    """Loses these messages."""
    return lambda message: None if message.get_type() in kinds else message
