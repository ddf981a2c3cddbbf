"""``rover-companion mission check``: prints how a mission file is understood."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from companion.cli.given import RadiusM, ResolutionM, SpeedMS
from companion.cli.inputs import EXIT_BAD_INPUT, SkipUnknown, usable_settings
from companion.cli.source import warn_of_places, warning
from companion.core.frames import GeoPoint, LocalFrame, NedPoint
from companion.core.grid import OBSTACLE, Cell, Grid
from companion.executive.controller_choice import another_controller, settings_for
from companion.executive.open_gaps import map_at_start, open_gap_m
from companion.mapping.evidence_map import EvidenceMap
from companion.mapping.map_files import MapError, load_map
from companion.mission.do_commands import DoCommand
from companion.mission.doubtful_places import doubtful_places
from companion.mission.field_size import FieldSize, field_size
from companion.mission.given import Given, with_given
from companion.mission.load import load_mission
from companion.mission.mission import Area, GridTooLargeError, Here, Mission, MissionError, MoverSpec, Place, RoverSpec
from companion.mission.outline_hint import guard_hint, outline_hint
from companion.mission.resolve import ResolvedMission, resolve
from companion.mission.sensor_tables import BEAMS
from companion.mission.simulated_world import SimulatedWorld, check_start, doubtful_targets, world_of
from companion.settings import Settings, SettingsError

app = typer.Typer(name="mission", add_completion=False)


@app.callback()
def group() -> None:
    """Mission files: `mission check FILE` says what is understood of one."""


@app.command()
def check(
    mission_file: Annotated[Path, typer.Argument(metavar="FILE", help="TOML, .plan or .waypoints file.")],
    resolution_m: ResolutionM = None,
    radius_m: RadiusM = None,
    speed_m_s: SpeedMS = None,
    skip_unknown: SkipUnknown = False,
    settings_file: Annotated[
        Path | None, typer.Option("--settings", help="TOML file that the mission is to be driven with.")
    ] = None,
) -> None:
    """Print what was understood of FILE. Exit code 0, or 2 with one line of reason."""
    try:
        settings = usable_settings(settings_file)
        mission = load_mission(mission_file, skip_unknown=skip_unknown)
        mission = with_given(mission, Given(resolution_m, radius_m, speed_m_s))
        world = world_of(mission)
        maps = _maps(mission, world)
        if world is not None:
            check_start(mission, world)
        _check_start_known(mission)
        asked, settings = settings.guidance.controller, _in_force(settings, mission)
        resolved = _resolved(mission, settings)
    except (MissionError, MapError, SettingsError) as error:
        typer.echo(str(error), err=True)
        raise typer.Exit(EXIT_BAD_INPUT) from error
    show(mission, settings, maps, Console(highlight=False))
    warn_of_places(mission, lambda line: typer.echo(warning(line)))
    if text := another_controller(asked, settings.guidance.controller, narrow_sight=_has_beams(mission)):
        typer.echo(warning(text))
    for line in _doubtful_in(world, mission, resolved):
        typer.echo(warning(line))


def warn_of_world(mission: Mission, warn: Callable[[str], None]) -> None:
    """Say which targets lie outside the simulator's world, or in its walls. Raises MissionError and MapError."""
    settings = _in_force(Settings(), mission)
    for line in _doubtful_in(world_of(mission), mission, _try_resolve(mission, settings)):
        warn(line)


def _in_force(settings: Settings, mission: Mission) -> Settings:
    """Those of the controller that really leads the rover."""
    return settings_for(settings, narrow_sight=_has_beams(mission), turning_radius_m=mission.rover.turning_radius_m)


def _doubtful_in(world: SimulatedWorld | None, mission: Mission, resolved: ResolvedMission | None) -> list[str]:
    return [] if world is None or resolved is None else doubtful_targets(mission, resolved, world)


def _check_start_known(mission: Mission) -> None:
    """Raises MissionError unless it is known where the rover stands in the simulator's world."""
    sitl = mission.sitl
    if sitl is not None and sitl.world is not None and sitl.start is None and mission.grid.home is None:
        says = f"missing; give the field of {sitl.world} in which the rover starts"
        raise MissionError(f"{mission.source or mission.name}: sitl.start: {says}")


