"""Rovers that are not what the companion takes them for."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from companion.mission.mission import Mission, RoverSpec
from companion.settings import Settings
from companion.settings.settings_file import parse_settings
from companion.vehicle.motion_limits import TIMEOUT
from companion.vehicle.recommended_parameters import RECOMMENDED_PARAMETERS
from sitl.autopilot.parameters import DEFAULTS
from sitl.experiments.experiment import GUARD, POINTS, TIMEOUT_S
from sitl.plant.rover import SIM_ROVER, Drivetrain
from sitl.scenario import Scenario, scenario_from_mission


class Limits(NamedTuple):
    """Of the autopilot, and what the rover's speed lags behind its motors."""

    acceleration_m_s2: float
    turn_acceleration_rad_s2: float
    turn_rate_rad_s: float
    lag_s: float


SHIPPED = Limits(
    DEFAULTS["ATC_ACCEL_MAX"][0],
    math.radians(DEFAULTS["ATC_STR_ACC_MAX"][0]),
    math.radians(DEFAULTS["ATC_STR_RAT_MAX"][0]),
    SIM_ROVER.speed_lag_s,
)


def taken_for(controller: str, name: str, chosen: Mapping[str, object] | None = None) -> Settings:
    """Settings in which the companion takes the rover for one with the limits as shipped.

    They are set, so that they are not read from the autopilot: else it would know the very limits that were drawn.
    ``name``: of the experiment. ``chosen``: further tables.
    """
    motion = {
        "acceleration_m_s2": SHIPPED.acceleration_m_s2,
        "deceleration_m_s2": SHIPPED.acceleration_m_s2,
        "turn_acceleration_rad_s2": SHIPPED.turn_acceleration_rad_s2,
    }
    return parse_settings({"guidance": {"controller": controller}, "motion": motion, **(chosen or {})}, name)


def parameters_for(
    rover: RoverSpec, controller: str, *, guarded: bool = True, timeout_s: float = TIMEOUT_S
) -> dict[str, float]:
    """Of the autopilot, as recommended. ``guarded``: with the guard where motions are planned."""
    guard = GUARD if guarded and controller != POINTS else {}
    return {"WP_SPEED": rover.cruise_speed_m_s, **RECOMMENDED_PARAMETERS, TIMEOUT: timeout_s, **guard}


def off_model(rng: np.random.Generator, share: float, limits: Limits = SHIPPED) -> tuple[Drivetrain, dict[str, float]]:
    """A rover that is not what the companion's settings say: each figure off by up to this share, drawn evenly.

    Its speed and turn rate at full output, its lag, and the autopilot's limits of acceleration, braking and turning.
    """
    top, lag, turn, gains, brakes, turns = 1.0 + share * rng.uniform(-1.0, 1.0, 6)
    own = SIM_ROVER
    turn_lag_s = min(0.1, limits.lag_s) * lag if share else 0.0
    drivetrain = Drivetrain(own.top_speed_m_s * top, limits.lag_s * lag, own.turn_rate_rad_s * turn, turn_lag_s)
    parameters = {
        "ATC_ACCEL_MAX": limits.acceleration_m_s2 * gains,
        "ATC_DECEL_MAX": limits.acceleration_m_s2 * brakes,
        "ATC_STR_ACC_MAX": math.degrees(limits.turn_acceleration_rad_s2) * turns,
        "ATC_STR_RAT_MAX": math.degrees(limits.turn_rate_rad_s),
    }
    if limits.acceleration_m_s2 > SHIPPED.acceleration_m_s2:
        parameters["MOT_SLEWRATE"] = 0.0  # else the motors take a second to their full output
    return drivetrain, parameters


def scenario_off_model(
    mission: Mission, seed: int, off: float, *, guarded: bool, timeout_s: float = TIMEOUT_S
) -> Scenario:
    """What the mission is driven in: a rover off its model by up to this share, if it turns on the spot.

    ``guarded``: with the guard on the autopilot. That ends a velocity itself after ``timeout_s``.
    """
    scenario = scenario_from_mission(mission)
    if off and mission.rover.turning_radius_m <= 0.0:
        drivetrain, limits = off_model(np.random.default_rng((seed, 54)), off)
        scenario = replace(scenario, drivetrain=drivetrain, parameters={**scenario.parameters, **limits})
    guard = GUARD if guarded else {}
    return replace(scenario, parameters={**scenario.parameters, TIMEOUT: timeout_s, **guard})
