"""Our own mission files: TOML, every key checked, units in the names.

Places are fields ``[x, y]`` (x east, y north, from the south-west corner), metres north and east of home, or latitude
and longitude in degrees. Lists of places say which by their name: ``polygon_fields``, ``polygon_m``, ``polygon_deg``.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Annotated, Literal

from pydantic import BeforeValidator, Field, model_validator

from companion.core.footprint import Footprint
from companion.core.frames import GeoPoint
from companion.core.grid import Cell
from companion.mission import mav_commands as mav
from companion.mission.check import FASTEST_M_S, LARGEST, LONGEST_HOLD_S, check_mission
from companion.mission.do_commands import PARAMETERS, TAKEN, WITH_PLACE, DoCommand, command_of_name, lacking, padded
from companion.mission.ground_station_reader import load_ground_station_file
from companion.mission.mission import (
    Area,
    DrivetrainSpec,
    GridSpec,
    HomePoint,
    Mission,
    MissionError,
    MoverSpec,
    OnBlocked,
    Patrol,
    Place,
    RoverSpec,
    SitlSpec,
    Target,
    WeightedArea,
    open_ring,
)
from companion.mission.sensor_tables import SensorsTable, sensors_from, sensors_given
from companion.mission.tables import (
    Field2,
    FileName,
    Lat,
    LatLon,
    Lon,
    Metres,
    Name,
    Pair,
    Positive,
    T,
    Table,
    named,
    refuse_swapped,
)
from companion.storage.toml_file import read_table, read_toml

MAX_COMMANDS = 100
"""Of one place."""
ABOVE_HOME = 3
"""The frame of a command's place: its altitude counts from home."""


class PlaceTable(Table):
    """One place: a field, metres from home, or latitude and longitude."""

    field: Field2 | None = None
    north_m: Metres | None = None
    east_m: Metres | None = None
    lat_deg: Lat | None = None
    lon_deg: Lon | None = None

    @model_validator(mode="before")
    @classmethod
    def _not_swapped(cls, values: object) -> object:
        if isinstance(values, dict):
            refuse_swapped(values.get("lat_deg"), values.get("lon_deg"))
        return values

    def place(self) -> Place | None:
        """The place, or None if none is given. Raises ValueError when it is given twice or incompletely."""
        metres = self.north_m is not None or self.east_m is not None
        degrees = self.lat_deg is not None or self.lon_deg is not None
        if (self.field is not None) + metres + degrees > 1:
            raise ValueError("a place is given twice; use one of field, north_m and east_m, lat_deg and lon_deg")
        if self.field is not None:
            return Cell(*self.field)
        if metres:
            if self.north_m is None or self.east_m is None:
                raise ValueError("north_m and east_m are both needed")
            return HomePoint(self.north_m, self.east_m)
        if degrees:
            if self.lat_deg is None or self.lon_deg is None:
                raise ValueError("lat_deg and lon_deg are both needed")
            return GeoPoint(self.lat_deg, self.lon_deg)
        return None


OF_WORLDS = {"base", "size_m", "obstacle", "door", "slippery", "rough", "mover"}
"""What only world files have."""


class CommandTable(Table):
    """``[[target.command]]`` and ``[[command]]``: a command for the autopilot."""

    name: Annotated[str, Field(min_length=1, max_length=60)]
    params: Annotated[list[Annotated[float, Field(ge=-LARGEST, le=LARGEST)]], Field(max_length=PARAMETERS)] = Field(
        default_factory=list
    )
    lat_deg: Lat | None = None
    lon_deg: Lon | None = None
    altitude_m: Metres | None = None
    after_s: Annotated[float, Field(ge=0.0, le=1e6)] = 0.0
    delay_s: Annotated[float, Field(ge=0.0, le=1e6)] | None = None
    within_m: Annotated[float, Field(gt=0.0, le=1e6)] | None = None

    def command(self) -> DoCommand:
        """The command. Raises ValueError for one that cannot be given, or with values that do not fit it."""
        number = command_of_name(self.name)
        params: tuple[float | None, ...] = tuple(self.params)
        if len(params) > TAKEN[number]:
            raise ValueError(f"params: {self.name} has at most {TAKEN[number]}, not {len(params)}")
        given = (self.lat_deg, self.lon_deg, self.altitude_m)
        if number not in WITH_PLACE and given != (None, None, None):
            raise ValueError(f"{self.name} has no place; leave out lat_deg, lon_deg and altitude_m")
        if (self.lat_deg is None) != (self.lon_deg is None):
            raise ValueError("lat_deg and lon_deg are both needed")
        if self.after_s > 0.0 and not (self.delay_s is None and self.within_m is None):
            raise ValueError("after_s counts at the target, delay_s and within_m on the way on; give either")
        place = None
        if self.lat_deg is not None and self.lon_deg is not None:
            place = GeoPoint(self.lat_deg, self.lon_deg)
            params = (*padded(params)[:6], self.altitude_m or 0.0)
        made = DoCommand(number, padded(params), place, ABOVE_HOME, None, self.after_s, self.delay_s, self.within_m)
        if number == mav.DO_SET_ROI and place is None:
            raise ValueError(f"{self.name}: needs lat_deg and lon_deg; DO_SET_ROI_NONE looks ahead again")
        if lacks := lacking(made):
            raise ValueError(f"{self.name}: {lacks}")
        return made


