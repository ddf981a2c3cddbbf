"""A mission as plain values: targets in order, grid, fences, weighted ground, rover, and the simulator's table.

Nouns: mission, target.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum
from pathlib import Path

from companion.core.footprint import Footprint
from companion.core.frames import GeoPoint
from companion.core.grid import Cell
from companion.mission.do_commands import DoCommand
from companion.mission.sensor_tables import Sensors


class MissionError(Exception):
    """A mission file that cannot be driven; the text is one line with file, place and reason."""


class GridTooLargeError(MissionError):
    """A mission that reaches so far that its ground cannot be kept."""


class OnBlocked(StrEnum):
    """What to do when a target cannot be reached."""

    SKIP = "skip"
    WAIT = "wait"
    RETURN = "return"
    HOLD = "hold"


@dataclass(frozen=True, slots=True)
class HomePoint:
    """A place in metres north and east of home, the rover's place when the mission begins."""

    north_m: float
    east_m: float


@dataclass(frozen=True, slots=True)
class Here:
    """Where the rover is when its turn comes: what ArduPilot takes latitude and longitude 0 to be."""

    here: bool


HERE = Here(here=True)
Place = Cell | HomePoint | GeoPoint | Here
"""A place in a mission: a field of its grid, metres from home, latitude and longitude, or where the rover is."""


@dataclass(frozen=True, slots=True)
class Target:
    """One place to reach. ``commands``: for the autopilot, once it is reached."""

    name: str
    place: Place
    hold_s: float = 0.0
    on_blocked: OnBlocked = OnBlocked.SKIP
    speed_m_s: float | None = None
    commands: tuple[DoCommand, ...] = ()


@dataclass(frozen=True, slots=True)
class Patrol:
    """The targets from number ``first`` (from 0) to the last are driven again and again.

    ``laps``: so often; None: until somebody ends it.
    """

    first: int = 0
    laps: int | None = None


@dataclass(frozen=True, slots=True)
class GridSpec:
    """The grid that the mission asks for.

    With ``size`` (width, height in fields) and ``home`` (the field whose middle is home) the grid is fixed. Without, it
    encloses home, all targets and fences, with a margin of ``margin_m``. ``by_footprint``: the mission does not say how
    large fields are; they may be smaller than ``resolution_m``, as the rover's outline needs.
    """

    resolution_m: float = 1.0
    size: tuple[int, int] | None = None
    home: Cell | None = None
    margin_m: float | None = None
    by_footprint: bool = False


@dataclass(frozen=True, slots=True)
class RoverSpec:
    """The vehicle: everything within ``radius_m`` of its centre must stay clear.

    ``turning_radius_m``: the tightest arc of its centre; 0: it turns on the spot. ``rectangle``: its outline, if that
    is not the circle; ``radius_m`` is then that of the circle round it.
    """

    radius_m: float = 0.35
    cruise_speed_m_s: float = 2.0
    turning_radius_m: float = 0.0
    rectangle: Footprint | None = None

    @property
    def footprint(self) -> Footprint:
        """Its outline."""
        return self.rectangle or Footprint.circle(self.radius_m)


@dataclass(frozen=True, slots=True)
class Area:
    """A polygon of three or more places; with ``radius_m`` a circle, with ``width_m`` a wide line."""

    places: tuple[Place, ...]
    radius_m: float | None = None
    width_m: float | None = None


def open_ring(places: tuple[Place, ...]) -> tuple[Place, ...]:
    """A polygon's corners, without the first one repeated at the end as in some files."""
    return places[:-1] if len(places) > 1 and places[0] == places[-1] else places


@dataclass(frozen=True, slots=True)
class WeightedArea:
    """Ground with its own weight, from 0 (preferred) to below 1: a corridor or rough ground."""

    area: Area
    weight: float


@dataclass(frozen=True, slots=True)
class MoverSpec:
    """A disc that moves in the simulator's world, from place to place at a constant speed.

    ``start_s``: when it starts, from the simulator's start. ``repeat``: back to the first place, and round again.
    ``announce``: how it reports its position (vehicle, adsb or ais); None: not at all.
    """

    name: str
    radius_m: float
    speed_m_s: float
    route: tuple[HomePoint, ...]
    start_s: float = 0.0
    repeat: bool = False
    announce: str | None = None


@dataclass(frozen=True, slots=True)
class DrivetrainSpec:
    """The simulated rover's motors: speed at full output, lag, distance between left and right wheels."""

    top_speed_m_s: float
    lag_s: float
    track_m: float


@dataclass(frozen=True, slots=True)
class SitlSpec:
    """The simulator's table of a mission.

    ``world``: map file; ``resolution_m``: its field size if it has none (None: the mission's);
    ``start``: the rover's field in the world; heading clockwise from north;
    ``home``: latitude and longitude of the start (None: planned home, else first target in degrees, else a default);
    ``parameters``: a file of ArduRover parameters;
    ``steering``: skid or ackermann (None: ackermann if the rover has a turning radius);
    ``drivetrain``: None for that of the firmware's own simulated rover.
    """

    world: Path | None = None
    resolution_m: float | None = None
    start: Cell | None = None
    heading_deg: float = 90.0
    sensors: Sensors = "lidar-90"
    home: GeoPoint | None = None
    movers: tuple[MoverSpec, ...] = ()
    steering: str | None = None
    parameters: Path | None = None
    drivetrain: DrivetrainSpec | None = None


@dataclass(frozen=True, slots=True)
class Mission:
    """The content of a mission file. The rover may drive inside all of ``keep_in`` and outside each of ``keep_out``.

    ``prior_map``: a map known beforehand; ``prior_resolution_m``: its field size if the file has none (None: the
    grid's); ``prior_corner``: its outer south-west corner (None: as the file says, or on the grid). ``in_auto``: the
    autopilot drives this mission in AUTO and hands targets over to the companion, in its own order (NAV_GUIDED_ENABLE).
    ``stored``: the digest of the autopilot's stored items if the mission was read from them, else empty. ``notes``: for
    people, what was read beyond the targets. ``also_read``: further files that the mission was read from.
    ``commands``: for the autopilot, where the mission begins. ``patrol``: None if every target has one turn.
    """

    name: str
    targets: tuple[Target, ...]
    grid: GridSpec = GridSpec(by_footprint=True)
    rover: RoverSpec = RoverSpec()
    keep_out: tuple[Area, ...] = ()
    keep_in: tuple[Area, ...] = ()
    weighted: tuple[WeightedArea, ...] = ()
    prior_map: Path | None = None
    prior_resolution_m: float | None = None
    prior_corner: HomePoint | None = None
    planned_home: GeoPoint | None = None
    sitl: SitlSpec | None = None
    source: Path | None = None
    in_auto: bool = False
    stored: str = ""
    notes: tuple[str, ...] = ()
    also_read: tuple[Path, ...] = ()
    commands: tuple[DoCommand, ...] = ()
    patrol: Patrol | None = None


def with_laps(mission: Mission, laps: int | None) -> Mission:
    """The mission with a patrol that ends after so many laps; None leaves it as it is. Raises MissionError."""
    if laps is None:
        return mission
    if mission.in_auto:
        raise MissionError(f"{mission.source or mission.name}: the autopilot drives this mission, it has no laps")
    return replace(mission, patrol=Patrol(0 if mission.patrol is None else mission.patrol.first, laps))
