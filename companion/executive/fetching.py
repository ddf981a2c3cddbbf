"""Fetches the mission that the autopilot has stored, before a run: one exchange with it, and the rover is not touched."""

from __future__ import annotations

from collections.abc import Callable

from companion.core.clock import Clock
from companion.mavlink.autopilot_link import AutopilotLink
from companion.mission.items import Item
from companion.mission.mission import MissionError
from companion.mission.stored_mission import NAME
from companion.vehicle.events import PlanKind

TRIES = 3
PAUSE_S = 2.0
"""After a try that failed: somebody may just be uploading."""


class Fetching:
    """``fetch`` waits for the autopilot, as long as it takes; ``stop`` (safe in a signal handler) ends that."""

    def __init__(self, autopilot: AutopilotLink, clock: Clock, tick_hz: float) -> None:
        self._autopilot = autopilot
        self._clock = clock
        self._tick_s = 1.0 / tick_hz
        self._stopped = False

    def stop(self) -> None:
        """End at the next tick."""
        self._stopped = True

    def fetch(self, show: Callable[[str], None] = lambda text: None) -> tuple[Item, ...] | None:
        """The items, item 0 is home; None when stopped. ``show`` is told what is awaited. Raises MissionError."""
        failure = ""
        for number in range(TRIES):
            if number > 0:
                self._listen_until_s(self._clock.now_s() + PAUSE_S)
            self._autopilot.downloads.ask(PlanKind.MISSION)
            while self._autopilot.downloads.busy(PlanKind.MISSION) and not self._stopped:
                heard = self._autopilot.codec.vehicle_known
                show(
                    "fetching the mission"
                    if heard
                    else f"waiting for the autopilot's heartbeat{self._autopilot.trouble}"
                )
                self._listen_until_s(self._clock.now_s() + self._tick_s)
            if self._stopped:
                self._autopilot.downloads.cancel()
                return None
            last = self._autopilot.downloads.last(PlanKind.MISSION)
            assert last is not None
            if not last.failure:
                return last.items
            failure = last.failure
        raise MissionError(f"{NAME} cannot be fetched: {failure}; check the link, or give a MISSION file")

    def _listen_until_s(self, time_s: float) -> None:
        while True:
            now_s = self._clock.now_s()
            self._autopilot.poll(now_s)
            self._autopilot.service(now_s)
            if now_s >= time_s - 1e-6 or self._stopped:
                return
            self._clock.sleep_until_s(min(time_s, now_s + self._tick_s))
