"""Interprets MAVLink mission items as a rover's mission: shared by files of ground stations and the stored mission.

The items are walked in ArduPilot's order, with jumps. Every item becomes a target, a command at a target, a fence, a
note, or is named as unknown with all others: none is dropped silently.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType

from companion.core.frames import GeoPoint
from companion.core.grid import BASE_WEIGHT
from companion.mission import mav_commands as mav
from companion.mission.check import FASTEST_M_S, LONGEST_HOLD_S
from companion.mission.do_commands import TAKEN, WITH_PLACE, WITHOUT_EFFECT, DoCommand, lacking, why_not
from companion.mission.fence_items import fences_of, is_fence
from companion.mission.item_walk import ItemWalk
from companion.mission.items import MAX_ITEMS, Item, ItemError, geo_point
from companion.mission.loiter_circle import corners
from companion.mission.mission import (
    HERE,
    Area,
    Here,
    HomePoint,
    Mission,
    OnBlocked,
    Patrol,
    Place,
    Target,
    WeightedArea,
)

MAX_TARGETS = 10_000
WRONG_SHOWN = 10
"""So many wrong items are told one by one."""
FOR_EVER_S = 1e9
GROUND_M = 1.0
"""Width of the ground along the lines that the autopilot drives by itself."""
JUMPS = (mav.DO_JUMP, mav.JUMP_TAG, mav.DO_JUMP_TAG)
ABOVE_HOME = 3
"""The frame in which a place without a usable one is sent."""


@dataclass
class _Walk:
    """What has become of the items so far. ``home``: where it lies after DO_SET_HOME, None if it has not moved."""

    targets: list[Target] = field(default_factory=list)
    commands: list[DoCommand] = field(default_factory=list)
    """For the autopilot, before the first target."""
    condition: DoCommand | None = None
    """A condition that the next command has to wait for."""
    notes: list[str] = field(default_factory=list)
    unknown: dict[tuple[str, str], list[Item]] = field(default_factory=dict)
    """Items that this rover cannot do, by what they are and why not."""
    wrong: list[str] = field(default_factory=list)
    """What no mission may hold: an item, its command and the reason."""
    speed_m_s: float | None = None
    home: Place | None = None
    ended_by: Item | None = None
    visits: Counter[int] = field(default_factory=Counter)
    in_auto: bool = False
    passed: list[GeoPoint] = field(default_factory=list)
    """Places that the autopilot drives to by itself."""

    def note(self, text: str) -> None:
        if text not in self.notes:
            self.notes.append(text)

    def refuse(self, item: Item, why: str) -> None:
        """Name it with the others. Once is enough in a loop."""
        items = self.unknown.setdefault((item.what, why), [])
        if item not in items:
            items.append(item)


def mission_from_items(
    items: Sequence[Item],
    path: Path | None,
    name: str,
    planned_home: GeoPoint | None,
    *,
    skip_unknown: bool = False,
) -> Mission:
    """The mission that the items describe. ``skip_unknown``: without those that this rover cannot do.

    Raises ItemError with the item's index and its command; what cannot be done is named with all its items at once.
    """
    fences = fences_of([item for item in items if is_fence(item)])
    route = [item for item in items if not is_fence(item)]
    walk, patrol = _walk_items(route)
    lines = [_unknown_text(what, why, found) for (what, why), found in walk.unknown.items()]
    if walk.wrong:
        raise ItemError("; ".join([*_first(walk.wrong), *(() if skip_unknown else lines)]))
    if lines and not skip_unknown:
        raise ItemError(f"{'; '.join(lines)}; --skip-unknown drives the rest")
    return Mission(
        name=name,
        targets=tuple(walk.targets),
        keep_out=tuple(fences.keep_out),
        keep_in=tuple(fences.keep_in),
        weighted=_ground_along(walk.passed),
        in_auto=walk.in_auto,
        planned_home=planned_home,
        source=path,
        notes=(*(f"left out: {line}" for line in lines), *walk.notes, *fences.notes),
        commands=tuple(walk.commands),
        patrol=patrol,
    )


def _first(wrong: list[str]) -> list[str]:
    more = len(wrong) - WRONG_SHOWN
    return wrong if more <= 0 else [*wrong[:WRONG_SHOWN], f"{more} more of this kind"]


def _unknown_text(what: str, why: str, items: list[Item]) -> str:
    numbers = [str(item.index) for item in items if item.index >= 0]
    where = f"item{'s' * (len(numbers) > 1)} {', '.join(numbers)}: " if numbers else ""
    return f"{where}{what}: {why}"


# --- where to go -----------------------------------------------------------------------------------------------------


def _walk_items(items: Sequence[Item]) -> tuple[_Walk, Patrol | None]:
    """Walk through all items. What stops the walk is named with the wrong items before it."""
    walk, order = _Walk(in_auto=any(_hands_over(item) for item in items)), ItemWalk(items)
    try:
        _walk_through(items, walk, order)
        return walk, None if order.loop is None or walk.wrong else _patrol(walk, *order.loop)
    except ItemError as error:
        # A loop may lead nowhere only because a wrong item in it made no target.
        if not walk.wrong:
            walk.wrong.append(str(error))
    return walk, None


def _walk_through(items: Sequence[Item], walk: _Walk, order: ItemWalk) -> None:
    """Raises ItemError when the walk cannot go on."""
    steps, met = 0, set()
    while not order.over:
        item = items[order.here]
        steps += 1
        met.add(order.here)
        if steps > MAX_ITEMS or len(walk.targets) > MAX_TARGETS:
            raise ItemError(_too_long(items, item, order, in_auto=walk.in_auto))
        if item.command in (mav.DO_JUMP, mav.DO_JUMP_TAG):
            if walk.in_auto and item.param(2) == -1.0:
                raise ItemError(f"{item.label}: repeats for ever; in AUTO a mission needs an end")
            order.jump(item, len(walk.targets), walk.speed_m_s)
            continue
        try:
            _take(item, walk)
        except ItemError as error:
            if str(error) not in walk.wrong:
                walk.wrong.append(str(error))
        order.here += 1
    for number, (to, times) in order.jumped.items():
        walk.note(f"item {number}: {mav.command_name(mav.DO_JUMP)}: to item {to}, {times} times, written out")
    for position, item in enumerate(items):
        if position not in met and item.command not in JUMPS:
            walk.note(f"{item.label}: never comes, a jump leads past it")


def _too_long(items: Sequence[Item], item: Item, order: ItemWalk, *, in_auto: bool) -> str:
    """Of the jumps met before this item, the one with the most repeats is to blame."""
    if not order.jumped:
        return f"{item.label}: this mission is longer than {MAX_TARGETS} targets; split it"
    number = max(order.jumped, key=lambda jump: order.jumped[jump][1])
    jump = next(one for one in items if one.index == number)
    remedy = "give it fewer repeats" if in_auto else "give it fewer repeats, or -1 for a patrol without end"
    return f"{jump.label}: its jumps make this mission longer than {MAX_TARGETS} targets; {remedy}"


def _take(item: Item, walk: _Walk) -> None:
    """What one item means."""
    if item.kind:
        walk.refuse(item, "is not understood")
    elif walk.in_auto:
        _auto_item(item, walk)
    elif item.command in _MEANINGS:
        _MEANINGS[item.command](item, walk)
    elif item.command in TAKEN:
        _command(item, walk)
    elif item.command in WITHOUT_EFFECT or item.command == mav.NAV_GUIDED_ENABLE:
        if reason := WITHOUT_EFFECT.get(item.command, "begins nothing with p1 0"):
            walk.note(f"{item.label}: {reason}, so it is not used")
    else:
        walk.refuse(item, why_not(item.command))


def _travel(item: Item, walk: _Walk) -> None:
    _refuse_after_the_end(item, walk)
    if item.command == mav.NAV_LOITER_UNLIM:
        walk.ended_by = item
        walk.note(f"{item.label}: stays there, the mission ends")
    place = _place(item, walk)
    hold_s = item.param(1) if item.command in (mav.NAV_WAYPOINT, mav.NAV_LOITER_TIME) else 0.0
    if not 0.0 <= hold_s <= LONGEST_HOLD_S:
        raise ItemError(f"{item.label}: a hold of {hold_s:g} s; it is from 0 to {LONGEST_HOLD_S:.0f} s")
    _add(Target(_name(item, walk), place, hold_s=hold_s, speed_m_s=walk.speed_m_s), walk)
    _note_unused(item, walk)


def _add(target: Target, walk: _Walk) -> None:
    """One more place to go to; a condition on the way there has had its time."""
    walk.condition = None
    walk.targets.append(target)


def _refuse_after_the_end(item: Item, walk: _Walk) -> None:
    if walk.ended_by is not None:
        raise ItemError(f"{item.label}: can never begin, {walk.ended_by.label} never ends")


def _name(item: Item, walk: _Walk) -> str:
    """The name of the target that an item makes, with a number from its second turn on."""
    walk.visits[item.index] += 1
    turn = walk.visits[item.index]
    name = "home" if item.command == mav.NAV_RETURN_TO_LAUNCH else f"waypoint {item.index}"
    return name if turn == 1 else f"{name} pass {turn}"


def _place(item: Item, walk: _Walk) -> Place:
    """The place of an item."""
    if item.command == mav.NAV_RETURN_TO_LAUNCH:
        return HomePoint(0.0, 0.0) if walk.home is None else walk.home
    if item.is_here:
        walk.note(f"{item.label}: has no place of its own (0, 0): where the rover is then, as ArduRover takes it")
        return HERE
    if item.frame not in mav.GLOBAL_FRAMES:
        frame = mav.FRAME_NAMES.get(item.frame, "unknown")
        raise ItemError(f"{item.label}: frame {item.frame} ({frame}) has no latitude and longitude")
    return geo_point(item.lat_deg, item.lon_deg, item.label)


def _circle(item: Item, walk: _Walk) -> None:
    """NAV_LOITER_TURNS: p1 turns, p3 radius (negative: counterclockwise), round its place or where the rover is."""
    _refuse_after_the_end(item, walk)
    before = _last_place(walk)
    centre = before if item.is_here else _place(item, walk)
    turns, radius_m = item.param(1), item.param(3)
    if not isinstance(centre, GeoPoint):
        walk.refuse(item, "the centre of its circle is where the rover happens to be")
        return
    if not (0.0 <= turns <= 255.0 and math.isfinite(radius_m) and abs(radius_m) <= 2550.0):
        limits = "at most 255 turns and 2550 m can be driven"
        raise ItemError(f"{item.label}: {turns:g} turns of {radius_m:g} m radius; {limits}")
    places = corners(centre, radius_m, turns, before if isinstance(before, GeoPoint) else None)
    name = _name(item, walk)
    for number, place in enumerate(places, 1):
        text = name if len(places) == 1 else f"{name} ({number} of {len(places)})"
        _add(Target(text, place, speed_m_s=walk.speed_m_s), walk)
    walk.note(f"{item.label}: {turns:g} turns of {abs(radius_m):g} m radius, driven through {len(places)} places")


def _last_place(walk: _Walk) -> Place | None:
    """Where the rover is then, as far as the items tell."""
    return next((target.place for target in reversed(walk.targets) if not isinstance(target.place, Here)), None)


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


def _patrol(walk: _Walk, jump: Item, first: int, end: int) -> Patrol:
    """Keep one lap of an endless loop, and what comes before it. Raises ItemError for a loop that leads nowhere."""
    lap = walk.targets[first:end]
    if all(isinstance(target.place, Here) for target in lap):
        raise ItemError(f"{jump.label}: repeats for ever without a place to go to")
    before = walk.targets[:first]
    while len(before) >= len(lap) and [replace(a, name="") for a in before[-len(lap) :]] == [
        replace(b, name="") for b in lap
    ]:
        lap, before = before[-len(lap) :], before[: -len(lap)]
    walk.targets = [*before, *lap]
    last = f"{len(lap)} targets" if len(lap) > 1 else "target"
    walk.note(f"{jump.label}: a patrol: the last {last} again and again, until somebody ends it")
    return Patrol(len(before))


# --- legs of a mission that the autopilot drives itself, in AUTO -----------------------------------------------------


def _hands_over(item: Item) -> bool:
    return item.command == mav.NAV_GUIDED_ENABLE and item.param(1) > 0.0


def _auto_item(item: Item, walk: _Walk) -> None:
    """An item of an AUTO mission: a target if it is handed over, else a place that the autopilot drives to.

    The target has no end of its own: the autopilot decides when it goes on.
    """
    if _hands_over(item):
        if item.is_here:
            raise ItemError(f"{item.label}: has no place (latitude and longitude are 0)")
        place = _place(item, walk)
        walk.visits[item.index] += 1
        turn = walk.visits[item.index]
        name = f"guided item {item.index}" if turn == 1 else f"guided item {item.index} pass {turn}"
        walk.targets.append(Target(name, place, hold_s=FOR_EVER_S, on_blocked=OnBlocked.WAIT, speed_m_s=None))
        walk.note("the autopilot drives this mission itself, in AUTO; the companion drives what it hands over")
    elif item.command <= mav.NAV_LAST and item.frame in mav.GLOBAL_FRAMES and not item.is_here:
        walk.passed.append(geo_point(item.lat_deg, item.lon_deg, item.label))


def _ground_along(passed: list[GeoPoint]) -> tuple[WeightedArea, ...]:
    """An area along the autopilot's own lines, so that the grid includes them; it has the weight of all ground."""
    if not passed:
        return ()
    alone = len(set(passed)) == 1
    area = Area((passed[0],), radius_m=GROUND_M) if alone else Area(tuple(passed), width_m=GROUND_M)
    return (WeightedArea(area, BASE_WEIGHT),)


