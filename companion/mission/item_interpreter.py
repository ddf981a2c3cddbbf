"""Interprets MAVLink mission items as a rover's mission: shared by files of ground stations and the stored mission.

The items are walked in ArduPilot's order, with jumps. Every item becomes a target, a fence, a note or an error with its
index and name: none is dropped silently.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from companion.core.frames import GeoPoint
from companion.core.grid import BASE_WEIGHT
from companion.mission import mav_commands as mav
from companion.mission.fence_items import fences_of, is_fence
from companion.mission.items import MAX_ITEMS, Item, ItemError, geo_point
from companion.mission.mission import Area, HomePoint, Mission, OnBlocked, Place, Target, WeightedArea

MAX_TARGETS = 10_000
FOR_EVER_S = 1e9
GROUND_M = 1.0
"""Width of the ground along the lines that the autopilot drives by itself."""


@dataclass
class _Walk:
    """The state of the walk through the items."""

    targets: list[Target] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    speed_m_s: float | None = None
    ended_by: Item | None = None
    visits: Counter[int] = field(default_factory=Counter)
    jumps: Counter[int] = field(default_factory=Counter)
    in_auto: bool = False
    passed: list[GeoPoint] = field(default_factory=list)
    """Places that the autopilot drives to by itself."""

    def note(self, text: str) -> None:
        if text not in self.notes:
            self.notes.append(text)


def mission_from_items(items: Sequence[Item], path: Path | None, name: str, planned_home: GeoPoint | None) -> Mission:
    """The mission that the items describe. Raises ItemError with the item's index and its command."""
    fences = fences_of([item for item in items if is_fence(item)])
    walk = _walk_items([item for item in items if not is_fence(item)])
    return Mission(
        name=name,
        targets=tuple(walk.targets),
        keep_out=tuple(fences.keep_out),
        keep_in=tuple(fences.keep_in),
        weighted=_ground_along(walk.passed),
        in_auto=walk.in_auto,
        planned_home=planned_home,
        source=path,
        notes=(*walk.notes, *fences.notes),
    )


# --- where to go -----------------------------------------------------------------------------------------------------


def _walk_items(items: Sequence[Item]) -> _Walk:
    walk = _Walk(in_auto=any(_hands_over(item) for item in items))
    places = {item.index: i for i, item in enumerate(items)}
    i = steps = 0
    while i < len(items):
        steps += 1
        if steps > MAX_ITEMS or len(walk.targets) > MAX_TARGETS:
            raise ItemError(f"{items[i].label}: jumps make this mission longer than {MAX_TARGETS} targets")
        item = items[i]
        if item.command == mav.DO_JUMP:
            i = _after_jump(item, i, places, walk)
            continue
        if walk.in_auto:
            _auto_item(item, walk)
        elif item.command in _TRAVEL:
            _travel(item, walk)
        elif item.command == mav.NAV_DELAY:
            _delay(item, walk)
        elif item.command == mav.DO_CHANGE_SPEED:
            _change_speed(item, walk)
        else:
            raise ItemError(f"{item.label}: not understood; a rover can do waypoints, holds, speeds, jumps and return")
        i += 1
    return walk


_TRAVEL = (mav.NAV_WAYPOINT, mav.NAV_LOITER_UNLIM, mav.NAV_LOITER_TIME, mav.NAV_RETURN_TO_LAUNCH)


def _travel(item: Item, walk: _Walk) -> None:
    if walk.ended_by is not None:
        raise ItemError(f"{item.label}: can never begin, {walk.ended_by.label} never ends")
    if item.command == mav.NAV_LOITER_UNLIM:
        walk.ended_by = item
        walk.note(f"{item.label}: stays there, the mission ends")
    place = _place(item, walk)
    if place is None:
        return
    walk.visits[item.index] += 1
    turn = walk.visits[item.index]
    name = "home" if item.command == mav.NAV_RETURN_TO_LAUNCH else f"waypoint {item.index}"
    hold_s = item.param(1) if item.command in (mav.NAV_WAYPOINT, mav.NAV_LOITER_TIME) else 0.0
    if not (math.isfinite(hold_s) and hold_s >= 0.0):
        raise ItemError(f"{item.label}: a hold of {hold_s} s")
    walk.targets.append(
        Target(name if turn == 1 else f"{name} pass {turn}", place, hold_s=hold_s, speed_m_s=walk.speed_m_s)
    )
    _note_unused(item, walk)


def _place(item: Item, walk: _Walk) -> Place | None:
    """The place of an item; None: where the rover is."""
    if item.command == mav.NAV_RETURN_TO_LAUNCH:
        return HomePoint(0.0, 0.0)
    if item.frame not in mav.GLOBAL_FRAMES:
        frame = mav.FRAME_NAMES.get(item.frame, "unknown")
        raise ItemError(f"{item.label}: frame {item.frame} ({frame}) has no latitude and longitude")
    if item.lat_deg == 0.0 and item.lon_deg == 0.0:
        # To ArduPilot, 0, 0 means the present place.
        if item.command == mav.NAV_LOITER_UNLIM and walk.targets:
            return None
        raise ItemError(f"{item.label}: has no place (latitude and longitude are 0)")
    return geo_point(item.lat_deg, item.lon_deg, item.label)


