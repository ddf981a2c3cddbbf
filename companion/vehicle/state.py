"""State of the vehicle: ``fold`` adds one event to it.

Nouns: vehicle state.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from enum import Enum

from companion.core.arrival_jitter import MOST_S, ArrivalJitter
from companion.core.changed import changed
from companion.core.frames import Pose
from companion.core.scan import WIRED
from companion.vehicle import guard
from companion.vehicle.auto_leg import GuidedLeg, LegState, leg_after, leg_at_heartbeat
from companion.vehicle.dead_reckoning import Drift, Reckoning, drift_after, jump_m, reckoning_after
from companion.vehicle.events import (
    AttitudeSeen,
    BatterySeen,
    EkfStatusSeen,
    Event,
    GlobalPositionSeen,
    GpsSeen,
    GuardSeen,
    HeartbeatSeen,
    HomeSeen,
    ItemCurrentSeen,
    ItemReachedSeen,
    LegSeen,
    LocalPositionSeen,
    OriginSeen,
    OtherSeen,
    ParameterSeen,
    PrearmSeen,
    RangeSeen,
    RoverMode,
    TargetSeen,
    ThrottleSeen,
)
from companion.vehicle.link_latency import BACK_S, Latency, TimeAnswered, latency_after_answer, latency_after_report
from companion.vehicle.motion_limits import LIMITS, THROTTLE_SCALE, TIMEOUT
from companion.vehicle.rc_input import Sticks, SticksSeen, sticks_after

EKF_ATTITUDE, EKF_VELOCITY = 1, 2
"""ATTITUDE and VELOCITY_HORIZ must both be set to drive."""
EKF_POSITION = 8 | 16
"""POS_HORIZ_REL or POS_HORIZ_ABS: one of them must be set to drive."""
EKF_CONST_POSITION = 128
"""CONST_POS_MODE must not be set. No other flag counts: GPS_GLITCH alone stops neither ArduRover nor the companion."""
FENCE = ("FENCE_ENABLE", "FENCE_TYPE", "FENCE_MARGIN", "FENCE_RADIUS", "FENCE_OPTIONS")
PARAMETERS_KEPT = frozenset((*FENCE, "WP_RADIUS", TIMEOUT, *LIMITS, *THROTTLE_SCALE))
"""The parameters that a run needs: the autopilot sends hundreds whenever a ground station lists them."""
FIRST_BATTERY = 0
OTHERS_KEPT = 64
OTHERS_FORGOTTEN_S = 30.0
"""Other vehicles are kept for this long after their last message, and no more than OTHERS_KEPT of them."""
WIDER_S = 1.0
"""So long a wide scan stands before those of single beams that look the same way."""


class EkfQuantity(Enum):
    """What the EKF estimates."""

    POSITION = "position"
    ATTITUDE = "attitude"
    VELOCITY = "velocity"


@dataclass(frozen=True)
class VehicleState:
    """The newest event of each kind; None until the first."""

    heartbeat: HeartbeatSeen | None = None
    position: LocalPositionSeen | None = None
    attitude: AttitudeSeen | None = None
    throttle: ThrottleSeen | None = None
    global_position: GlobalPositionSeen | None = None
    ekf: EkfStatusSeen | None = None
    origin: OriginSeen | None = None
    home: HomeSeen | None = None
    scan: RangeSeen | None = None
    scan_ahead: RangeSeen | None = None
    """The newest range data that covers straight ahead: without it the rover would drive blind."""
    target: TargetSeen | None = None
    prearm: PrearmSeen | None = None
    gps: GpsSeen | None = None
    battery: BatterySeen | None = None
    """The first one; for people only."""
    guard: GuardSeen | None = None
    jump_m: float = 0.0
    """How far the last position report was from where the velocity led."""
    frozen: bool = False
    """The velocity says that the rover moves, the position that it stands: kept until a person sets GUIDED again."""
    reckoned: Reckoning | None = None
    """The state of that check."""
    wander: Drift = field(default_factory=Drift)
    """How far the position has drifted from where the velocity led."""
    restarted: bool = False
    """The autopilot's boot time has run back: kept until a person sets GUIDED again."""
    latency: Latency = field(default_factory=Latency)
    """How late the link is."""
    jitter: ArrivalJitter = field(default_factory=ArrivalJitter)
    """Of position reports, and so of all that bears the autopilot's boot time."""
    sticks: Sticks = field(default_factory=Sticks)
    """Whether a pilot has moved the sticks since a person set GUIDED."""
    parameters: dict[str, float] = field(default_factory=dict)
    others: dict[str, OtherSeen] = field(default_factory=dict)
    """Other vehicles, by name."""
    in_auto: bool = False
    """Whether the companion drives legs of an AUTO mission, instead of a mission of its own in GUIDED."""
    leg: GuidedLeg | None = None
    """The last leg that was handed over."""

    @property
    def own_mode(self) -> RoverMode:
        """The mode in which the companion may steer."""
        return RoverMode.AUTO if self.in_auto else RoverMode.GUIDED

    @property
    def is_ours(self) -> bool:
        """Whether the mode lets the companion steer: GUIDED; or AUTO with a live leg, if it drives legs of AUTO."""
        if self.heartbeat is None or self.heartbeat.mode != self.own_mode:
            return False
        return not self.in_auto or (self.leg is not None and self.leg.state is LegState.LIVE)

    def pose_at(self, time_s: float) -> Pose | None:
        """Position and heading at a time, by the last velocities; None until both are known.

        The jitter of their arrival does not count, which the autopilot's boot time shows.
        """
        if self.position is None or self.attitude is None:
            return None
        ahead_s, turn_s = self._since_s(self.position, time_s), self._since_s(self.attitude, time_s)
        return Pose(
            self.position.north_m + self.position.north_m_s * ahead_s,
            self.position.east_m + self.position.east_m_s * ahead_s,
            self.attitude.heading_rad + self.attitude.yaw_rate_rad_s * turn_s,
            time_s,
        )

    def _since_s(self, report: LocalPositionSeen | AttitudeSeen, time_s: float) -> float:
        """The time since a report; below 0 before it."""
        return min(max(time_s - self.came_s(report), -MOST_S), 0.5)

    def came_s(self, report: LocalPositionSeen | AttitudeSeen) -> float:
        """When a report would have come without the jitter of its way; when it came where that is not known."""
        return report.time_s - (self.jitter.late_s(report.time_s, report.boot_s) or 0.0)

    def seen_s(self, seen: RangeSeen) -> float:
        """When the rover was where it got a scan, by when its positions come.

        What comes over the link is as late as they are but for the jitter; a scan whose own jitter is not known has
        waited as the last position did. A lidar of the companion's own is not late: positions are, by half a round trip
        at least.
        """
        waited_s = 0.0 if self.position is None else self.position.time_s - self.came_s(self.position)
        if seen.scan.sender == WIRED:
            return seen.time_s + max(0.5 * self.latency_s - waited_s, 0.5 * self.latency.round_trip_s)
        return seen.time_s - (waited_s if seen.scan.late_s is None else seen.scan.late_s)

    @property
    def speed_m_s(self) -> float:
        """Ground speed; 0 until a position is known."""
        return 0.0 if self.position is None else math.hypot(self.position.north_m_s, self.position.east_m_s)

    @property
    def forward_m_s(self) -> float:
        """Velocity over ground along the heading; 0 until both are known."""
        if self.position is None or self.attitude is None:
            return 0.0
        heading_rad = self.attitude.heading_rad
        return self.position.north_m_s * math.cos(heading_rad) + self.position.east_m_s * math.sin(heading_rad)

    def guard_at(self, time_s: float) -> GuardSeen | None:
        """The guard on the autopilot as last heard; None if it is not there, or does not watch: in legs of AUTO."""
        if self.in_auto or self.guard is None or time_s - self.guard.time_s >= guard.FRESH_S:
            return None
        return self.guard

    @property
    def latency_s(self) -> float:
        """The link's share of the time from an observation to the arrival of a command; 0 until measured."""
        return self.latency.longest_s

    @property
    def ekf_lacks(self) -> EkfQuantity | None:
        """The estimate that the autopilot does not trust; None when the rover may drive."""
        flags = 0 if self.ekf is None else self.ekf.flags
        if not flags & EKF_POSITION or flags & EKF_CONST_POSITION:
            return EkfQuantity.POSITION
        if not flags & EKF_ATTITUDE:
            return EkfQuantity.ATTITUDE
        return None if flags & EKF_VELOCITY else EkfQuantity.VELOCITY

    @property
    def ekf_ok(self) -> bool:
        """Whether the autopilot trusts its own estimate."""
        return self.ekf_lacks is None


