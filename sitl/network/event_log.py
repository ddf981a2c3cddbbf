"""Log lines of a served simulator: clients that connect and disconnect, commands of missions, and collisions."""

from __future__ import annotations

from collections.abc import Callable

from sitl.network.collision_log import CollisionLog
from sitl.simulator import Simulator

SILENT_S = 5.0
"""A UDP client that has been silent for this long counts as gone."""


class EventLog:
    """Reports each event in one line to ``tell`` (by default nowhere); ``now_s`` reads real seconds.

    ``warn``: is told of collisions; by default ``tell``.
    """

    def __init__(
        self,
        tell: Callable[[str], None] = lambda line: None,
        now_s: Callable[[], float] = lambda: 0.0,
        warn: Callable[[str], None] | None = None,
    ) -> None:
        self._tell = tell
        self._now_s = now_s
        self._heard_s: dict[tuple[str, str], float] = {}
        self._collisions = CollisionLog(warn or tell, now_s)
        self._commands = 0

    def connected(self, client: str, url: str) -> None:
        """A client has connected."""
        self._tell(f"{client} has connected ({url})")

    def disconnected(self, client: str, url: str, *, dropped: bool) -> None:
        """A client has disconnected, or was ``dropped`` by the vehicle."""
        self._tell(f"{client} has {'been dropped: the autopilot restarts' if dropped else 'disconnected'} ({url})")

    def heard(self, client: str, url: str) -> None:
        """A client has sent something over a protocol without connections."""
        if (client, url) not in self._heard_s:
            self.connected(client, url)
        self._heard_s[client, url] = self._now_s()

    def look(self, simulator: Simulator) -> None:
        """Report clients that have fallen silent, commands that were answered and collisions since the last look."""
        now_s = self._now_s()
        for (client, url), last_s in list(self._heard_s.items()):
            if now_s - last_s > SILENT_S:
                del self._heard_s[client, url]
                self._tell(f"{client} has been silent for {SILENT_S:g} s ({url})")
        self._collisions.look(simulator.collisions, simulator.start)
        commands = simulator.commands
        for event in commands[self._commands :]:
            auto = " in AUTO" if event.in_auto else ""
            self._tell(f"{event.name}{auto}: {event.result_name}")
        self._commands = len(commands)

    def end(self, simulator: Simulator) -> None:
        """The last look: report the collisions that have not been told."""
        self._collisions.look(simulator.collisions, simulator.start, last=True)
