"""The simulation of a mission: world, start, sensors, steering, parameters, faults.

Nouns: Scenario.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from companion.core.frames import GeoPoint
from companion.core.grid import Cell
from companion.lidar.spec import LidarSpec
from companion.mapping.map_files import MapError
from companion.mission.mission import Mission, RoverSpec, SitlSpec
from companion.mission.sensor_tables import sensors_from, sensors_given
from companion.vehicle.recommended_parameters import RECOMMENDED_PARAMETERS
from sitl.autopilot.parameters import DEFAULTS, REAL32, steered_wheels
from sitl.faults.fault_file import load_faults
from sitl.faults.plan import FaultPlan, LidarFault, SensorFault
from sitl.firmware.parameter_files import ParameterFile, ParameterFileError, load_parameters
from sitl.firmware.physics import Physics
from sitl.plant.closed_loop import NoiseSettings
from sitl.plant.outline import DISC, Outline, OutlinePose, mover_room_m, room_m
from sitl.plant.rover import SIM_ROVER, Drivetrain, two_wheels
from sitl.sensors.lidar_bytes import MAKES
from sitl.sensors.range_sensors import SensorSuite, suite_named
from sitl.sensors.serial_lidar import MountedLidar
from sitl.sensors.suites import suite_of
from sitl.simulator import Simulator
from sitl.world.truth import SimStart
from sitl.world.world import World
from sitl.world.world_file import load_world, movers_of

SOMEWHERE = GeoPoint(53.1325, 23.1688)
"""Latitude and longitude of the start if the mission has none."""


class ScenarioError(Exception):
    """A mission that cannot be simulated; the text is one line with file, place and remedy."""


@dataclass(frozen=True, eq=False)
class Scenario:
    """Everything from which a simulator is created, except the seed.

    World frame: metres north and east of the outer south-west corner of the world's field (0, 0).
    """

    world: World
    start: SimStart
    sensors: str | SensorSuite = "lidar-90"
    outline: Outline = DISC
    parameters: dict[str, float] = field(default_factory=dict)
    turning_radius_m: float = 0.0
    """0: skid steering; else Ackermann steering."""
    faults: FaultPlan | None = None
    kept: dict[str, int] = field(default_factory=dict)
    """Types of those parameters that have no effect."""
    drivetrain: Drivetrain = SIM_ROVER
    parameter_file: ParameterFile | None = None
    """The file from which some of the parameters come."""
    lidars: tuple[MountedLidar, ...] = ()
    """On serial lines of their own."""

    @property
    def notes(self) -> tuple[str, ...]:
        """Remarks about the parameter file, one line each."""
        return () if self.parameter_file is None else self.parameter_file.notes(self.turning_radius_m > 0.0)

    def simulator(self, seed: int, noise: bool | NoiseSettings = True) -> Simulator:
        """A rover that has just been switched on."""
        return Simulator(
            self.world,
            self.start,
            self.sensors,
            seed,
            self.outline,
            self.parameters,
            noise,
            turning_radius_m=self.turning_radius_m,
            faults=self.faults,
            kept=self.kept,
            drivetrain=self.drivetrain,
            lidars=self.lidars,
        )

    def physics(self, seed: int, *, linked: bool = False) -> Physics:
        """The same rover and world for the real firmware. Raises ScenarioError for unsuitable sensors."""
        suite = suite_named(self.sensors) if isinstance(self.sensors, str) else self.sensors
        try:
            return Physics(
                self.world, self.start, suite, seed, self.outline, self.turning_radius_m,
                linked=linked, drivetrain=self.drivetrain,
            )  # fmt: skip
        except ValueError as error:
            raise ScenarioError(f"sensors: {error}; describe fewer beams") from error


def scenario_from_mission(mission: Mission) -> Scenario:
    """The simulation of a mission; without a world file, open ground.

    A fixed grid (``grid.size``, ``grid.home``) and a world of the same resolution share their fields: the rover
    starts in the centre of ``sitl.start``, by default ``grid.home``. Raises ScenarioError, and MapError for a bad
    world file.
    """
    spec = mission.sitl or SitlSpec()
    name = str(mission.source or mission.name)
    try:
        described = suite_of(spec.sensors)
    except ValueError as error:
        raise ScenarioError(f"{name}: sitl.sensors: {error}") from error
    world, start_m = _ground(mission, spec, name)
    outline = outline_of(mission.rover)
    pose = OutlinePose(*start_m, math.radians(spec.heading_deg))
    if room_m(world.layers().solid, outline, pose, 0.0) < 0.0:
        raise ScenarioError(
            f"{name}: sitl.start: a rover of {size_in_words(mission.rover)} touches an obstacle of {spec.world} there; "
            "choose a free field"
        )
    own = len(world.movers)
    world = replace(world, movers=world.movers + movers_of(list(spec.movers), start_m))
    gap_m, touching = mover_room_m(world.fleet, outline, pose, 0.0)
    if gap_m < 0.0:
        which = f"sitl.movers {touching + 1 - own}" if touching >= own else f"{spec.world}: mover {touching + 1}"
        raise ScenarioError(f"{name}: {which}: starts where the rover stands; let it start farther from home")
    start = SimStart(*start_m, math.radians(spec.heading_deg), _home(mission, spec))
    parameters = {"WP_SPEED": mission.rover.cruise_speed_m_s, **RECOMMENDED_PARAMETERS}
    turning_radius_m = _turning_radius_m(mission, spec, name)
    sensors = spec.sensors if isinstance(spec.sensors, str) else described
    motors = spec.drivetrain
    drivetrain = SIM_ROVER if motors is None else two_wheels(motors.top_speed_m_s, motors.lag_s, motors.track_m)
    scenario = Scenario(world, start, sensors, outline, parameters, drivetrain=drivetrain)
    if spec.parameters is None:
        return steered(scenario, turning_radius_m)
    try:
        file = load_parameters(spec.parameters)
    except ParameterFileError as error:
        raise ScenarioError(str(error)) from error
    scenario = steered(scenario, _fitting_radius_m(turning_radius_m, spec, file))
    kept = {name: file.types.get(name, REAL32) for name in file.unknown}
    parameters = {**scenario.parameters, **file.known, **file.unknown}
    return replace(scenario, parameters=parameters, kept=kept, parameter_file=file)


def outline_of(rover: RoverSpec) -> Outline:
    """The outline of a mission's rover."""
    if rover.rectangle is None:
        return Outline(rover.radius_m)
    return Outline(0.0, rover.rectangle.front_m, rover.rectangle.rear_m, rover.rectangle.half_width_m)