class TargetTable(PlaceTable):
    """``[[target]]``."""

    name: Name | None = None
    hold_s: Annotated[float, Field(ge=0.0, le=LONGEST_HOLD_S)] = 0.0
    on_blocked: Literal["skip", "wait", "return", "hold"] = "skip"
    speed_m_s: Annotated[float, Field(gt=0.0, le=FASTEST_M_S)] | None = None
    command: Annotated[list[CommandTable], Field(default_factory=list, max_length=MAX_COMMANDS)]

    def target(self, number: int) -> Target:
        """The target; the default of its name is its number, counted from 1."""
        place = self.place()
        if place is None:
            raise ValueError("has no place; use one of field, north_m and east_m, lat_deg and lon_deg")
        name = self.name or f"target {number}"
        commands = _commands(self.command)
        return Target(name, place, self.hold_s, OnBlocked(self.on_blocked), self.speed_m_s, commands)


class AreaTable(PlaceTable):
    """``[[keep_out]]`` and ``[[keep_in]]``: a polygon, or a circle round a place."""

    polygon_fields: list[Field2] | None = None
    polygon_m: list[Pair] | None = None
    polygon_deg: list[LatLon] | None = None
    radius_m: Positive | None = None

    def area(self) -> Area:
        """The area. Raises ValueError unless it is exactly one polygon or one circle."""
        shapes = [*self.shapes()]
        middle = self.place()
        if (middle is None) != (self.radius_m is None):
            raise ValueError("a circle needs a place (field, north_m and east_m, or lat_deg and lon_deg) and radius_m")
        if middle is not None:
            shapes.append(Area((middle,), radius_m=self.radius_m))
        if len(shapes) != 1:
            raise ValueError(f"exactly one shape is needed, not {len(shapes)}")
        return shapes[0]

    def shapes(self) -> list[Area]:
        """The shapes given as lists of places."""
        lists = (self.polygon_fields, self.polygon_m, self.polygon_deg)
        return [Area(open_ring(places)) for places in _places(*lists)]


class CorridorTable(AreaTable):
    """``[[corridor]]``: ground with its own weight; also a line with a width."""

    weight: Annotated[float, Field(ge=0.0, lt=1.0)]
    line_fields: list[Field2] | None = None
    line_m: list[Pair] | None = None
    line_deg: list[LatLon] | None = None
    width_m: Positive | None = None

    def shapes(self) -> list[Area]:
        """The shapes given as lists of places."""
        lines = _places(self.line_fields, self.line_m, self.line_deg)
        if bool(lines) != (self.width_m is not None):
            raise ValueError("a line needs line_fields, line_m or line_deg, and width_m")
        return [*super().shapes(), *(Area(line, width_m=self.width_m) for line in lines)]


class GridTable(Table):
    """``[grid]``."""

    resolution_m: Annotated[float, Field(ge=0.01, le=1000.0)] = 1.0
    size: Annotated[tuple[Annotated[int, Field(ge=1)], Annotated[int, Field(ge=1)]], Field(strict=False)] | None = None
    home: Field2 | None = None
    margin_m: Annotated[float, Field(ge=0.0, le=1e6)] | None = None


