"""What the experiment ``driving`` drives, with the map unknown or known, and the least time that physics allows.

Nouns: course.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from companion.app import Status
from companion.core.frames import NedPoint
from companion.core.grid import BASE_WEIGHT, OBSTACLE, Cell, inflated
from companion.mapping.evidence_map import EvidenceMap, restore
from companion.mission.mission import Mission
from companion.planning.problem import Budget, PlanningProblem
from companion.planning.registry import make_planner
from companion.recording.recorder import NullRecorder
from companion.settings import PlannerSettings
from sitl.experiments.controllers import SENSORS, mission_on
from sitl.experiments.experiment import POINTS
from sitl.experiments.navigation import settings_with
from sitl.experiments.off_model import parameters_for
from sitl.generators.made_ground import made
from sitl.lockstep import Drive, Report
from sitl.scenario import SOMEWHERE, Scenario, outline_of, scenario_from_mission
from sitl.world.truth import SimStart
from sitl.world.world import World

TIME_LIMIT_S = 1800.0
TELL_S = 0.1
"""So soon after its beginning a map is told."""
FIELD_M = 0.25
"""Fields for the shortest way."""


@dataclass(frozen=True, slots=True)
class CourseDrive:
    """One drive. ``bound_s``: the shortest way of the footprint at cruise speed, and the stays; None: not asked for."""

    report: Report
    bound_s: float | None = None


def drive(course: Mission | str, planner: str, seed: int, known: bool = False) -> CourseDrive:
    """One drive in lock-step. ``course``: a mission, or a kind of ground, of which each seed draws another one.

    ``known``: the companion has the true map from the start; ``bound_s`` is worked out.
    """
    if isinstance(course, Mission):
        mission, scenario = course, scenario_from_mission(course)
    else:
        mission, scenario = _on_made_ground(course, seed)
    run = Drive(mission, scenario, settings_with(planner), seed, NullRecorder(), TIME_LIMIT_S)
    told = _ToldMap(run) if known else None
    report = run.run() if told is None else run.run(told.observe, TELL_S)
    report.track.clear()
    return CourseDrive(report, bound_s(run) if known else None)


def _on_made_ground(kind: str, seed: int) -> tuple[Mission, Scenario]:
    ground = made(kind, seed)
    mission = mission_on(ground, POINTS, seed)
    start = SimStart(*ground.start_m, math.pi / 2.0, SOMEWHERE)
    parameters = parameters_for(mission.rover, POINTS)
    return mission, Scenario(ground.world, start, SENSORS, outline_of(mission.rover), parameters)


class _ToldMap:
    """Tells the companion the true world once its map begins, as if it had seen all of it many times."""

    def __init__(self, run: Drive) -> None:
        self._run = run
        self._evidence: EvidenceMap | None = None

    def observe(self, status: Status) -> None:
        """To be called now and then. Tells each new map once."""
        executor = self._run.companion.mission_run.executor
        if executor is None or executor.evidence is self._evidence:
            return
        self._evidence = evidence = executor.evidence
        rows, columns = evidence.log_odds.shape
        world, start, home = self._run.scenario.world, self._run.scenario.start, executor.progress.home.point
        corner, size_m = evidence.base.south_west, evidence.evidence_m
        south_m = start.north_m + corner.north_m - home.north_m
        west_m = start.east_m + corner.east_m - home.east_m
        solid = sampled(world, south_m, west_m, size_m, (rows, columns))
        log_odds = np.where(solid, evidence.settings.limit, -evidence.settings.free_limit).astype(np.float32)
        restore(evidence, log_odds, np.zeros_like(evidence.penalty))


def sampled(world: World, south_m: float, west_m: float, field_m: float, shape: tuple[int, int]) -> NDArray[np.bool_]:
    """Where obstacles lie under the middles of fields; the corner in the world frame. Beyond the world nothing does."""
    rows, columns = (np.arange(size) + 0.5 for size in shape)
    solid = world.layers().solid.fields
    south = np.floor((south_m + rows * field_m - world.south_m) / world.resolution_m).astype(int)
    west = np.floor((west_m + columns * field_m - world.west_m) / world.resolution_m).astype(int)
    on_south, on_west = (south >= 0) & (south < solid.shape[0]), (west >= 0) & (west < solid.shape[1])
    found = np.zeros(shape, np.bool_)
    found[np.ix_(on_south, on_west)] = solid[np.ix_(south[on_south], west[on_west])]
    return found


def bound_s(run: Drive) -> float:
    """Seconds that nothing can beat: the shortest way past all targets at cruise speed, and the stays before the last.

    The way is any-angle, of a disc as wide as the rover, on fields of ``FIELD_M``, and ends where targets count as
    reached; neither turning nor gathering speed takes time. The grid makes no way longer: obstacles grow by half a
    field's diagonal less. Fences do not count.
    """
    executor = run.companion.mission_run.executor
    if executor is None:
        return math.nan
    home, start = executor.progress.home.point, run.scenario.start
    places = [
        (start.north_m + point.north_m - home.north_m, start.east_m + point.east_m - home.east_m)
        for point in (home, *(target.point for target in executor.progress.targets))
    ]
    outline = run.scenario.outline
    way_m = shortest_way_m(run.scenario.world, places, outline.radius_m or outline.half_width_m)
    # Each target is reached from this far away.
    way_m -= run.settings.guidance.arrival_m * (2 * len(places) - 3)
    stays_s = sum(target.hold_s for target in run.mission.targets[:-1])
    return way_m / run.mission.rover.cruise_speed_m_s + stays_s


def shortest_way_m(world: World, places: list[tuple[float, float]], half_m: float) -> float:
    """The shortest way of a disc of that radius past all places, metres north and east; NaN where there is none."""
    ground = _Ground(world, places, half_m)
    return sum(ground.way_m(*ends) for ends in pairwise(places))


class _Ground:
    """The world's obstacles on fine fields, grown by the rover. Beyond the world it reaches as far as the places."""

    def __init__(self, world: World, places: list[tuple[float, float]], half_m: float) -> None:
        norths, easts = zip(*places, strict=True)
        self._south_m = min(*norths, world.south_m)
        self._west_m = min(*easts, world.west_m)
        rows = math.ceil((max(*norths, world.south_m + world.height_m) - self._south_m) / FIELD_M) + 1
        columns = math.ceil((max(*easts, world.west_m + world.width_m) - self._west_m) / FIELD_M) + 1
        solid = sampled(world, self._south_m, self._west_m, FIELD_M, (rows, columns))
        weights = np.where(solid, OBSTACLE, BASE_WEIGHT)
        self._weights = inflated(weights, max(half_m / FIELD_M - math.sqrt(0.5), 0.0))

    def way_m(self, start_m: tuple[float, float], target_m: tuple[float, float]) -> float:
        """The shortest way, any angle; NaN where there is none."""
        start, target = (
            Cell(math.floor((east_m - self._west_m) / FIELD_M), math.floor((north_m - self._south_m) / FIELD_M))
            for north_m, east_m in (start_m, target_m)
        )
        if start == target:
            return NedPoint(*start_m).distance_m(NedPoint(*target_m))
        problem = PlanningProblem(self._weights, start, target)
        path = make_planner("theta-star", PlannerSettings()).plan(problem, Budget(), np.random.default_rng(0)).path
        if path is None or path.curve is None:
            return math.nan
        return FIELD_M * float(np.hypot(*np.diff(path.curve, axis=0).T).sum())
