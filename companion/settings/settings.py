"""Settings of the companion: groups, defaults, bounds and descriptions (see docs/settings.md).

Nouns: settings.
"""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import AfterValidator, AliasChoices, Field, NonNegativeFloat, model_validator

from companion.core.own_parts import OwnKind, looks_own, registered
from companion.settings.planners import PlannerSettings
from companion.settings.section import Section
from companion.storage.validation import alike

ControlPoints = Annotated[tuple[Annotated[int, Field(ge=3, le=64)], ...], Field(strict=False)]


class SearchSettings(Section):
    """A search by the navigator: numbers of control points, tried in turn, and epochs for each."""

    min_epochs: int = Field(1, ge=1, description="minimum, even after a path was found")
    max_epochs: int = Field(100, ge=1, description="maximum, then the next number of control points")
    control_points: ControlPoints = Field((4,), min_length=1, description="tried in turn")
    population: int = Field(30, ge=12, le=3000, description="chromosomes")


class QuickSearch(SearchSettings):
    """Parts A and B: a quick look."""

    min_epochs: int = Field(5, ge=1, description="minimum, even after a path was found")
    max_epochs: int = Field(50, ge=1, description="maximum, then the next number of control points")


class ThoroughSearch(SearchSettings):
    """Part C: for quality, with more control points for harder problems."""

    min_epochs: int = Field(10, ge=1, description="minimum, even after a path was found")
    max_epochs: int = Field(40, ge=1, description="maximum, then the next number of control points")
    control_points: ControlPoints = Field((4, 6, 8), min_length=1, description="tried in turn")
    population: int = Field(40, ge=12, le=3000, description="chromosomes")


class NavigatorSettings(Section):
    """The obstacle avoidance of section 4."""

    planner: str = Field("hybrid", description="a name of `rover-companion plan --planner`")
    better_every_fields: int = Field(5, ge=1, description="part B: fields between searches for a better path")
    doubts: int = Field(3, ge=0, description="how often per target weak evidence is dropped when no path is left")
    wait_retry_s: float = Field(5.0, gt=0.0, description="on_blocked = wait: time between attempts")
    wait_limit_s: float = Field(600.0, ge=0.0, description="on_blocked = wait: then the target is given up")
    quick: QuickSearch = QuickSearch()
    thorough: ThoroughSearch = ThoroughSearch()


class MappingSettings(Section):
    """From range data to field weights."""

    evidence_m: float = Field(
        0.125,
        ge=0.05,
        le=2.0,
        description="wanted side of an evidence cell: a field's side is a whole number of them, so it is less where "
        "fields are small. Planned motions are bolder in gaps with smaller ones",
    )
    keeps: Literal["circle", "outline"] = Field(
        "circle",
        description="the rover's middle keeps from obstacles the radius of the circle round it, or what its outline "
        "needs where it points along its way (for controllers that plan motions)",
    )
    beside_m: float = Field(0.03, ge=0.0, description="room beside that outline")
    hit: float = Field(0.9, gt=0.0, description="log-odds added at the end of a beam")
    miss: float = Field(0.3, gt=0.0, description="log-odds removed along a beam")
    occupied_at: float = Field(0.6, gt=0.0, description="log-odds from which evidence counts as an obstacle")
    sure_at: float = Field(
        2.0, gt=0.0, description="weaker evidence is dropped and looked at again before a target is given up"
    )
    limit: float = Field(
        3.0, gt=0.0, description="maximum evidence for an obstacle, so that one that disappears is forgotten"
    )
    free_limit: float = Field(
        1.2, gt=0.0, description="maximum evidence for free ground, so that an obstacle that appears is seen"
    )
    hit_depth_m: float = Field(
        0.05,
        ge=0.0,
        description="obstacles are marked this far behind a surface, so that noise does not fill the free side",
    )
    narrow_kept_m: float = Field(
        0.3,
        ge=0.0,
        description="a single thin beam does not free the ground this close to its end: it sees a wall once or twice, "
        "and as the position drifts, later passes would erase the wall",
    )
    confirm_m: float = Field(
        0.15,
        ge=0.0,
        le=0.5,
        description="a reading on ground that was seen free counts as much as elsewhere if another of the last second "
        "ended this near, and no obstacle is as near: of an edge a noisy sensor's readings end in different cells. "
        "0: never",
    )
    soft_cost: float = Field(0.4, ge=0.0, lt=0.5, description="weight added beside obstacles")
    soft_reach_m: float = Field(2.0, ge=0.0, description="how far from an obstacle the soft cost reaches")
    max_yaw_rate_deg_s: float = Field(120.0, gt=0.0, description="scans taken while turning faster are dropped")
    range_age_s: float | None = Field(
        None,
        ge=0.0,
        le=1.0,
        description="so much older than positions are ranges over MAVLink when they come; without it that is found "
        "while the rover turns, from 0.05 s on. Of a lidar that the companion reads itself it is known",
    )


