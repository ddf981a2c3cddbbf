"""The fence monitor: the autopilot's own fence and rally points, read before driving, then regularly.

Nouns: fence monitor.
"""

from __future__ import annotations

import math

from companion.core.frames import GeoPoint
from companion.core.severity import Severity, TextSink
from companion.mavlink.autopilot_link import AutopilotLink
from companion.mavlink.download import Downloaded
from companion.mission.autopilot_fence import NO_FENCE, PARAMETERS, AutopilotFence, autopilot_fence
from companion.mission.fence_items import rally_points
from companion.mission.items import ItemError
from companion.safety.reasons import Doubt, Reason, WaitReason
from companion.safety.watchdogs import Monitor
from companion.settings import FenceSettings
from companion.vehicle.commands import ReadParameter
from companion.vehicle.events import (
    Event,
    FenceStatusSeen,
    ParameterSeen,
    PlanChangedSeen,
    PlanKind,
)
from companion.vehicle.state import VehicleState

PARAMETER_S, PARAMETER_TRIES = 1.0, 8
"""How often a parameter of the fence is asked for; one that has not come by then does not exist in this firmware."""
FAILED_S = 2.0
"""A list that could not be fetched is asked for again after this long."""
STATUS_S, ON_S = 5.0, 30.0
"""FENCE_STATUS comes once a second while a fence is on. A message older than the first time says nothing of a breach;
only after the second time does the fence count as switched off, because a bad line loses messages."""
TOTALS = {"FENCE_TOTAL": PlanKind.FENCE, "RALLY_TOTAL": PlanKind.RALLY}
"""ArduPilot tells everybody these parameters when a list has got another length."""


class FenceMonitor(Monitor):
    """Keeps up with both lists, and says when the fence is breached."""

    def __init__(self, autopilot: AutopilotLink, settings: FenceSettings, notifier: TextSink) -> None:
        self.rally: tuple[GeoPoint, ...] = ()
        self._fence: AutopilotFence | None = NO_FENCE if settings.heed == "never" else None
        self._autopilot = autopilot
        self._settings = settings
        self._notifier = notifier
        self._fault = ""
        self._status: FenceStatusSeen | None = None
        self._breach_told = False
        self._totals: dict[str, float] = {}
        self._asked_s = dict.fromkeys((PlanKind.FENCE, PlanKind.RALLY), -math.inf)
        self._parameters_s = -math.inf
        self._tries = 0
        self._known: tuple[object, ...] = ()
        self._rally: Downloaded | None = None
        self._vehicle = VehicleState()

    @property
    def fence(self) -> AutopilotFence:
        """The fence as known now."""
        return self._fence or NO_FENCE

    def awaited(self) -> Reason[WaitReason] | None:
        """Before the rover may be driven, fence and rally points must be known."""
        if self._fence is not None and (self._rally is not None or self._settings.heed == "never"):
            return None
        return Reason(WaitReason.FENCE, (f" ({self._fault})" if self._fault else "",))

    def doubt(self, now_s: float) -> Reason[Doubt] | None:
        """Whether the autopilot sees its fence breached."""
        told = self._told_within(STATUS_S, now_s) and self._status is not None and self._status.breached
        return Reason(Doubt.FENCE_BREACHED) if told else None

    def take(self, event: Event, vehicle: VehicleState) -> None:
        """One more event: whatever tells that a list may have changed has it fetched anew."""
        self._vehicle = vehicle
        match event:
            case FenceStatusSeen():
                self._status = event
            case PlanChangedSeen() if event.kind in self._asked_s:
                self._asked_s[PlanKind(event.kind)] = -math.inf
            case ParameterSeen() if event.name in TOTALS:
                if self._totals.get(event.name) != event.value:
                    self._asked_s[TOTALS[event.name]] = -math.inf
                self._totals[event.name] = event.value
            case _:
                pass

    def tick(self, now_s: float) -> None:
        """Ask for what is missing or old, put together what has come, tell of a breach."""
        self._ask_and_take(self._vehicle, now_s)
        breach = self.doubt(now_s)
        if breach is not None and not self._breach_told:
            text = str(breach)
            self._notifier.tell(text[0].upper() + text[1:], Severity.WARNING)
        self._breach_told = breach is not None

    def _ask_and_take(self, vehicle: VehicleState, now_s: float) -> None:
        if vehicle.heartbeat is None or self._settings.heed == "never":
            return
        self._read_parameters(vehicle, now_s)
        for kind in self._asked_s:
            self._fetch(kind, now_s)
        rally = self._autopilot.downloads.last(PlanKind.RALLY)
        if rally is not None and rally != self._rally:
            self._take_rally(rally)
        self._put_together(vehicle, now_s)

    def _told_within(self, seconds: float, now_s: float) -> bool:
        return self._status is not None and now_s - self._status.time_s <= seconds

    def _read_parameters(self, vehicle: VehicleState, now_s: float) -> None:
        """All of them every ``again_s``, and those that are missing every second for a while."""
        missing = [name for name in PARAMETERS if name not in vehicle.parameters]
        if now_s - self._parameters_s >= self._settings.again_s:
            names: list[str] = list(PARAMETERS)
        elif missing and self._tries < PARAMETER_TRIES and now_s - self._parameters_s >= PARAMETER_S:
            names = missing
        else:
            return
        self._parameters_s, self._tries = now_s, self._tries + 1
        for name in names:
            self._autopilot.send(ReadParameter(name), now_s)

    def _fetch(self, kind: PlanKind, now_s: float) -> None:
        downloads = self._autopilot.downloads
        last = downloads.last(kind)
        failed = last is not None and last.failure != ""
        if not downloads.busy(kind) and now_s - self._asked_s[kind] >= (FAILED_S if failed else self._settings.again_s):
            self._asked_s[kind] = now_s
            downloads.ask(kind)

    def _take_rally(self, rally: Downloaded) -> None:
        """What cannot be had leaves the points known before: returning the way the rover came needs none."""
        self._rally = rally
        if rally.failure:
            return
        try:
            self.rally = rally_points(rally.items)
        except ItemError as error:
            self._notifier.tell(f"The autopilot's rally points are not used: {error}", Severity.WARNING)

    def _put_together(self, vehicle: VehicleState, now_s: float) -> None:
        """Make the fence anew when it has changed; what makes no sense leaves the fence as it was."""
        stored = self._autopilot.downloads.last(PlanKind.FENCE)
        told = all(name in vehicle.parameters for name in PARAMETERS) or self._tries >= PARAMETER_TRIES
        if stored is None or not told or vehicle.home is None:
            return
        if stored.failure:
            self._fault = stored.failure
            return
        on = self._settings.heed == "stored" or self._told_within(ON_S, now_s)
        values = tuple(vehicle.parameters.get(name) for name in PARAMETERS)
        known = (stored, values, vehicle.home.point, on)
        same, self._known = known == self._known, known
        if same:
            return
        try:
            self._fence = autopilot_fence(stored.items, vehicle.parameters, vehicle.home.point, enabled=on)
            self._fault = ""
        except ItemError as error:
            self._fault = str(error)
            self._notifier.tell(f"The autopilot's fence makes no sense: {error}", Severity.WARNING)
