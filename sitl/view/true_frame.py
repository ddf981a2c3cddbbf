"""True scenes and frames: the simulator at a moment, as the plain values that the page of the companion reads.

Places are [north, east] in metres of the rover's start, which is the zero of its LOCAL_POSITION_NED. Headings are
radians clockwise from north.

Nouns: true scene, true frame.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from companion.viewer.feed import TOUCHED_KEPT
from companion.viewer.frame import FORMAT
from companion.viewer.map_tiles import TILE
from sitl.autopilot.control.records import LEG, WAYPOINT
from sitl.autopilot.fence import CIRCLE_FENCE, POLYGON_FENCE, shapes
from sitl.autopilot.mission_items import FENCE_CIRCLE_IN, FENCE_POLYGON_IN
from sitl.autopilot.state import Mode
from sitl.autopilot.vehicle import Vehicle
from sitl.plant.outline import Outline
from sitl.simulator import Simulator
from sitl.view.activity import activity_of
from sitl.view.gps_fix import NO_GPS, fix_told
from sitl.view.true_rays import rays_of
from sitl.view.watching import bounds_of
from sitl.world import geodesy

CORNERS = 24
"""Of anything round."""
DRIVES = {
    Mode.MANUAL: "pilot",
    Mode.ACRO: "pilot",
    Mode.STEERING: "pilot",
    Mode.SIMPLE: "pilot",
    Mode.HOLD: "nobody",
    Mode.INITIALISING: "nobody",
    Mode.GUIDED: "companion or ground station",
}
"""Who drives in these modes; in all others it is the autopilot."""
SATELLITES = 10
"""As GPS_RAW_INT says it."""

Json = dict[str, Any]
Rates = Mapping[str, tuple[float, float]]


def scene_of(simulator: Simulator, name: str) -> Json:
    """What stays as it is for a while. ``name``: of the mission."""
    start, vehicle = simulator.start, simulator.vehicle
    return {
        "kind": "scene",
        "format": FORMAT,
        "mission": name,
        "map_epoch": 1,
        "home": _relative(simulator, vehicle.home),
        "origin": [start.home.lat_deg, start.home.lon_deg],
        "rover": {"outline": _outline(simulator.outline)},
        "targets": [],
        "borders": _borders(simulator),
        "map": _map(simulator),
        "vehicle": vehicle.system,
        "live": True,
        "simulated": True,
        "truth": True,
        "began_unix_s": None,
    }


def frame_of(simulator: Simulator, heard: Sequence[str], rates: Rates, how: str) -> Json:
    """The moment. ``heard``: links on which somebody is heard; ``rates``: packets a second by link, in and out.

    ``how``: how to connect.
    """
    truth, vehicle = simulator.truth, simulator.vehicle
    return {
        "kind": "frame",
        "t": round(simulator.time_s, 2),
        "pose": [*_from_start(simulator, truth.north_m, truth.east_m), round(truth.heading_rad, 4)],
        "speed": round(truth.speed_m_s, 3),
        "turn": round(truth.yaw_rate_rad_s, 3),
        "mode": vehicle.mode.name,
        "armed": vehicle.armed,
        "drives": DRIVES.get(vehicle.mode, "autopilot") if vehicle.armed else "nobody",
        **activity_of(simulator, bool(heard), how).as_json(),
        "statuses": [],
        "goal": _goal(simulator),
        "path": [],
        "motion": [],
        "setpoint": None,
        "rays": rays_of(simulator),
        "movers": _movers(simulator),
        "figures": {"clearance_m": round(simulator.clearance_m, 2)},
        "battery": _battery(vehicle),
        "gps": _gps(vehicle),
        "decision": None,
        "guard": None,
        "paused": False,
        "driven_m": round(simulator.driven_m, 1),
        "contacts": len(simulator.collisions),
        "touched": [one.from_start(simulator.start) for one in simulator.collisions[-TOUCHED_KEPT:]],
        "rates": {
            "links": [
                {"name": name, "heard": name in heard, "in": round(told, 1), "out": round(said, 1)}
                for name, (told, said) in rates.items()
            ]
        },
        "news": [],
    }


def _from_start(simulator: Simulator, north_m: float, east_m: float) -> list[float]:
    """A place of the world."""
    start = simulator.start
    return [round(north_m - start.north_m, 3), round(east_m - start.east_m, 3)]


def _relative(simulator: Simulator, place: tuple[int, int]) -> list[float]:
    """A place in 1e-7 degree."""
    home = simulator.start.home
    north_m, east_m = geodesy.offset_m((geodesy.to_units(home.lat_deg), geodesy.to_units(home.lon_deg)), place)
    return [round(north_m, 2), round(east_m, 2)]


def _circle(radius_m: float) -> list[list[float]]:
    angles = np.arange(CORNERS) * (2.0 * math.pi / CORNERS)
    corners: list[list[float]] = np.round(radius_m * np.column_stack((np.cos(angles), np.sin(angles))), 3).tolist()
    return corners


def _outline(outline: Outline) -> list[list[float]]:
    """Corners: metres ahead and to the right."""
    if outline.radius_m > 0.0:
        return _circle(outline.radius_m)
    front, rear, side = outline.front_m, -outline.rear_m, outline.half_width_m
    return [[front, side], [rear, side], [rear, -side], [front, -side]]


def _borders(simulator: Simulator) -> list[Json]:
    """The autopilot's fences that are enabled."""
    vehicle = simulator.vehicle
    borders = []
    if vehicle.fence.enabled & POLYGON_FENCE:
        for command, corners, radius_m in shapes(vehicle.storage.fence):
            keeps_in = command in (FENCE_POLYGON_IN, FENCE_CIRCLE_IN)
            places = [_relative(simulator, corner) for corner in corners]
            around = _shifted(_circle(radius_m), places[0]) if radius_m else places
            borders.append({"name": "fence", "keeps_in": keeps_in, "corners": around})
    if vehicle.fence.enabled & CIRCLE_FENCE:
        around = _shifted(_circle(vehicle.parameters["FENCE_RADIUS"]), _relative(simulator, vehicle.home))
        borders.append({"name": "fence", "keeps_in": True, "corners": around})
    return borders