CONTROLLERS = ("points", "motion-ga", "dwa", "mppi")


def _known_controller(name: str) -> str:
    if name in CONTROLLERS or looks_own(OwnKind.CONTROLLER, name):
        return name
    known = (*CONTROLLERS, *registered(OwnKind.CONTROLLER))
    near = alike(name, known)
    hint = f", did you mean {near!r}?" if near else ";"
    raise ValueError(f"unknown controller {name!r:.80}{hint} known: {', '.join(known)}")


ControllerKind = Annotated[str, AfterValidator(_known_controller)]
"""One of ``CONTROLLERS``, or one's own."""


class GuidanceSettings(Section):
    """From the path to a guided target and a speed."""

    horizon_m: float = Field(8.0, gt=0.0, description="maximum distance of a guided target along the reference path")
    clearance_m: float = Field(
        0.15, ge=0.0, description="room beside the rover's radius that the choice of speed keeps"
    )
    clearances: tuple[Annotated[tuple[NonNegativeFloat, NonNegativeFloat], Field(strict=False)], ...] = Field(
        ((0.6, 3.0), (0.4, 1.5), (0.2, 0.5), (0.12, 0.3), (0.06, 0.1)),
        min_length=1,
        description="room beside the rover's radius, tried in turn; the next one if the reach is less than the second "
        "figure, metres",
        strict=False,
    )
    least_reach_m: float = Field(0.4, gt=0.0, description="with less clear way than this the way counts as blocked")
    look_ahead_m: float = Field(1.0, gt=0.0, description="distance of the place to turn to when the way is unseen")
    turn_first_deg: float = Field(
        60.0, gt=0.0, le=180.0, description="turn on the spot first if the target is farther aside"
    )
    turn_until_deg: float = Field(40.0, gt=0.0, le=180.0, description="... until it is less than this aside")
    turn_first_close_deg: float = Field(45.0, gt=0.0, le=180.0, description="turn_first_deg near obstacles")
    turn_until_close_deg: float = Field(15.0, gt=0.0, le=180.0, description="turn_until_deg near obstacles")
    roll_out_m_s: float = Field(
        0.3, ge=0.0, description="above this speed the rover brakes straight before it turns on the spot"
    )
    swing_m_s2: float = Field(
        1.0, gt=0.0, description="a rover whose speed times turn rate is more than this gets no position"
    )
    reach_after_look_m: float = Field(
        2.5, gt=0.0, description="after a turn to look, drive off with this much clear way"
    )
    turned_deg: float = Field(
        6.0, gt=0.0, description="a turn is complete when the place is this near to straight ahead"
    )
    turn_cost: float = Field(0.45, ge=0.0, description="weight added to fields behind the rover in plans")
    turn_reach_m: float = Field(6.0, ge=0.0, description="how far behind the rover that reaches")
    slow_within_m: float = Field(0.6, gt=0.0, description="obstacles nearer than this beside the rover slow it down")
    deceleration_m_s2: float = Field(0.8, gt=0.0, description="the rover's braking deceleration")
    brake_delay_s: float = Field(0.25, ge=0.0, description="time from the stop command to braking")
    brake_on_m: float = Field(
        0.7, ge=0.0, description="braking ends when the way is clear this far beyond the braking distance"
    )
    latency_s: float = Field(0.4, ge=0.0, description="time from observation to braking")
    velocity_lasts_s: float = Field(
        3.0,
        gt=0.0,
        le=30.0,
        description="the autopilot stops the rover this long after the last velocity, if it does not tell GUID_TIMEOUT",
    )
    overshoot_m: float = Field(
        0.35, ge=0.0, description="how far beyond a guided position the rover may stop (ArduRover: 0.30 m)"
    )
    held_overshoot_s: float = Field(
        2.0,
        ge=0.0,
        description="so much farther for each m/s by which the ground holds the rover back",
    )
    resend_s: float = Field(1.0, gt=0.0, description="a target is repeated at least this often")
    change_after_s: float = Field(0.1, ge=0.0, description="minimum time between targets that differ")
    narrow_clearance_m: float = Field(
        0.4, ge=0.0, description="clearance with single thin beams; with less the rover creeps a little at a time"
    )
    narrow_margin_m: float = Field(
        0.05,
        ge=0.0,
        description="added to the rover's radius with single thin beams: they see points of a wall, "
        "and the position drifts between readings",
    )
    narrow_horizon_m: float = Field(
        1.5,
        ge=1.0,
        description="`horizon_m` with single thin beams: a wall that they have missed may stand on a longer way",
    )
    narrow_speed_m_s: float = Field(
        1.0, gt=0.0, description="maximum speed with single thin beams, which leave gaps unseen"
    )
    min_speed_m_s: float = Field(0.5, gt=0.0, description="minimum commanded speed")
    max_speed_m_s: float = Field(20.0, gt=0.0, description="maximum commanded speed, whatever the mission says")
    stuck_after_s: float = Field(6.0, gt=0.0, description="without progress for this long: back out and plan again")
    back_out_m: float = Field(0.8, ge=0.0, description="distance to back out")
    back_out_speed_m_s: float = Field(0.4, gt=0.0, description="speed of backing out")
    arrival_m: float = Field(0.5, gt=0.0, description="a target is reached within this distance")
    controller: ControllerKind = Field(
        "points",
        description="what leads the rover along its path: `points` sends positions (arcs where it cannot turn on the "
        "spot); `motion-ga`, `dwa`, `mppi` and [your own](planners.md#a-controller-of-your-own) plan motions and send "
        "velocities, but not with single thin beams or a turning radius",
    )

    @model_validator(mode="after")
    def _slowest_below_fastest(self) -> Self:
        if self.min_speed_m_s > self.max_speed_m_s:
            raise ValueError(
                f"min_speed_m_s {self.min_speed_m_s:g} lies above max_speed_m_s {self.max_speed_m_s:g}; "
                "lower the one or raise the other"
            )
        return self