# --- what to do there ------------------------------------------------------------------------------------------------


def _delay(item: Item, walk: _Walk) -> None:
    """NAV_DELAY: a longer hold at the last target, or one where the rover is."""
    delay_s = item.param(1)
    if not (math.isfinite(delay_s) and delay_s >= 0.0):
        walk.refuse(item, "waiting for a time of day is not understood")
        return
    if walk.condition is not None or any(command.is_conditional for command in _commands_here(walk)):
        walk.refuse(item, "a delay after a condition on the way is not understood")
        return
    if not walk.targets:
        _add(Target(_name(item, walk), HERE), walk)
    walk.targets[-1] = replace(walk.targets[-1], hold_s=walk.targets[-1].hold_s + delay_s)


def _commands_here(walk: _Walk) -> Sequence[DoCommand]:
    return walk.targets[-1].commands if walk.targets else walk.commands


def _condition(item: Item, walk: _Walk) -> None:
    """CONDITION_DELAY: p1 seconds; CONDITION_DISTANCE: p1 metres to the next place."""
    value = item.param(1)
    if not (math.isfinite(value) and value >= 0.0):
        raise ItemError(f"{item.label}: a condition of {value:g}")
    by_time = item.command == mav.CONDITION_DELAY
    before = walk.condition
    delay_s = value + (before.delay_s or 0.0 if before else 0.0) if by_time else (before.delay_s if before else None)
    within_m = (before.within_m if before else None) if by_time else value
    walk.condition = DoCommand(item.command, (), delay_s=delay_s, within_m=within_m)


