"""Braking: how far the rover goes before it stands, and how fast it may go to stand in time.

A rover at v m/s that sees ``sight`` metres must keep v * latency + v² / (2 * deceleration) + margin <= sight.

Nouns: braking distance.
"""

from __future__ import annotations

import math

from companion.control.following import Following
from companion.settings import GuidanceSettings, Settings

GUARD_SLACK_S = 0.05
"""A guard looks every 20 ms, and then changes the mode."""
OVERSHOT_SHARE = 0.1
"""A position is overshot by no more than this share of the distance from which the rover sets off."""
ROLLS_BEYOND_S, ROLLS_MOST_M_S = 0.2, 1.0
LINK_STEP_S = 0.05
"""The link's latency counts in steps of this, rounded up."""


def overshoot_m(distance_m: float, speed_m_s: float, settings: GuidanceSettings) -> float:
    """How far beyond a guided position the rover may come to stand: the farther it is away, the farther beyond.

    Not less than a rolling rover needs that gets a near position: ArduRover with ``WP_JERK`` 3 then goes 0.09 m beyond
    it at 0.5 m/s, and 0.18 m at 1 m/s and more (measured on the simulated autopilot).
    """
    rolls_m = ROLLS_BEYOND_S * min(speed_m_s, ROLLS_MOST_M_S)
    return min(settings.overshoot_m, max(OVERSHOT_SHARE * distance_m, rolls_m))


def loop_latency_s(settings: Settings) -> float:
    """From an obstacle coming into sight to braking, without the link: the wait for a scan, a tick and the brakes."""
    return 1.0 / settings.link.range_rate_hz + 1.0 / settings.link.tick_hz + settings.guidance.brake_delay_s


def counted_s(link_s: float) -> float:
    """The link's latency in whole steps."""
    return math.ceil(link_s / LINK_STEP_S - 1e-6) * LINK_STEP_S


def for_link(settings: Settings, link_s: float) -> Settings:
    """The settings to drive with while the link takes ``link_s``, there and back: latency and braking delay grow."""
    late_s, own = counted_s(link_s), settings.guidance
    latency_s = max(own.latency_s, loop_latency_s(settings) + late_s)
    guidance = own.model_copy(update={"latency_s": latency_s, "brake_delay_s": own.brake_delay_s + late_s})
    return settings.model_copy(update={"guidance": guidance})


def late(follows: Following, dead_s: float, link_s: float) -> Following:
    """The same where the link takes ``link_s``, there and back, beyond the first step: that is in any dead time.

    ``dead_s``: as set. The estimate has the link in it, but sees a change of it only seconds later.
    """
    late_s = counted_s(link_s) - LINK_STEP_S
    return follows._replace(dead_s=max(follows.dead_s, dead_s + late_s)) if late_s > 0.0 else follows


def soonest_s(follows: Following, link_s: float) -> float:
    """When a command has its effect at the soonest over a late link: as was found, but no sooner than the link allows.

    ``follows``: as found. inf where the link is not late: then the dead time is what is known.
    """
    late_s = counted_s(link_s) - LINK_STEP_S
    return max(follows.dead_s, late_s) if late_s > 0.0 else math.inf


def for_silence(settings: Settings, told_s: float, waits_s: float | None) -> Settings:
    """The settings for a companion that falls silent: the autopilot ends its last velocity after ``told_s``.

    A guard that waits for ``waits_s`` ends it sooner; None without one.
    """
    lasts_s = told_s if waits_s is None else min(told_s, waits_s + GUARD_SLACK_S)
    if lasts_s == settings.guidance.velocity_lasts_s:
        return settings
    guidance = settings.guidance.model_copy(update={"velocity_lasts_s": lasts_s})
    return settings.model_copy(update={"guidance": guidance})


def braking_distance_m(speed_m_s: float, settings: GuidanceSettings) -> float:
    """Distance from the stop command to standing still."""
    return speed_m_s * settings.brake_delay_s + speed_m_s**2 / (2.0 * settings.deceleration_m_s2)


def stopping_distance_m(speed_m_s: float, settings: GuidanceSettings) -> float:
    """Distance from something coming into sight to standing still."""
    return speed_m_s * settings.latency_s + speed_m_s**2 / (2.0 * settings.deceleration_m_s2)


def blind_distance_m(speed_m_s: float, settings: GuidanceSettings) -> float:
    """How far a rover drives if nothing follows a velocity command: until the command expires, and while it brakes."""
    return speed_m_s * settings.velocity_lasts_s + braking_distance_m(speed_m_s, settings)


def fastest_blind_m_s(distance_m: float, settings: GuidanceSettings) -> float:
    """The velocity that may be told with so much clear way ahead: the inverse of ``blind_distance_m``."""
    a, t = settings.deceleration_m_s2, settings.velocity_lasts_s + settings.brake_delay_s
    return a * (math.sqrt(t * t + 2.0 * max(distance_m, 0.0) / a) - t)


def farthest_m(speed_m_s: float, settings: GuidanceSettings, *, narrow: bool = False) -> float:
    """How far away a guided target may lie, straight. ``narrow``: the sensor is single thin beams."""
    horizon_m = min(settings.narrow_horizon_m, settings.horizon_m) if narrow else settings.horizon_m
    return horizon_m + stopping_distance_m(speed_m_s, settings)


def fastest_within_m(distance_m: float, settings: GuidanceSettings) -> float:
    """The speed from which the rover can stop within a distance: the inverse of ``stopping_distance_m``."""
    a, t = settings.deceleration_m_s2, settings.latency_s
    return a * (math.sqrt(t * t + 2.0 * max(distance_m, 0.0) / a) - t)
