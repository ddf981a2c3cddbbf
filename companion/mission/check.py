"""Checks of a mission, whatever file it came from: grid, places, areas, files."""

from __future__ import annotations

import shapely

from companion.core.frames import GeoPoint
from companion.core.grid import Cell
from companion.mission import mav_commands as mav
from companion.mission.do_commands import TAKEN, DoCommand
from companion.mission.mission import Area, HomePoint, Mission, MissionError, Place
from companion.storage.files import why_no_file

LARGEST = 1e9
"""A parameter of a command is no larger: it is sent as a float."""
FASTEST_M_S = 50.0
LONGEST_HOLD_S = 1e6
MAX_GRID_FIELDS = 4_000_000
"""Larger grids are refused: the companion holds several rasters of that size."""


def check_mission(mission: Mission) -> None:
    """Raise MissionError (file, place, reason) unless the mission can be driven, as far as the file alone shows."""
    try:
        _check_grid(mission)
        for kind, areas in _areas(mission).items():
            for number, area in enumerate(areas, start=1):
                _check_area(mission, f"{kind} {number}", area)
        for number, target in enumerate(mission.targets, start=1):
            _check_place(mission, f"target {number} '{target.name}'", target.place)
        for number, target in enumerate(mission.targets, start=1):
            _check_commands(f"target {number} '{target.name}'", target.commands)
        _check_commands("where the mission begins", mission.commands)
        if not mission.targets:
            raise MissionError("target: there is none; a mission needs at least one place to go to")
        _check_files(mission)
    except MissionError as error:
        raise MissionError(f"{mission.source or mission.name}: {error}") from None


def _areas(mission: Mission) -> dict[str, tuple[Area, ...]]:
    corridors = tuple(weighted.area for weighted in mission.weighted)
    return {"keep_out": mission.keep_out, "keep_in": mission.keep_in, "corridor": corridors}


def _check_grid(mission: Mission) -> None:
    grid = mission.grid
    if grid.size is None:
        return
    if grid.home is None:
        raise MissionError("grid.home: missing; with a size, the field whose middle is home must be given")
    if grid.size[0] * grid.size[1] > MAX_GRID_FIELDS:
        raise MissionError(f"grid.size: {grid.size[0]} x {grid.size[1]} is more than {MAX_GRID_FIELDS} fields")
    if grid.margin_m is not None:
        raise MissionError("grid.margin_m: goes with a grid laid round the targets, not with a size")
    _check_place(mission, "grid.home", grid.home)


def _check_place(mission: Mission, what: str, place: Place) -> None:
    """Fields need a fixed grid; places in metres must lie in it, if there is one."""
    grid = mission.grid
    if isinstance(place, Cell):
        if grid.size is None or grid.home is None:
            raise MissionError(f"{what}: a field needs [grid] size and home; or give metres or degrees instead")
        cell = place
    elif isinstance(place, HomePoint) and grid.size is not None and grid.home is not None:
        # Home is the middle of its field.
        x = grid.home.x + 0.5 + place.east_m / grid.resolution_m
        y = grid.home.y + 0.5 + place.north_m / grid.resolution_m
        cell = Cell(int(x // 1), int(y // 1))
    else:
        return
    if not (0 <= cell.x < grid.size[0] and 0 <= cell.y < grid.size[1]):
        raise MissionError(
            f"{what}: field {cell.x}, {cell.y} is outside the grid of {grid.size[0]} x {grid.size[1]} fields"
        )


def _check_commands(what: str, commands: tuple[DoCommand, ...]) -> None:
    """Only what the autopilot takes, with finite numbers."""
    for number, command in enumerate(commands, start=1):
        if command.command not in TAKEN:
            raise MissionError(f"{what}: command {number}: {mav.command_name(command.command)} cannot be given there")
        if not all(value is None or abs(value) <= LARGEST for value in command.params):
            raise MissionError(f"{what}: command {number}: {command.name}: a parameter is no number that can be sent")


def _check_area(mission: Mission, what: str, area: Area) -> None:
    """Areas may extend beyond the grid; polygons must be simple, lines need two places."""
    if any(isinstance(place, Cell) for place in area.places) and mission.grid.size is None:
        raise MissionError(f"{what}: fields need [grid] size and home; or give metres or degrees instead")
    if area.radius_m is not None:
        return
    points = [_plane(place, area.places[0]) for place in area.places]
    if area.width_m is not None:
        if len(set(points)) < 2:
            raise MissionError(f"{what}: a line needs at least two places")
        return
    if len(set(points)) < 3:
        raise MissionError(f"{what}: a polygon needs at least three corners, not {len(set(points))}")
    if not shapely.Polygon(points).is_valid:
        raise MissionError(f"{what}: not a simple polygon: its sides cross or touch")


def _plane(place: Place, first: Place) -> tuple[float, float]:
    """Plane coordinates, good enough to see whether sides cross; longitudes are relative to the first place."""
    if isinstance(place, GeoPoint):
        west_deg = first.lon_deg if isinstance(first, GeoPoint) else 0.0
        return ((place.lon_deg - west_deg + 180.0) % 360.0 - 180.0, place.lat_deg)
    if isinstance(place, HomePoint):
        return (place.east_m, place.north_m)
    assert isinstance(place, Cell)
    return (float(place.x), float(place.y))


def _check_files(mission: Mission) -> None:
    sitl = mission.sitl
    files = [("prior_map", mission.prior_map)]
    if sitl is not None:
        files += [("sitl.world", sitl.world), ("sitl.parameters", sitl.parameters)]
    for what, path in files:
        if path is not None and (fault := why_no_file(path)):
            raise MissionError(f"{what}: {path}: {fault}")
    if sitl is not None and sitl.start is not None and sitl.world is None:
        _check_place(mission, "sitl.start", sitl.start)
