"""The lidar trouble monitor: tells why a lidar that is wired to the companion has given no whole turn yet.

Nouns: lidar trouble monitor.
"""

from __future__ import annotations

from companion.core.severity import Severity, TextSink
from companion.lidar.reader import Lidars
from companion.lidar.trouble import trouble
from companion.safety.watchdogs import Monitor

LISTENS_S = 4.0
"""A motor takes a while to get up to speed, and a lidar that gives nothing is told twice to begin."""

EVERY_S = 1.0
"""To look what a sample of bytes is takes some milliseconds."""


class LidarTroubleMonitor(Monitor):
    """Never a reason not to drive: that is the ``LidarMonitor``'s. A run that waits says here what it waits for."""

    def __init__(self, lidars: Lidars, notifier: TextSink) -> None:
        self._lidars = lidars
        self._notifier = notifier
        self._look_s: float | None = None
        self._told: set[tuple[int, str]] = set()

    def tick(self, now_s: float) -> None:
        """Tell each trouble of each lidar once."""
        self._look_s = now_s + LISTENS_S if self._look_s is None else self._look_s
        if now_s < self._look_s:
            return
        self._look_s = now_s + EVERY_S
        for reader in self._lidars.readers:
            found = trouble(reader)
            if found is not None and (reader.number, found.name) not in self._told:
                self._told.add((reader.number, found.name))
                self._notifier.tell(str(found), Severity.WARNING)
