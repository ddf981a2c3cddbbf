"""Following: how the autopilot and the rover follow a speed and a turn rate that they are told.

Nouns: following.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

from companion.core.changed import changed
from companion.core.rover_limits import RoverLimits
from companion.settings import MotionSettings
from companion.vehicle.motion_limits import ACCELERATION, CRUISE, DECELERATION, FASTEST, TURN_ACCELERATION, TURN_RATE

MOST_M_S2 = 10.0
"""Where the autopilot has no limit, or a larger one, the motors have."""
BELIEVED_M_S2, BELIEVED_RAD_S2 = 2.0, 4.0
"""No rover is taken to brake, gather speed or change its turn rate better than this because its autopilot would let
it."""
GUARDED_S = 1.0
"""A velocity that lasts no longer is ended by a guard, or by a short timeout of the autopilot."""
SOON_S = 0.5
"""Of one that lasts no longer it hardly matters where it leads then: so long with a guard as it ships."""
ALONE_SHARE, LONG_ALONE_S = 0.8, 2.0
"""Beyond ``SOON_S`` this share counts as left alone; without a guard, with 3 s, that is ``LONG_ALONE_S``."""
LONG_OFF = 0.1
"""Then a rover may turn by so much more off what is told: a small error of the turn rate grows for seconds."""


class Following(NamedTuple):
    """It begins after ``dead_s`` and changes speed and turn rate within limits.

    ``turn_gain``: it turns by this factor more than told; it may be off that by the share ``turn_off_model``, and off
    all the rest by ``off_model``. ``gains_most_m_s2``: no rover gains speed faster than this.
    """

    dead_s: float = 0.3
    acceleration_m_s2: float = 1.0
    deceleration_m_s2: float = 1.0
    turn_acceleration_rad_s2: float = 2.1
    turn_gain: float = 1.0
    off_model: float = 0.3
    gains_most_m_s2: float = 1.3
    turn_off_model: float = 0.3


def alone_s(lasts_s: float) -> float:
    """How long a rover counts as left alone with a velocity that lasts so long."""
    return max(lasts_s - GUARDED_S, ALONE_SHARE * (lasts_s - SOON_S), 0.0)


def turn_gains(follows: Following, lasts_s: float) -> tuple[float, ...]:
    """By which factors more than told a rover may turn, where a velocity lasts so long."""
    off = follows.turn_off_model + LONG_OFF * min(alone_s(lasts_s) / LONG_ALONE_S, 1.0)
    return 1.0 + off, 1.0 - off, 1.0


AS_SHIPPED = Following()
"""ArduRover's parameters as shipped, and its measured dead time with some to spare."""


def following_of(settings: MotionSettings, parameters: Mapping[str, float]) -> Following:
    """As set; what is not set is read from the autopilot's parameters, as shipped where they are not known.

    A limit of the autopilot says what the rover does at most. That is counted on up to ``BELIEVED_M_S2`` and
    ``BELIEVED_RAD_S2``; where there is no limit, the rover is taken to do as one with the limits as shipped.
    """
    usual = AS_SHIPPED
    most_m_s2 = settings.acceleration_m_s2 or _limit(parameters, ACCELERATION, usual.acceleration_m_s2, MOST_M_S2)
    gains = settings.acceleration_m_s2 or _believed(parameters, ACCELERATION, usual.acceleration_m_s2, BELIEVED_M_S2)
    brakes = settings.deceleration_m_s2
    if brakes is None:
        brakes = _believed(parameters, DECELERATION, gains, BELIEVED_M_S2) if parameters.get(DECELERATION) else gains
    turns = settings.turn_acceleration_rad_s2
    if turns is None:
        usual_deg_s2 = math.degrees(usual.turn_acceleration_rad_s2)
        turns = math.radians(_believed(parameters, TURN_ACCELERATION, usual_deg_s2, math.degrees(BELIEVED_RAD_S2)))
    off = settings.off_model
    return Following(settings.dead_s, gains, brakes, turns, settings.turn_gain, off, most_m_s2 * (1.0 + off), off)


def turns_are_limited(settings: MotionSettings, parameters: Mapping[str, float]) -> bool:
    """Whether the change of the turn rate is known to have a limit: a set one, or one that the autopilot tells."""
    told_rad_s2 = math.radians(parameters.get(TURN_ACCELERATION, 0.0))
    return settings.turn_acceleration_rad_s2 is not None or 0.0 < told_rad_s2 <= BELIEVED_RAD_S2


def within_limits(rover: RoverLimits, parameters: Mapping[str, float]) -> RoverLimits:
    """The same rover, no faster than the autopilot lets it drive and turn where it is told velocities.

    What is not known, and a limit of 0, changes nothing; ``WP_SPEED`` 0 leaves it to ``CRUISE_SPEED``.
    """
    fastest_m_s = parameters.get(FASTEST, 0.0) or parameters.get(CRUISE, 0.0)
    turns_deg_s = parameters.get(TURN_RATE, 0.0)
    return changed(
        rover,
        told_most_m_s=fastest_m_s if fastest_m_s > 0.0 else math.inf,
        turns_most_rad_s=math.radians(turns_deg_s) if turns_deg_s > 0.0 else math.inf,
    )


def _believed(parameters: Mapping[str, float], name: str, usual: float, most: float) -> float:
    value = parameters.get(name, usual)
    return min(value, most) if value > 0.0 else usual


def _limit(parameters: Mapping[str, float], name: str, usual: float, most: float) -> float:
    value = parameters.get(name, usual)
    return min(value, most) if value > 0.0 else most
