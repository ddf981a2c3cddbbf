"""Every setting of the companion, with its default, unit and meaning."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from companion.settings.planners import PlannerSettings
from companion.settings.section import Section

ControlPoints = tuple[Annotated[int, Field(ge=3, le=64)], ...]


class SearchSettings(Section):
    """One kind of search by the navigator: numbers of control points tried one after the other, epochs for each."""

    min_epochs: int = Field(1, ge=1, description="evolved at least, even when a path was found")
    max_epochs: int = Field(100, ge=1, description="then the next number of control points")
    control_points: ControlPoints = Field((4,), min_length=1, description="tried one after the other")
    population: int = Field(30, ge=12, le=3000, description="chromosomes")


class QuickSearch(SearchSettings):
    """Parts A and B: a quick look."""

    min_epochs: int = Field(5, ge=1, description="evolved at least, even when a path was found")
    max_epochs: int = Field(50, ge=1, description="then the next number of control points")


class ThoroughSearch(SearchSettings):
    """Part C: for quality, with more control points as it gets harder."""

    min_epochs: int = Field(10, ge=1, description="evolved at least, even when a path was found")
    max_epochs: int = Field(40, ge=1, description="then the next number of control points")
    control_points: ControlPoints = Field((4, 6, 8), min_length=1, description="tried one after the other")
    population: int = Field(40, ge=12, le=3000, description="chromosomes")


class NavigatorSettings(Section):
    """The obstacle avoidance of section 4."""

    planner: str = Field("hybrid", description="a name of `rover-companion plan --planner`")
    better_every_fields: int = Field(5, ge=1, description="part B: fields between looks for a better path")
    doubts: int = Field(3, ge=0, description="how often per target weak evidence is forgotten when no path is left")
    wait_retry_s: float = Field(5.0, gt=0.0, description="on_blocked = wait: time between tries")
    wait_limit_s: float = Field(600.0, ge=0.0, description="on_blocked = wait: then the target is given up")
    quick: QuickSearch = QuickSearch()
    thorough: ThoroughSearch = ThoroughSearch()


class MappingSettings(Section):
    """From ranges to field weights."""

    evidence_m: float = Field(
        0.125, gt=0.0, description="side of an evidence cell; a whole number of them fills a field"
    )
    hit: float = Field(0.9, gt=0.0, description="log-odds added where a beam ended")
    miss: float = Field(0.3, gt=0.0, description="log-odds removed where a beam passed")
    occupied_at: float = Field(0.6, gt=0.0, description="log-odds from which evidence counts as an obstacle")
    sure_at: float = Field(
        2.0, gt=0.0, description="weaker evidence is doubted, and looked at again, before a target is given up"
    )
    limit: float = Field(
        3.0, gt=0.0, description="evidence for an obstacle grows no further: what disappears is forgotten"
    )
    free_limit: float = Field(
        1.2, gt=0.0, description="evidence for free ground grows no further: what appears is seen"
    )
    hit_depth_m: float = Field(
        0.05, ge=0.0, description="a surface is entered this deep, so that noise does not fill the free side"
    )
    narrow_kept_m: float = Field(
        0.3,
        ge=0.0,
        description="a single thin beam does not free the last piece before what it hit: it looks at a wall once or twice, and as the "
        "position wanders, later passes would rub the wall out",
    )
    soft_cost: float = Field(0.4, ge=0.0, lt=0.5, description="weight added beside obstacles")
    soft_reach_m: float = Field(2.0, ge=0.0, description="how far from an obstacle the soft cost reaches")
    max_yaw_rate_deg_s: float = Field(120.0, gt=0.0, description="scans taken while turning faster are not used")


class GuidanceSettings(Section):
    """From the path to one guided target and a speed."""

    horizon_m: float = Field(8.0, gt=0.0, description="a target is never farther than this along the route")
    clearance_m: float = Field(0.15, ge=0.0, description="kept beside the rover's radius when speed is chosen")
    clearances: tuple[tuple[float, float], ...] = Field(
        ((0.6, 3.0), (0.4, 1.5), (0.2, 0.5), (0.12, 0.3)),
        description="room kept beside the rover's radius, tried in turn; the next one when the reach is less than the second figure, metres",
    )
    least_reach_m: float = Field(0.4, gt=0.0, description="less clear way than this is no way")
    look_ahead_m: float = Field(1.0, gt=0.0, description="the place to turn to when the way has not been seen")
    turn_first_deg: float = Field(
        60.0, gt=0.0, le=180.0, description="turn on the spot first when the target is farther aside"
    )
    turn_until_deg: float = Field(40.0, gt=0.0, le=180.0, description="... until it is less than this aside")
    turn_first_close_deg: float = Field(
        45.0, gt=0.0, le=180.0, description="turn_first_deg with something close beside"
    )
    turn_until_close_deg: float = Field(
        15.0, gt=0.0, le=180.0, description="turn_until_deg with something close beside"
    )
    roll_out_m_s: float = Field(
        0.3, ge=0.0, description="faster than this the rover first brakes straight, then turns on the spot"
    )
    reach_after_look_m: float = Field(2.5, gt=0.0, description="having turned to look, drive off when so much is clear")
    turned_deg: float = Field(6.0, gt=0.0, description="turned to a place when it is this near to straight ahead")
    turn_cost: float = Field(0.45, ge=0.0, description="weight added to fields behind the rover when it plans")
    turn_reach_m: float = Field(6.0, ge=0.0, description="how far behind")
    slow_within_m: float = Field(0.6, gt=0.0, description="obstacles nearer than this beside the rover slow it down")
    deceleration_m_s2: float = Field(0.8, gt=0.0, description="what the rover brakes with")
    brake_delay_s: float = Field(0.25, ge=0.0, description="from the stop command to braking")
    brake_on_m: float = Field(
        0.7, ge=0.0, description="braking goes on until the way is clear so far beyond the braking distance"
    )
    latency_s: float = Field(0.4, ge=0.0, description="from seeing to braking")
    velocity_lasts_s: float = Field(
        3.0,
        gt=0.0,
        description="the autopilot stops a rover so long after the last velocity it was told (ArduRover: 3 s)",
    )
    overshoot_m: float = Field(
        0.25, ge=0.0, description="so far beyond a guided position the rover may come to stand (ArduRover: 0.23 m)"
    )
    resend_s: float = Field(1.0, gt=0.0, description="a target is repeated at least this often")
    change_after_s: float = Field(
        0.1, ge=0.0, description="a target that moved is sent not sooner than this after the last"
    )
    narrow_clearance_m: float = Field(
        0.3, ge=0.0, description="clearances smaller than this are not used with single thin beams"
    )
    narrow_margin_m: float = Field(
        0.05,
        ge=0.0,
        description="with single thin beams the rover is taken for so much wider: of a wall they see points, and the position wanders "
        "between one look and the next",
    )
    narrow_speed_m_s: float = Field(
        1.5, gt=0.0, description="never faster than this with single thin beams, between which much stays unseen"
    )
    min_speed_m_s: float = Field(0.5, gt=0.0, description="never asked to go slower than this")
    max_speed_m_s: float = Field(
        20.0, gt=0.0, description="never asked to go faster than this, whatever the mission says"
    )
    stuck_after_s: float = Field(6.0, gt=0.0, description="no progress for so long: back out and plan anew")
    back_out_m: float = Field(0.8, ge=0.0, description="how far to back out")
    back_out_speed_m_s: float = Field(0.4, gt=0.0, description="how fast to back out")
    arrival_m: float = Field(0.5, gt=0.0, description="a target is reached within this distance")

    @model_validator(mode="after")
    def _slowest_below_fastest(self) -> Self:
        if self.min_speed_m_s > self.max_speed_m_s:
            raise ValueError(
                f"min_speed_m_s {self.min_speed_m_s:g} lies above max_speed_m_s {self.max_speed_m_s:g}; lower the one or raise the other"
            )
        return self


class SteeringSettings(Section):
    """Guidance of rovers that cannot turn on the spot (`rover.turning_radius_m` of the mission)."""

    planned_radius: float = Field(
        1.15,
        ge=1.0,
        le=3.0,
        description="ways are planned with so many times the turning radius, to have some left for corrections",
    )
    steer_time_s: float = Field(0.6, ge=0.0, description="from straight ahead to full lock")
    scale_base_m_s: float = Field(
        1.0,
        gt=0.0,
        description="ArduRover's MOT_SPD_SCA_BASE: slower than this it drives only a part of the turn rate it is told",
    )
    lateral_m_s2: float = Field(1.0, gt=0.0, description="bends are driven so slowly that they take no more than this")
    ahead_m: float = Field(0.9, gt=0.0, description="the place on the way that is steered for lies so far ahead ...")
    ahead_s: float = Field(0.5, ge=0.0, description="... and so much farther for each m/s")
    astray_m: float = Field(0.8, gt=0.0, description="farther beside its way than this the rover has lost it")
    clearance_m: float = Field(0.15, ge=0.0, description="room kept beside the rover's radius")
    clearances_m: tuple[float, ...] = Field(
        (0.4, 0.25, 0.12), min_length=1, description="the same when a manoeuvre is looked for, tried in turn"
    )
    narrow_clearance_m: float = Field(
        0.3, ge=0.0, description="both with single thin beams, between which much stays unseen"
    )
    drives_on_m: float = Field(
        2.5, gt=0.0, description="with less than this of its route to be driven in arcs the rover looks for a manoeuvre"
    )
    manoeuvre_every_s: float = Field(0.5, ge=0.0, description="... and not sooner again than this")
    join_within_m: float = Field(0.5, gt=0.0, description="a manoeuvre ends so near to the route")
    end_within_m: float = Field(0.3, gt=0.0, description="... and so near to the route's end")
    switch_cost_m: float = Field(1.5, ge=0.0, description="what changing direction costs in metres")
    turned_cost_radii: float = Field(
        2.5, ge=0.0, description="what ending a manoeuvre tail first costs, in turning radii"
    )
    most_poses: int = Field(
        6000, ge=100, le=1_000_000, description="poses from which one search for a manoeuvre goes on"
    )
    stopped_m_s: float = Field(0.15, gt=0.0, description="slower than this the rover may change its direction")


class SafetySettings(Section):
    """Watchdogs."""

    stale_s: float = Field(1.0, gt=0.0, description="position, EKF or range data older than this: stop")
    hold_after_s: float = Field(2.0, ge=0.0, description="from stop to HOLD when nothing gets better")
    heartbeat_s: float = Field(3.0, gt=0.0, description="autopilot silent for so long: stop")
    jump_m: float = Field(2.0, gt=0.0, description="a position jump larger than this is noticed")
    latency_s: float = Field(1.0, gt=0.0, description="from the autopilot and back in more than this: stop")
    planner_s: float = Field(30.0, gt=0.0, description="one step of the navigator in work for so long: stop")
    settle_s: float = Field(0.5, ge=0.0, description="after the autopilot's clock has jumped the rover stands so long")
    errand_reach_m: float = Field(
        300.0, gt=0.0, description="a place asked for on the way that lies farther away than this is refused"
    )


class FenceSettings(Section):
    """The autopilot's own fence and rally points; the mission's fences always count."""

    heed: Literal["enabled", "stored", "never"] = Field(
        "enabled",
        description="`enabled`: while the autopilot enforces it; `stored`: also while FENCE_ENABLE is 0; `never`: not even asked for",
    )
    again_s: float = Field(
        15.0, ge=1.0, description="fence, rally points and the parameters of the fence are read again so often"
    )


class PowerSettings(Section):
    """When the battery ends the mission. 0 switches a threshold off."""

    return_percent: float = Field(20.0, ge=0.0, lt=100.0, description="less charge left than this: return")
    return_volts: float = Field(0.0, ge=0.0, description="a lower voltage than this: return")
    hold_percent: float = Field(10.0, ge=0.0, lt=100.0, description="less charge left than this: stop and HOLD")
    hold_volts: float = Field(0.0, ge=0.0, description="a lower voltage than this: stop and HOLD")
    after_s: float = Field(
        5.0, ge=0.0, description="below a threshold for so long without a break: a voltage sags when the rover sets off"
    )
    heed_autopilot: bool = Field(
        True,
        description="the autopilot's own battery failsafe counts too: low means return, critical HOLD (BATT_LOW_..., BATT_CRT_...)",
    )
    to_rally: bool = Field(True, description="return to a rally point if the way there is shorter than the way back")


class TrafficSettings(Section):
    """Things that move: other vehicles that announce themselves, and what the range sensors see moving."""

    horizon_s: float = Field(
        20.0, gt=0.0, le=120.0, description="so far ahead planners are told where a moving thing goes"
    )
    stale_s: float = Field(5.0, gt=0.0, description="an announced position older than this does not count")
    radius_m: float = Field(1.0, gt=0.0, description="of vehicles that do not tell their size")
    level_m: float = Field(10.0, gt=0.0, description="what is so much higher or lower than the rover is not in its way")
    reach_m: float = Field(40.0, gt=0.0, description="what stays farther away than this does not count")
    moving_m_s: float = Field(0.3, gt=0.0, description="slower than this a thing counts as standing")
    changed_m_s: float = Field(
        0.5, gt=0.0, description="a planner that knows of moving things plans anew when a velocity changes by more"
    )
    replan_s: float = Field(2.0, ge=0.0, description="... but not sooner than this after the last time")
    look_s: float = Field(
        8.0, gt=0.0, le=60.0, description="so far ahead the rover looks whether something comes across"
    )
    margin_m: float = Field(0.4, ge=0.0, description="room kept between the rover and something that moves")
    drift_m_s: float = Field(0.08, ge=0.0, description="that room grows by so much a second of looking ahead")
    patience_s: float = Field(
        30.0, gt=0.0, description="having made way for so long without getting on, the rover counts as stuck"
    )


class LinkSettings(Section):
    """How the companion talks to the autopilot."""

    setpoint: Literal["local", "global", "mission-item", "reposition"] = Field(
        "local", description="SET_POSITION_TARGET_LOCAL_NED | _GLOBAL_INT | MISSION_ITEM_INT current=2 | DO_REPOSITION"
    )
    position_rate_hz: float = Field(10.0, gt=0.0, le=50.0, description="asked for: LOCAL_POSITION_NED")
    attitude_rate_hz: float = Field(20.0, gt=0.0, le=50.0, description="asked for: ATTITUDE")
    range_rate_hz: float = Field(
        10.0, gt=0.0, le=50.0, description="asked for: DISTANCE_SENSOR and RANGEFINDER, where there are any"
    )
    figures_hz: float = Field(
        1.0,
        ge=0.0,
        le=10.0,
        description="how often the figures for ground stations are sent (NAMED_VALUE_FLOAT); 0 never",
    )
    tick_hz: float = Field(20.0, ge=5.0, le=100.0, description="the companion's own loop")
    component_id: int = Field(191, ge=1, le=255, description="the companion's own; its system id is the vehicle's")


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
    safety: SafetySettings = SafetySettings()
    fence: FenceSettings = FenceSettings()
    power: PowerSettings = PowerSettings()
    traffic: TrafficSettings = TrafficSettings()
    link: LinkSettings = LinkSettings()