class RoverTable(Table):
    """``[rover]``: a circle, or a rectangle."""

    radius_m: Annotated[float, Field(gt=0.0, le=20.0)] | None = None
    length_m: Annotated[float, Field(gt=0.0, le=20.0)] | None = None
    width_m: Annotated[float, Field(gt=0.0, le=20.0)] | None = None
    centre_forward_m: Annotated[float, Field(ge=-10.0, le=10.0)] = 0.0
    cruise_speed_m_s: Annotated[float, Field(gt=0.0, le=FASTEST_M_S)] = RoverSpec().cruise_speed_m_s
    turning_radius_m: Annotated[float, Field(ge=0.0, le=100.0)] = RoverSpec().turning_radius_m

    @model_validator(mode="after")
    def _outline(self) -> RoverTable:
        if (self.length_m is None) != (self.width_m is None):
            raise ValueError("length_m and width_m are given together")
        if self.length_m is not None and self.radius_m is not None:
            raise ValueError("give length_m and width_m, or radius_m")
        if self.length_m is None and self.centre_forward_m != 0.0:
            raise ValueError("centre_forward_m needs length_m and width_m")
        if self.length_m is not None and abs(self.centre_forward_m) >= 0.5 * self.length_m:
            raise ValueError("centre_forward_m must be less than half of length_m")
        return self

    @property
    def rover(self) -> RoverSpec:
        """The vehicle."""
        if self.length_m is None or self.width_m is None:
            radius_m = RoverSpec().radius_m if self.radius_m is None else self.radius_m
            return RoverSpec(radius_m, self.cruise_speed_m_s, self.turning_radius_m)
        rectangle = Footprint.rectangle(self.length_m, self.width_m, self.centre_forward_m)
        return RoverSpec(rectangle.radius_m, self.cruise_speed_m_s, self.turning_radius_m, rectangle)


class GeoTable(Table):
    """Latitude and longitude."""

    lat_deg: Lat
    lon_deg: Lon


class MoverTable(Table):
    """``[[sitl.movers]]``: a disc that moves in the simulator's world."""

    name: Name | None = None
    radius_m: Annotated[float, Field(gt=0.0, le=20.0)]
    speed_m_s: Annotated[float, Field(gt=0.0, le=50.0)]
    route_m: Annotated[list[Pair], Field(max_length=1000)]
    start_s: Annotated[float, Field(ge=0.0, le=1e6)] = 0.0
    repeat: bool = False
    announce: Literal["vehicle", "adsb", "ais"] | None = None

    def mover(self, number: int) -> MoverSpec:
        """The mover. Raises ValueError for fewer than two different places."""
        route = tuple(HomePoint(*pair) for pair in self.route_m)
        if len(set(route)) < 2:
            raise ValueError("route_m needs at least two different places")
        name = self.name or f"mover {number}"
        return MoverSpec(name, self.radius_m, self.speed_m_s, route, self.start_s, self.repeat, self.announce)


class DrivetrainTable(Table):
    """``[sitl.drivetrain]``: motors unlike those of the firmware's own simulated rover."""

    top_speed_m_s: Annotated[float, Field(gt=0.0, le=4.0)]
    lag_s: Annotated[float, Field(ge=0.01, le=2.0)]
    track_m: Annotated[float, Field(ge=0.1, le=5.0)]


class SitlTable(Table):
    """``[sitl]``: a real rover ignores it."""

    world: FileName | None = None
    resolution_m: Positive | None = None
    start: Field2 | None = None
    heading_deg: Annotated[float, Field(ge=-360.0, le=360.0)] = SitlSpec().heading_deg
    sensors: Annotated[SensorsTable | FileName, BeforeValidator(sensors_given)] = "lidar-90"
    home: GeoTable | None = None
    movers: Annotated[list[MoverTable], Field(max_length=100, default_factory=list)]
    steering: Literal["skid", "ackermann"] | None = None
    parameters: FileName | None = None
    drivetrain: DrivetrainTable | None = None


class PatrolTable(Table):
    """``[patrol]``: the targets from ``first`` on are driven again and again."""

    first: Name | None = None
    laps: Annotated[int, Field(ge=1, le=1_000_000)] | None = None


class MissionTable(Table):
    """The whole file."""

    name: Name | None = None
    prior_map: FileName | None = None
    fence: FileName | None = None
    grid: GridTable = GridTable()
    rover: RoverTable = RoverTable()
    target: list[TargetTable] = Field(default_factory=list)
    command: Annotated[list[CommandTable], Field(default_factory=list, max_length=MAX_COMMANDS)]
    patrol: PatrolTable | None = None
    keep_out: list[AreaTable] = Field(default_factory=list)
    keep_in: list[AreaTable] = Field(default_factory=list)
    corridor: list[CorridorTable] = Field(default_factory=list)
    sitl: SitlTable | None = None


def load(path: Path, *, simulated: bool = True) -> Mission:
    """Read a TOML mission. ``simulated``: with the ``[sitl]`` table and its files, which a real rover does not need.

    Raises MissionError: one line with file, place and reason.
    """
    _refuse_world(path)
    table = read_table(path, MissionTable, MissionError)
    mission = _mission(table if simulated else table.model_copy(update={"sitl": None}), path)
    check_mission(mission)
    return mission


def _refuse_world(path: Path) -> None:
    """Raises MissionError for a world file of the simulator."""
    keys = read_toml(path, MissionError).keys()
    if keys & OF_WORLDS and not keys & set(MissionTable.model_fields):
        raise MissionError(
            f'{path}: describes a world of the simulator, and no mission; name it in one: [sitl] world = "{path.name}"'
        )


