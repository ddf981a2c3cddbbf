"""Keeps what a run would need to go on after its end: looks each tick whether it is time, takes it, and hands it to a writer."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

from companion.checkpoint.format import BandPlace, Raster
from companion.checkpoint.model import SavedDraws, SavedTally
from companion.checkpoint.resume import Kept, clock_ahead_s, nav_state, shift_of
from companion.checkpoint.snapshot import Snapshot
from companion.checkpoint.writer import Update, Writer
from companion.core.frames import NedPoint
from companion.core.grid import Cell
from companion.core.rounds import Mark
from companion.executive.goal_driver import Tally
from companion.executive.mission_executor import MissionExecutor
from companion.executive.mission_progress import Leg, MissionProgress
from companion.mapping.evidence_map import EvidenceMap
from companion.mission.identity import fingerprint
from companion.mission.mission import Mission
from companion.recording.recorder import DecisionLog
from companion.safety.mode_latch import Control
from companion.vehicle.events.vehicle import LocalPositionSeen
from companion.vehicle.rc_input import Sticks
from companion.vehicle.state import VehicleState

SAVE_S = 5.0
"""The state is written this often while the rover moves, and at once when something has happened."""
MOVED_M = 0.3
CARRIED_M = 25.0
"""A rover that is found farther than this from where it was has been carried: the leg begins anew where it stands."""
UNSAVED = "The state cannot be saved: no --resume from here"
BAND_CELLS = 250_000
"""So much of the map is copied in one tick, a megabyte; larger maps take several."""

Occasion = tuple[MissionProgress, Control, bool, bool, bool]


class Memory:
    """Of one run. ``kept`` is what an earlier one has left, if it is to be taken up."""

    def __init__(self, mission: Mission, writer: Writer, kept: Kept | None = None) -> None:
        self.kept = kept
        self._name = mission.name
        self._sha256 = fingerprint(mission)
        self._writer = writer
        self._occasion: Occasion | None = None
        self._map: tuple[int, bool] | None = None
        self._rows: Iterator[tuple[BandPlace, Raster]] | None = None
        self._complete = False
        self._saved_s = -math.inf
        self._saved_at = NedPoint(math.inf, math.inf)
        self._draws: Mapping[str, Any] | None = None

    @property
    def sticks(self) -> Sticks:
        """Where a rover's sticks rested that is still ours: who has taken hold of them since is not to be left without it."""
        ours = self.kept is not None and self.kept.state.control is Control.COMPANION
        return Sticks(self.kept.state.sticks_us if self.kept is not None and ours else None)

    @property
    def problem(self) -> str:
        """Why the state cannot be saved; empty while it can."""
        return self._writer.problem

    def heed_problem(self, log: DecisionLog) -> str:
        """What people are told of it, in words that follow from the record: the disk's own reason is known to this computer only."""
        if not self.problem:
            return ""
        log.mark(Mark.UNSAVED)
        return UNSAVED

    def take_up(self, executor: MissionExecutor, vehicle: VehicleState, now_s: float) -> bool:
        """Go on in the middle of the leg: once, with an executor on the ground of ``lay_resumed``. False: there is nothing to take up."""
        if self.kept is None:
            return False
        state = self.kept.state
        tally = Tally(state.tally.steps, state.tally.return_steps, state.tally.stuck)
        executor.driver.go_on(tally, state.tally.epoch)
        if state.draws is not None:
            executor.driver.searcher.rng.bit_generator.state = _generator(state.draws)
        shift = shift_of(state, executor.layout)
        for x, y in state.trail:
            executor.trail.enter(Cell(x + shift.x, y + shift.y))
        _look(executor, vehicle)
        progress, leg, pose = executor.progress, state.leg, vehicle.pose_at(now_s)
        drives = progress.leg in (Leg.TRAVEL, Leg.HOME) and not executor.target_refused
        if leg is not None and pose is not None and drives:
            past = nav_state(leg, shift)
            if executor.evidence.base.centre_of(past.past[-1]).distance_m(pose.point) <= CARRIED_M:
                view = executor.view(pose, vehicle.speed_m_s)
                executor.driver.take_up(progress.goal, past, leg.doubts_left, view)
        return True

    def note(
        self,
        now_s: float,
        vehicle: VehicleState,
        control: Control,
        executor: MissionExecutor,
        doubted: bool,
        released: bool,
        done: bool,
    ) -> None:
        """One tick is over. ``doubted``: the position is; ``released``: we have put the rover into HOLD; ``done``: the run ends."""
        position, heartbeat = vehicle.position, vehicle.heartbeat
        if position is None or heartbeat is None:
            return
        if not executor.driver.planning:
            self._draws = executor.driver.searcher.rng.bit_generator.state
        ended = done and executor.progress.ended
        occasion = (executor.progress, control, heartbeat.armed, released, ended)
        happened, self._occasion = occasion != self._occasion, occasion
        afresh, self._map = self._map not in (None, (executor.maps_begun, doubted)), (executor.maps_begun, doubted)
        if afresh:
            self._rows = None
        elif self._rows is None and not doubted and self._is_due(now_s, position) and not self._writer.busy:
            self._rows = _rows(executor.evidence)
        band = None if self._rows is None else next(self._rows, None)
        if done and not doubted:  # nobody waits any more
            self._writer.put(Update(dict(_rows(executor.evidence))))
        elif band is not None:
            self._writer.put(Update(dict([band])))
        through = self._rows is not None and band is None
        if through:
            self._rows, self._complete = None, True
            self._saved_s, self._saved_at = now_s, NedPoint(position.north_m, position.east_m)
        if afresh or through or done or (happened and self._complete):
            now = self._snapshot(now_s, position, vehicle.sticks, executor, occasion)
            self._writer.put(Update(snapshot=now, afresh=afresh))

    def close(self) -> None:
        """Write what is left."""
        self._writer.close()

    def _is_due(self, now_s: float, position: LocalPositionSeen) -> bool:
        """Not while the rover stands: then nothing is lost but seconds."""
        moved_m = NedPoint(position.north_m, position.east_m).distance_m(self._saved_at)
        return now_s - self._saved_s >= SAVE_S and moved_m >= MOVED_M

    def _snapshot(
        self, now_s: float, position: LocalPositionSeen, sticks: Sticks, executor: MissionExecutor, occasion: Occasion
    ) -> Snapshot:
        _, control, armed, released, ended = occasion
        driver, layout = executor.driver, executor.layout
        leg, doubts_left, epoch = driver.leg
        tally = driver.tally
        return Snapshot(
            mission=self._name,
            mission_sha256=self._sha256,
            now_s=now_s,
            ended=ended,
            control=control,
            released=released,
            armed=armed,
            boot_s=position.boot_s,
            ahead_s=clock_ahead_s(position),
            origin=layout.origin,
            home=layout.home,
            progress=executor.progress,
            leg=leg if driver.goal is executor.progress.goal else None,
            doubts_left=doubts_left,
            trail=executor.trail.back()[::-1],
            base=executor.evidence.base,
            subdivisions=executor.evidence.subdivisions,
            tally=SavedTally(steps=tally.steps, return_steps=tally.return_steps, stuck=tally.stuck, epoch=epoch),
            draws=self._draws,
            sticks_us=sticks.rest_us,
        )


def _look(executor: MissionExecutor, vehicle: VehicleState) -> None:
    """A rover that is found driving is beyond what had been seen when the state was written: what it sees now comes before the first target."""
    seen, attitude = vehicle.scan_ahead, vehicle.attitude
    pose = None if seen is None else vehicle.pose_at(seen.time_s)
    if seen is not None and attitude is not None and pose is not None:
        executor.map_scan(pose, attitude.yaw_rate_rad_s, seen.scan)


def _rows(evidence: EvidenceMap) -> Iterator[tuple[BandPlace, Raster]]:
    """The map in bands, each copied when it is asked for: some seconds may lie between the first and the last of a large one."""
    for name, raster in (("log_odds", evidence.log_odds), ("penalty", evidence.penalty)):
        height, width = raster.shape
        step = max(1, BAND_CELLS // width)
        for row in range(0, height, step):
            rows = raster[row : row + step].copy()
            yield BandPlace(name, row, len(rows)), rows


def _generator(draws: SavedDraws) -> dict[str, Any]:
    """As numpy takes it."""
    inner = {"state": draws.state, "inc": draws.inc}
    return {"bit_generator": "PCG64", "state": inner, "has_uint32": draws.has_uint32, "uinteger": draws.uinteger}
