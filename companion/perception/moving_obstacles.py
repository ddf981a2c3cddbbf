"""Moving obstacles round the rover: where each will be, for collision avoidance and for planners.

Announced ones (other vehicles, ADS-B, AIS) and those that the range sensors track are the same here: a disc that
goes on as it does now.

Nouns: moving obstacle.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from companion.core.frames import LocalFrame, NedPoint, Pose
from companion.core.grid import Grid
from companion.planning.problem import ObstacleTrajectory
from companion.settings import TrafficSettings
from companion.vehicle.events import OtherSeen
from companion.vehicle.state import VehicleState

SAME_M = 1.2
"""A thing that is seen this near to an announced place is the one that was announced."""


@dataclass(frozen=True, slots=True)
class Moving:
    """A disc that was at ``point`` (local frame) at ``time_s`` and goes on evenly."""

    name: str
    time_s: float
    point: NedPoint
    north_m_s: float
    east_m_s: float
    radius_m: float

    @property
    def speed_m_s(self) -> float:
        """How fast it goes."""
        return math.hypot(self.north_m_s, self.east_m_s)

    def at(self, time_s: float) -> NedPoint:
        """Where it is at a moment."""
        since_s = time_s - self.time_s
        return NedPoint(self.point.north_m + self.north_m_s * since_s, self.point.east_m + self.east_m_s * since_s)


def announced(
    vehicle: VehicleState, pose: Pose, rover_radius_m: float, settings: TrafficSettings
) -> tuple[Moving, ...]:
    """The vehicles announced lately that are on our level and come near enough within the horizon to matter.

    One that claims to be where the rover itself is, is the rover: its own transponder, heard again.
    """
    if vehicle.origin is None:
        return ()
    frame = LocalFrame(vehicle.origin.point)
    found = []
    for other in vehicle.others.values():
        radius_m = other.radius_m if other.radius_m is not None else settings.radius_m
        moving = Moving(other.name, other.seen_s, frame.to_ned(other.point), other.north_m_s, other.east_m_s, radius_m)
        fresh = pose.time_s - other.seen_s <= settings.stale_s
        own = moving.at(pose.time_s).distance_m(pose.point) < rover_radius_m
        if fresh and not own and _on_our_level(other, vehicle, settings) and _comes_near(moving, pose, settings):
            found.append(moving)
    return tuple(found)


def merged(told: tuple[Moving, ...], seen: tuple[Moving, ...], now_s: float) -> tuple[Moving, ...]:
    """All that moves; of a thing both seen and announced the announcement counts, which knows its motion better."""
    alone = [one for one in seen if all(one.at(now_s).distance_m(other.at(now_s)) > SAME_M for other in told)]
    return (*told, *alone)


def motion_changed(planned: tuple[Moving, ...], now: tuple[Moving, ...], settings: TrafficSettings) -> bool:
    """Whether a plan made among ``planned`` is out of date: something new moves, or moves otherwise than it did."""
    before = {one.name: one for one in planned}
    for one in now:
        then = before.get(one.name)
        if then is None and one.speed_m_s >= settings.moving_m_s:
            return True
        if then is not None:
            change_m_s = math.hypot(one.north_m_s - then.north_m_s, one.east_m_s - then.east_m_s)
            if change_m_s > settings.changed_m_s:
                return True
    return False


def planners_movers(
    moving: tuple[Moving, ...], grid: Grid, rover_radius_m: float, now_s: float, settings: TrafficSettings
) -> tuple[ObstacleTrajectory, ...]:
    """The same for a planner: time from now, places in fields of the grid, the rover's radius added."""
    return tuple(
        ObstacleTrajectory(
            grid.fields(one.radius_m + rover_radius_m),
            np.array([(ahead_s, *grid.in_fields(one.at(now_s + ahead_s))) for ahead_s in (0.0, settings.horizon_s)]),
        )
        for one in moving
    )


def _on_our_level(other: OtherSeen, vehicle: VehicleState, settings: TrafficSettings) -> bool:
    """Not in the air above us; one that does not tell its height might be beside us."""
    own_m = None if vehicle.global_position is None else vehicle.global_position.altitude_m
    if own_m is None or other.altitude_m is None:
        return True
    return abs(other.altitude_m - own_m) <= settings.level_m


def _comes_near(moving: Moving, pose: Pose, settings: TrafficSettings) -> bool:
    """Whether it is, or within the horizon will be, within ``reach_m`` of where the rover is now."""
    here = moving.at(pose.time_s)
    north_m, east_m = here.north_m - pose.north_m, here.east_m - pose.east_m
    speed2 = moving.speed_m_s**2
    towards = -(north_m * moving.north_m_s + east_m * moving.east_m_s)
    when_s = min(max(towards / speed2, 0.0), settings.horizon_s) if speed2 > 0.0 else 0.0
    nearest_m = math.hypot(north_m + moving.north_m_s * when_s, east_m + moving.east_m_s * when_s)
    return nearest_m - moving.radius_m <= settings.reach_m