def _fences(path: Path, name: str) -> Mission:
    """What the file of fences says. Raises MissionError, with the mission that names it."""
    try:
        return load_ground_station_file(path.parent / name, skip_unknown=True)
    except MissionError as error:
        raise MissionError(f"{path}: fence: {error}") from error


def _mission(table: MissionTable, path: Path) -> Mission:
    folder = path.parent
    fences = _fences(path, table.fence) if table.fence else None
    keep_out = tuple(_named(path, "keep_out", i, item.area) for i, item in enumerate(table.keep_out, 1))
    keep_in = tuple(_named(path, "keep_in", i, item.area) for i, item in enumerate(table.keep_in, 1))
    targets = tuple(_named(path, "target", i, partial(item.target, i)) for i, item in enumerate(table.target, 1))
    return Mission(
        name=table.name or path.stem,
        targets=targets,
        commands=tuple(_named(path, "command", i, item.command) for i, item in enumerate(table.command, 1)),
        patrol=None if table.patrol is None else _patrol(table.patrol, targets, path),
        grid=GridSpec(
            table.grid.resolution_m,
            table.grid.size,
            None if table.grid.home is None else Cell(*table.grid.home),
            table.grid.margin_m,
            by_footprint="resolution_m" not in table.grid.model_fields_set and table.grid.size is None,
        ),
        rover=table.rover.rover,
        keep_out=keep_out + (fences.keep_out if fences else ()),
        keep_in=keep_in + (fences.keep_in if fences else ()),
        weighted=tuple(
            WeightedArea(_named(path, "corridor", i, item.area), item.weight)
            for i, item in enumerate(table.corridor, 1)
        ),
        prior_map=folder / table.prior_map if table.prior_map else None,
        sitl=None if table.sitl is None else _sitl(table.sitl, path),
        source=path,
        notes=(f"fences taken from {table.fence}; its targets, if any, are not used",) if fences else (),
        also_read=tuple(folder / name for name in _also_read(table)),
    )


def _commands(tables: list[CommandTable]) -> tuple[DoCommand, ...]:
    """The commands of one place. Raises ValueError with the number of the one that is wrong."""
    made = []
    for number, table in enumerate(tables, 1):
        try:
            made.append(table.command())
        except ValueError as error:
            raise ValueError(f"command {number}: {error}") from None
    return tuple(made)


def _patrol(table: PatrolTable, targets: tuple[Target, ...], path: Path) -> Patrol:
    """Raises MissionError if no target has the name of the first one."""
    names = [target.name for target in targets]
    if table.first is not None and table.first not in names:
        raise MissionError(f"{path}: patrol.first: there is no target {table.first!r:.60}")
    return Patrol(0 if table.first is None else names.index(table.first), table.laps)


def _also_read(table: MissionTable) -> tuple[str, ...]:
    """The files whose content has become part of the mission."""
    sensors = table.sitl.sensors if table.sitl is not None else None
    names = (table.fence, sensors if isinstance(sensors, str) and sensors.endswith(".toml") else None)
    return tuple(name for name in names if name is not None)


def _sitl(table: SitlTable, path: Path) -> SitlSpec:
    return SitlSpec(
        world=path.parent / table.world if table.world else None,
        resolution_m=table.resolution_m,
        start=None if table.start is None else Cell(*table.start),
        heading_deg=table.heading_deg,
        sensors=sensors_from(table.sensors, path.parent, MissionError),
        home=None if table.home is None else GeoPoint(table.home.lat_deg, table.home.lon_deg),
        movers=tuple(_named(path, "sitl.movers", i, partial(item.mover, i)) for i, item in enumerate(table.movers, 1)),
        steering=table.steering,
        parameters=path.parent / table.parameters if table.parameters else None,
        drivetrain=None if table.drivetrain is None else DrivetrainSpec(**dict(table.drivetrain)),
    )


def _places(
    fields: list[Field2] | None, metres: list[Pair] | None, degrees: list[LatLon] | None
) -> list[tuple[Place, ...]]:
    """The given lists of places, each of one kind."""
    lists: list[tuple[Place, ...]] = []
    if fields is not None:
        lists.append(tuple(Cell(*pair) for pair in fields))
    if metres is not None:
        lists.append(tuple(HomePoint(*pair) for pair in metres))
    if degrees is not None:
        lists.append(tuple(GeoPoint(*pair) for pair in degrees))
    return lists


def _named(path: Path, kind: str, number: int, make: Callable[[], T]) -> T:
    return named(path, kind, number, make, MissionError)