def _resolved(mission: Mission, settings: Settings) -> ResolvedMission | None:
    """Like ``_try_resolve``. Where the grid is too large, all places that may be the reason are named first."""
    try:
        return _try_resolve(mission, settings)
    except GridTooLargeError as error:
        for line in doubtful_places(mission):
            if line not in str(error):
                typer.echo(warning(line), err=True)
        raise


def _try_resolve(mission: Mission, settings: Settings) -> ResolvedMission | None:
    """The mission as at the start of a run, if the file alone says where home is.

    This finds targets inside a fence, and a grid that is too large. A rover's home may differ from the planned home, so
    a mission in degrees is resolved only where the file has one, and then only a grid that is too large is refused.
    Raises MissionError.
    """
    size = _size_of(mission, settings)
    if _first_in_degrees(mission) is None:
        return resolve(mission, LocalFrame(GeoPoint(0.0, 0.0)), NedPoint(0.0, 0.0), size=size)
    if mission.planned_home is None:
        return None
    try:
        return resolve(mission, LocalFrame(mission.planned_home), NedPoint(0.0, 0.0), size=size)
    except GridTooLargeError:
        raise
    except (MissionError, MapError):
        return None


def _size_of(mission: Mission, settings: Settings) -> FieldSize:
    """By the rover, and by whether the mission is to be simulated with single beams alone."""
    return field_size(mission.rover, settings.mapping, narrow_sight=_has_beams(mission))


def _has_beams(mission: Mission) -> bool:
    return mission.sitl is not None and mission.sitl.sensors == BEAMS


def _first_in_degrees(mission: Mission) -> GeoPoint | None:
    """The first place in degrees, if there is any."""
    return next((place for place in _all_places(mission) if isinstance(place, GeoPoint)), None)


def _map_at_start(mission: Mission, settings: Settings, *, narrow_sight: bool) -> EvidenceMap | None:
    """The map as at the start of a run; None where it cannot be laid, or where it depends on a home that is not known.

    Fields of a size that is given lie round any home alike: the first place in degrees may stand for it.
    """
    somewhere = _first_in_degrees(mission)
    home = mission.planned_home or (GeoPoint(0.0, 0.0) if somewhere is None else somewhere)
    if mission.grid.by_footprint and mission.planned_home is None and somewhere is not None:
        return None
    try:
        return map_at_start(mission, settings, home, narrow_sight=narrow_sight)
    except MissionError:
        return None


def _all_places(mission: Mission) -> list[Place]:
    areas = [*mission.keep_out, *mission.keep_in, *(weighted.area for weighted in mission.weighted)]
    return [*(target.place for target in mission.targets), *(place for area in areas for place in area.places)]


def show(mission: Mission, settings: Settings, maps: list[str], console: Console) -> None:
    """Print the mission."""
    console.print(f"[bold]{escape(mission.name)}[/bold]", soft_wrap=True)
    console.print(_targets(mission))
    for line in (
        *_commands(mission),
        *_ground(mission, settings),
        *_vehicle(mission, settings),
        *maps,
        *(f"note: {note}" for note in mission.notes),
    ):
        console.print(escape(line), soft_wrap=True)


def _targets(mission: Mission) -> Table:
    table = Table("", "target", "place", "hold", "if blocked", "speed")
    for number, target in enumerate(mission.targets, start=1):
        speed_m_s = target.speed_m_s or mission.rover.cruise_speed_m_s
        hold = "AUTO's" if mission.in_auto else f"{target.hold_s:g} s" if target.hold_s else "-"
        name, place = escape(target.name), place_text(target.place)
        table.add_row(str(number), name, place, hold, target.on_blocked.value, f"{speed_m_s:g} m/s")
    return table


