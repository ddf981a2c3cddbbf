"""Doubts about where the rover is: its position jumped, the origin moved, the companion itself stood still."""

from __future__ import annotations

import math
from collections.abc import Callable

from companion.laying import apart_m
from companion.pursuit import Pursuit, Tell
from companion.settings import Settings
from companion.vehicle import Event, HomeSeen, LocalPositionSeen, OriginSeen, VehicleState

WARNING = 4
HOME_MOVED_M = 2.0
ASK_PLACES_S = 0.5
"""While it is doubtful where the rover is, the origin is asked for this often,"""
SETTLED_S = 0.4
"""and an answer counts that comes so long after the doubt arose: position and origin then speak of the same frame."""


class Whereabouts:
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

    def retune(self, settings: Settings) -> None:
        """Other settings from now on."""
        self._jump_m = settings.safety.jump_m

    @property
    def position_doubted(self) -> bool:
        """Whether scans cannot be given a place now."""
        return bool(self._doubt)

    def reason(self, now_s: float) -> str:
        """Why the rover must not move now; empty when it may."""
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

    def take_in(self, event: Event, vehicle: VehicleState, pursuit: Pursuit) -> None:
        """One more event, already folded into ``vehicle``."""
        match event:
            case LocalPositionSeen() if vehicle.jump_m > self._jump_m:
                if not self._doubt:
                    self._tell(f"Position jumped {vehicle.jump_m:.1f} m: map forgotten", WARNING)
                self._doubt, self._doubt_s = "position jumped", event.time_s
            case OriginSeen():
                self._find_ground(event, pursuit)
            case HomeSeen() if not self._home_told and apart_m(event.point, pursuit.laid.home) > HOME_MOVED_M:
                self._home_told = True
                self._tell("Home has moved; the mission stays where it began", WARNING)
            case _:
                pass

    def _find_ground(self, event: OriginSeen, pursuit: Pursuit) -> None:
        """The origin as it is now: after a jump this tells whether the frame has moved or only the rover's place in it."""
        if pursuit.follow_origin(event.point):
            self._doubt, self._doubt_s = "EKF origin moved", event.time_s
        elif self._doubt and event.time_s - self._doubt_s >= SETTLED_S:
            pursuit.forget_map()
            self._doubt = ""
            self._start_afresh()
