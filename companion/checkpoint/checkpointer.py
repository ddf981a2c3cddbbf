"""Decides in each tick whether the state of the run must be saved, and takes the snapshots that are written.

Nouns: checkpointer, snapshot.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol

from companion.checkpoint.resume import PreviousRun, clock_ahead_s, resume_mission
from companion.checkpoint.state_format import (
    MAX_DURATION_S,
    MapPart,
    Raster,
    SavedCommands,
    SavedCommandTally,
    SavedEstimate,
    SavedFollowing,
    SavedGenerator,
    SavedGrid,
    SavedLap,
    SavedNavState,
    SavedOpenCommand,
    SavedPlace,
    SavedProgress,
    SavedRequestedGoal,
    SavedState,
    SavedTally,
)
from companion.control.model_estimate import ModelEstimate
from companion.core.frames import GeoPoint, LocalFrame, NedPoint
from companion.core.grid import Cell, Grid
from companion.core.tick_marks import Mark
from companion.executive.command_progress import CommandProgress
from companion.executive.laps import LapStart
from companion.executive.mission_executor import MissionExecutor
from companion.executive.mission_progress import MissionProgress
from companion.mapping.evidence_map import EvidenceMap
from companion.mission.identity import fingerprint
from companion.mission.mission import Mission
from companion.mission.resolve import ResolvedTarget
from companion.navigation.field_step import NavState
from companion.perception.scan_filter import Sensor
from companion.recording.recorder import RunLog
from companion.safety.mode_latch import Control
from companion.vehicle.events import LocalPositionSeen
from companion.vehicle.rc_input import Sticks
from companion.vehicle.state import VehicleState

SAVE_INTERVAL_S = 5.0
"""Interval between saves while the rover moves. A change of the mission, mode or arming is saved immediately."""
SAVE_DISTANCE_M = 0.3
UNSAVED = "The state cannot be saved: no --resume from here"
TICK_CELLS = 250_000
"""How much of the map is copied in one tick (1 MB). Larger maps take several ticks."""

Condition = tuple[MissionProgress, Control, bool, bool, bool]
"""Progress, control, armed, released, ended: a change of any of them is saved immediately."""


@dataclass(frozen=True, eq=False, slots=True)
class RunMoment:
    """The run at the end of a tick. ``released``: the program has set HOLD for the shutdown; ``done``: the run ends."""

    now_s: float
    vehicle: VehicleState
    control: Control
    executor: MissionExecutor
    position_doubted: bool
    released: bool
    done: bool


@dataclass(frozen=True, eq=False, slots=True)
class Snapshot:
    """A run at one moment. It refers to immutable values: it is cheap to take in a tick, and another thread writes it.

    ``now_s``: the program's clock. ``draws``: the random generator's state in numpy's form. The others as in
    ``SavedState``.
    """

    mission: str
    mission_sha256: str
    now_s: float
    ended: bool
    control: Control
    released: bool
    armed: bool
    boot_s: float
    ahead_s: float
    origin: GeoPoint
    home: GeoPoint
    progress: MissionProgress
    nav_state: NavState | None
    doubts_left: int
    trail: tuple[Cell, ...]
    base: Grid
    subdivisions: int
    tally: SavedTally
    draws: Mapping[str, Any] | None
    sticks_us: tuple[int, int] | None
    guarded: bool
    estimate: ModelEstimate
    range_ages: tuple[tuple[Sensor, float], ...]
    lap: LapStart
    driven_m: float


@dataclass(frozen=True, eq=False, slots=True)
class StateUpdate:
    """What changed: copied parts of the map (``new_map``: all older ones are void). A snapshot asks for a write."""

    parts: Mapping[MapPart, Raster] = field(default_factory=dict)
    snapshot: Snapshot | None = None
    new_map: bool = False


class StateWriter(Protocol):
    """Takes updates in order and writes the state file."""

    @property
    def busy(self) -> bool:
        """Whether updates are still being processed."""
        ...

    @property
    def problem(self) -> str:
        """Why the last write failed; empty if it succeeded."""
        ...

    def holds(self, progress: MissionProgress) -> bool:
        """Whether the state on the disk has the same commands of the mission open."""
        ...

    def put(self, update: StateUpdate) -> None:
        """Process an update, now or later."""
        ...

    def close(self) -> None:
        """Process what is left."""
        ...


class Checkpointer:
    """Saves the state of one run. ``previous``: the interrupted run that it resumes."""

    def __init__(self, mission: Mission, writer: StateWriter, previous: PreviousRun | None = None) -> None:
        self.previous = previous
        self._name = mission.name
        self._sha256 = fingerprint(mission)
        self._writer = writer
        self._condition: Condition | None = None
        self._map: tuple[int, bool] | None = None
        self._parts: Iterator[dict[MapPart, Raster]] | None = None
        self._map_complete = False
        self._saved_s = -math.inf
        self._saved_at = NedPoint(math.inf, math.inf)
        self._draws: Mapping[str, Any] | None = None

    @property
    def sticks(self) -> Sticks:
        """The pilot's sticks to start with."""
        return Sticks() if self.previous is None else self.previous.sticks

    @property
    def problem(self) -> str:
        """Why the state cannot be saved; empty if it can."""
        return self._writer.problem

    def problem_text(self, log: RunLog) -> str:
        """The text for the ground station, empty without a problem. Noted in the record, without the reason."""
        if not self.problem:
            return ""
        log.mark(Mark.UNSAVED)
        return UNSAVED

    def resume(self, executor: MissionExecutor, vehicle: VehicleState, now_s: float) -> bool:
        """Continue the interrupted run, whose executor has the layout of ``resumed_layout``. False if there is none."""
        if self.previous is None:
            return False
        resume_mission(self.previous, executor, vehicle, now_s)
        return True

    def holds(self, progress: MissionProgress) -> bool:
        """Whether the saved state has the same commands of the mission open."""
        return self._writer.holds(progress)

    def update(self, moment: RunMoment) -> None:
        """At the end of each tick: copy a part of the map, and write the state, if it is time."""
        executor, position, heartbeat = moment.executor, moment.vehicle.position, moment.vehicle.heartbeat
        if position is None or heartbeat is None:
            return
        if not executor.driver.planning:
            self._draws = executor.driver.searcher.rng.bit_generator.state
        ended = moment.done and executor.progress.ended
        condition = (executor.progress, moment.control, heartbeat.armed, moment.released, ended)
        changed, self._condition = condition != self._condition, condition
        the_map = (executor.maps_begun, moment.position_doubted)
        new_map, self._map = self._map not in (None, the_map), the_map
        if new_map:
            self._parts = None
        elif self._parts is None and self._is_due(moment, position):
            self._parts = _map_parts(executor.evidence)
        parts = None if self._parts is None else next(self._parts, None)
        if moment.done and not moment.position_doubted:  # no further tick is delayed by copying the whole map
            for rest in _map_parts(executor.evidence):
                self._writer.put(StateUpdate(rest))
        elif parts is not None:
            self._writer.put(StateUpdate(parts))
        copied = self._parts is not None and parts is None
        if copied:
            self._parts, self._map_complete = None, True
            self._saved_s, self._saved_at = moment.now_s, NedPoint(position.north_m, position.east_m)
        if new_map or copied or moment.done or (changed and self._map_complete):
            self._writer.put(StateUpdate(snapshot=self._snapshot(moment, position, condition), new_map=new_map))

    def close(self) -> None:
        """Write what is left."""
        self._writer.close()

    def _is_due(self, moment: RunMoment, position: LocalPositionSeen) -> bool:
        """Not while the rover stands: an older state is as good then."""
        if moment.position_doubted or self._writer.busy:
            return False
        moved_m = NedPoint(position.north_m, position.east_m).distance_m(self._saved_at)
        return moment.now_s - self._saved_s >= SAVE_INTERVAL_S and moved_m >= SAVE_DISTANCE_M

    def _snapshot(self, moment: RunMoment, position: LocalPositionSeen, condition: Condition) -> Snapshot:
        executor = moment.executor
        progress, control, armed, released, ended = condition
        driver, layout = executor.driver, executor.layout
        tally = driver.tally
        return Snapshot(
            mission=self._name,
            mission_sha256=self._sha256,
            now_s=moment.now_s,
            ended=ended,
            control=control,
            released=released,
            armed=armed,
            boot_s=position.boot_s,
            ahead_s=clock_ahead_s(position),
            origin=layout.origin,
            home=layout.home,
            progress=progress,
            nav_state=driver.nav_state if driver.goal == progress.goal else None,
            doubts_left=driver.doubts_left,
            trail=executor.trail.back()[::-1],
            base=executor.evidence.base,
            subdivisions=executor.evidence.subdivisions,
            tally=SavedTally(steps=tally.steps, return_steps=tally.return_steps, stuck=tally.stuck, epoch=driver.epoch),
            draws=self._draws,
            sticks_us=moment.vehicle.sticks.rest_us,
            guarded=moment.vehicle.guard_at(moment.now_s) is not None,
            estimate=executor.estimator.estimate,
            range_ages=executor.range_ages.found,
            lap=executor.lap_start or LapStart(moment.now_s),
            driven_m=executor.odometer.driven_m,
        )