def _shifted(corners: list[list[float]], middle: list[float]) -> list[list[float]]:
    return [[round(north + middle[0], 3), round(east + middle[1], 3)] for north, east in corners]


def _map(simulator: Simulator) -> Json | None:
    """None for open ground."""
    world = simulator.world
    if bounds_of(world) is None:
        return None
    rows, columns = world.obstacles.shape
    south_m, west_m = _from_start(simulator, world.south_m, world.west_m)
    return {
        "south_m": south_m, "west_m": west_m, "cell_m": world.resolution_m, "columns": columns, "rows": rows,
        "tile": TILE,
    }  # fmt: skip


def _goal(simulator: Simulator) -> Json | None:
    """The autopilot's own destination."""
    vehicle = simulator.vehicle
    told = vehicle.control[0]
    if not vehicle.has_target or int(told["task"]) not in (WAYPOINT, LEG):
        return None
    north_m, east_m = float(told["dest_n"]) + vehicle.origin_m[0], float(told["dest_e"]) + vehicle.origin_m[1]
    return {"name": "autopilot's target", "place": _from_start(simulator, north_m, east_m)}


def _movers(simulator: Simulator) -> list[Json]:
    world = simulator.world
    told = []
    for number, mover in enumerate(world.movers):
        north_m, east_m, north_m_s, east_m_s = world.mover_at(number, simulator.time_s)
        told.append(
            {
                "place": _from_start(simulator, north_m, east_m),
                "velocity": [round(north_m_s, 2), round(east_m_s, 2)],
                "radius_m": round(mover.radius_m, 2),
                "name": mover.name,
            }
        )
    return told


def _battery(vehicle: Vehicle) -> Json | None:
    """None if it is not monitored."""
    if int(vehicle.parameters["BATT_MONITOR"]) == 0:
        return None
    return {"volts": round(vehicle.volts(), 2), "percent": vehicle.battery_percent()}


def _gps(vehicle: Vehicle) -> Json:
    fix = fix_told(vehicle)
    return {"fix": fix, "satellites": None if fix == NO_GPS else SATELLITES}
