"""One trip through an environment of ``wang_environments``: plan off-line, follow, replan when the obstacles change."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from companion.core.clock import stopwatch_s
from companion.core.grid import Cell
from companion.planning.papers.wang_ga import Plan, planned
from companion.planning.problem import KinematicConstraints, ObstacleTrajectory, PlanningProblem
from companion.planning.raster import polyline
from companion.settings.planners import VertexSettings
from sitl.experiments.wang_environments import Environment

SPEEDS_M_S = (0.3, 0.7)
"""The slowest and the fastest in table IV; five levels in all."""
CHECK_STEP_S = 0.05

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Trip:
    """What came of one run: the two plans and how long planning took (None: not reached).

    ``gap_m`` is the least distance that the robot kept from the edge of a moving obstacle on the whole trip.
    """

    offline: Plan
    online: Plan | None
    first_ms: float | None
    all_ms: float | None
    offline_ms: float
    offline_first_ms: float
    gap_m: float | None

    @property
    def found(self) -> bool:
        """Whether both plans were found."""
        return self.online is not None and len(self.online.corners) > 0


def travel(corners: Floats, speeds: Floats, times_s: Floats) -> tuple[Floats, Floats]:
    """Where a robot on this path is at these times: x and y. Before it starts and after it arrives it stands."""
    steps = np.hypot(*np.diff(corners, axis=0).T)
    reached_s = np.concatenate(([0.0], np.cumsum(steps / speeds)))
    return np.interp(times_s, reached_s, corners[:, 0]), np.interp(times_s, reached_s, corners[:, 1])


def length_m(plan: Plan) -> float:
    """Length of the path."""
    return float(np.hypot(*np.diff(plan.corners, axis=0).T).sum())


def time_s(plan: Plan) -> float:
    """Travel time of the path."""
    return float((np.hypot(*np.diff(plan.corners, axis=0).T) / plan.speeds_fields_s).sum())


def least_gap_m(plan: Plan, movers: tuple[ObstacleTrajectory, ...], until_s: float) -> float:
    """The least distance from the edges of the moving obstacles until then, both simulated in small steps."""
    times_s = np.arange(0.0, min(until_s, time_s(plan)), CHECK_STEP_S)
    x, y = travel(plan.corners.astype(float), plan.speeds_fields_s, times_s)
    gaps = [
        np.hypot(x - np.interp(times_s, *m.track[:, :2].T), y - np.interp(times_s, *m.track[:, ::2].T)).min()
        - m.radius_fields
        for m in movers
    ]
    return float(min(gaps))


def make_trip(environment: Environment, settings: VertexSettings, seed: int) -> Trip:
    """Plan, follow the plan until the obstacles change, then replan with their new motion (each twice, to time it)."""
    kinematics = KinematicConstraints(speeds_fields_s=SPEEDS_M_S)
    weights, before, after = environment.weights(), environment.movers(), environment.movers_after()
    problem = PlanningProblem(
        weights, environment.start, environment.target, moving_obstacles=before, kinematics=kinematics
    )
    begun_s = stopwatch_s()
    offline = planned(problem, settings, 2 * seed, timed=True)
    planned_s = stopwatch_s()
    planned(problem, settings, 2 * seed, timed=True, first_only=True)
    offline_ms, offline_first_ms = 1e3 * (planned_s - begun_s), 1e3 * (stopwatch_s() - planned_s)
    if len(offline.corners) == 0:
        return Trip(offline, None, None, None, offline_ms, offline_first_ms, None)
    x, y = travel(offline.corners.astype(float), offline.speeds_fields_s, np.array([environment.change_s]))
    fields = polyline(offline.corners)
    here = Cell(*(int(c) for c in fields[np.argmin((fields[:, 0] - x) ** 2 + (fields[:, 1] - y) ** 2)]))
    rest = PlanningProblem(weights, here, environment.target, moving_obstacles=after, kinematics=kinematics)
    began_s = stopwatch_s()
    planned(rest, settings, 2 * seed + 1, timed=True, first_only=True)
    first_s = stopwatch_s()
    online = planned(rest, settings, 2 * seed + 1, timed=True)
    done_s = stopwatch_s()
    gap = least_gap_m(offline, before, environment.change_s)
    if len(online.corners):
        gap = min(gap, least_gap_m(online, after, np.inf))
    return Trip(offline, online, 1e3 * (first_s - began_s), 1e3 * (done_s - first_s), offline_ms, offline_first_ms, gap)
