"""Downloads mission, fence or rally items from the autopilot (MAVLink's mission protocol), one list at a time."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field

from companion.mavlink.decode import MISSION_ACK_COMMAND
from companion.mission.items import Item
from companion.vehicle.commands import Command, EndTransfer, RequestItem, RequestList
from companion.vehicle.events import AckSeen, Event, PlanCountSeen, PlanItemSeen, PlanKind

ANSWER_S = 0.8
"""A request is repeated after this time without answer: a slow radio's round trip takes about half of it."""
TRIES = 5
MOST_ITEMS = 4000
"""Longer lists are refused: flight controllers without a memory card hold about 700 items."""
RESTARTS = 3
"""How often a download is restarted because the list changes."""
ACCEPTED, ERROR, UNSUPPORTED, INVALID_SEQUENCE, DENIED = 0, 1, 3, 13, 14
"""Values of MAV_MISSION_RESULT that a download meets."""


@dataclass(frozen=True, slots=True)
class Downloaded:
    """The result of a download. ``failure`` is empty if all ``items`` have arrived; item 0 of a mission is home.

    If the autopilot does not support such a list, it is empty: no items, no failure.
    """

    kind: PlanKind
    time_s: float
    items: tuple[Item, ...] = ()
    failure: str = ""


@dataclass
class _Transfer:
    """A download in progress. ``count`` is None until known."""

    kind: PlanKind
    sent_s: float | None = None
    tries: int = 0
    restarts: int = 0
    count: int | None = None
    items: list[Item] = field(default_factory=list)


class Downloads:
    """Downloads lists in the order of request, and keeps the last result of each."""

    def __init__(self) -> None:
        self._wanted: deque[PlanKind] = deque()
        self._now: _Transfer | None = None
        self._last: dict[PlanKind, Downloaded] = {}
        self._closing: EndTransfer | None = None

    def ask(self, kind: PlanKind) -> None:
        """Request this list (again), unless it is waiting already.

        A download in progress ends first: it may be older.
        """
        if kind not in self._wanted:
            self._wanted.append(kind)

    def cancel(self) -> None:
        """Cancel waiting downloads and the one in progress."""
        self._wanted.clear()
        if self._now is not None:
            self._end(self._now, None, "cancelled", cancelled=True)

    def last(self, kind: PlanKind) -> Downloaded | None:
        """The last result of this list; None before the first."""
        return self._last.get(kind)

    def busy(self, kind: PlanKind) -> bool:
        """Whether this list is waiting or in progress."""
        return kind in self._wanted or (self._now is not None and self._now.kind is kind)

    def heard(self, event: Event) -> None:
        """Call for each event; those that do not belong to the download in progress are ignored."""
        now = self._now
        if now is None or now.sent_s is None:
            return
        match event:
            case PlanCountSeen() if event.kind == now.kind:
                self._counted(now, event)
            case PlanItemSeen() if event.kind == now.kind and event.index == len(now.items) and now.count is not None:
                self._add_item(now, event)
            case AckSeen() if event.command == MISSION_ACK_COMMAND and event.kind == now.kind:
                self._refused(now, event)
            case _:
                pass

    def due(self, now_s: float) -> list[Command]:
        """The commands to send now."""
        commands: list[Command] = []
        if self._closing is not None:
            commands.append(self._closing)
            self._closing = None
        if self._now is None and self._wanted:
            self._now = _Transfer(self._wanted.popleft())
        now = self._now
        if now is None or (now.sent_s is not None and now_s - now.sent_s < ANSWER_S):
            return commands
        if now.tries >= TRIES:
            self._end(now, now_s, f"no answer to {TRIES} requests", cancelled=now.count is not None)
            return commands
        now.sent_s, now.tries = now_s, now.tries + 1
        commands.append(RequestList(now.kind) if now.count is None else RequestItem(now.kind, len(now.items)))
        return commands

    def _counted(self, now: _Transfer, event: PlanCountSeen) -> None:
        if now.count == event.count:
            return  # sent twice
        if now.count is not None:
            self._restart(now, event.time_s)
            return
        if event.count > MOST_ITEMS:
            self._end(now, event.time_s, f"{event.count} items are more than {MOST_ITEMS}", cancelled=True)
            return
        now.count = event.count
        self._next(now, event.time_s)

    def _add_item(self, now: _Transfer, event: PlanItemSeen) -> None:
        place = (event.lat_deg, event.lon_deg)
        rest = (*place, event.autocontinue, event.altitude_m)
        now.items.append(Item(event.index, event.command, event.frame, event.params, *rest))
        self._next(now, event.time_s)

    def _next(self, now: _Transfer, time_s: float) -> None:
        """Request the next item at once, or end."""
        now.sent_s, now.tries = -math.inf, 0
        if len(now.items) == now.count:
            self._end(now, time_s, "")

    def _refused(self, now: _Transfer, event: AckSeen) -> None:
        """The autopilot refuses: the list has become shorter, an upload is in progress, or it supports no such list."""
        if event.result == ACCEPTED:
            return
        if event.result == UNSUPPORTED and now.count is None:
            now.count = 0
            self._next(now, event.time_s)
        elif event.result in (ERROR, INVALID_SEQUENCE) and now.count is not None:
            self._restart(now, event.time_s)
        else:
            reason = "somebody is just uploading it" if event.result == DENIED else f"refused (result {event.result})"
            self._end(now, event.time_s, reason)

    def _restart(self, now: _Transfer, time_s: float) -> None:
        if now.restarts >= RESTARTS:
            self._end(now, time_s, "it changes all the time", cancelled=True)
            return
        self._now = _Transfer(now.kind, sent_s=-math.inf, restarts=now.restarts + 1)

    def _end(self, now: _Transfer, time_s: float | None, failure: str, *, cancelled: bool = False) -> None:
        """End the download: acknowledge a complete list, cancel another one. With ``time_s`` None no result is kept."""
        self._now = None
        if time_s is not None:
            self._last[now.kind] = Downloaded(now.kind, time_s, () if failure else tuple(now.items), failure)
        if cancelled or not failure:
            self._closing = EndTransfer(now.kind, cancelled)
