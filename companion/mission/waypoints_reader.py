"""Reader of QGC WPL 110 (``.waypoints``): the text form of Mission Planner, MAVProxy and older QGroundControl.

A header line, then one item a line: index, current, frame, command, p1 to p4, latitude, longitude, altitude,
autocontinue, separated by tabs or spaces. Item 0 is home if it is a waypoint. Mission Planner saves fences and rally
points as separate files of the same form; here they may also follow the mission's items.

Nouns: waypoints.
"""

from __future__ import annotations

import math
import re
import reprlib
from pathlib import Path

from companion.core.frames import GeoPoint
from companion.mission import mav_commands as mav
from companion.mission.item_interpreter import mission_from_items
from companion.mission.items import MAX_ITEMS, XML, Item, ItemError, geo_point
from companion.mission.mission import Mission, MissionError
from companion.storage.files import read_text
from companion.storage.validation import number_hint

HEADER = ("QGC", "WPL", "110")
MAX_BYTES = 20_000_000


def load(path: Path, *, skip_unknown: bool = False) -> Mission:
    """Read a WPL file; fences without any target are allowed. Raises MissionError: file, line or item, reason."""
    lines = _lines(path)
    if not lines or tuple(lines[0][1]) != HEADER:
        found = reprlib.repr(" ".join(lines[0][1])) if lines else "nothing"
        place = f"line {lines[0][0]}" if lines else "file"
        raise MissionError(f"{path}: {place}: expected the header 'QGC WPL 110', found {found}{_hint(lines)}")
    if len(lines) - 1 > MAX_ITEMS:
        raise MissionError(f"{path}: {len(lines) - 1} items are more than {MAX_ITEMS}")
    items = []
    for position, (number, words) in enumerate(lines[1:]):
        try:
            items.append(_item(words, position))
        except ValueError as error:
            raise MissionError(f"{path}: line {number}: {error}") from None
    if not items:
        raise MissionError(f"{path}: holds no items")
    try:
        home, items = home_of(items)
        return mission_from_items(items, path, path.stem, home, skip_unknown=skip_unknown)
    except ItemError as error:
        raise MissionError(f"{path}: {error}") from None


def _lines(path: Path) -> list[tuple[int, list[str]]]:
    """Line numbers and words, without comments and blank lines."""
    text = read_text(path, MissionError, MAX_BYTES, "utf-8-sig")
    split = (
        (number, line.partition("#")[0].split()) for number, line in enumerate(re.split(r"\r\n|\r|\n", text), start=1)
    )
    return [(number, words) for number, words in split if words]


def _hint(lines: list[tuple[int, list[str]]]) -> str:
    """What to add where another kind of file has this name."""
    first = lines[0][1][0] if lines else ""
    if first.startswith("{"):
        return "; it seems a plan of QGroundControl; end its name in .plan"
    if first.startswith("<"):
        return f"; the file {XML}"
    return "; save it anew with Mission Planner, MAVProxy or QGroundControl"


def _item(words: list[str], position: int) -> Item:
    """One line's item. Raises ValueError with the reason."""
    if len(words) != 12:
        raise ValueError(f"12 values are needed, found {len(words)}")
    names = ("index", "current", "frame", "command")
    index, _, frame, command = (_whole(word, name) for word, name in zip(words, names, strict=False))
    if index != position:
        raise ValueError(f"item {position} is expected here, found item {index}")
    p1, p2, p3, p4 = (_real(word, f"p{i}", nan=True) for i, word in enumerate(words[4:8], start=1))
    lat_deg, lon_deg = _real(words[8], "latitude"), _real(words[9], "longitude")
    altitude_m = _real(words[10], "altitude", nan=True)
    autocontinue = _whole(words[11], "autocontinue") != 0
    return Item(index, command, frame, (p1, p2, p3, p4), lat_deg, lon_deg, autocontinue, altitude_m)


def home_of(items: list[Item]) -> tuple[GeoPoint | None, list[Item]]:
    """Home and the other items. Item 0 is home if it is a waypoint (fence files begin with a fence)."""
    first = items[0]
    if first.command != mav.NAV_WAYPOINT:
        return None, items
    if first.lat_deg == 0.0 and first.lon_deg == 0.0:
        return None, items[1:]
    return geo_point(first.lat_deg, first.lon_deg, "item 0: home"), items[1:]


def _whole(word: str, name: str) -> int:
    value = _real(word, name)
    if value != int(value):
        raise ValueError(f"{name}: expected a whole number, got {reprlib.repr(word)}")
    return int(value)


def _real(word: str, name: str, *, nan: bool = False) -> float:
    try:
        value = math.inf if "_" in word else float(word)
    except ValueError:
        value = math.inf
    if not (math.isfinite(value) or (nan and math.isnan(value))):
        raise ValueError(f"{name}: expected a number, got {reprlib.repr(word)}{number_hint(word)}")
    return value