def fold(state: VehicleState, event: Event) -> VehicleState:
    """The state after one more event."""
    match event:
        case HeartbeatSeen():
            return _with_heartbeat(state, event)
        case LocalPositionSeen():
            return _with_position(state, event)
        case AttitudeSeen():
            return changed(state, attitude=event)
        case ThrottleSeen():
            return changed(state, throttle=event)
        case GlobalPositionSeen():
            return changed(state, global_position=event)
        case EkfStatusSeen():
            return changed(state, ekf=event)
        case RangeSeen():
            return changed(state, scan=event, scan_ahead=_seen_ahead(state.scan_ahead, event))
        case TargetSeen():
            return changed(state, target=event)
        case SticksSeen():
            return changed(state, sticks=sticks_after(state.sticks, event))
        case TimeAnswered():
            return changed(state, latency=latency_after_answer(state.latency, event))
        case _:
            return _fold_rare(state, event)


def _fold_rare(state: VehicleState, event: Event) -> VehicleState:
    """The state after an event of a rarer kind."""
    match event:
        case OriginSeen():
            return changed(state, origin=event)
        case HomeSeen():
            return changed(state, home=event)
        case OtherSeen():
            return changed(state, others=_with_other(state.others, event))
        case LegSeen() | ItemReachedSeen() | ItemCurrentSeen():
            return changed(state, leg=leg_after(state.leg, event))
        case PrearmSeen():
            return changed(state, prearm=event)
        case GpsSeen():
            return changed(state, gps=event)
        case BatterySeen():
            return changed(state, battery=event) if event.number == FIRST_BATTERY else state
        case GuardSeen():
            return changed(state, guard=event)
        case ParameterSeen():
            return _with_parameter(state, event)
        case _:
            return state