def size_in_words(rover: RoverSpec) -> str:
    """Its radius, or length and width."""
    if rover.rectangle is None:
        return f"{rover.radius_m} m radius"
    rectangle = rover.rectangle
    return f"{rectangle.front_m + rectangle.rear_m:g} x {2.0 * rectangle.half_width_m:g} m"


def steered(scenario: Scenario, turning_radius_m: float) -> Scenario:
    """The scenario with steered wheels; unchanged for radius 0."""
    if turning_radius_m <= 0.0:
        return scenario
    parameters = scenario.parameters | steered_wheels(turning_radius_m)
    return replace(scenario, parameters=parameters, turning_radius_m=turning_radius_m)


def _fitting_radius_m(radius_m: float, spec: SitlSpec, file: ParameterFile) -> float:
    """The plant's turning radius, if the parameter file determines the kind of steering. Raises ScenarioError."""
    if file.is_skid:
        if spec.steering == "ackermann":
            raise ScenarioError(
                f"{file.path}: SERVOn_FUNCTION are those of a rover with skid steering, the mission says steering "
                "ackermann; remove that, or use another file"
            )
        return 0.0
    if file.is_steered and radius_m <= 0.0:
        if spec.steering == "skid":
            raise ScenarioError(
                f"{file.path}: SERVOn_FUNCTION are those of a rover with steered wheels, the mission says steering "
                "skid; remove that, or use another file"
            )
        turning_m = file.values.get("TURN_RADIUS", DEFAULTS["TURN_RADIUS"][0])
        if turning_m <= 0.0:
            raise ScenarioError(
                f"{file.path}: TURN_RADIUS {turning_m:g}: steered wheels need the radius of the tightest turn"
            )
        return turning_m
    return radius_m


def _turning_radius_m(mission: Mission, spec: SitlSpec, name: str) -> float:
    """The plant's turning radius, by default that of the mission's rover; 0 for skid steering."""
    radius_m = mission.rover.turning_radius_m
    if spec.steering == "ackermann" and radius_m <= 0.0:
        raise ScenarioError(
            f"{name}: sitl.steering: ackermann needs [rover] turning_radius_m, the radius of its tightest turn"
        )
    return 0.0 if spec.steering == "skid" else radius_m


