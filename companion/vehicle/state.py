"""What is known of the vehicle: events come in, ``fold`` keeps the state."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

from companion.core.frames import Pose
from companion.vehicle.dead_reckoning import Reckoned, Wander, jump_m, reckoned, wandered
from companion.vehicle.events.event import Event
from companion.vehicle.events.targets import (
    GuidedLeg,
    ItemCurrentSeen,
    ItemReachedSeen,
    LegSeen,
    LegState,
    leg_after,
    leg_at_heartbeat,
)
from companion.vehicle.events.vehicle import (
    AttitudeSeen,
    EkfStatusSeen,
    GlobalPositionSeen,
    HeartbeatSeen,
    HomeSeen,
    LocalPositionSeen,
    OriginSeen,
    OtherSeen,
    ParameterSeen,
    PrearmSeen,
    RangeSeen,
    RoverMode,
    TargetSeen,
)
from companion.vehicle.link_latency import BACK_S, Latency, TimeAnswered, answered, reported
from companion.vehicle.rc_input import Sticks, SticksSeen, followed

EKF_ATTITUDE, EKF_VELOCITY = 1, 2
"""ATTITUDE and VELOCITY_HORIZ must both be set to drive."""
EKF_POSITION = 8 | 16
"""POS_HORIZ_REL or POS_HORIZ_ABS: one of them must be set to drive."""
EKF_CONST_POSITION = 128
"""CONST_POS_MODE must not be set. No other flag counts: GPS_GLITCH alone stops neither ArduRover nor us."""
PARAMETERS_KEPT = frozenset(
    ("FENCE_ENABLE", "FENCE_TYPE", "FENCE_MARGIN", "FENCE_RADIUS", "FENCE_OPTIONS", "WP_RADIUS")
)
"""The autopilot tells hundreds of parameters whenever somebody lists them; no other is of use to a run."""
OTHERS_KEPT = 64
OTHERS_FORGOTTEN_S = 30.0
"""Other vehicles are remembered for so long after they were last heard, and no more than so many of them."""


@dataclass(frozen=True, slots=True)
class VehicleState:
    """The newest of everything; ``None`` until first heard."""

    heartbeat: HeartbeatSeen | None = None
    position: LocalPositionSeen | None = None
    attitude: AttitudeSeen | None = None
    global_position: GlobalPositionSeen | None = None
    ekf: EkfStatusSeen | None = None
    origin: OriginSeen | None = None
    home: HomeSeen | None = None
    scan: RangeSeen | None = None
    scan_ahead: RangeSeen | None = None
    """The newest range data that says something about straight ahead: without it the rover would drive blind."""
    target: TargetSeen | None = None
    prearm: PrearmSeen | None = None
    jump_m: float = 0.0
    """How far the last position report lay from where the velocity had led us to expect it."""
    frozen: bool = False
    """The velocity says that the rover moves and the position does not: kept until a person sets GUIDED again."""
    reckoned: Reckoned | None = None
    """The check for that, under way."""
    wander: Wander = field(default_factory=Wander)
    """How far the position has wandered from where the velocity has led."""
    restarted: bool = False
    """The autopilot's boot time has run back: kept until a person sets GUIDED again."""
    latency: Latency = field(default_factory=Latency)
    """How late the link is."""
    sticks: Sticks = field(default_factory=Sticks)
    """Whether a pilot has taken hold of them since a person set GUIDED."""
    parameters: dict[str, float] = field(default_factory=dict)
    others: dict[str, OtherSeen] = field(default_factory=dict)
    """Who else is about, by name."""
    in_auto: bool = False
    """Whether the companion drives legs that AUTO hands over, instead of a mission of its own in GUIDED."""
    leg: GuidedLeg | None = None
    """The last leg that was handed over."""

    @property
    def own_mode(self) -> RoverMode:
        """The mode in which the companion may steer."""
        return RoverMode.AUTO if self.in_auto else RoverMode.GUIDED

    @property
    def is_ours(self) -> bool:
        """Whether the companion may steer, by the mode: in GUIDED; or, if it serves AUTO, there while a leg is handed over."""
        if self.heartbeat is None or self.heartbeat.mode != self.own_mode:
            return False
        return not self.in_auto or (self.leg is not None and self.leg.state is LegState.LIVE)

    def pose_at(self, time_s: float) -> Pose | None:
        """Position and heading carried forward to a moment with the last known velocities; None if not known yet."""
        if self.position is None or self.attitude is None:
            return None
        ahead_s = min(max(time_s - self.position.time_s, 0.0), 0.5)
        turn_s = min(max(time_s - self.attitude.time_s, 0.0), 0.5)
        return Pose(
            self.position.north_m + self.position.north_m_s * ahead_s,
            self.position.east_m + self.position.east_m_s * ahead_s,
            self.attitude.heading_rad + self.attitude.yaw_rate_rad_s * turn_s,
            time_s,
        )

    @property
    def speed_m_s(self) -> float:
        """Ground speed; 0 until a position is known."""
        return 0.0 if self.position is None else math.hypot(self.position.north_m_s, self.position.east_m_s)

    @property
    def latency_s(self) -> float:
        """From something seen to a command that arrives, as far as the link is to blame; measured, 0 until then."""
        return self.latency.longest_s

    @property
    def ekf_lacks(self) -> str:
        """What the autopilot does not trust of its own estimate, in a word; empty when the rover may be driven by it."""
        flags = 0 if self.ekf is None else self.ekf.flags
        if not flags & EKF_POSITION or flags & EKF_CONST_POSITION:
            return "position"
        if not flags & EKF_ATTITUDE:
            return "attitude"
        return "" if flags & EKF_VELOCITY else "velocity"

    @property
    def ekf_ok(self) -> bool:
        """Whether the autopilot trusts its own estimate."""
        return not self.ekf_lacks