def _command(item: Item, walk: _Walk) -> None:
    """A command for the autopilot at the last place, or where the mission begins."""
    if walk.ended_by is not None:
        walk.note(f"{item.label}: never comes, {walk.ended_by.label} never ends")
        return
    rest = (item.lat_deg, item.lon_deg, item.altitude_m)
    given = tuple(None if math.isnan(value) else value for value in (*item.params, *rest))
    place, frame = None, 0
    if item.command in WITH_PLACE and not item.is_here:
        place = geo_point(item.lat_deg, item.lon_deg, item.label)
        frame = item.frame if item.frame in mav.GLOBAL_FRAMES else ABOVE_HOME
        given = (*given[:4], None, None, given[6])
    if item.command == mav.DO_SET_HOME:
        walk.home = place if place is not None and item.param(1) != 1.0 else _last_place(walk)
    condition, walk.condition = walk.condition, None
    on_way = condition is not None or any(before.is_conditional for before in _commands_here(walk))
    command = DoCommand(
        item.command,
        given,
        place,
        frame,
        item.index,
        after_s=0.0 if on_way or not walk.targets else walk.targets[-1].hold_s,
        delay_s=condition.delay_s if condition else None,
        within_m=condition.within_m if condition else None,
    )
    if lacks := lacking(command):
        raise ItemError(f"{item.label}: {lacks}")
    if not walk.targets:
        walk.commands.append(command)
    else:
        walk.targets[-1] = replace(walk.targets[-1], commands=(*walk.targets[-1].commands, command))


