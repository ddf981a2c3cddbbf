"""The mission that the autopilot has stored: fetched before a run, and watched for changes during it.

Nouns: mission fetcher, mission change monitor.
"""

from __future__ import annotations

from collections.abc import Callable

from companion.core.clock import Clock
from companion.core.severity import Severity, TextSink
from companion.mavlink.autopilot_link import AutopilotLink
from companion.mavlink.download import Downloads
from companion.mission.items import Item
from companion.mission.mission import MissionError
from companion.mission.stored_mission import NAME, digest
from companion.safety.reasons import Activity, Reason, RunPhase, WaitReason
from companion.safety.watchdogs import Monitor
from companion.vehicle.events import (
    Event,
    ItemCurrentSeen,
    PlanChangedSeen,
    PlanKind,
    TextSeen,
)
from companion.vehicle.state import VehicleState

TRIES = 3
PAUSE_S = 2.0
"""After a try that failed: somebody may just be uploading."""
RECEIVED = "Flight plan received"
"""ArduPilot's text after an upload. It is sent on the link of the upload only, which need not be ours."""
AGAIN_S = 60.0
"""The mission is fetched again this often. Nothing else tells of an upload by another link with as many items."""


class MissionFetcher:
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
                waits = Activity(RunPhase.WAITING, awaited=Reason(WaitReason.HEARTBEAT, (self._autopilot.trouble,)))
                show("fetching the mission" if heard else str(waits))
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


class MissionChangeMonitor(Monitor):
    """``stored``: the digest of what was read; empty for a mission from elsewhere, which nothing is compared with."""

    def __init__(self, stored: str, downloads: Downloads, notifier: TextSink) -> None:
        self._stored = stored
        self._told = stored
        self._downloads = downloads
        self._notifier = notifier
        self._total: int | None = None
        self._looked_s = 0.0
        self._asked_s: float | None = None

    def take(self, event: Event, vehicle: VehicleState) -> None:
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
            self._notifier.tell(
                "The autopilot's mission has changed: this run drives the one it read; start it again for the new one",
                Severity.WARNING,
            )
        self._told = now