class MotionSettings(Section):
    """How the autopilot and the rover follow a speed and a turn rate, for controllers that plan motions."""

    dead_s: float = Field(0.3, ge=0.0, le=2.0, description="time until a new speed or turn rate begins to show")
    acceleration_m_s2: float | None = Field(
        None, gt=0.0, le=20.0, description="fastest gain of speed; unset: read from the autopilot, ATC_ACCEL_MAX"
    )
    deceleration_m_s2: float | None = Field(
        None, gt=0.0, le=20.0, description="fastest loss of speed; unset: ATC_DECEL_MAX, or ATC_ACCEL_MAX if that is 0"
    )
    turn_acceleration_rad_s2: float | None = Field(
        None, gt=0.0, le=50.0, description="fastest change of the turn rate; unset: ATC_STR_ACC_MAX"
    )
    turn_gain: float = Field(1.0, gt=0.0, le=3.0, description="the turn rate that shows, as a multiple of that told")
    learns: bool = Field(True, description="whether all of these are estimated from what the rover does")
    off_model: float = Field(0.3, ge=0.0, le=0.9, description="the rover may differ from these by so large a share ...")
    off_model_known: float = Field(0.1, ge=0.0, le=0.9, description="... and by this one, if less, once they are known")
    turn_rad_s: float = Field(1.5, gt=0.0, le=10.0, description="the fastest turn that is told")
    backwards_m_s: float = Field(0.5, ge=0.0, le=10.0, description="the fastest speed backwards that is told")