def _change_speed(item: Item, walk: _Walk) -> None:
    """p1: kind (air and ground speed are the same to a rover), p2: m/s (-1 unchanged, -2 default), p3: throttle."""
    if item.param(1) not in (0.0, 1.0):
        walk.refuse(item, f"a speed of kind {item.param(1):g} is not for a rover")
        return
    speed_m_s = item.param(2)
    if speed_m_s == -2.0:
        walk.speed_m_s = None
    elif speed_m_s != -1.0:
        if not 0.0 < speed_m_s <= FASTEST_M_S:
            raise ItemError(f"{item.label}: a speed of {speed_m_s:g} m/s; give more than 0 and up to {FASTEST_M_S:g}")
        walk.speed_m_s = speed_m_s
    if item.param(3) not in (0.0, -1.0):
        walk.note(f"{item.label}: throttle {item.param(3):g} is not used")


def _reverse(item: Item, walk: _Walk) -> None:
    """DO_SET_REVERSE: forwards (p1 0) is how the companion drives anyway."""
    if item.param(1) == 1.0:
        walk.refuse(item, "the companion drives forwards, the way that its sensors look")


_MEANINGS: Mapping[int, Callable[[Item, _Walk], None]] = MappingProxyType(
    {
        mav.NAV_WAYPOINT: _travel,
        mav.NAV_LOITER_UNLIM: _travel,
        mav.NAV_LOITER_TIME: _travel,
        mav.NAV_RETURN_TO_LAUNCH: _travel,
        mav.NAV_LOITER_TURNS: _circle,
        mav.NAV_DELAY: _delay,
        mav.CONDITION_DELAY: _condition,
        mav.CONDITION_DISTANCE: _condition,
        mav.DO_CHANGE_SPEED: _change_speed,
        mav.DO_SET_REVERSE: _reverse,
    }
)
