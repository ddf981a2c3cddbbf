"""What the experiment ``driving`` drives, with the map unknown or known, and the least time that physics allows.

Nouns: course.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from companion.core.frames import NedPoint
from companion.core.grid import OBSTACLE, Cell, Grid, Weights, inflated
from companion.mapping.map_files import save_ros_map
from companion.mission.mission import HomePoint, Mission
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
    with TemporaryDirectory() as folder:
        if known:
            mission = _with_known_map(mission, scenario, Path(folder))
        run = Drive(mission, scenario, settings_with(planner), seed, NullRecorder(), TIME_LIMIT_S)
        report = run.run()
    report.track.clear()
    return CourseDrive(report, bound_s(run) if known else None)


def _on_made_ground(kind: str, seed: int) -> tuple[Mission, Scenario]:
    ground = made(kind, seed)
    mission = mission_on(ground, POINTS, seed)
    start = SimStart(*ground.start_m, math.pi / 2.0, SOMEWHERE)
    parameters = parameters_for(mission.rover, POINTS)
    return mission, Scenario(ground.world, start, SENSORS, outline_of(mission.rover), parameters)


def _with_known_map(mission: Mission, scenario: Scenario, folder: Path) -> Mission:
    """The mission with the world's obstacles as the map that is known beforehand."""
    world, start = scenario.world, scenario.start
    weights = np.where(world.layers().solid.fields, OBSTACLE, 0.5)
    save_ros_map(Grid(weights, world.resolution_m), folder / "known")
    corner = HomePoint(world.south_m - start.north_m, world.west_m - start.east_m)
    return replace(mission, prior_map=folder / "known.yaml", prior_resolution_m=world.resolution_m, prior_corner=corner)


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
        self._weights = inflated(self._sampled(world, rows, columns), max(half_m / FIELD_M - math.sqrt(0.5), 0.0))

    def _sampled(self, world: World, rows: int, columns: int) -> Weights:
        """What lies under the middle of each field."""
        middle = np.arange(max(rows, columns)) + 0.5
        south = np.floor((self._south_m + middle[:rows] * FIELD_M - world.south_m) / world.resolution_m).astype(int)
        west = np.floor((self._west_m + middle[:columns] * FIELD_M - world.west_m) / world.resolution_m).astype(int)
        solid = world.layers().solid.fields
        on_south, on_west = (south >= 0) & (south < solid.shape[0]), (west >= 0) & (west < solid.shape[1])
        weights = np.full((rows, columns), 0.5)
        weights[np.ix_(on_south, on_west)] = np.where(solid[np.ix_(south[on_south], west[on_west])], OBSTACLE, 0.5)
        return weights

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