def _commands(mission: Mission) -> list[str]:
    """What the autopilot is told where, and which targets are a patrol."""
    places = [("where the mission begins", mission.commands)]
    places += [(f"at {target.name}", target.commands) for target in mission.targets]
    lines = [f"{command_text(command)} {where}" for where, commands in places for command in commands]
    if mission.patrol is not None:
        first, laps = mission.targets[mission.patrol.first].name, mission.patrol.laps
        often = "until somebody ends it" if laps is None else f"{laps} times"
        lines.append(f"patrol: from {first} to {mission.targets[-1].name} {often}")
    return lines


def command_text(command: DoCommand) -> str:
    """A command in words: what, whither, when."""
    parts = [f"command: {command.name}"]
    if command.place is not None:
        parts.append(f"({place_text(command.place)})")
    if command.after_s > 0.0:
        parts.append(f"{command.after_s:g} s after arrival")
    if command.delay_s is not None:
        parts.append(f"{command.delay_s:g} s on the way on")
    if command.within_m is not None:
        parts.append(f"within {command.within_m:g} m of the next target")
    return " ".join([*parts, "once" if not command.repeatable else ""]).strip()


def _ground(mission: Mission, settings: Settings) -> list[str]:
    grid = mission.grid
    fields, gaps = _fields_by_rover(mission, settings) if grid.by_footprint else _fields(mission, settings)
    if grid.size is not None and grid.home is not None:
        lines = [f"grid: {grid.size[0]} x {grid.size[1]} {fields}, home in the middle of {place_text(grid.home)}{gaps}"]
    else:
        margin = "25 m (half its extent if that is more)" if grid.margin_m is None else f"{grid.margin_m:g} m"
        lines = [f"grid: {fields}, laid round home, targets and fences with a margin of {margin}{gaps}"]
    lines += [f"keep out of {area_text(area)}" for area in mission.keep_out]
    lines += [f"keep inside {area_text(area)}" for area in mission.keep_in]
    lines += [f"weight {weighted.weight:g} in {area_text(weighted.area)}" for weighted in mission.weighted]
    return lines


def _fields(mission: Mission, settings: Settings) -> tuple[str, str]:
    """How large fields are, and what narrow ground that leaves open: beginning and end of one sentence."""
    evidence = _map_at_start(mission, settings, narrow_sight=_has_beams(mission))
    gaps = "" if evidence is None else _gaps(open_gap_m(mission.rover, evidence))
    return f"fields of {mission.grid.resolution_m:g} m", gaps


def _gaps(narrowest_m: float) -> str:
    return f"; the rover drives through gaps of {narrowest_m:.1f} m or more"


def _fields_by_rover(mission: Mission, settings: Settings) -> tuple[str, str]:
    """The same where the file does not say how large they are."""
    rover, size = mission.rover, _size_of(mission, settings)
    why = "as single beams need" if _has_beams(mission) else "by the rover's size"
    evidence = _map_at_start(mission, settings, narrow_sight=_has_beams(mission))
    if evidence is None:
        return f"fields of {size.fine_m:g} m ({why}; larger on ground with more than {size.most})", ""
    side_m = evidence.base.resolution_m
    most = narrower = ""
    if size.may_be_finer(side_m):
        of_ours = mission.source is not None and mission.source.suffix.lower() == ".toml"
        smaller = "[grid] resolution_m or a smaller margin_m" if of_ours else "--resolution-m"
        if settings.mapping.keeps == "outline":  # with a resolution_m evidence is coarser, and opens fewer
            smaller = "a smaller margin_m in [grid], or targets on the way" if of_ours else "targets on the way"
        most, narrower = f", and no more than {size.most} of them", f"; for narrower gaps give {smaller}"
    told, gaps = f"fields of {side_m:.3g} m ({why}{most})", _gaps(open_gap_m(rover, evidence))
    by_beams = _map_at_start(mission, settings, narrow_sight=True)
    if by_beams is None or by_beams.base.resolution_m <= side_m:
        return told, f"{gaps}{narrower}"
    beams_m, gap_m = by_beams.base.resolution_m, open_gap_m(rover, by_beams)
    return told, f"{gaps}, with single beams alone (fields of {beams_m:.3g} m) of {gap_m:.1f} m{narrower}"


