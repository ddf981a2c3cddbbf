"""The fence: polygons, circles, the circle around home; breaches and actions (AC_Fence, AC_PolyFence_loader).

Nouns: AC_Fence.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.core.severity import Severity
from sitl.autopilot.mission_items import FENCE_CIRCLE_IN, FENCE_CIRCLE_OUT, FENCE_POLYGON_IN, FENCE_POLYGON_OUT, Item
from sitl.autopilot.state import Mode
from sitl.autopilot.vehicle import Vehicle
from sitl.world import geodesy

CIRCLE_FENCE, POLYGON_FENCE = 2, 4
"""Bits of FENCE_TYPE: the circle around home, and the uploaded fence."""

UNION = 2
"""Bit of FENCE_OPTIONS: being inside one of the inclusion areas is enough."""

Place = tuple[int, int]


def inside(place: Place, corners: Sequence[Place]) -> bool:
    """Whether a place lies within a polygon of latitudes and longitudes (1e-7 degree)."""
    within = False
    lat, lon = place
    for (lat_a, lon_a), (lat_b, lon_b) in zip(corners, [*corners[1:], corners[0]], strict=True):
        if (lon_a > lon) != (lon_b > lon):
            # Integers, so that rounding cannot decide about a place on the border.
            side = (lat - lat_a) * (lon_b - lon_a) - (lat_b - lat_a) * (lon - lon_a)
            within ^= (side < 0) == (lon_b > lon_a)
    return within


def distance_m(place: Place, other: Place) -> float:
    """Metres between two places."""
    return math.hypot(*geodesy.offset_m(place, other))


def shapes(items: Sequence[Item]) -> list[tuple[int, Sequence[Place], float]]:
    """The areas of the fence: command, corners (of a circle its centre), radius in metres."""
    found: list[tuple[int, Sequence[Place], float]] = []
    at = 0
    while at < len(items):
        first = items[at]
        if first.command in (FENCE_POLYGON_IN, FENCE_POLYGON_OUT):
            size = int(first.params[0])
            found.append((first.command, [item.place for item in items[at : at + size]], 0.0))
            at += size
        else:
            found.append((first.command, [first.place], first.params[0]))
            at += 1
    return found


def outside(items: Sequence[Item], place: Place, options: int = 0) -> bool:
    """Whether a place breaches the fence: outside an inclusion area or inside an exclusion area."""
    areas = missed = 0
    for command, corners, radius_m in shapes(items):
        if command == FENCE_POLYGON_IN:
            areas += 1
            missed += not inside(place, corners)
        elif command == FENCE_CIRCLE_IN:
            areas += 1
            missed += distance_m(place, corners[0]) > radius_m
        elif (command == FENCE_POLYGON_OUT and inside(place, corners)) or (
            command == FENCE_CIRCLE_OUT and distance_m(place, corners[0]) < radius_m
        ):
            return True
    return missed == areas > 0 if options & UNION else missed > 0


def nearest(place: Place, places: Sequence[Place]) -> Place | None:
    """The nearest of several places; None if there are none."""
    return min(places, key=lambda one: distance_m(place, one), default=None)


def allowed(vehicle: Vehicle, place: Place) -> bool:
    """Whether a place lies inside all enabled fences."""
    kinds = vehicle.fence.enabled
    if kinds & CIRCLE_FENCE and distance_m(vehicle.home, place) > vehicle.parameters["FENCE_RADIUS"]:
        return False
    options = int(vehicle.parameters["FENCE_OPTIONS"])
    return not (kinds & POLYGON_FENCE and outside(vehicle.storage.fence, place, options))


NAMES = {CIRCLE_FENCE: "Circle", POLYGON_FENCE: "Polygon"}

ON, OFF, FLOOR_OFF = 1, 0, 2

REPORT, RETURN, HOLD, SMART_RETURN, SMART_RETURN_OR_HOLD, DISARM = 0, 1, 2, 3, 4, 5
"""FENCE_ACTION."""

GIVE_UP_M = 100.0

BACKUP_M = 20.0

RECOVERY_S = 10.0

FENCE_STATUS = 162


def fence_names(kinds: int) -> str:
    """The firmware's words for these kinds of fence."""
    found = [name for bit, name in NAMES.items() if kinds & bit]
    return " and ".join(found) + (" fences" if len(found) > 1 else " fence")


def configured(vehicle: Vehicle) -> int:
    """The kinds of fence selected by FENCE_TYPE."""
    return int(vehicle.parameters["FENCE_TYPE"]) & (CIRCLE_FENCE | POLYGON_FENCE)


def enable_fence(vehicle: Vehicle, action: int, spoken: bool = False) -> bool:
    """DO_FENCE_ENABLE, as a command or in a mission (``spoken``: with a text); False if it is refused."""
    kinds = configured(vehicle)
    if action not in (ON, OFF, FLOOR_OFF):
        return False
    if action == FLOOR_OFF:
        return True
    if action == ON and not present(vehicle) and not spoken:
        return False
    vehicle.fence.enabled = kinds if action == ON else 0
    if action == OFF:
        vehicle.fence.breached = 0
    if spoken and kinds:
        vehicle.say(Severity.NOTICE, f"{fence_names(kinds)} {'enabled' if action == ON else 'disabled'}")
    return True


def present(vehicle: Vehicle) -> bool:
    """Whether there is a fence to breach: the circle always, the uploaded fence if there is one."""
    kinds = configured(vehicle)
    return bool(kinds & CIRCLE_FENCE) or (bool(kinds & POLYGON_FENCE) and bool(vehicle.storage.fence))