class SteeringSettings(Section):
    """Guidance of rovers that cannot turn on the spot (`rover.turning_radius_m` of the mission)."""

    planned_radius: float = Field(
        1.15,
        ge=1.0,
        le=3.0,
        description="paths are planned with this multiple of the turning radius, to leave room for corrections",
    )
    steer_time_s: float = Field(0.6, ge=0.0, description="time from straight ahead to full lock")
    scale_base_m_s: float = Field(
        1.0,
        gt=0.0,
        description="ArduRover's MOT_SPD_SCA_BASE: at lower speeds it drives only a part of the commanded turn rate",
    )
    lateral_m_s2: float = Field(1.0, gt=0.0, description="maximum lateral acceleration in bends")
    ahead_m: float = Field(0.9, gt=0.0, description="look-ahead distance ...")
    ahead_s: float = Field(0.5, ge=0.0, description="... and its increase for each m/s")
    astray_m: float = Field(0.8, gt=0.0, description="at this distance from its path the rover has lost it")
    clearance_m: float = Field(0.15, ge=0.0, description="room beside the rover's radius")
    clearances_m: tuple[float, ...] = Field(
        (0.4, 0.25, 0.12),
        min_length=1,
        description="the same for the search of a manoeuvre, tried in turn",
        strict=False,
    )
    narrow_clearance_m: float = Field(0.3, ge=0.0, description="both with single thin beams, which leave gaps unseen")
    drives_on_m: float = Field(
        2.5, gt=0.0, description="the rover searches a manoeuvre if it can drive less than this of its path in arcs"
    )
    manoeuvre_every_s: float = Field(0.5, ge=0.0, description="... and at most this often")
    join_within_m: float = Field(0.5, gt=0.0, description="a manoeuvre ends within this distance of the reference path")
    end_within_m: float = Field(0.3, gt=0.0, description="... and within this distance of the path's end")
    switch_cost_m: float = Field(1.5, ge=0.0, description="cost of a change of direction, in metres")
    turned_cost_radii: float = Field(2.5, ge=0.0, description="cost of ending a manoeuvre tail first, in turning radii")
    most_poses: int = Field(6000, ge=100, le=1_000_000, description="poses that one search for a manoeuvre expands")
    stopped_m_s: float = Field(0.15, gt=0.0, description="below this speed the rover may change direction")


class SafetySettings(Section):
    """Watchdogs of position, link and planner."""

    stale_s: float = Field(1.0, gt=0.0, description="position, EKF or range data older than this: stop")
    hold_after_s: float = Field(2.0, ge=0.0, description="time from stop to HOLD if the fault lasts")
    heartbeat_s: float = Field(3.0, gt=0.0, description="autopilot silent for this long: stop")
    jump_m: float = Field(2.0, gt=0.0, description="position jumps larger than this count")
    latency_s: float = Field(1.0, gt=0.0, description="round trip to the autopilot longer than this: stop")
    planner_s: float = Field(30.0, gt=0.0, description="a step of the navigator that takes this long: stop")
    settle_s: float = Field(0.5, ge=0.0, description="how long the rover stands after a jump of the autopilot's clock")
    gps_fix: Literal["any", "3d", "dgps", "rtk-float", "rtk-fixed"] = Field(
        "any", description="the rover stands while the GPS fix is worse than this; `any`: it is not looked at"
    )
    gps_lost_s: float = Field(
        1.0,
        ge=0.3,
        description="... so long after the last fix that was good enough (single worse ones do not stop it)",
    )
    gps_settle_s: float = Field(
        3.0, ge=0.0, description="... and until it has been good enough for so long without a break"
    )
    requested_goal_m: float = Field(
        300.0,
        gt=0.0,
        validation_alias=AliasChoices("requested_goal_m", "errand_reach_m"),  # the key of older files and records
        description="a requested goal farther away than this is refused",
    )


class FenceSettings(Section):
    """The autopilot's own fence and rally points; the mission's fences always count."""

    heed: Literal["enabled", "stored", "never"] = Field(
        "enabled",
        description="`enabled`: while the autopilot enforces it; `stored`: also while FENCE_ENABLE is 0; "
        "`never`: not even requested",
    )
    again_s: float = Field(
        15.0, ge=1.0, description="how often fence, rally points and fence parameters are read again"
    )


class PowerSettings(Section):
    """When the battery ends the mission. 0 switches a threshold off."""

    return_percent: float = Field(20.0, ge=0.0, lt=100.0, description="charge below this: return")
    return_volts: float = Field(0.0, ge=0.0, description="voltage below this: return")
    hold_percent: float = Field(10.0, ge=0.0, lt=100.0, description="charge below this: stop and HOLD")
    hold_volts: float = Field(0.0, ge=0.0, description="voltage below this: stop and HOLD")
    after_s: float = Field(
        5.0, ge=0.0, description="time below a threshold without a break: the voltage sags when the rover sets off"
    )
    heed_autopilot: bool = Field(
        True,
        description="the autopilot's own battery failsafe counts too: low means return, critical HOLD "
        "(BATT_LOW_..., BATT_CRT_...)",
    )
    to_rally: bool = Field(True, description="return to a rally point if the way there is shorter than the way back")

    @model_validator(mode="after")
    def _return_before_hold(self) -> Self:
        for unit in ("percent", "volts"):
            hold, back = getattr(self, f"hold_{unit}"), getattr(self, f"return_{unit}")
            if hold > back > 0.0:
                raise ValueError(
                    f"hold_{unit} {hold:g} lies above return_{unit} {back:g}, so that it would never return; "
                    "lower the one or raise the other"
                )
        return self


