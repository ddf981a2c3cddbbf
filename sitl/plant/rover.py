"""The plant: the rover's motion in the world frame, and its contacts with obstacles (like SIM_Rover).

With skid steering the speed follows the mean of both motors with a first-order lag, and the turn rate their
difference; ``Drivetrain`` says how fast. Ackermann steering is the bicycle model: the same drive, and front wheels with
a limited angle and rate, so the rover turns only while it moves.

On slippery ground both slide: the friction that changes the velocity is limited to grip times gravity. The rover then
accelerates and brakes more slowly, and drifts sideways (skid steering) or understeers (steered wheels).

Nouns: plant, drivetrain, SIM_Rover.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from sitl.plant.outline import Outline, OutlinePose, mover_room_m, room_m
from sitl.world.movers import Fleet
from sitl.world.world import TOP_SPEED_M_S, Surroundings, ground_under


class Drivetrain(NamedTuple):
    """How motor outputs become motion.

    ``top_speed_m_s``: at full output; ``turn_rate_rad_s``: when the outputs of left and right motor differ by 1;
    ``speed_lag_s``, ``turn_lag_s``: time constants with which both follow the outputs.
    """

    top_speed_m_s: float
    speed_lag_s: float
    turn_rate_rad_s: float
    turn_lag_s: float


SIM_ROVER = Drivetrain(TOP_SPEED_M_S, 4.0 / 14.0, math.radians(140.0), 0.0)
"""The firmware's own simulated skid rover, to which its default gains are tuned: it turns at once."""


def two_wheels(top_speed_m_s: float, lag_s: float, track_m: float) -> Drivetrain:
    """Two driven wheels (or tracks) at this distance from each other, whose motors follow with this lag."""
    return Drivetrain(top_speed_m_s, lag_s, top_speed_m_s / track_m, lag_s)


WHEEL_MOST_RAD = math.radians(35.0)
"""Steering angle at full lock, where the rover drives its turning radius; as in the firmware's simulated rover."""
WHEEL_RATE_RAD_S = math.radians(60.0)
"""How fast the steered wheels turn: 0.6 s from straight ahead to full lock."""

GRAVITY_M_S2 = 9.81
TURN_GRIP_RAD_S2 = 20.0
"""Angular acceleration with full grip; used only where there is less."""

RELEASE_M = 0.05
"""A contact ends when the rover is this far from the obstacle."""

ROVER = np.dtype(
    [
        ("north_m", "f8"),
        ("east_m", "f8"),
        ("heading_rad", "f8"),
        ("speed_m_s", "f8"),
        ("accel_m_s2", "f8"),
        ("yaw_rate_rad_s", "f8"),
        ("driven_m", "f8"),
        ("radius_m", "f8"),
        ("front_m", "f8"),
        ("rear_m", "f8"),
        ("half_width_m", "f8"),
        ("touching", "i8"),
        ("contacts", "i8"),
        ("struck", "i8"),
        ("struck_m_s", "f8"),
        ("turning_radius_m", "f8"),
        ("wheel_rad", "f8"),
        ("slide_m_s", "f8"),
        ("grip_1", "f8"),
        ("grip_3", "f8"),
        ("drawn_ah", "f8"),
    ]
    + [(name, "f8") for name in Drivetrain._fields]
)
"""The rover's true state, world frame, heading clockwise from north; ``contacts`` counts collisions so far.

``radius_m`` to ``half_width_m``: its outline.

``struck``: number of the mover that it touches, from 1; ``struck_m_s``: the rover's own speed at the last contact.
``turning_radius_m``: 0 for skid steering; ``wheel_rad``: angle of the steered wheels, clockwise.
``slide_m_s``: sideways speed, to the right; 0 unless the ground is slippery.
``grip_1``, ``grip_3``: share of each servo output that reaches the ground; ``drawn_ah``: drawn from the battery so far.
"""

RoverState = NDArray[Any]


