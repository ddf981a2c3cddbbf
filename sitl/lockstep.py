"""Companion and simulator in one process on one simulated clock, connected by real MAVLink bytes.

When the companion sleeps, the world advances: nothing waits, and the same seed gives the same run.

Nouns: LockstepClock, Drive.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from enum import StrEnum

from companion.app import Companion, Status
from companion.checkpoint.checkpointer import Checkpointer
from companion.control.model_estimate import described
from companion.core.clock import stopwatch_s
from companion.core.interrupts import WholeSteps
from companion.executive.mission_progress import TargetStatus
from companion.executive.warm_up import warm_up
from companion.lidar.reader import Chunk, lidars_on
from companion.lidar.spec import LidarSpec
from companion.mavlink.autopilot_link import AutopilotLink
from companion.mavlink.codec import Codec
from companion.mavlink.local_station import LocalStation
from companion.mavlink.transport import MemoryLink
from companion.mission.mission import Mission
from companion.navigation.step_runner import InlineRunner
from companion.operator.notifications import News
from companion.recording.recorder import NullRecorder, Recorder
from companion.safety.reasons import EndReason
from companion.settings import Settings
from sitl.scenario import Scenario
from sitl.sensors.serial_lidar import SerialLidar
from sitl.sim_link import SimLink
from sitl.simulator import Simulator

TRACK_PERIOD_S = 0.5


class _Way:
    """One way of the link: bytes arrive so much later than they were sent."""

    def __init__(self, late_s: float) -> None:
        self._late_s = late_s
        self._under_way: deque[tuple[float, bytes]] = deque()

    def passed(self, now_s: float, sent: bytes) -> bytes:
        """What arrives now."""
        self._under_way.append((now_s + self._late_s, sent))
        arrived = b""
        while self._under_way and self._under_way[0][0] <= now_s + 1e-9:
            arrived += self._under_way.popleft()[1]
        return arrived


class LockstepClock:
    """The simulator's clock; sleeping exchanges bytes and advances the world. ``late_s``: of the link, each way."""

    def __init__(
        self, simulator: Simulator, vehicle_end: SimLink, companion_end: MemoryLink, late_s: float = 0.0
    ) -> None:
        self._simulator = simulator
        self._vehicle_end = vehicle_end
        self._companion_end = companion_end
        self._up, self._down = _Way(late_s), _Way(late_s)
        self._now_s = simulator.time_s
        self.overhear: Callable[[float, bytes], None] | None = None
        """Called with the time to which the world advances, and the bytes that the companion has written."""
        self.delivered: Callable[[float, bytes], None] | None = None
        """Called with the time, and the bytes that the companion is given then."""

    def now_s(self) -> float:
        """Simulated seconds since the autopilot booted."""
        return self._now_s

    def sleep_until_s(self, time_s: float) -> None:
        """Deliver what the companion has written, advance the world, and fetch what the vehicle has sent."""
        if time_s <= self._now_s:
            return
        said = self._companion_end.read()
        if self.overhear is not None:
            self.overhear(time_s, said)
        self._vehicle_end.receive(self._up.passed(self._now_s, said))
        self._simulator.advance_to_s(time_s)
        arrived = self._down.passed(time_s, self._vehicle_end.take())
        if self.delivered is not None:
            self.delivered(time_s, arrived)
        self._companion_end.write(arrived)
        if self._vehicle_end.dropped:
            # The autopilot has rebooted: connect again at once.
            self._vehicle_end = self._simulator.connect(name="companion")
        self._now_s = time_s


class DevicePort:
    """A serial port within the process: the companion reads what a simulated lidar has sent."""

    def __init__(self, device: SerialLidar, clock: LockstepClock) -> None:
        self._device = device
        self._clock = clock
        self._cuts = device.cuts

    def read(self) -> list[Chunk]:
        """What has come since the last call."""
        now_s, cut = self._clock.now_s(), self._device.cuts != self._cuts
        self._cuts = self._device.cuts
        data = self._device.take()
        return [*([Chunk(now_s, b"")] if cut else []), *([Chunk(now_s, data)] if data else [])]

    def write(self, data: bytes) -> None:
        """Commands."""
        self._device.hear(data)

    def close(self) -> None:
        """Nothing to close."""


@dataclass(frozen=True, slots=True)
class TrackPoint:
    """The rover's true position (world frame), and the navigator's part at that moment."""

    time_s: float
    north_m: float
    east_m: float
    part: str