class TrafficSettings(Section):
    """Moving obstacles: other vehicles that announce themselves, and what the range sensors see moving."""

    horizon_s: float = Field(
        20.0, gt=0.0, le=120.0, description="how far ahead planners know the track of a moving obstacle"
    )
    stale_s: float = Field(5.0, gt=0.0, description="an announced position older than this does not count")
    radius_m: float = Field(1.0, gt=0.0, description="radius of vehicles that do not announce their size")
    level_m: float = Field(10.0, gt=0.0, description="a difference in height above which a vehicle is ignored")
    reach_m: float = Field(40.0, gt=0.0, description="obstacles that stay farther away are ignored")
    moving_m_s: float = Field(0.3, gt=0.0, description="below this speed an obstacle counts as standing")
    changed_m_s: float = Field(
        0.5, gt=0.0, description="a planner that knows moving obstacles plans again when a velocity changes by more"
    )
    replan_s: float = Field(2.0, ge=0.0, description="... but not sooner than this after the last time")
    look_s: float = Field(8.0, gt=0.0, le=60.0, description="how far ahead the rover checks for crossing obstacles")
    margin_m: float = Field(0.4, ge=0.0, description="room between the rover and a moving obstacle")
    drift_m_s: float = Field(0.08, ge=0.0, description="growth of that room for each second ahead")
    patience_s: float = Field(
        30.0, gt=0.0, description="after yielding this long without progress the rover counts as stuck"
    )


class LinkSettings(Section):
    """The link to the autopilot."""

    setpoint: Literal["local", "global", "mission-item", "reposition"] = Field(
        "local", description="SET_POSITION_TARGET_LOCAL_NED | _GLOBAL_INT | MISSION_ITEM_INT current=2 | DO_REPOSITION"
    )
    position_rate_hz: float = Field(10.0, gt=0.0, le=50.0, description="requested: LOCAL_POSITION_NED")
    attitude_rate_hz: float = Field(20.0, gt=0.0, le=50.0, description="requested: ATTITUDE")
    range_rate_hz: float = Field(
        10.0, gt=0.0, le=50.0, description="requested: DISTANCE_SENSOR and RANGEFINDER, if there are any"
    )
    points_above_m: float = Field(
        1.0, gt=0.0, le=10.0, description="OBSTACLE_DISTANCE_3D: points higher above the rover's origin say nothing"
    )
    points_below_m: float = Field(
        0.1,
        ge=-10.0,
        le=10.0,
        description="the same for points lower than this below it: the ground; negative: a height above it",
    )
    figures_hz: float = Field(
        1.0,
        ge=0.0,
        le=10.0,
        description="rate of the figures for ground stations (NAMED_VALUE_FLOAT); 0: never",
    )
    tick_hz: float = Field(20.0, ge=5.0, le=100.0, description="rate of the companion's loop")
    component_id: int = Field(
        191,
        ge=2,
        le=255,
        description="the companion's component id, not the autopilot's 1; its system id is the vehicle's",
    )


class Settings(Section):
    """All settings. ``profile = "paper"`` uses the genetic algorithm alone, as the paper does."""

    profile: Literal["default", "paper"] = Field(
        "default", description="`paper`: the genetic algorithm alone, without graph search behind it"
    )
    planner: PlannerSettings = PlannerSettings()
    navigator: NavigatorSettings = NavigatorSettings()
    mapping: MappingSettings = MappingSettings()
    guidance: GuidanceSettings = GuidanceSettings()
    steering: SteeringSettings = SteeringSettings()
    motion: MotionSettings = MotionSettings()
    safety: SafetySettings = SafetySettings()
    fence: FenceSettings = FenceSettings()
    power: PowerSettings = PowerSettings()
    traffic: TrafficSettings = TrafficSettings()
    link: LinkSettings = LinkSettings()
