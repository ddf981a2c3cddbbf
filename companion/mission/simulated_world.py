"""What a mission file's simulated world has at a place, for ``mission check``: the start, and the targets."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from companion.core.frames import NedPoint
from companion.core.grid import Cell, Grid
from companion.mapping.map_files import load_map
from companion.mission.mission import Mission, MissionError
from companion.mission.resolve import ResolvedMission
from companion.mission.world_shapes import touches_obstacle
from companion.storage.toml_file import read_toml


@dataclass(frozen=True, eq=False, slots=True)
class SimulatedWorld:
    """A world; places in it are metres from its south-west corner. ``size_m``: east and north, None if not known here.

    ``field_m``: the side of the fields in which the mission counts; ``grid``: the map, None of a world file.
    """

    path: Path
    field_m: float
    size_m: tuple[float, float] | None
    stands_at: Callable[[NedPoint], bool]
    grid: Grid | None = None

    def holds(self, place: NedPoint) -> bool:
        """Whether the place lies in it; where its size is not known, it does."""
        if self.size_m is None:
            return True
        return 0.0 <= place.east_m < self.size_m[0] and 0.0 <= place.north_m < self.size_m[1]

    def middle_of(self, cell: Cell) -> NedPoint:
        """The middle of a field in which the mission counts."""
        return NedPoint((cell.y + 0.5) * self.field_m, (cell.x + 0.5) * self.field_m)


def world_of(mission: Mission) -> SimulatedWorld | None:
    """The world of a mission; None without one. Raises MissionError and MapError where it cannot be read."""
    sitl = mission.sitl
    if sitl is None or sitl.world is None:
        return None
    path, field_m, rover = sitl.world, sitl.resolution_m or mission.grid.resolution_m, mission.rover.footprint
    if path.suffix.lower() == ".toml":
        content = read_toml(path, MissionError)
        return SimulatedWorld(
            path,
            field_m,
            _size_m(content.get("size_m")),
            lambda at: touches_obstacle(path, content, rover, (at.north_m, at.east_m)),
        )
    grid = load_map(path, field_m)
    side_m = grid.resolution_m

    def stands_at(place: NedPoint) -> bool:
        cell = Cell(int(place.east_m // side_m), int(place.north_m // side_m))
        return grid.contains(cell) and grid.is_obstacle(cell)

    return SimulatedWorld(path, side_m, (grid.width * side_m, grid.height * side_m), stands_at, grid)


def _size_m(value: object) -> tuple[float, float] | None:
    """East and north; None for what the simulator would refuse: that is left to it."""
    match value:
        case [int() | float() as east_m, int() | float() as north_m]:
            return float(east_m), float(north_m)
    return None


def check_start(mission: Mission, world: SimulatedWorld) -> None:
    """Raises MissionError where ``sitl.start`` lies outside the world or on a wall."""
    cell = None if mission.sitl is None else mission.sitl.start
    if cell is None:
        return
    where, place = f"{mission.source or mission.name}: sitl.start: field {cell.x}, {cell.y}", world.middle_of(cell)
    if not world.holds(place):
        east_m, north_m = world.size_m or (0.0, 0.0)
        says = f"lies outside the world ({east_m:g} m east, {north_m:g} m north)"
        raise MissionError(f"{where} {says}; fields are of {world.field_m:g} m here")
    if world.stands_at(place):
        says = f"touches an obstacle of {world.path}" if world.grid is None else f"is an obstacle in {world.path}"
        raise MissionError(f"{where} {says}; choose a free field")


def doubtful_targets(mission: Mission, resolved: ResolvedMission, world: SimulatedWorld) -> list[str]:
    """A line for each target that lies outside the world or in something that always stands there.

    The rover starts at its home, so places of the mission count from there.
    """
    start = None if mission.sitl is None else mission.sitl.start or mission.grid.home
    if start is None:
        return []
    home, lines = world.middle_of(start), []
    for target in resolved.targets:
        place = NedPoint(home.north_m + target.point.north_m, home.east_m + target.point.east_m)
        if not world.holds(place):
            lines.append(f"target {target.name!r} lies outside the simulator's world {world.path}")
        elif world.stands_at(place):
            lines.append(f"target {target.name!r} lies in an obstacle of the simulator's world {world.path}")
    return lines
