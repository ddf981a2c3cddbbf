"""Log lines of the lidar's client link: its peer, and how much was sent."""

from __future__ import annotations

import math
import socket
from collections.abc import Callable
from enum import Enum, auto

from sitl.network.endpoint import packets
from sitl.network.event_log import SILENT_S
from sitl.network.mavlink_client import ClientLink


class State(Enum):
    """State of a link."""

    BEGUN = auto()
    NO_PEER = auto()
    CONNECTED = auto()
    ANSWERED = auto()
    SILENT = auto()


class LoggedLink:
    """Wraps ``link`` and reports changes of its state to ``tell``; ``system``: the autopilot heard there, if any."""

    def __init__(
        self, link: ClientLink, url: str, tell: Callable[[str], None], system: Callable[[], int | None]
    ) -> None:
        self._link = link
        self._url = url
        self._tell = tell
        self._system = system
        self._known: tuple[State, int | None] = (State.BEGUN, None)
        self._peer = ""
        self._heard_s = -math.inf
        self._sent = self._lost = 0

    @property
    def peer(self) -> str:
        """As of the link."""
        return self._link.peer

    def sockets(self) -> list[socket.socket]:
        """As of the link."""
        return self._link.sockets()

    def exchange(self, data: bytes, now_s: float) -> bytes:
        """As the link does; then report a change of state."""
        heard = self._link.exchange(data, now_s)
        if data and self._link.peer:
            self._sent += len(packets(data))
        elif data:
            self._lost += len(packets(data))
        if heard:
            self._heard_s = now_s
        known = self._state(now_s), self._system()
        if known != self._known:
            if line := self._line(*known):
                self._tell(line)
            self._known, self._peer = known, self._link.peer
        return heard

    def close(self) -> None:
        """Close all sockets, and report how much was sent."""
        self._link.close()
        lost = f", {self._lost} lost without a peer" if self._lost else ""
        self._tell(f"{self._url}: {self._sent} packets of the lidar sent{lost}")

    def _state(self, now_s: float) -> State:
        if not self._link.peer:
            self._heard_s = -math.inf
            return State.NO_PEER
        if self._heard_s == -math.inf or self._system() is None:
            return State.CONNECTED
        return State.ANSWERED if now_s - self._heard_s <= SILENT_S else State.SILENT

    def _line(self, state: State, system: int | None) -> str:
        peer = self._link.peer
        match state:
            case State.NO_PEER if self._known[0] is State.BEGUN:
                return f"waiting for {self._url}"
            case State.NO_PEER if self._known[0] is not State.NO_PEER:
                return f"{self._peer}: link lost; waiting for {self._url}"
            case State.CONNECTED:
                return f"scans go to {peer}, where no autopilot has been heard yet ({self._url})"
            case State.ANSWERED:
                return f"scans go to {peer} (system {system})"
            case State.SILENT:
                return f"{peer} has been silent for {SILENT_S:g} s ({self._url})"
            case _:
                return ""