class DriveOutcome(StrEnum):
    """How a run ended; the values are those of ``--json``."""

    REACHED = "reached"
    INCOMPLETE = "incomplete"
    COLLISION = "collision"
    TIME_LIMIT = "time limit"


@dataclass
class Report:
    """Result of a lock-step run; ``as_json`` gives the documented keys."""

    seed: int
    outcome: DriveOutcome = DriveOutcome.TIME_LIMIT
    targets: list[tuple[str, TargetStatus]] = field(default_factory=list)
    steps: int = 0
    return_steps: int = 0
    searches: int = 0
    genetic_searches: int = 0
    """Those that the genetic algorithm answered with a curve of its own, and not a graph search."""
    stuck: int = 0
    distance_m: float = 0.0
    drawn_ah: float = 0.0
    """Charge from the battery, since the simulator was switched on."""
    collisions: int = 0
    contacts: list[dict[str, float | str]] = field(default_factory=list)
    """Each collision: time, place from the start, speed, with what."""
    commands: list[str] = field(default_factory=list)
    """What became of each command of the mission, a line each."""
    commands_done: str = ""
    """How many of them had which result; empty for a mission without commands."""
    laps: list[str] = field(default_factory=list)
    """A line for each lap of a patrol that has ended."""
    autopilot_commands: list[dict[str, object]] = field(default_factory=list)
    """The commands that the autopilot has answered."""
    refused: int = 0
    """Setpoints rejected by the companion's own check before sending."""
    sim_time_s: float = 0.0
    driving_time_s: float = 0.0
    """From the first movement to the last, to within a tick."""
    wall_time_s: float = 0.0
    compile_time_s: float = 0.0
    planning_time_s: float = 0.0
    tick_p99_ms: float = 0.0
    track: list[TrackPoint] = field(default_factory=list)
    said: list[str] = field(default_factory=list)
    following: str = ""
    """How the rover followed velocities, as the companion found; empty where it plans no motions."""

    @property
    def exit_code(self) -> int:
        """0 all targets reached without a collision, 3 a target missed, 4 a collision."""
        if self.collisions:
            return 4
        return 0 if self.outcome is DriveOutcome.REACHED else 3

    def as_json(self) -> dict[str, object]:
        """The figures for ``--json``: everything except track and texts."""
        hidden = {"track", "said", "targets"}
        result: dict[str, object] = {key: value for key, value in vars(self).items() if key not in hidden}
        result["targets"] = [{"name": name, "status": status} for name, status in self.targets]
        return result


