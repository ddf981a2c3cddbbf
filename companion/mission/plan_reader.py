"""Reader of QGroundControl's ``.plan`` files: JSON with mission items, geofence and rally points.

Nouns: .plan.
"""

from __future__ import annotations

import json
import math
import reprlib
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from companion.core.frames import GeoPoint
from companion.mission.fence_items import circle
from companion.mission.item_interpreter import mission_from_items
from companion.mission.items import MAX_ITEMS, XML, Item, ItemError, geo_point
from companion.mission.mission import Area, Mission, MissionError, open_ring
from companion.storage.files import read_text
from companion.storage.validation import quoted_hint

MAX_BYTES = 50_000_000

LARGEST = 1e18
"""Larger numbers are refused: no value of a plan can be that large."""

Json = dict[str, object]


def load(path: Path, *, skip_unknown: bool = False) -> Mission:
    """Read a plan; fences without any target are allowed. Raises MissionError: file, place, reason."""
    plan = _read(path)
    try:
        return _mission(plan, path, skip_unknown=skip_unknown)
    except ItemError as error:
        raise MissionError(f"{path}: {error}") from None


def _mission(plan: Json, path: Path, *, skip_unknown: bool) -> Mission:
    if plan.get("fileType") != "Plan":
        raise ItemError(f'fileType: expected "Plan", got {reprlib.repr(plan.get("fileType"))}')
    _expect_version(plan, "version", 1)
    listing = _table(plan, "mission")
    _expect_version(listing, "mission.version", 2)
    items = list(_items(_list(listing, "mission.items"), "mission.items"))
    if len(items) > MAX_ITEMS:
        raise ItemError(f"mission.items: {len(items)} items are more than {MAX_ITEMS}")
    seen: set[int] = set()
    for item in items:
        if item.index in seen:
            raise ItemError(f"item {item.index}: two items have this doJumpId")
        seen.add(item.index)
    home = listing.get("plannedHomePosition")
    planned_home = None if home is None else _geo(home, "mission.plannedHomePosition")
    mission = mission_from_items(items, path, path.stem, planned_home, skip_unknown=skip_unknown)
    keep_out, keep_in, notes = _geofence(plan)
    return replace(
        mission,
        keep_out=mission.keep_out + keep_out,
        keep_in=mission.keep_in + keep_in,
        notes=(*mission.notes, *notes, *_rally_notes(plan)),
    )


def _read(path: Path) -> Json:
    text = read_text(path, MissionError, MAX_BYTES, "utf-8-sig")
    try:
        plan = json.loads(text)
    except json.JSONDecodeError as error:
        reason = _what_else(text, error.pos) or f"not valid JSON: {error.msg.lower()}"
        raise MissionError(f"{path}: line {error.lineno}: {reason}") from error
    except RecursionError as error:
        raise MissionError(f"{path}: lists within lists, far deeper than a plan has them; save it anew") from error
    except ValueError as error:
        raise MissionError(f"{path}: not valid JSON: {str(error)[:80]}") from error
    if not isinstance(plan, dict):
        raise MissionError(f"{path}: not a QGroundControl plan")
    return plan


def _what_else(text: str, fault: int) -> str:
    """What a text with a fault at this place is, if it is no plan with a slip of the pen; empty if it may be one."""
    whole = text.strip()
    if not whole:
        return "the file is empty"
    if whole.startswith("<"):
        return XML
    if whole.startswith("QGC WPL"):
        return f"begins with {reprlib.repr(whole.splitlines()[0])}; end its name in .waypoints"
    if whole.startswith("{") and (fault >= len(text.rstrip()) or not whole.endswith("}")):
        return "not valid JSON: the end is missing; the file seems cut, save or copy it anew"
    return ""


# --- items -----------------------------------------------------------------------------------------------------------


def _items(entries: list[object], place: str, *, inner: bool = False) -> Iterator[Item]:
    """The simple items in order; a complex item (such as a survey) is replaced by the simple items that it holds."""
    for position, entry in enumerate(entries, start=1):
        where = f"{place} {position}"
        if not isinstance(entry, dict):
            raise ItemError(f"{where}: not an item")
        kind = entry.get("type")
        if kind == "SimpleItem":
            yield _simple_item(entry, where, position)
        elif kind == "ComplexItem" and not inner:
            name = reprlib.repr(entry.get("complexItemType"))
            transects = entry.get("TransectStyleComplexItem")
            if not isinstance(transects, dict) or not isinstance(transects.get("Items"), list):
                kind = f"{where}: ComplexItem {name}"
                yield Item(-position, 0, 0, (0.0, 0.0, 0.0, 0.0), 0.0, 0.0, kind=kind)
                continue
            yield from _items(transects["Items"], f"{where} ({name}) item", inner=True)
        else:
            raise ItemError(f"{where}: type {reprlib.repr(kind)} is not understood")