def _note_unused(item: Item, walk: _Walk) -> None:
    """Notes radii and headings, which this rover does not use."""
    names = {
        mav.NAV_WAYPOINT: ((2, "acceptance radius"), (3, "pass-by radius"), (4, "heading")),
        mav.NAV_LOITER_UNLIM: ((3, "circle radius"), (4, "heading")),
        mav.NAV_LOITER_TIME: ((3, "circle radius"), (4, "exit rule")),
    }.get(item.command, ())
    for number, name in names:
        if item.param(number) != 0.0:
            walk.note(f"{item.label}: {name} {item.param(number):g} is not used")
    if not item.autocontinue:
        walk.note(f"{item.label}: the rover goes on after it, though autocontinue is off")


# --- legs of a mission that the autopilot drives itself, in AUTO -----------------------------------------------------


def _hands_over(item: Item) -> bool:
    return item.command == mav.NAV_GUIDED_ENABLE and item.param(1) > 0.0


def _auto_item(item: Item, walk: _Walk) -> None:
    """An item of an AUTO mission: a target if it is handed over, else a place that the autopilot drives to.

    The target has no end of its own: the autopilot decides when it goes on.
    """
    if _hands_over(item):
        place = _place(item, walk)
        walk.visits[item.index] += 1
        turn = walk.visits[item.index]
        name = f"guided item {item.index}" if turn == 1 else f"guided item {item.index} pass {turn}"
        assert place is not None
        walk.targets.append(Target(name, place, hold_s=FOR_EVER_S, on_blocked=OnBlocked.WAIT, speed_m_s=None))
        walk.note("the autopilot drives this mission itself, in AUTO; the companion drives what it hands over")
    elif (
        item.command <= mav.NAV_LAST and item.frame in mav.GLOBAL_FRAMES and (item.lat_deg, item.lon_deg) != (0.0, 0.0)
    ):
        walk.passed.append(geo_point(item.lat_deg, item.lon_deg, item.label))


def _ground_along(passed: list[GeoPoint]) -> tuple[WeightedArea, ...]:
    """An area along the autopilot's own lines, so that the grid includes them; it has the weight of all ground."""
    if not passed:
        return ()
    alone = len(set(passed)) == 1
    area = Area((passed[0],), radius_m=GROUND_M) if alone else Area(tuple(passed), width_m=GROUND_M)
    return (WeightedArea(area, BASE_WEIGHT),)


def _delay(item: Item, walk: _Walk) -> None:
    """NAV_DELAY: a longer hold at the last target."""
    delay_s = item.param(1)
    if not walk.targets:
        raise ItemError(f"{item.label}: a delay before the first waypoint is not understood")
    if not (math.isfinite(delay_s) and delay_s >= 0.0):
        raise ItemError(f"{item.label}: waiting for a time of day is not understood")
    walk.targets[-1] = replace(walk.targets[-1], hold_s=walk.targets[-1].hold_s + delay_s)


def _change_speed(item: Item, walk: _Walk) -> None:
    """p1: kind (air and ground speed are the same to a rover), p2: m/s (-1 unchanged, -2 default), p3: throttle."""
    if item.param(1) not in (0.0, 1.0):
        raise ItemError(f"{item.label}: speed of kind {item.param(1):g} is not for a rover")
    speed_m_s = item.param(2)
    if speed_m_s == -2.0:
        walk.speed_m_s = None
    elif speed_m_s != -1.0:
        if not (math.isfinite(speed_m_s) and speed_m_s > 0.0):
            raise ItemError(f"{item.label}: a speed of {speed_m_s:g} m/s")
        walk.speed_m_s = speed_m_s
    if item.param(3) not in (0.0, -1.0):
        walk.note(f"{item.label}: throttle {item.param(3):g} is not used")


def _after_jump(item: Item, here: int, places: dict[int, int], walk: _Walk) -> int:
    """The next position. As in ArduPilot, each jump item counts its jumps over the whole mission."""
    to, repeats = item.param(1), item.param(2)
    if repeats == -1.0:
        raise ItemError(f"{item.label}: repeats for ever (-1); give a number of repeats")
    if not (math.isfinite(repeats) and repeats >= 0.0 and repeats == int(repeats)):
        raise ItemError(f"{item.label}: {repeats:g} repeats")
    if not math.isfinite(to) or to != int(to) or int(to) not in places or int(to) == item.index:
        raise ItemError(f"{item.label}: there is no item {to:g} to jump to")
    if walk.jumps[item.index] >= repeats:
        return here + 1
    walk.jumps[item.index] += 1
    walk.note(f"{item.label}: to item {int(to)}, {int(repeats)} times, written out")
    return places[int(to)]
