"""Fetches mission, fence or rally items from the autopilot (MAVLink's mission protocol), one list at a time, never waiting."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field

from companion.mavlink.decode import MISSION_ACK_COMMAND
from companion.mission.items import Item
from companion.vehicle.commands import Command, EndTransfer, RequestItem, RequestList
from companion.vehicle.events.event import Event
from companion.vehicle.events.plan import PlanCountSeen, PlanItemSeen, PlanKind
from companion.vehicle.events.vehicle import AckSeen

ANSWER_S = 0.8
"""A request that is not answered for so long is repeated: a slow radio needs about half of it there and back."""
TRIES = 5
MOST_ITEMS = 4000
"""Longer lists are refused: no flight controller without a memory card keeps more than about 700."""
RESTARTS = 3
"""A list that changes under way is begun anew, at most so often."""
ACCEPTED, ERROR, UNSUPPORTED, INVALID_SEQUENCE, DENIED = 0, 1, 3, 13, 14
"""MAV_MISSION_RESULT, as far as a download cares."""


@dataclass(frozen=True, slots=True)
class Downloaded:
    """How a transfer ended. ``failure`` is empty when all ``items`` have arrived; item 0 of a mission is home.

    An autopilot that knows no such list has none: no items, no failure.
    """

    kind: PlanKind
    time_s: float
    items: tuple[Item, ...] = ()
    failure: str = ""


@dataclass
class _Transfer:
    """The one under way. ``count`` is None until it has been told."""

    kind: PlanKind
    sent_s: float | None = None
    tries: int = 0
    restarts: int = 0
    count: int | None = None
    items: list[Item] = field(default_factory=list)


class Downloads:
    """Asks for lists in the order they were wanted, and keeps how each ended last."""

    def __init__(self) -> None:
        self._wanted: deque[PlanKind] = deque()
        self._now: _Transfer | None = None
        self._last: dict[PlanKind, Downloaded] = {}
        self._farewell: EndTransfer | None = None

    def ask(self, kind: PlanKind) -> None:
        """Fetch this list (again); nothing happens while it is wanted already. One under way may be an older state: it ends first."""
        if kind not in self._wanted:
            self._wanted.append(kind)

    def cancel(self) -> None:
        """Forget what is wanted and what is under way."""
        self._wanted.clear()
        if self._now is not None:
            self._end(self._now, None, "cancelled", cancelled=True)

    def last(self, kind: PlanKind) -> Downloaded | None:
        """How the last transfer of this list ended; None before."""
        return self._last.get(kind)

    def busy(self, kind: PlanKind) -> bool:
        """Whether this list is wanted or under way."""
        return kind in self._wanted or (self._now is not None and self._now.kind is kind)

    def heard(self, event: Event) -> None:
        """An answer, perhaps to us; what does not belong to the transfer under way is passed over."""
        now = self._now
        if now is None or now.sent_s is None:
            return
        match event:
            case PlanCountSeen() if event.kind == now.kind:
                self._counted(now, event)
            case PlanItemSeen() if event.kind == now.kind and event.index == len(now.items) and now.count is not None:
                self._take(now, event)
            case AckSeen() if event.command == MISSION_ACK_COMMAND and event.kind == now.kind:
                self._refused(now, event)
            case _:
                pass

    def due(self, now_s: float) -> list[Command]:
        """What to send now."""
        commands: list[Command] = []
        if self._farewell is not None:
            commands.append(self._farewell)
            self._farewell = None
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
            return  # told twice
        if now.count is not None:
            self._restart(now, event.time_s)
            return
        if event.count > MOST_ITEMS:
            self._end(now, event.time_s, f"{event.count} items are more than {MOST_ITEMS}", cancelled=True)
            return
        now.count = event.count
        self._next(now, event.time_s)

    def _take(self, now: _Transfer, event: PlanItemSeen) -> None:
        place = (event.lat_deg, event.lon_deg)
        now.items.append(Item(event.index, event.command, event.frame, event.params, *place, event.autocontinue))
        self._next(now, event.time_s)

    def _next(self, now: _Transfer, time_s: float) -> None:
        """Go on with the next item at once, or be done."""
        now.sent_s, now.tries = -math.inf, 0
        if len(now.items) == now.count:
            self._end(now, time_s, "")

    def _refused(self, now: _Transfer, event: AckSeen) -> None:
        """The autopilot will not go on: the list became shorter, somebody uploads one, or it knows none."""
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
        """``time_s`` None: by ourselves, nothing is kept of it. A whole list is acknowledged, an unfinished one called off."""
        self._now = None
        if time_s is not None:
            self._last[now.kind] = Downloaded(now.kind, time_s, () if failure else tuple(now.items), failure)
        if cancelled or not failure:
            self._farewell = EndTransfer(now.kind, cancelled)
