"""Doubts about where the rover is: its position jumped, the origin moved, the companion itself stood still."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable

from companion.executive.mission_executor import MissionExecutor, Tell
from companion.executive.mission_layout import apart_m
from companion.settings import Settings
from companion.vehicle.events import (
    Event,
    HomeSeen,
    LocalPositionSeen,
    OriginSeen,
)
from companion.vehicle.state import VehicleState

WARNING = 4
HOME_MOVED_M = 2.0
ASK_PLACES_S = 0.5
"""While it is doubtful where the rover is, the origin is asked for this often,"""
SETTLED_S = 0.4
"""and an answer counts that comes so long after the doubt arose: position and origin then speak of the same frame."""

WANDERINGS, WANDERINGS_S = 3, 20.0
"""A position that wanders so often within so long is no position to drive by,"""
ONCE_S = 3.0
"""(what lasts no longer than this is once)"""
CALM_S = 10.0
"""until it has been calm for so long."""


class LocalizationMonitor:
    """Keeps the doubt that there is, and says when it is settled. The map is worthless from a jump on, and begun anew.

    ``tell`` says a text with its severity to the people; ``start_afresh`` has the leg begin again where the rover then is.
    """

    def __init__(self, jump_m: float, tell: Tell, start_afresh: Callable[[], None]) -> None:
        self._jump_m = jump_m
        self._tell = tell
        self._start_afresh = start_afresh
        self._doubt = ""
        self._doubt_s = 0.0
        self._asked_s = self._settled_s = -math.inf
        self._home_told = False
        self._wandered_s: deque[float] = deque(maxlen=WANDERINGS)
        self._unsure_until_s = -math.inf

    def retune(self, settings: Settings) -> None:
        """Other settings from now on."""
        self._jump_m = settings.safety.jump_m

    @property
    def position_doubted(self) -> bool:
        """Whether scans cannot be given a place now."""
        return bool(self._doubt)

    def reason(self, now_s: float) -> str:
        """Why the rover must not move now; empty when it may."""
        if now_s < self._unsure_until_s:
            return "position wanders"
        return self._doubt or ("the companion stood still" if now_s < self._settled_s else "")

    def stalled(self, now_s: float) -> None:
        """The companion's own loop stood still: what piled up meanwhile is not believed."""
        self._settled_s = now_s + SETTLED_S

    def must_ask(self, now_s: float) -> bool:
        """Whether it is time to ask for the origin (again)."""
        if not self._doubt or now_s - self._asked_s < ASK_PLACES_S:
            return False
        self._asked_s = now_s
        return True

    def take_in(self, event: Event, vehicle: VehicleState, executor: MissionExecutor) -> None:
        """One more event, already folded into ``vehicle``."""
        match event:
            case LocalPositionSeen() if vehicle.jump_m > self._jump_m:
                if not self._doubt:
                    self._tell(f"Position jumped {vehicle.jump_m:.1f} m: map forgotten", WARNING)
                self._doubt, self._doubt_s = "position jumped", event.time_s
            case LocalPositionSeen() if vehicle.wander.noticed:
                self._note_wandering(vehicle.wander.off_m, event.time_s)
            case OriginSeen():
                self._find_ground(event, executor)
            case HomeSeen() if not self._home_told and apart_m(event.point, executor.layout.home) > HOME_MOVED_M:
                self._home_told = True
                self._tell("Home has moved; the mission stays where it began", WARNING)
            case _:
                pass

    def _note_wandering(self, off_m: float, now_s: float) -> None:
        """Once in a while the map begins anew; again and again, nothing that is mapped is true for long."""
        if not self._doubt:
            self._tell(f"Position wandered {off_m:.1f} m: map forgotten", WARNING)
        self._doubt, self._doubt_s = "position wandered", now_s
        if not self._wandered_s or now_s - self._wandered_s[-1] > ONCE_S:
            self._wandered_s.append(now_s)
        if len(self._wandered_s) == WANDERINGS and now_s - self._wandered_s[0] <= WANDERINGS_S:
            self._unsure_until_s = now_s + CALM_S

    def _find_ground(self, event: OriginSeen, executor: MissionExecutor) -> None:
        """The origin as it is now: after a jump this tells whether the frame has moved or only the rover's place in it."""
        if executor.follow_origin(event.point, event.time_s):
            self._doubt, self._doubt_s = "EKF origin moved", event.time_s
        elif self._doubt and event.time_s - self._doubt_s >= SETTLED_S:
            executor.forget_map(event.time_s)
            self._doubt = ""
            self._start_afresh()
