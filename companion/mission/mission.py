"""A mission: targets in order, the ground they lie on, and the rover that is to drive there."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

from companion.core.frames import GeoPoint
from companion.core.grid import Cell
from companion.mission.sensor_tables import Sensors


class MissionError(Exception):
    """A mission file that cannot be driven; the text is one line with file, place and reason."""


class OnBlocked(StrEnum):
    """What to do when a target cannot be reached."""

    SKIP = "skip"
    WAIT = "wait"
    RETURN = "return"
    HOLD = "hold"


@dataclass(frozen=True, slots=True)
class HomePoint:
    """A place in metres north and east of home (where the rover stands when the mission begins)."""

    north_m: float
    east_m: float


Place = Cell | HomePoint | GeoPoint
"""A place as missions write it: a field of the mission's grid, local metres from home, or latitude and longitude."""


@dataclass(frozen=True, slots=True)
class Target:
    """One place to reach."""

    name: str
    place: Place
    hold_s: float = 0.0
    on_blocked: OnBlocked = OnBlocked.SKIP
    speed_m_s: float | None = None


@dataclass(frozen=True, slots=True)
class GridSpec:
    """The grid as the mission asks for it.

    With ``size`` (width, height in fields) and ``home`` (the field whose middle is home) the grid is fixed; without, it
    is laid round home, all targets and fences with ``margin_m`` to spare.
    """

    resolution_m: float = 1.0
    size: tuple[int, int] | None = None
    home: Cell | None = None
    margin_m: float | None = None


@dataclass(frozen=True, slots=True)
class RoverSpec:
    """The vehicle: everything within ``radius_m`` of its centre must stay clear.

    ``turning_radius_m`` is the tightest arc that its centre can drive; 0: it turns on the spot.
    """

    radius_m: float = 0.35
    cruise_speed_m_s: float = 2.0
    turning_radius_m: float = 0.0


@dataclass(frozen=True, slots=True)
class Area:
    """A polygon (three or more places, closed by itself), with ``radius_m`` a circle, with ``width_m`` a broad line."""

    places: tuple[Place, ...]
    radius_m: float | None = None
    width_m: float | None = None


def open_ring(places: tuple[Place, ...]) -> tuple[Place, ...]:
    """A polygon's corners without the repeated first one at the end, which some files write and some do not."""
    return places[:-1] if len(places) > 1 and places[0] == places[-1] else places


@dataclass(frozen=True, slots=True)
class WeightedArea:
    """Ground with a weight of its own, 0 (preferred) to below 1: a corridor or rough ground."""

    area: Area
    weight: float


@dataclass(frozen=True, slots=True)
class MoverSpec:
    """A disc that moves in the simulator's world: from place to place at an even speed, from ``start_s`` on.

    The time counts from when the simulator is switched on. ``repeat``: from the last place back to the first, and again.
    ``announce``: vehicle, adsb or ais, or None: it tells nobody of itself.
    """

    name: str
    radius_m: float
    speed_m_s: float
    route: tuple[HomePoint, ...]
    start_s: float = 0.0
    repeat: bool = False
    announce: str | None = None


@dataclass(frozen=True, slots=True)
class SitlSpec:
    """What only the simulator reads.

    ``world``: map file; ``resolution_m``: its field size where it has none of its own (None: the mission's);
    ``start``: the field of the world where the rover stands; heading clockwise from north;
    ``home``: where on earth that is (None: the planned home, else the first target in degrees, else somewhere);
    ``parameters``: a file with ArduRover's parameters;
    ``steering``: skid or ackermann (None: ackermann if the rover has a turning radius).
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


@dataclass(frozen=True, slots=True)
class Mission:
    """Everything that a mission file says. ``notes`` tells people what was understood beyond the targets; ``also_read`` are the files,
    beside ``source`` and those named below, that it was made of.

    ``prior_map`` is a known map, its field size where the file has none (None: the grid's), and where its outer south-west
    corner lies from home (None: as the file says, or on the grid). ``in_auto``: the autopilot drives this mission itself, in AUTO, and
    hands its targets over to the companion, in an order of its own (NAV_GUIDED_ENABLE). ``stored``: the digest of what the autopilot had stored when this mission was read from it, else empty. Ground is passable inside all of ``keep_in`` and outside each of ``keep_out``.
    """

    name: str
    targets: tuple[Target, ...]
    grid: GridSpec = GridSpec()
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