def new_rover(
    north_m: float, east_m: float, heading_rad: float, outline: Outline, turning_radius_m: float = 0.0,
    drivetrain: Drivetrain = SIM_ROVER,
) -> RoverState:  # fmt: skip
    """A rover at rest: an array of one ``ROVER`` record. With a turning radius it has Ackermann steering."""
    state = np.zeros(1, dtype=ROVER)
    state["turning_radius_m"] = turning_radius_m
    state["grip_1"] = state["grip_3"] = 1.0
    state["north_m"], state["east_m"] = north_m, east_m
    state["heading_rad"] = heading_rad
    for name, value in (outline._asdict() | drivetrain._asdict()).items():
        state[name] = value
    return state


@njit(cache=True, nogil=True)
def outline_of(rover: Any) -> Outline:
    """The outline of a ``ROVER`` record."""
    return Outline(rover.radius_m, rover.front_m, rover.rear_m, rover.half_width_m)


@njit(cache=True, nogil=True)
def wheel_curvature_per_m(wheel_rad: float, turning_radius_m: float) -> float:
    """Curvature of the path, clockwise, with the steered wheels at this angle (bicycle model)."""
    return math.tan(wheel_rad) / (turning_radius_m * math.tan(WHEEL_MOST_RAD))


@njit(cache=True, nogil=True)
def turn_wheels(rover: Any, steering: float, step_s: float) -> None:
    """Turn the steered wheels towards a share of full lock, -1 to 1, at their limited rate."""
    change_rad = min(max(steering, -1.0), 1.0) * WHEEL_MOST_RAD - rover.wheel_rad
    most_rad = WHEEL_RATE_RAD_S * step_s
    rover.wheel_rad += min(max(change_rad, -most_rad), most_rad)


@njit(cache=True, nogil=True)
def slide(rover: Any, grip: float, wanted_m_s: float, wanted_rad_s: float, step_s: float) -> tuple[float, float, float]:
    """Forward speed, turn rate and sideways speed after a step on slippery ground.

    The wheels demand a forward speed, no sideways speed, and a turn rate. Friction changes the velocity by at most
    grip times gravity, in any direction, and limits the angular acceleration. With steered wheels friction also
    limits the turn rate (understeer); with skid steering the rover turns all the same and drifts sideways.
    """
    most_m_s = grip * GRAVITY_M_S2 * step_s
    if rover.turning_radius_m > 0.0:
        most_rad_s = grip * GRAVITY_M_S2 / max(abs(rover.speed_m_s), 1e-6)
        wanted_rad_s = min(max(wanted_rad_s, -most_rad_s), most_rad_s)
    change_rad_s = grip * TURN_GRIP_RAD_S2 * step_s
    yaw_rate_rad_s = rover.yaw_rate_rad_s + min(max(wanted_rad_s - rover.yaw_rate_rad_s, -change_rad_s), change_rad_s)
    turned_rad = yaw_rate_rad_s * step_s
    ahead_m_s = rover.speed_m_s * math.cos(turned_rad) + rover.slide_m_s * math.sin(turned_rad)
    aside_m_s = rover.slide_m_s * math.cos(turned_rad) - rover.speed_m_s * math.sin(turned_rad)
    missing_m_s = math.hypot(wanted_m_s - ahead_m_s, aside_m_s)
    if missing_m_s <= most_m_s:
        return wanted_m_s, yaw_rate_rad_s, 0.0
    share = most_m_s / missing_m_s
    return ahead_m_s + share * (wanted_m_s - ahead_m_s), yaw_rate_rad_s, aside_m_s - share * aside_m_s


