"""From a mission file to a simulation: which world, where the rover stands, what it carries."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

from companion.frames import GeoPoint
from companion.grid import Cell, Grid
from companion.mapfiles import load_map
from companion.mission.mission import Mission, SitlSpec
from sitl.faults import FaultPlan, SensorFault
from sitl.motion import NoiseSettings
from sitl.movers import Mover, timed_track
from sitl.sensors import suite_named
from sitl.simulator import SimStart, Simulator, steered_wheels
from sitl.world import World

SOMEWHERE = GeoPoint(53.1325, 23.1688)
"""Where the rover stands on earth when no place in the mission says."""


class ScenarioError(Exception):
    """A mission that cannot be simulated; the text is one line with file, place and remedy."""


@dataclass(frozen=True, eq=False)
class Scenario:
    """Everything a simulator is made from, but the seed.

    World frame: metres north and east of the outer south-west corner of the world's field (0, 0).
    """

    world: World
    start: SimStart
    sensors: str = "lidar-90"
    rover_radius_m: float = 0.35
    parameters: dict[str, float] = field(default_factory=dict)
    turning_radius_m: float = 0.0
    """0: skid steering; else Ackermann."""
    faults: FaultPlan | None = None

    def simulator(self, seed: int, noise: bool | NoiseSettings = True) -> Simulator:
        """A rover that has just been switched on."""
        return Simulator(
            self.world,
            self.start,
            self.sensors,
            seed,
            self.rover_radius_m,
            self.parameters,
            noise,
            turning_radius_m=self.turning_radius_m,
            faults=self.faults,
        )


def scenario_from_mission(mission: Mission) -> Scenario:
    """The simulation a mission asks for; without a world file, open ground.

    A fixed grid (``grid.size``, ``grid.home``) and a world of the same resolution share their fields: the rover stands in
    the middle of ``sitl.start``, by default ``grid.home``. Raises ScenarioError, and MapError for a bad world file.
    """
    spec = mission.sitl or SitlSpec()
    name = str(mission.source or mission.name)
    try:
        suite_named(spec.sensors)
    except ValueError as error:
        raise ScenarioError(f"{name}: sitl.sensors: {error}") from error
    world, start_m = _ground(mission, spec, name)
    radius_m = mission.rover.radius_m
    if world.clearance_m(*start_m, radius_m) < radius_m:
        raise ScenarioError(
            f"{name}: sitl.start: a rover of {radius_m} m radius touches an obstacle of {spec.world} there; "
            "choose a free field"
        )
    world = replace(world, movers=_movers(spec, start_m))
    gap_m, touching = world.mover_gap_m(*start_m, 0.0)
    if gap_m < radius_m:
        raise ScenarioError(
            f"{name}: sitl.movers {touching + 1}: begins where the rover stands; let it begin farther from home"
        )
    start = SimStart(*start_m, math.radians(spec.heading_deg), _home(mission, spec))
    parameters = {"WP_SPEED": mission.rover.cruise_speed_m_s, "WP_RADIUS": 1.0, "OA_TYPE": 0.0, "AVOID_ENABLE": 0.0}
    turning_radius_m = _turning_radius_m(mission, spec, name)
    if turning_radius_m > 0.0:
        parameters |= steered_wheels(turning_radius_m)
    return Scenario(world, start, spec.sensors, radius_m, parameters, turning_radius_m)


def _turning_radius_m(mission: Mission, spec: SitlSpec, name: str) -> float:
    """The plant's, by default the rover's own; 0 for skid steering."""
    radius_m = mission.rover.turning_radius_m
    if spec.steering == "ackermann" and radius_m <= 0.0:
        raise ScenarioError(
            f"{name}: sitl.steering: ackermann needs [rover] turning_radius_m, the tightest turn it can drive"
        )
    return 0.0 if spec.steering == "skid" else radius_m


def _ground(mission: Mission, spec: SitlSpec, name: str) -> tuple[World, tuple[float, float]]:
    """The world and the start in it, metres north and east."""
    cell = spec.start or mission.grid.home
    if spec.world is None:
        return World.open(), _middle(cell, mission.grid.resolution_m) if cell else (0.0, 0.0)
    grid = load_map(spec.world, spec.resolution_m or mission.grid.resolution_m)
    grid = Grid(grid.weights, grid.resolution_m)
    if cell is None:
        raise ScenarioError(f"{name}: sitl.start: missing; say in which field of {spec.world} the rover stands")
    resolution_m = grid.resolution_m if spec.start else mission.grid.resolution_m
    start_m = _middle(cell, resolution_m)
    if not (0.0 <= start_m[0] < grid.height * grid.resolution_m and 0.0 <= start_m[1] < grid.width * grid.resolution_m):
        raise ScenarioError(
            f"{name}: sitl.start: field {cell.x}, {cell.y} lies outside {spec.world} "
            f"({grid.width} x {grid.height} fields of {grid.resolution_m} m)"
        )
    return World.from_grid(grid), start_m


def _movers(spec: SitlSpec, home_m: tuple[float, float]) -> tuple[Mover, ...]:
    """What moves, in the world frame; the mission counts metres from home, where the rover begins."""
    movers = []
    for one in spec.movers:
        places_m = [(home_m[0] + place.north_m, home_m[1] + place.east_m) for place in one.route]
        track = timed_track(places_m, one.speed_m_s, one.start_s, repeats=one.repeat)
        movers.append(Mover(one.name, one.radius_m, track, one.repeat, one.announce or ""))
    return tuple(movers)


def _middle(cell: Cell, resolution_m: float) -> tuple[float, float]:
    return (cell.y + 0.5) * resolution_m, (cell.x + 0.5) * resolution_m


def _home(mission: Mission, spec: SitlSpec) -> GeoPoint:
    """Where on earth the rover starts: as said for the simulator, as planned, or at the first target."""
    if spec.home is not None:
        return spec.home
    if mission.planned_home is not None:
        return mission.planned_home
    places = [target.place for target in mission.targets if isinstance(target.place, GeoPoint)]
    return places[0] if places else SOMEWHERE


def with_parameters(scenario: Scenario, changes: dict[str, float]) -> Scenario:
    """The same scenario with some of ArduRover's parameters changed."""
    return replace(scenario, parameters={**scenario.parameters, **changes})


def with_faults(scenario: Scenario, plan: FaultPlan | None) -> Scenario:
    """The same scenario with what goes wrong. Raises ScenarioError for a fault of something that it does not have."""
    beams = len(suite_named(scenario.sensors).beams)
    for number, fault in enumerate(plan.faults if plan else (), 1):
        missing = [one for one in fault.beams if one > beams] if isinstance(fault, SensorFault) else []
        if missing:
            raise ScenarioError(
                f"{plan.source if plan else ''}: fault {number}: beams {missing[0]}: the sensors {scenario.sensors} have "
                f"{beams} beams; leave beams out to mean all sensors"
            )
    return replace(scenario, faults=plan)