def _seen_ahead(before: RangeSeen | None, event: RangeSeen) -> RangeSeen | None:
    """The newest scan ahead. A single beam does not take the place of a wider scan that is as good as new."""
    if not event.scan.looks_ahead:
        return before
    wider = before is not None and not before.scan.is_narrow and event.time_s - before.time_s < WIDER_S
    return before if event.scan.is_narrow and wider else event


def _with_parameter(state: VehicleState, event: ParameterSeen) -> VehicleState:
    if event.name not in PARAMETERS_KEPT or state.parameters.get(event.name) == event.value:
        return state
    return changed(state, parameters={**state.parameters, event.name: event.value})


def _with_other(others: dict[str, OtherSeen], event: OtherSeen) -> dict[str, OtherSeen]:
    """The newest event of each vehicle, without those silent for too long; of too many, the newest."""
    kept = [one for one in others.values() if one.name != event.name and event.time_s - one.time_s < OTHERS_FORGOTTEN_S]
    return {one.name: one for one in [*kept[-(OTHERS_KEPT - 1) :], event]}


def _with_heartbeat(state: VehicleState, event: HeartbeatSeen) -> VehicleState:
    """Mode and arming.

    A person who sets the companion's mode again accepts the position, the clock and the sticks as they are.
    """
    leg = leg_at_heartbeat(state.leg, event.time_s, in_auto=event.armed and event.mode == RoverMode.AUTO)
    before, state = state.heartbeat, changed(state, heartbeat=event, leg=leg)
    if before is None:
        return state
    if before.mode != state.own_mode == event.mode:
        return changed(state, frozen=False, restarted=False, sticks=Sticks())
    return changed(state, sticks=Sticks()) if event.armed and not before.armed else state


def _with_position(state: VehicleState, now: LocalPositionSeen) -> VehicleState:
    """The position, compared with where the velocity led, and its time compared with the companion's clock."""
    before = state.position
    if before is not None and now.boot_s < before.boot_s - BACK_S:
        off_m = jump_m(before, now, clock_jumped=True)
        jitter = ArrivalJitter().after(now.time_s, now.boot_s)
        return changed(
            state, position=now, jump_m=off_m, restarted=True, latency=Latency(), jitter=jitter, reckoned=None
        )
    latency = latency_after_report(state.latency, now.time_s, now.boot_s)
    clock_jumped = latency.jumped_s == now.time_s
    so_far, frozen = reckoning_after(None if clock_jumped else state.reckoned, before, now)
    off_m = jump_m(before, now, clock_jumped=clock_jumped)
    frozen = state.frozen or frozen
    wander = drift_after(state.wander, before, now)
    jitter = state.jitter.after(now.time_s, now.boot_s)
    return changed(
        state, position=now, jump_m=off_m, reckoned=so_far, frozen=frozen, latency=latency, jitter=jitter, wander=wander
    )