def fold(state: VehicleState, event: Event) -> VehicleState:
    """The state after one more event."""
    match event:
        case HeartbeatSeen():
            return _with_heartbeat(state, event)
        case LocalPositionSeen():
            return _with_position(state, event)
        case AttitudeSeen():
            return replace(state, attitude=event)
        case GlobalPositionSeen():
            return replace(state, global_position=event)
        case EkfStatusSeen():
            return replace(state, ekf=event)
        case RangeSeen():
            return replace(state, scan=event, scan_ahead=event if event.scan.looks_ahead else state.scan_ahead)
        case TargetSeen():
            return replace(state, target=event)
        case SticksSeen():
            return replace(state, sticks=followed(state.sticks, event))
        case TimeAnswered():
            return replace(state, latency=answered(state.latency, event))
        case _:
            return _fold_seldom(state, event)


def _fold_seldom(state: VehicleState, event: Event) -> VehicleState:
    """What comes once, or by the way."""
    match event:
        case OriginSeen():
            return replace(state, origin=event)
        case HomeSeen():
            return replace(state, home=event)
        case OtherSeen():
            return replace(state, others=_with_other(state.others, event))
        case LegSeen() | ItemReachedSeen() | ItemCurrentSeen():
            return replace(state, leg=leg_after(state.leg, event))
        case PrearmSeen():
            return replace(state, prearm=event)
        case ParameterSeen():
            return _with_parameter(state, event)
        case _:
            return state


def _with_parameter(state: VehicleState, event: ParameterSeen) -> VehicleState:
    if event.name not in PARAMETERS_KEPT or state.parameters.get(event.name) == event.value:
        return state
    return replace(state, parameters={**state.parameters, event.name: event.value})


def _with_other(others: dict[str, OtherSeen], event: OtherSeen) -> dict[str, OtherSeen]:
    """The newest of everybody; who has been silent for long is forgotten, and of too many those heard longest ago."""
    kept = [one for one in others.values() if one.name != event.name and event.time_s - one.time_s < OTHERS_FORGOTTEN_S]
    return {one.name: one for one in [*kept[-(OTHERS_KEPT - 1) :], event]}


def _with_heartbeat(state: VehicleState, event: HeartbeatSeen) -> VehicleState:
    """Mode and arming; whoever sets our mode anew has looked after position and clock, and has the sticks as he wants them."""
    leg = leg_at_heartbeat(state.leg, event.time_s, in_auto=event.armed and event.mode == RoverMode.AUTO)
    before, state = state.heartbeat, replace(state, heartbeat=event, leg=leg)
    if before is None:
        return state
    if before.mode != state.own_mode == event.mode:
        return replace(state, frozen=False, restarted=False, sticks=Sticks())
    return replace(state, sticks=Sticks()) if event.armed and not before.armed else state


def _with_position(state: VehicleState, now: LocalPositionSeen) -> VehicleState:
    """The position, compared with where the velocity has led, and its time with our clock."""
    before = state.position
    if before is not None and now.boot_s < before.boot_s - BACK_S:
        off_m = jump_m(before, now, clock_jumped=True)
        return replace(state, position=now, jump_m=off_m, restarted=True, latency=Latency(), reckoned=None)
    latency = reported(state.latency, now.time_s, now.boot_s)
    clock_jumped = latency.jumped_s == now.time_s
    so_far, frozen = reckoned(None if clock_jumped else state.reckoned, before, now)
    off_m = jump_m(before, now, clock_jumped=clock_jumped)
    frozen = state.frozen or frozen
    wander = wandered(state.wander, before, now)
    return replace(state, position=now, jump_m=off_m, reckoned=so_far, frozen=frozen, latency=latency, wander=wander)