def _ground(mission: Mission, spec: SitlSpec, name: str) -> tuple[World, tuple[float, float]]:
    """The world and the start in it, metres north and east."""
    cell = spec.start or mission.grid.home
    if spec.world is None:
        return World.open(), _middle(cell, mission.grid.resolution_m) if cell else (0.0, 0.0)
    try:
        world = load_world(spec.world, spec.resolution_m or mission.grid.resolution_m)
    except MapError as error:
        place = "" if mission.source is None else f"{mission.source}: sitl.world: "
        raise MapError(f"{place}{error}") from error
    if cell is None:
        raise ScenarioError(f"{name}: sitl.start: missing; give the field of {spec.world} in which the rover starts")
    shapes = spec.world.suffix.lower() == ".toml"
    own_m = (spec.resolution_m or mission.grid.resolution_m) if shapes else world.resolution_m
    start_m = _middle(cell, own_m if spec.start else mission.grid.resolution_m)
    if not (0.0 <= start_m[0] < world.height_m and 0.0 <= start_m[1] < world.width_m):
        fields = f"{world.obstacles.shape[1]} x {world.obstacles.shape[0]} fields of {world.resolution_m} m"
        size = f"{world.width_m:g} m east, {world.height_m:g} m north" if shapes else fields
        raise ScenarioError(f"{name}: sitl.start: field {cell.x}, {cell.y} lies outside {spec.world} ({size})")
    return world, start_m


def _middle(cell: Cell, resolution_m: float) -> tuple[float, float]:
    return (cell.y + 0.5) * resolution_m, (cell.x + 0.5) * resolution_m


def _home(mission: Mission, spec: SitlSpec) -> GeoPoint:
    """Latitude and longitude of the start: ``sitl.home``, the planned home, or the first target."""
    if spec.home is not None:
        return spec.home
    if mission.planned_home is not None:
        return mission.planned_home
    places = [target.place for target in mission.targets if isinstance(target.place, GeoPoint)]
    return places[0] if places else SOMEWHERE


def equipped(mission: Mission, sensors: str | None, params: Path | None) -> Mission:
    """The mission with other sensors, and with autopilot parameters from a file. Raises ScenarioError."""
    mission = mission if sensors is None else with_sensors(mission, sensors)
    return mission if params is None else with_parameter_file(mission, params)


def simulated(mission: Mission, faults: Path | None) -> Scenario:
    """The simulation of a mission, with the faults of a file. Raises ScenarioError, FaultFileError."""
    return with_faults(scenario_from_mission(mission), load_faults(faults) if faults else None)


def with_faults(scenario: Scenario, plan: FaultPlan | None) -> Scenario:
    """The scenario with faults. Raises ScenarioError for a fault of a sensor that it does not have."""
    described = isinstance(scenario.sensors, SensorSuite)
    beams = len((scenario.sensors if isinstance(scenario.sensors, SensorSuite) else suite_of(scenario.sensors)).beams)
    name = "of the mission" if described else scenario.sensors
    for number, fault in enumerate(plan.faults if plan else (), 1):
        missing = [one for one in fault.beams if one > beams] if isinstance(fault, SensorFault) else []
        if missing:
            raise ScenarioError(
                f"{plan.source if plan else ''}: fault {number}: beams {missing[0]}: the sensors {name} have "
                f"{beams} beams; leave beams out to mean all sensors"
            )
    return replace(scenario, faults=plan)


def with_lidars(scenario: Scenario, specs: Sequence[LidarSpec]) -> Scenario:
    """The scenario with lidars on serial lines, mounted as the companion is told. Raises ScenarioError.

    A fault of a lidar that is not there is one.
    """
    plan = scenario.faults
    for number, fault in enumerate(plan.faults if plan else (), 1):
        missing = [one for one in fault.lidars if one > len(specs)] if isinstance(fault, LidarFault) else []
        if missing or (isinstance(fault, LidarFault) and not specs):
            raise ScenarioError(
                f"{plan.source if plan else ''}: fault {number}: there are {len(specs)} lidars on serial lines; "
                "give them with --lidar (drive) or --lidar-pty (serve)"
            )
    return replace(scenario, lidars=tuple(_mounted(one) for one in specs))


def _mounted(spec: LidarSpec) -> MountedLidar:
    where = spec.mounting
    yaw_rad = math.radians(where.yaw_deg)
    return MountedLidar(MAKES[spec.model.name], yaw_rad, where.forward_m, where.right_m, where.flipped)


def with_sensors(mission: Mission, sensors: str) -> Mission:
    """The mission with other sensors: the name of a suite, or a TOML file. Raises ScenarioError."""
    try:
        given = sensors_from(sensors_given(sensors), Path(), ScenarioError)
    except ValueError as error:
        raise ScenarioError(f"--sensors: {error}") from error
    return replace(mission, sitl=replace(mission.sitl or SitlSpec(), sensors=given))


def with_parameter_file(mission: Mission, path: Path) -> Mission:
    """The mission with the parameters of a file."""
    return replace(mission, sitl=replace(mission.sitl or SitlSpec(), parameters=path))