def _maps(mission: Mission, world: SimulatedWorld | None) -> list[str]:
    """Loads the maps that the mission names, to find a bad one before the drive; returns a line for each."""
    lines = []
    if mission.prior_map is not None:
        known = load_map(mission.prior_map, mission.grid.resolution_m)
        lines.append(f"known map: {mission.prior_map}: {_map_text(known)}")
    if world is not None:
        unknown = "a world file; only rover-sitl checks all of it"
        lines.append(f"simulator's world: {world.path}: {unknown if world.grid is None else _map_text(world.grid)}")
    return lines


def _map_text(grid: Grid) -> str:
    obstacles = int((grid.weights >= OBSTACLE).sum())
    return f"{grid.width} x {grid.height} fields of {grid.resolution_m:g} m, {obstacles} of them obstacles"


def _vehicle(mission: Mission, settings: Settings) -> list[str]:
    rover = mission.rover
    turns = (
        f"in arcs of {rover.turning_radius_m:g} m radius or wider" if rover.turning_radius_m > 0.0 else "on the spot"
    )
    lines = [f"rover: {outline_text(rover)}, cruises at {rover.cruise_speed_m_s:g} m/s, turns {turns}"]
    controller = settings.guidance.controller
    if hint := outline_hint(rover, controller) or guard_hint(rover, controller):
        lines.append(f"note: {hint}")
    if mission.planned_home is not None:
        lines.append(f"planned home: {place_text(mission.planned_home)}; the rover's own home is what counts")
    if mission.sitl is not None:
        sitl = mission.sitl
        start = f", start {place_text(sitl.start)}" if sitl.start is not None else ""
        world = "" if sitl.world else "open ground, "
        steering = f", {sitl.steering} steering" if sitl.steering is not None else ""
        lines.append(
            f"simulator only: {world}heading {sitl.heading_deg:g} deg, sensors {sitl.sensors}{steering}{start}"
        )
        lines += [f"simulator only: {mover_text(mover)}" for mover in sitl.movers]
    return lines


def place_text(place: Place) -> str:
    """A place in words."""
    if isinstance(place, Cell):
        return f"field {place.x}, {place.y}"
    if isinstance(place, GeoPoint):
        return f"{place.lat_deg:.7f}, {place.lon_deg:.7f}"
    if isinstance(place, Here):
        return "where the rover is then"
    if place.north_m == place.east_m == 0.0:
        return "home"
    north_south = f"{abs(place.north_m):g} m {'south' if place.north_m < 0.0 else 'north'}"
    return f"{north_south}, {abs(place.east_m):g} m {'west' if place.east_m < 0.0 else 'east'} of home"


def outline_text(rover: RoverSpec) -> str:
    """The outline in the words of the file's keys, so that a slip in them is seen; the circle round it."""
    if rover.rectangle is None:
        return f"radius {rover.radius_m:g} m"
    outline = rover.rectangle
    forward_m = round(0.5 * (outline.front_m - outline.rear_m), 6)
    middle = f"{abs(forward_m):g} m {'behind' if forward_m < 0.0 else 'ahead of'} the centre of rotation"
    return (
        f"{outline.front_m + outline.rear_m:g} m long, {2.0 * outline.half_width_m:g} m wide, its middle "
        f"{middle if forward_m else 'at the centre of rotation'}, in a circle of radius {rover.radius_m:.3g} m"
    )


def mover_text(mover: MoverSpec) -> str:
    """A moving obstacle in words."""
    route = f"through {len(mover.route)} places from {place_text(mover.route[0])}"
    again = " and round again" if mover.repeat else ""
    tells = f"announces itself ({mover.announce})" if mover.announce else "announces nothing"
    return f"{mover.name}, radius {mover.radius_m:g} m, moves at {mover.speed_m_s:g} m/s {route}{again}, {tells}"


def area_text(area: Area) -> str:
    """An area in words."""
    first = place_text(area.places[0])
    if area.radius_m is not None:
        return f"a circle of {area.radius_m:g} m round {first}"
    if area.width_m is not None:
        return f"a line {area.width_m:g} m wide through {len(area.places)} places from {first}"
    return f"a polygon of {len(area.places)} corners from {first}"
