"""The localization monitor: doubts the position when it jumps, wanders or follows another GPS fix, or its origin moves.

Nouns: localization monitor.
"""

from __future__ import annotations

import math
from collections import deque

from companion.core.severity import Severity, TextSink
from companion.executive.mission_executor import MissionExecutor
from companion.executive.mission_layout import apart_m
from companion.executive.mission_run import MissionRun
from companion.mavlink.autopilot_link import AutopilotLink
from companion.safety.fix_jump import FixJump, JumpPhase
from companion.safety.reasons import Doubt, Reason
from companion.safety.watchdogs import Monitor
from companion.settings.live_settings import LiveSettings
from companion.vehicle.dead_reckoning import MAX_DRIFT_M, Drift
from companion.vehicle.events import (
    Event,
    GpsSeen,
    HomeSeen,
    LocalPositionSeen,
    OriginSeen,
)
from companion.vehicle.state import VehicleState

HOME_MOVED_M = 2.0
ASK_PLACES_S = 0.5
"""While the position is doubted, the origin is requested this often."""
SETTLED_S = 0.4
"""An answer counts if it comes at least this long after the doubt arose: position and origin then share one frame."""
UNSETTLED_S = 10.0
"""So long at most the rover stands until the position follows its velocity again. An EKF that followed a wrong GPS
comes back as slowly, and what is mapped meanwhile lies aside."""

WANDERINGS, WANDERINGS_S = 3, 20.0
"""If the position wanders this often within this time, the rover must not drive."""
ONCE_S = 3.0
"""Wandering that goes on within this time of the last is counted once."""
ANSWERED_S = 2.0
"""While it settles, the origin must be heard this often: without it the map could not begin anew."""
CALM_S = 10.0
"""How long after the last wandering the rover must not drive; after steps with the fix it stands so long."""