def arming_fault(vehicle: Vehicle) -> str | None:
    """Why the fence forbids arming, in the firmware's words; None if it does not."""
    on = vehicle.parameters["FENCE_ENABLE"] > 0.0
    if on and not present(vehicle):
        return "Fences enabled, but none selected"
    if not on or not configured(vehicle):
        return None
    if not vehicle.has_position:
        return "Fence requires position"
    radius_m, margin_m = vehicle.parameters["FENCE_RADIUS"], vehicle.parameters["FENCE_MARGIN"]
    circles = [size for command, _, size in shapes(vehicle.storage.fence) if command == FENCE_CIRCLE_IN]
    if configured(vehicle) & POLYGON_FENCE and any(size < margin_m for size in circles):
        return "Polygon fence margin is greater than inclusion circle radius"
    if radius_m < 0.0:
        return "Invalid Circle FENCE_RADIUS value"
    if radius_m < margin_m:
        return "Circle FENCE_MARGIN is greater than FENCE_RADIUS"
    if vehicle.fence.breached:
        return f"Vehicle breaching {fence_names(vehicle.fence.breached)}"
    return "Invalid FENCE_MARGIN value" if margin_m < 0.0 else None


def run_fence(vehicle: Vehicle, set_mode: Callable[[Vehicle, int], bool], disarm: Callable[[Vehicle], None]) -> None:
    """Check for breaches; report a new one while armed, and take FENCE_ACTION."""
    fence, setting = vehicle.fence, vehicle.parameters["FENCE_ENABLE"]
    if setting != fence.seen_setting:
        fence.seen_setting = setting
        fence.enabled = configured(vehicle) if setting > 0.0 else 0
    if not setting > 0.0 and not fence.enabled:
        fence.breached = 0
        return
    fresh, beyond_m = _look(vehicle)
    if fence.recovering_since_s is not None:
        if vehicle.time_s - fence.recovering_since_s < RECOVERY_S:
            return
        fence.recovering_since_s = None
    if fresh and vehicle.armed:
        vehicle.say(Severity.NOTICE, f"{fence_names(fresh)} breached")
        _act(vehicle, beyond_m, set_mode, disarm)


def _look(vehicle: Vehicle) -> tuple[int, float]:
    """The newly breached kinds, and how many metres beyond the circle the rover is."""
    fence, here, fresh, beyond_m = vehicle.fence, vehicle.place(), 0, 0.0
    if not vehicle.has_position:
        return 0, 0.0
    if fence.enabled & CIRCLE_FENCE:
        home_m = distance_m(vehicle.home, here)
        beyond_m = home_m - vehicle.parameters["FENCE_RADIUS"]
        if beyond_m < 0.0:
            fence.breached &= ~CIRCLE_FENCE
            fence.backup_m = 0.0
        elif not fence.breached & CIRCLE_FENCE or 0.0 < fence.backup_m <= home_m:
            fresh |= CIRCLE_FENCE
            fence.backup_m = home_m + BACKUP_M
    if fence.enabled & POLYGON_FENCE:
        options = int(vehicle.parameters["FENCE_OPTIONS"])
        if not outside(vehicle.storage.fence, here, options):
            fence.breached &= ~POLYGON_FENCE
        elif not fence.breached & POLYGON_FENCE:
            fresh |= POLYGON_FENCE
    fence.breached &= fence.enabled
    if fresh:
        _record(vehicle, fresh)
    return fresh, beyond_m


def _record(vehicle: Vehicle, fresh: int) -> None:
    fence = vehicle.fence
    fence.count = min(fence.count + bin(fresh).count("1"), 65500)
    first = not fence.breached
    fence.breached |= fresh
    if first:
        fence.breach_s = vehicle.time_s
        if vehicle.time_s - fence.reported_s > 1.0:
            fence.reported_s = vehicle.time_s
            for channel in vehicle.channels.values():
                channel.requested.append(FENCE_STATUS)


def _act(
    vehicle: Vehicle, beyond_m: float, set_mode: Callable[[Vehicle, int], bool], disarm: Callable[[Vehicle], None]
) -> None:
    """Take FENCE_ACTION; far outside the circle that is always HOLD."""
    action = int(vehicle.parameters["FENCE_ACTION"])
    if action == DISARM and beyond_m <= GIVE_UP_M:
        disarm(vehicle)
        return
    fallbacks: dict[int, tuple[Mode, ...]] = {
        REPORT: (),
        RETURN: (Mode.RTL, Mode.HOLD),
        HOLD: (Mode.HOLD,),
        SMART_RETURN: (Mode.SMART_RTL, Mode.RTL, Mode.HOLD),
        SMART_RETURN_OR_HOLD: (Mode.SMART_RTL, Mode.HOLD),
    }
    modes = fallbacks.get(action, ())
    if modes and beyond_m > GIVE_UP_M:
        modes = (Mode.HOLD,)
    for mode in modes:
        if set_mode(vehicle, mode):
            return


def fence_status(vehicle: Vehicle) -> list[mavlink.MAVLink_fence_status_message]:
    """FENCE_STATUS, which is only sent while a fence is enabled."""
    fence = vehicle.fence
    if not fence.enabled:
        return []
    kind = mavlink.FENCE_BREACH_BOUNDARY if fence.breached else mavlink.FENCE_BREACH_NONE
    return [
        mavlink.MAVLink_fence_status_message(
            int(fence.breached != 0), fence.count, kind, round(fence.breach_s * 1000.0), mavlink.FENCE_MITIGATE_NONE
        )
    ]
