"""The mission stored in the autopilot, made from its downloaded items as from a file."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import replace

from companion.mission.check import check_mission
from companion.mission.item_interpreter import mission_from_items
from companion.mission.items import Item, ItemError
from companion.mission.mission import Mission, MissionError
from companion.mission.waypoints_reader import home_of

NAME = "the autopilot's mission"


def mission_of(items: Sequence[Item], *, skip_unknown: bool = False) -> Mission:
    """The mission that the items describe; item 0 is home. ``skip_unknown``: without those that no rover can do.

    Raises MissionError: one line with the item and the reason.
    """
    if len(items) < 2:
        raise MissionError(f"{NAME}: there is none; upload one to the autopilot, or give a MISSION file")
    try:
        home, rest = home_of(list(items))
        mission = mission_from_items(rest, None, NAME, home, skip_unknown=skip_unknown)
    except ItemError as error:
        raise MissionError(f"{NAME}: {error}") from None
    check_mission(mission)
    return replace(mission, stored=digest(items))


def digest(items: Sequence[Item]) -> str:
    """SHA-256 of the stored items, without home (item 0), which changes with every start of the autopilot."""
    return hashlib.sha256(repr(list(items[1:])).encode()).hexdigest()
