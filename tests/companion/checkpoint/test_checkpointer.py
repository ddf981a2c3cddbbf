"""When the state of a run is saved, and what is in it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest

from companion.checkpoint.checkpointer import (
    SAVE_DISTANCE_M,
    SAVE_INTERVAL_S,
    TICK_CELLS,
    Checkpointer,
    RunMoment,
    StateUpdate,
    _map_parts,
    saved_state,
)
from companion.checkpoint.resume import resumed_estimate, resumed_nav_state
from companion.control.following import AS_SHIPPED
from companion.control.model_estimate import ModelEstimator
from companion.core.frames import GeoPoint, LocalFrame, Pose
from companion.core.grid import Cell, empty_grid
from companion.core.tick_marks import Mark
from companion.executive.goal_driver import Tally
from companion.executive.laps import LapStart, Odometer
from companion.executive.mission_executor import MissionExecutor
from companion.executive.mission_layout import MissionLayout, lay
from companion.executive.mission_progress import MissionPhase, MissionProgress, plan_progress
from companion.executive.return_path import Trail
from companion.mapping.evidence_map import EvidenceMap, new_map
from companion.mission.mission import Mission
from companion.navigation.field_step import NavState, initial_state
from companion.perception.range_age import RangeAges
from companion.recording.recorder import NullRecorder
from companion.safety.mode_latch import Control
from companion.settings import MappingSettings
from companion.vehicle.events import HeartbeatSeen, LocalPositionSeen, RoverMode
from companion.vehicle.state import VehicleState
from tests.support.rig import yard

HOME = GeoPoint(53.1327, 23.169)


class Writer:
    """Keeps what it is given."""

    def __init__(self) -> None:
        self.updates: list[StateUpdate] = []
        self.busy = False
        self.problem = ""

    def holds(self, progress: MissionProgress) -> bool:
        return True

    def put(self, update: StateUpdate) -> None:
        self.updates.append(update)

    def close(self) -> None:
        pass

    def taken(self) -> list[StateUpdate]:
        taken, self.updates = self.updates, []
        return taken


@dataclass
class PathSearcher:
    rng: np.random.Generator = field(default_factory=lambda: np.random.default_rng(7))


@dataclass
class Driver:
    goal: object
    nav_state: NavState
    planning: bool = False
    tally: Tally = field(default_factory=lambda: Tally(5, 2, 1))
    searcher: PathSearcher = field(default_factory=PathSearcher)
    doubts_left: int = 3
    epoch: int = 4


@dataclass
class Executor:
    """As much of a mission executor as is saved."""

    layout: MissionLayout
    driver: Driver
    progress: MissionProgress
    maps_begun: int = 0
    trail: Trail = field(default_factory=Trail)
    estimator: ModelEstimator = field(default_factory=lambda: ModelEstimator(AS_SHIPPED))
    range_ages: RangeAges = field(default_factory=RangeAges)
    odometer: Odometer = field(default_factory=Odometer)
    lap_start: LapStart | None = None

    @property
    def evidence(self) -> EvidenceMap:
        return self.layout.evidence


@dataclass
class Bench:
    """A checkpointer, and a run that it looks at."""

    checkpointer: Checkpointer
    writer: Writer
    executor: Executor
    now_s: float = 100.0
    north_m: float = 0.0

    def update(self, **changes: Any) -> list[StateUpdate]:
        position = LocalPositionSeen(self.now_s, self.now_s - 90.0, self.north_m, 0.0, 0.0, 0.0)
        vehicle = VehicleState(heartbeat=HeartbeatSeen(self.now_s, RoverMode.GUIDED, True, 1), position=position)
        executor = cast(MissionExecutor, self.executor)
        moment = RunMoment(self.now_s, vehicle, Control.COMPANION, executor, False, False, False)
        self.checkpointer.update(replace(moment, **changes))
        self.now_s += 0.05
        return self.writer.taken()

    def until_saved(self) -> None:
        while not any(update.snapshot for update in self.update()):
            assert self.now_s < 200.0


@pytest.fixture
def mission(tmp_path: Path) -> Mission:
    return yard(tmp_path)


@pytest.fixture
def bench(mission: Mission) -> Bench:
    home = LocalFrame(HOME).to_ned(HOME)
    layout = lay(mission, MappingSettings(), HOME, HOME, Pose(home.north_m, home.east_m, 0.0, 0.0))
    progress = plan_progress(layout.targets, layout.start)
    driver = Driver(progress.goal, initial_state(Cell(2, 7), progress.goal.cell, 9, 5))
    executor, writer = Executor(layout, driver, progress), Writer()
    executor.trail.enter(Cell(2, 7))
    return Bench(Checkpointer(mission, writer), writer, executor)


def test_the_map_is_saved_before_the_first_snapshot(bench: Bench) -> None:
    assert [(bool(update.parts), update.snapshot) for update in bench.update()] == [(True, None)]
    bench.until_saved()


def test_nothing_is_saved_before_position_and_heartbeat_are_known(bench: Bench) -> None:
    assert bench.update(vehicle=VehicleState()) == []


@pytest.mark.parametrize(
    ("later_s", "north_m", "busy", "doubted", "due"),
    [
        (SAVE_INTERVAL_S + 0.1, SAVE_DISTANCE_M, False, False, True),
        (SAVE_INTERVAL_S - 0.2, 5.0, False, False, False),
        (100.0, SAVE_DISTANCE_M - 0.01, False, False, False),
        (100.0, 5.0, True, False, False),
    ],
    ids=["due", "too soon", "standing", "writer busy"],
)
def test_it_is_saved_again_after_a_while_if_the_rover_has_moved(
    bench: Bench, later_s: float, north_m: float, busy: bool, doubted: bool, due: bool
) -> None:
    bench.until_saved()
    bench.now_s += later_s - 0.05
    bench.north_m, bench.writer.busy = north_m, busy
    assert bool(bench.update(position_doubted=doubted)) is due


def leg_ends(bench: Bench) -> dict[str, Any]:
    bench.executor.progress = replace(bench.executor.progress, phase=MissionPhase.WAIT)
    return {}


@pytest.mark.parametrize(
    "change",
    [leg_ends, lambda _: {"control": Control.PERSON}, lambda _: {"released": True}],
    ids=["progress", "a person takes over", "released"],
)
def test_a_change_is_saved_immediately(bench: Bench, change: Callable[[Bench], dict[str, Any]]) -> None:
    bench.until_saved()
    assert bench.update() == []
    (update,) = bench.update(**change(bench))
    assert update.snapshot is not None and not update.parts and not update.new_map


@pytest.mark.parametrize("doubted", [False, True])
def test_a_map_that_was_forgotten_is_void_in_the_file_at_once(bench: Bench, doubted: bool) -> None:
    bench.until_saved()
    bench.executor.maps_begun += not doubted
    (update,) = bench.update(position_doubted=doubted)
    assert update.new_map and update.snapshot is not None and not update.parts


def test_at_the_end_the_whole_map_is_saved(bench: Bench) -> None:
    bench.update()
    bench.executor.evidence.seen.add(5, 5, 9, 9)
    first, last = bench.update(done=True)
    assert {part.raster for part in first.parts} == {"log_odds", "penalty"}
    assert last.snapshot is not None and not last.snapshot.ended, "the mission is not over"


def test_the_state_has_what_a_resumed_run_needs(bench: Bench, mission: Mission) -> None:
    old = ((196, "obstacle distance", 0), 0.15)
    bench.executor.range_ages.go_on([old])
    bench.until_saved()
    bench.executor.progress = replace(bench.executor.progress, phase=MissionPhase.STAY, until_s=bench.now_s + 7.0)
    (update,) = bench.update(released=True)
    assert update.snapshot is not None
    state = saved_state(update.snapshot)
    assert (state.mission, state.released, state.control, state.armed) == (mission.name, True, Control.COMPANION, True)
    assert state.progress.left_s == pytest.approx(7.0) and state.ahead_s == pytest.approx(90.0)
    assert state.nav_state is not None and state.trail == ((2, 7),)
    restored, driver = resumed_nav_state(state.nav_state, Cell(0, 0)), bench.executor.driver
    assert restored.past == driver.nav_state.past and restored.draws == driver.nav_state.draws
    assert (state.tally.steps, state.tally.epoch) == (5, 4)
    assert state.estimate is not None
    assert resumed_estimate(state.estimate) == bench.executor.estimator.estimate
    assert state.range_ages == (old,)
    assert state.draws is not None
    assert state.draws.state == driver.searcher.rng.bit_generator.state["state"]["state"]


def test_the_navigators_state_of_another_target_is_not_saved(bench: Bench) -> None:
    bench.executor.driver.goal = None
    bench.update()
    _, update = bench.update(done=True)
    assert update.snapshot is not None and saved_state(update.snapshot).nav_state is None


def test_a_problem_is_noted_in_the_record(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    marks: list[Mark] = []
    log = NullRecorder()
    monkeypatch.setattr(log, "mark", marks.append)
    assert bench.checkpointer.problem_text(log) == "" and marks == []
    bench.writer.problem = "/home/pi/state: No space left on device"
    text = bench.checkpointer.problem_text(log)
    assert marks == [Mark.UNSAVED] and text and "space" not in text


def test_a_large_map_is_copied_a_megabyte_at_a_time() -> None:
    evidence = new_map(empty_grid(1000, 900), 0.35, MappingSettings(evidence_m=0.5))
    evidence.log_odds[:] = np.arange(evidence.log_odds.size, dtype=np.float32).reshape(evidence.log_odds.shape)
    evidence.seen.add(0, 0, 2000, 1800)
    copies = list(_map_parts(evidence))
    assert all(sum(cells.size for cells in copy.values()) <= TICK_CELLS for copy in copies) and len(copies) > 10
    fine, coarse = np.zeros_like(evidence.log_odds), np.ones_like(evidence.penalty)
    for part, cells in (one for copy in copies for one in copy.items()):
        rows, x = slice(part.first_row, part.first_row + part.rows), part.first_column
        (fine if part.raster == "log_odds" else coarse)[rows, x : x + part.columns] = cells
    assert np.array_equal(fine, evidence.log_odds) and np.array_equal(coarse, evidence.penalty)


def test_of_a_large_map_only_what_was_seen_is_copied_and_always_in_the_same_rows() -> None:
    evidence, places = new_map(empty_grid(1000, 900), 0.35, MappingSettings(evidence_m=0.5)), []
    for x in (700, 650, 1200):
        evidence.seen.add(x, 500, x + 30, 540)
        parts = [part for copy in _map_parts(evidence) for part in copy if part.raster == "log_odds"]
        places.append([(part.first_row, part.rows) for part in parts])
        assert sum(part.rows * part.columns for part in parts) <= 64 * 580
    assert places[0] == places[1] == places[2]
    copy = next(_map_parts(evidence))
    evidence.log_odds[:] = 7.0
    assert not any(cells.any() for cells in copy.values()), "what is told later is what it was"