@dataclass
class Drive:
    """One mission in lock-step; after ``run`` the companion and the simulator can be inspected."""

    mission: Mission
    scenario: Scenario
    settings: Settings
    seed: int
    recorder: Recorder | NullRecorder
    time_limit_s: float = 3600.0
    checkpointer: Checkpointer | None = None
    """Saves the companion's state."""
    late_s: float = 0.0
    """So long each message takes over the link, each way."""
    station: LocalStation | None = None
    """Heard by the companion beside its link."""
    lidars: tuple[LidarSpec, ...] = ()
    """On serial ports of the companion; the scenario has the same ones, in this order."""
    autopilot_on_s: float = 0.0
    """So long the autopilot is switched on when the companion starts. The first 40 s it only waits, at some cost."""

    def __post_init__(self) -> None:
        self.report = Report(self.seed)
        self._news: list[News] = []
        self._driven_m = self._set_off_s = self._stood_s = 0.0
        began_s = stopwatch_s()
        warm_up(self.settings, self.mission.rover.turning_radius_m)
        self.simulator = self.scenario.simulator(self.seed)
        self.report.compile_time_s = stopwatch_s() - began_s
        self.simulator.advance_to_s(self.autopilot_on_s)
        self._start_companion()

    def _start_companion(self) -> None:
        near, far = MemoryLink.pair()
        self._link = self.simulator.connect(name="companion")
        self.clock = LockstepClock(self.simulator, self._link, far, self.late_s)
        codec = Codec(self.settings.link)
        ports = [DevicePort(device, self.clock) for device in self.simulator.lidars]
        autopilot = AutopilotLink(near, codec, self.settings.link, self.recorder, self.station)
        self.companion = Companion(
            autopilot,
            self.clock,
            self.mission,
            self.settings,
            InlineRunner(),
            self.recorder,
            seed=self.seed,
            arm=True,
            checkpointer=self.checkpointer,
            lidars=lidars_on(self.lidars, ports, self.recorder),
        )

    def kill_companion(self, absent_s: float, resumed: Checkpointer) -> None:
        """The companion says nothing more; ``absent_s`` later another one takes its place and resumes the run."""
        self.simulator.disconnect(self._link)
        self.simulator.advance_to_s(self.simulator.time_s + absent_s)
        self.checkpointer = resumed
        self._start_companion()

    def run(self, observe: Callable[[Status], None] = lambda status: None, every_s: float = TRACK_PERIOD_S) -> Report:
        """Drive until the mission has ended or the time limit is reached; ``observe`` is called every few ticks."""
        began_s = stopwatch_s()
        next_track_s = next_look_s = self.simulator.time_s
        with WholeSteps() as steps:  # a record of half a tick would be a damaged one
            while not self.companion.done and self.simulator.time_s < self.time_limit_s:
                before_s = self.simulator.time_s
                steps.do(self.companion.tick)
                self._note_motion(before_s)
                self._news += self.companion.news
                if self.simulator.time_s >= next_track_s:
                    next_track_s += TRACK_PERIOD_S
                    self._note_track()
                if self.simulator.time_s >= next_look_s:
                    next_look_s += every_s
                    observe(self.take_status())
        self._note_track()
        self.report.wall_time_s = stopwatch_s() - began_s
        self._sum_up()
        return self.report

    def ended_by(self, broken_off: EndReason) -> EndReason:
        """Why the companion has ended the run; ``broken_off``, where it has not."""
        end = self.companion.mission_run.end
        return broken_off if end is None else end.kind

    @property
    def contacts(self) -> list[dict[str, float | str]]:
        """All collisions so far: time, place from the start, speed, with what."""
        return [collision.as_json(self.scenario.start) for collision in self.simulator.collisions]

    def take_status(self) -> Status:
        """The companion's status, with all that has been said since the last call."""
        news, self._news = tuple(self._news), []
        return replace(self.companion.status(), news=news)

    def _note_motion(self, before_s: float) -> None:
        """Whether it rolled in this tick."""
        if self.simulator.driven_m == self._driven_m:
            return
        if self._driven_m == 0.0:
            self._set_off_s = before_s
        self._driven_m, self._stood_s = self.simulator.driven_m, self.simulator.time_s

    def _note_track(self) -> None:
        truth = self.simulator.truth
        decision = self.companion.driver.decision if self.companion.driver else None
        part = decision.part.value if decision else "-"
        self.report.track.append(TrackPoint(self.simulator.time_s, truth.north_m, truth.east_m, part))

    def _sum_up(self) -> None:
        report, companion = self.report, self.companion
        report.said = companion.outcome.said
        report.targets = companion.statuses()
        report.collisions = len(self.simulator.collisions)
        report.contacts = self.contacts
        report.commands, report.commands_done = companion.command_lines(), companion.commands_done()
        report.laps = [str(lap) for lap in companion.laps]
        report.autopilot_commands = [event.as_json() for event in self.simulator.commands]
        report.refused = companion.mission_run.setpoint_check.refused.total()
        report.following = "" if companion.estimate is None else described(companion.estimate)
        report.distance_m = self.simulator.driven_m
        report.drawn_ah = self.simulator.drawn_ah
        report.sim_time_s = self.simulator.time_s
        if companion.driver is not None:
            report.steps = companion.driver.tally.steps
            report.return_steps = companion.driver.tally.return_steps
            report.stuck = companion.driver.tally.stuck
            report.searches = len(companion.driver.searcher.seconds)
            report.genetic_searches = companion.driver.searcher.by_curves
            report.planning_time_s = math.fsum(companion.driver.searcher.seconds)
        report.driving_time_s = self._stood_s - self._set_off_s if self._driven_m > 0.0 else 0.0
        seconds = sorted(companion.outcome.tick_seconds)
        report.tick_p99_ms = 1e3 * seconds[int(0.99 * (len(seconds) - 1))] if seconds else 0.0
        if report.collisions:
            report.outcome = DriveOutcome.COLLISION
        elif companion.done:
            report.outcome = DriveOutcome.REACHED if companion.outcome.complete else DriveOutcome.INCOMPLETE