def _map_parts(evidence: EvidenceMap) -> Iterator[dict[MapPart, Raster]]:
    """All that was seen, and all penalties, a megabyte at a time.

    Parts are copied when they are asked for: the last may be seconds newer than the first.
    """
    parts: dict[MapPart, Raster] = {}
    size = 0
    for part, cells in _parts(evidence):
        if parts and size + cells.size > TICK_CELLS:
            yield parts
            parts, size = {}, 0
        parts[part], size = cells.copy(), size + cells.size
    if parts:
        yield parts


def _parts(evidence: EvidenceMap) -> Iterator[tuple[MapPart, Raster]]:
    for rows, columns in evidence.seen.windows():
        place = rows.start, rows.stop - rows.start, columns.start, columns.stop - columns.start
        yield MapPart("log_odds", *place), evidence.log_odds[rows, columns]
    height, width = evidence.penalty.shape
    step = max(1, TICK_CELLS // width)
    for row in range(0, height, step):
        penalties = evidence.penalty[row : row + step]
        yield MapPart("penalty", row, len(penalties), 0, width), penalties


def saved_state(snapshot: Snapshot) -> SavedState:
    """The snapshot as the values of the state file. Raises ValueError for a value outside their limits."""
    home, corner = LocalFrame(snapshot.origin).to_ned(snapshot.home), snapshot.base.south_west
    ground = SavedGrid(
        north_m=corner.north_m - home.north_m,
        east_m=corner.east_m - home.east_m,
        resolution_m=snapshot.base.resolution_m,
        width=snapshot.base.width,
        height=snapshot.base.height,
        subdivisions=snapshot.subdivisions,
    )
    return SavedState(
        mission=snapshot.mission,
        mission_sha256=snapshot.mission_sha256,
        ended=snapshot.ended,
        control=snapshot.control,
        released=snapshot.released,
        armed=snapshot.armed,
        boot_s=snapshot.boot_s,
        ahead_s=snapshot.ahead_s,
        origin=(snapshot.origin.lat_deg, snapshot.origin.lon_deg),
        home=(snapshot.home.lat_deg, snapshot.home.lon_deg),
        progress=_saved_progress(snapshot.progress, snapshot.now_s),
        lap=_saved_lap(snapshot),
        commands=_saved_commands(snapshot.progress.commands, snapshot.now_s),
        nav_state=None if snapshot.nav_state is None else _saved_nav_state(snapshot.nav_state, snapshot.doubts_left),
        trail=snapshot.trail,
        ground=ground,
        tally=snapshot.tally,
        draws=None if snapshot.draws is None else _saved_generator(snapshot.draws),
        sticks_us=snapshot.sticks_us,
        guarded=snapshot.guarded,
        estimate=_saved_estimate(snapshot.estimate),
        range_ages=snapshot.range_ages,
    )


def _saved_estimate(estimate: ModelEstimate) -> SavedEstimate:
    return SavedEstimate(
        began=SavedFollowing(**estimate.began._asdict()),
        figures=SavedFollowing(**estimate.figures._asdict()),
        gathered_s=estimate.gathered_s,
        braked_s=estimate.braked_s,
        turned_s=estimate.turned_s,
        steady_s=estimate.steady_s,
    )


def _saved_progress(progress: MissionProgress, now_s: float) -> SavedProgress:
    home, give_up_s = progress.home, progress.give_up_s
    return SavedProgress(
        start=SavedPlace(name=home.name, north_m=home.point.north_m, east_m=home.point.east_m),
        statuses=progress.statuses,
        index=progress.index,
        phase=progress.phase,
        left_s=_left_s(progress.until_s, now_s),
        give_up_left_s=None if give_up_s is None else _left_s(give_up_s, now_s),
        requested=None if progress.requested is None else _saved_requested(progress.requested),
    )


def _saved_lap(snapshot: Snapshot) -> SavedLap:
    progress, lap = snapshot.progress, snapshot.lap
    return SavedLap(
        number=progress.lap,
        elapsed_s=_left_s(snapshot.now_s, lap.time_s),
        driven_m=max(snapshot.driven_m - lap.driven_m, 0.0),
        failed_before=lap.failed,
        missed=progress.missed,
    )


def _saved_commands(commands: CommandProgress, now_s: float) -> SavedCommands:
    """Only what is open, and what became of the others: the commands themselves are in the mission."""
    return SavedCommands(
        open=tuple(
            SavedOpenCommand(
                place=one.place,
                number=one.number,
                left_s=None if one.due_s is None else _left_s(one.due_s, now_s),
                on_way=one.on_way,
                announced=one.announced,
                at=None if one.at is None else SavedPlace(name="", north_m=one.at.north_m, east_m=one.at.east_m),
            )
            for one in commands.open
        ),
        tallies=tuple(
            SavedCommandTally(place=one.place, number=one.number, counts=one.counts, answer=one.answer)
            for one in commands.tallies
        ),
    )


def _left_s(until_s: float, now_s: float) -> float:
    return min(max(0.0, until_s - now_s), MAX_DURATION_S)


def _saved_requested(goal: ResolvedTarget) -> SavedRequestedGoal:
    point = goal.point
    return SavedRequestedGoal(name=goal.name, north_m=point.north_m, east_m=point.east_m, speed_m_s=goal.speed_m_s)


def _saved_nav_state(state: NavState, doubts_left: int) -> SavedNavState:
    return SavedNavState(
        past=state.past,
        returning=state.returning,
        until_search=state.until_search,
        since_better=state.since_better,
        draws=state.draws,
        doubts_left=doubts_left,
    )


def _saved_generator(state: Mapping[str, Any]) -> SavedGenerator:
    return SavedGenerator(**state["state"], has_uint32=state["has_uint32"], uinteger=state["uinteger"])