class LocalizationMonitor(Monitor):
    """Keeps the doubt until it is settled. From a jump on the map is worthless, and begun anew.

    Only where the position steps because the GPS fix has changed, and by no more than ``safety.jump_m``, the rover
    stands until the step is over, and then the map is moved by it.
    """

    def __init__(self, run: MissionRun, autopilot: AutopilotLink, settings: LiveSettings, notifier: TextSink) -> None:
        self._run = run
        self._autopilot = autopilot
        self._settings = settings
        self._notifier = notifier
        self._doubt: Doubt | None = None
        self._doubt_s = 0.0
        self._asked_s = -math.inf
        self._home_told = False
        self._wandered_s: deque[float] = deque(maxlen=WANDERINGS)
        self._stepped_s: deque[float] = deque(maxlen=WANDERINGS)
        self._unsure_until_s = self._steps_until_s = -math.inf
        self._answered_s = -math.inf
        """When the origin was heard last."""
        self._began_s: float | None = None
        """When a drift was noticed that may be a step of the GPS fix, of which the receiver has not told yet."""
        self._forgot: tuple[float, int] | None = None
        """When the map was forgotten, and how many scans there had been; None once one ahead is on it again."""
        self._fix = FixJump()

    @property
    def position_doubted(self) -> bool:
        """Whether scans cannot be given a place now."""
        return self._doubt is not None

    def doubt(self, now_s: float) -> Reason[Doubt] | None:
        """Why the rover must not move now; None when it may."""
        if now_s < self._unsure_until_s:
            return Reason(Doubt.POSITION_WANDERS)
        if self._doubt is None and now_s < self._steps_until_s:
            return Reason(Doubt.FIX_CHANGED)
        if self._doubt is None and self._forgot is not None:
            return Reason(Doubt.MAP_EMPTY)
        if self._doubt is Doubt.POSITION_SETTLES and now_s - self._answered_s > ANSWERED_S:
            return Reason(Doubt.POSITION_WANDERED)
        return None if self._doubt is None else Reason(self._doubt)

    def tick(self, now_s: float) -> None:
        """While a frame is doubted, have its origin told again and again until the run ends."""
        if (
            self._doubt not in (None, Doubt.FIX_CHANGED)
            and self._run.end is None
            and now_s - self._asked_s >= ASK_PLACES_S
        ):
            self._asked_s = now_s
            self._autopilot.ask_places()

    def take(self, event: Event, vehicle: VehicleState) -> None:
        """One more event; before the mission has begun there is no map that could be wrong."""
        if isinstance(event, GpsSeen):
            self._fix.take_fix(event)
        elif isinstance(event, LocalPositionSeen):
            self._fix.take_report(event)
        if (executor := self._run.executor) is None:
            return
        if self._forgot is not None and vehicle.scan_ahead is not None:
            forgot_s, scans = self._forgot
            if vehicle.scan_ahead.time_s > forgot_s and executor.scans_mapped > scans:
                self._forgot = None
        match event:
            case LocalPositionSeen() if vehicle.jump_m > self._settings.current.safety.jump_m:
                self._begin(Doubt.POSITION_JUMPED, event.time_s, f"Position jumped {vehicle.jump_m:.1f} m")
            case LocalPositionSeen() if self._doubt is Doubt.FIX_CHANGED and not self._fix.watching:
                self._begin(Doubt.POSITION_WANDERED, event.time_s, "Positions were missing after a change of GPS fix")
            case LocalPositionSeen() if self._fix.watching and self._may_be_fix:
                self._follow_fix(event.time_s, executor)
            case LocalPositionSeen() if vehicle.wander.noticed:
                self._wander(vehicle.wander, event.time_s)
            case OriginSeen():
                self._find_ground(event, executor, settled=vehicle.wander.settled)
            case HomeSeen() if not self._home_told and apart_m(event.point, executor.layout.home) > HOME_MOVED_M:
                self._home_told = True
                self._notifier.tell("Home has moved; the mission stays where it began", Severity.WARNING)
            case _:
                pass

    @property
    def _may_be_fix(self) -> bool:
        """Whether a step of the position may be one of the fix: the receiver may tell of that later."""
        return self._doubt in (None, Doubt.FIX_CHANGED) or self._began_s is not None

    def _wander(self, drift: Drift, now_s: float) -> None:
        """A drift was noticed. A quick one may be a step of the fix: what is to be done is known a second later."""
        if drift.off_m > MAX_DRIFT_M:
            self._begin(Doubt.POSITION_WANDERED, now_s, f"Position wandered {drift.off_m:.1f} m")
        elif self._doubt in (None, Doubt.FIX_CHANGED):
            self._notifier.tell(f"Position wandered {drift.quick_m:.1f} m within a second", Severity.WARNING)
            self._doubt, self._doubt_s, self._began_s = Doubt.POSITION_WANDERED, now_s, now_s
        else:
            self._doubt, self._doubt_s = Doubt.POSITION_WANDERED, now_s
        self._count_wandering(now_s)

    def _begin(self, doubt: Doubt, now_s: float, text: str) -> None:
        if self._doubt in (None, Doubt.FIX_CHANGED):
            self._notifier.tell(f"{text}: map forgotten", Severity.WARNING)
        self._doubt, self._doubt_s, self._began_s = doubt, now_s, None

    def _follow_fix(self, now_s: float, executor: MissionExecutor) -> None:
        """The rover stands while the position steps with the fix; then the map is moved. In doubt it is forgotten."""
        fix, limit_m = self._fix, self._settings.current.safety.jump_m
        if fix.off_m > limit_m or fix.phase is JumpPhase.LOST:
            self._begin(Doubt.POSITION_WANDERED, now_s, f"Position left by {fix.off_m:.1f} m after a change of GPS fix")
            self._count_wandering(now_s)
        elif fix.phase is JumpPhase.STEPPING:
            self._doubt, self._doubt_s = Doubt.FIX_CHANGED, now_s
            self._uncount_wandering()
        elif fix.phase is JumpPhase.SETTLED:
            self._count_step(now_s)
            change = f"{fix.before.text} to {fix.after.text}" if fix.before != fix.after else f"{fix.after.text} again"
            self._notifier.tell(f"GPS {change}: the map is moved by {fix.off_m:.2f} m", Severity.WARNING)
            executor.move_map(fix.north_m, fix.east_m, now_s)
            self._uncount_wandering()
            self._doubt = None
            self._run.start_afresh()

    def _count_step(self, now_s: float) -> None:
        """A fix that comes and goes moves the map again and again: the rover stands until it has stayed for a while."""
        self._stepped_s.append(now_s)
        if len(self._stepped_s) == WANDERINGS and now_s - self._stepped_s[0] <= WANDERINGS_S:
            self._steps_until_s = now_s + CALM_S

    def _count_wandering(self, now_s: float) -> None:
        """Once in a while the map begins anew; again and again, nothing that is mapped is true for long."""
        if not self._wandered_s or now_s - self._wandered_s[-1] > ONCE_S:
            self._wandered_s.append(now_s)
        if len(self._wandered_s) == WANDERINGS and now_s - self._wandered_s[0] <= WANDERINGS_S:
            self._unsure_until_s = now_s + CALM_S

    def _uncount_wandering(self) -> None:
        """What was taken for a drift is a step of the fix."""
        while self._began_s is not None and self._wandered_s and self._wandered_s[-1] >= self._began_s:
            self._wandered_s.pop()
        self._began_s = None

    @property
    def _wandered(self) -> bool:
        return self._doubt in (Doubt.POSITION_WANDERED, Doubt.POSITION_SETTLES)

    def _find_ground(self, event: OriginSeen, executor: MissionExecutor, *, settled: bool) -> None:
        """The origin as it is now: after a jump it tells whether the frame has moved, or only the rover in it."""
        self._answered_s = event.time_s
        if executor.follow_origin(event.point, event.time_s):
            self._doubt, self._doubt_s = Doubt.ORIGIN_MOVED, event.time_s
        elif self._doubt in (None, Doubt.FIX_CHANGED) or event.time_s - self._doubt_s < SETTLED_S:
            return
        elif self._wandered and not settled and event.time_s - self._doubt_s < UNSETTLED_S:
            self._doubt = Doubt.POSITION_SETTLES
        else:
            self._fix.begin_anew()
            if self._began_s is not None:
                self._notifier.tell("The position has settled: map forgotten", Severity.WARNING)
            executor.forget_map(event.time_s)
            self._forgot = event.time_s, executor.scans_mapped
            self._doubt = self._began_s = None
            self._run.start_afresh()
