"""The mission that the autopilot itself has stored, as it was fetched: read like a file with the same items."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import replace

from companion.mission.check import check_mission
from companion.mission.item_meaning import understand
from companion.mission.items import Item, ItemError
from companion.mission.mission import Mission, MissionError
from companion.mission.waypoints_reader import home_of

NAME = "the autopilot's mission"


def mission_of(items: Sequence[Item]) -> Mission:
    """Item 0 is home. Raises MissionError: one line with the item and the reason."""
    if len(items) < 2:
        raise MissionError(f"{NAME}: there is none; upload one to the autopilot, or give a MISSION file")
    try:
        home, rest = home_of(list(items))
        mission = understand(rest, None, NAME, home)
    except ItemError as error:
        raise MissionError(f"{NAME}: {error}") from None
    check_mission(mission)
    return replace(mission, stored=digest(items))


def digest(items: Sequence[Item]) -> str:
    """Differs when the stored items do; home (item 0) is not looked at, for it moves with every start of the autopilot."""
    return hashlib.sha256(repr(list(items[1:])).encode()).hexdigest()
