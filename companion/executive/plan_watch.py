"""Notices that the mission in the autopilot is no longer the one that this run was given from it, and says so."""

from __future__ import annotations

from companion.executive.mission_executor import Tell
from companion.mavlink.download import Downloads
from companion.mission.stored_mission import digest
from companion.vehicle.events import (
    Event,
    ItemCurrentSeen,
    PlanChangedSeen,
    PlanKind,
    TextSeen,
)

WARNING = 4
RECEIVED = "Flight plan received"
"""ArduPilot says so, and acknowledges, on the link that an upload came by, which need not be ours;"""
AGAIN_S = 60.0
"""so the mission is fetched again this often: nothing else tells of an upload with as many items as before."""


class PlanWatch:
    """``stored``: the digest of what was read; empty for a mission from elsewhere, which nothing is compared with."""

    def __init__(self, stored: str, downloads: Downloads, tell: Tell) -> None:
        self._stored = stored
        self._told = stored
        self._downloads = downloads
        self._tell = tell
        self._total: int | None = None
        self._looked_s = 0.0
        self._asked_s: float | None = None

    def take_in(self, event: Event) -> None:
        """One more event. Any sign of a change has the mission fetched again: only its items tell."""
        if not self._stored:
            return
        since_s = self._asked_s = event.time_s if self._asked_s is None else self._asked_s
        if event.time_s - since_s >= AGAIN_S or self._is_sign(event):
            self._asked_s = event.time_s
            self._downloads.ask(PlanKind.MISSION)
        else:
            self._compare()

    def _is_sign(self, event: Event) -> bool:
        match event:
            case PlanChangedSeen():
                return event.kind == PlanKind.MISSION
            case TextSeen():
                return event.text == RECEIVED
            case ItemCurrentSeen() if event.total is not None:
                before, self._total = self._total, event.total
                return before not in (None, event.total)
            case _:
                return False

    def _compare(self) -> None:
        last = self._downloads.last(PlanKind.MISSION)
        if last is None or last.failure or last.time_s <= self._looked_s:
            return
        self._looked_s = last.time_s
        now = digest(last.items)
        if now not in (self._stored, self._told):
            self._tell(
                "The autopilot's mission has changed: this run drives the one it read; start it again for the new one",
                WARNING,
            )
        self._told = now