def _simple_item(entry: Json, where: str, position: int) -> Item:
    params = entry.get("params")
    if not isinstance(params, list) or len(params) != 7:
        raise ItemError(f"{where}: params: 7 values are needed")
    values = [math.nan if value is None else _real(value, f"{where}: params {i}") for i, value in enumerate(params, 1)]
    command, frame = _whole(entry.get("command"), f"{where}: command"), _whole(entry.get("frame"), f"{where}: frame")
    index = _whole(entry.get("doJumpId", position), f"{where}: doJumpId")
    p1, p2, p3, p4 = values[:4]
    autocontinue = entry.get("autoContinue", True) is True
    return Item(index, command, frame, (p1, p2, p3, p4), values[4], values[5], autocontinue, values[6])


# --- fences and rally points -----------------------------------------------------------------------------------------


def _geofence(plan: Json) -> tuple[tuple[Area, ...], tuple[Area, ...], tuple[str, ...]]:
    """Keep-out areas, keep-in areas, notes."""
    if plan.get("geoFence") is None:
        return (), (), ()
    fence = _table(plan, "geoFence")
    _expect_version(fence, "geoFence.version", 2)
    keep: dict[bool, list[Area]] = {True: [], False: []}
    for number, entry in enumerate(_list(fence, "geoFence.polygons", needed=False), start=1):
        where = f"geoFence.polygons {number}"
        corners = _list(_dict(entry, where), f"{where}.polygon")
        keep[_inclusion(entry, where)].append(Area(open_ring(tuple(_geo(corner, where) for corner in corners))))
    for number, entry in enumerate(_list(fence, "geoFence.circles", needed=False), start=1):
        where = f"geoFence.circles {number}"
        shape = _table(_dict(entry, where), f"{where}.circle")
        centre = _geo(shape.get("center"), f"{where}: center")
        radius_m = _real(shape.get("radius"), f"{where}: radius")
        keep[_inclusion(entry, where)].append(circle(centre, radius_m, where))
    notes = ("geoFence: the rover stays inside its fences and needs no breach return point",)
    return tuple(keep[False]), tuple(keep[True]), notes if fence.get("breachReturn") else ()


def _inclusion(entry: object, where: str) -> bool:
    inclusion = _dict(entry, where).get("inclusion")
    if not isinstance(inclusion, bool):
        raise ItemError(f"{where}: inclusion: expected true or false")
    return inclusion


def _rally_notes(plan: Json) -> tuple[str, ...]:
    if plan.get("rallyPoints") is None:
        return ()
    points = _list(_table(plan, "rallyPoints"), "rallyPoints.points", needed=False)
    return (f"rallyPoints: {len(points)} rally points are not used",) if points else ()


# --- values ----------------------------------------------------------------------------------------------------------


def _geo(value: object, where: str) -> GeoPoint:
    if not isinstance(value, list) or len(value) < 2:
        raise ItemError(f"{where}: expected [latitude, longitude], got {reprlib.repr(value)}")
    return geo_point(_real(value[0], where), _real(value[1], where), where)


def _dict(value: object, where: str) -> Json:
    if not isinstance(value, dict):
        raise ItemError(f"{where}: expected an object")
    return value


def _table(parent: Json, where: str) -> Json:
    return _dict(parent.get(where.rpartition(".")[2]), where)


def _list(parent: Json, where: str, *, needed: bool = True) -> list[object]:
    value = parent.get(where.rpartition(".")[2])
    if value is None and not needed:
        return []
    if not isinstance(value, list):
        raise ItemError(f"{where}: expected a list")
    return value


def _expect_version(parent: Json, where: str, version: int) -> None:
    value = parent.get("version")
    if value != version or isinstance(value, bool):
        got = "there is none" if value is None else f"got {reprlib.repr(value)}"
        raise ItemError(f"{where}: only version {version} is understood, {got}; save it with a newer QGroundControl")


def _real(value: object, where: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) < LARGEST:
        raise ItemError(f"{where}: expected a number, got {reprlib.repr(value)}{quoted_hint(value)}")
    return float(value)


def _whole(value: object, where: str) -> int:
    if isinstance(value, bool) or not isinstance(value, int):
        raise ItemError(f"{where}: expected a whole number, got {reprlib.repr(value)}{quoted_hint(value)}")
    return value