@njit(cache=True, nogil=True)
def drive(rover: Any, surroundings: Surroundings, servo_1: float, servo_3: float, step_s: float) -> None:
    """Move the rover for ``step_s`` (a few milliseconds) with servo outputs -1 to 1.

    As in the firmware these are left and right motor with skid steering, steering and throttle with Ackermann steering.
    """
    ackermann = rover.turning_radius_m > 0.0
    grip, pace = ground_under(surroundings.ground, surroundings.solid, rover.north_m, rover.east_m)
    goal_m_s = (servo_3 if ackermann else 0.5 * (servo_1 + servo_3)) * rover.top_speed_m_s
    before_m_s, aside_m_s = rover.speed_m_s, 0.0
    speed_m_s = goal_m_s * pace + (before_m_s - goal_m_s * pace) * math.exp(-step_s / rover.speed_lag_s)
    from_rad = rover.heading_rad
    if ackermann:
        turn_wheels(rover, servo_1, step_s)
        curvature_per_m = wheel_curvature_per_m(rover.wheel_rad, rover.turning_radius_m)
        yaw_rate_rad_s = 0.5 * (before_m_s + speed_m_s) * curvature_per_m
    else:
        yaw_rate_rad_s = (servo_1 - servo_3) * rover.turn_rate_rad_s * pace
        if rover.turn_lag_s > 0.0:
            yaw_rate_rad_s += (rover.yaw_rate_rad_s - yaw_rate_rad_s) * math.exp(-step_s / rover.turn_lag_s)
    if grip < 1.0 or rover.slide_m_s != 0.0:
        speed_m_s, yaw_rate_rad_s, aside_m_s = slide(rover, grip, speed_m_s, yaw_rate_rad_s, step_s)
    rover.accel_m_s2 = (speed_m_s - before_m_s) / step_s
    rover.yaw_rate_rad_s = yaw_rate_rad_s
    heading_rad = rover.heading_rad + rover.yaw_rate_rad_s * step_s
    rover.heading_rad = (heading_rad + math.pi) % (2.0 * math.pi) - math.pi
    step_m = 0.5 * (before_m_s + speed_m_s) * step_s
    north_m = rover.north_m + step_m * math.cos(rover.heading_rad)
    east_m = rover.east_m + step_m * math.sin(rover.heading_rad)
    if aside_m_s != 0.0:
        north_m -= aside_m_s * step_s * math.sin(rover.heading_rad)
        east_m += aside_m_s * step_s * math.cos(rover.heading_rad)
    outline = outline_of(rover)
    there_m = room_m(surroundings.solid, outline, OutlinePose(north_m, east_m, rover.heading_rad), RELEASE_M)
    if there_m < 0.0:
        here_m = room_m(surroundings.solid, outline, OutlinePose(rover.north_m, rover.east_m, from_rad), RELEASE_M)
        if there_m <= here_m:
            if rover.touching == 0:
                rover.contacts += 1
                rover.struck_m_s = math.hypot(before_m_s, rover.slide_m_s)
            rover.touching = 1
            rover.speed_m_s = 0.0
            rover.slide_m_s = 0.0
            rover.accel_m_s2 = 0.0
            if ackermann or outline.radius_m == 0.0:
                rover.heading_rad = from_rad
                rover.yaw_rate_rad_s = 0.0
            return
    elif there_m >= RELEASE_M:
        rover.touching = 0
    rover.speed_m_s = speed_m_s
    rover.slide_m_s = aside_m_s
    rover.driven_m += abs(step_m)
    rover.north_m = north_m
    rover.east_m = east_m


@njit(cache=True, nogil=True)
def meet_movers(rover: Any, fleet: Fleet, time_s: float) -> None:
    """Note a contact with a mover: it counts once and stops the rover; the mover drives on."""
    pose = OutlinePose(rover.north_m, rover.east_m, rover.heading_rad)
    gap_m, mover = mover_room_m(fleet, outline_of(rover), pose, time_s)
    if gap_m >= RELEASE_M:
        rover.struck = 0
    elif gap_m < 0.0 and rover.struck != mover + 1:
        rover.contacts += 1
        rover.struck = mover + 1
        rover.struck_m_s = rover.speed_m_s
        rover.speed_m_s = 0.0
        rover.slide_m_s = 0.0
        rover.accel_m_s2 = 0.0
