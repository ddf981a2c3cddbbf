"""A run at one moment, by references to values that never change: cheap to take in a tick, made into a state in another thread."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from companion.checkpoint.model import (
    LONGEST_S,
    SavedDraws,
    SavedErrand,
    SavedGround,
    SavedLeg,
    SavedPlace,
    SavedProgress,
    SavedState,
    SavedTally,
)
from companion.core.frames import GeoPoint, LocalFrame
from companion.core.grid import Cell, Grid
from companion.executive.mission_progress import MissionProgress
from companion.mission.resolve import ResolvedTarget
from companion.navigation.field_step import NavState
from companion.safety.mode_latch import Control


@dataclass(frozen=True, eq=False, slots=True)
class Snapshot:
    """``now_s``: our clock; ``draws``: the random generator's state, as numpy gives it. The rest as in SavedState."""

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
    leg: NavState | None
    doubts_left: int
    trail: tuple[Cell, ...]
    base: Grid
    subdivisions: int
    tally: SavedTally
    draws: Mapping[str, Any] | None
    sticks_us: tuple[int, int] | None


def saved_state(now: Snapshot) -> SavedState:
    """The snapshot as plain values."""
    home, corner = LocalFrame(now.origin).to_ned(now.home), now.base.south_west
    ground = SavedGround(
        north_m=corner.north_m - home.north_m,
        east_m=corner.east_m - home.east_m,
        resolution_m=now.base.resolution_m,
        width=now.base.width,
        height=now.base.height,
        subdivisions=now.subdivisions,
    )
    return SavedState(
        mission=now.mission,
        mission_sha256=now.mission_sha256,
        ended=now.ended,
        control=now.control,
        released=now.released,
        armed=now.armed,
        boot_s=now.boot_s,
        ahead_s=now.ahead_s,
        origin=(now.origin.lat_deg, now.origin.lon_deg),
        home=(now.home.lat_deg, now.home.lon_deg),
        progress=_progress(now.progress, now.now_s),
        leg=None if now.leg is None else _leg(now.leg, now.doubts_left),
        trail=now.trail,
        ground=ground,
        tally=now.tally,
        draws=None if now.draws is None else _draws(now.draws),
        sticks_us=now.sticks_us,
    )


def _progress(progress: MissionProgress, now_s: float) -> SavedProgress:
    give_up_s = progress.give_up_s
    return SavedProgress(
        start=SavedPlace(
            name=progress.home.name, north_m=progress.home.point.north_m, east_m=progress.home.point.east_m
        ),
        statuses=progress.statuses,
        index=progress.index,
        leg=progress.phase,
        left_s=_left_s(progress.until_s, now_s),
        give_up_left_s=None if give_up_s is None else _left_s(give_up_s, now_s),
        errand=None if progress.requested is None else _errand(progress.requested),
    )


def _left_s(until_s: float, now_s: float) -> float:
    return min(max(0.0, until_s - now_s), LONGEST_S)


def _errand(errand: ResolvedTarget) -> SavedErrand:
    point = errand.point
    return SavedErrand(name=errand.name, north_m=point.north_m, east_m=point.east_m, speed_m_s=errand.speed_m_s)


def _leg(state: NavState, doubts_left: int) -> SavedLeg:
    return SavedLeg(
        past=state.past,
        returning=state.returning,
        until_search=state.until_search,
        since_better=state.since_better,
        draws=state.draws,
        doubts_left=doubts_left,
    )


def _draws(state: Mapping[str, Any]) -> SavedDraws:
    return SavedDraws(**state["state"], has_uint32=state["has_uint32"], uinteger=state["uinteger"])
