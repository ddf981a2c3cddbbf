"""How far the rover goes before it stands, and how fast it may go to stand in time. A settings' worth of mechanics, nothing else."""

from __future__ import annotations

import math

from companion.settings import GuidanceSettings


def braking_distance_m(speed_m_s: float, settings: GuidanceSettings) -> float:
    """Distance from the stop command to standing still."""
    return speed_m_s * settings.brake_delay_s + speed_m_s**2 / (2.0 * settings.deceleration_m_s2)


def stopping_distance_m(speed_m_s: float, settings: GuidanceSettings) -> float:
    """Distance from something coming into sight to standing still."""
    return speed_m_s * settings.latency_s + speed_m_s**2 / (2.0 * settings.deceleration_m_s2)


def blind_distance_m(speed_m_s: float, settings: GuidanceSettings) -> float:
    """How far a rover drives that was told a velocity and is then told nothing more: until that is forgotten, and to standing."""
    return speed_m_s * settings.velocity_lasts_s + braking_distance_m(speed_m_s, settings)


def fastest_blind_m_s(distance_m: float, settings: GuidanceSettings) -> float:
    """The velocity that may be told with so much clear way ahead: the inverse of ``blind_distance_m``."""
    a, t = settings.deceleration_m_s2, settings.velocity_lasts_s + settings.brake_delay_s
    return a * (math.sqrt(t * t + 2.0 * max(distance_m, 0.0) / a) - t)


def farthest_m(speed_m_s: float, settings: GuidanceSettings) -> float:
    """How far away a guided target may lie, straight."""
    return settings.horizon_m + stopping_distance_m(speed_m_s, settings)


def fastest_within_m(distance_m: float, settings: GuidanceSettings) -> float:
    """The speed from which the rover can stop within a distance: the inverse of ``stopping_distance_m``."""
    a, t = settings.deceleration_m_s2, settings.latency_s
    return a * (math.sqrt(t * t + 2.0 * max(distance_m, 0.0) / a) - t)


def overshoot_m(distance_m: float, settings: GuidanceSettings) -> float:
    """How far beyond a guided position at this distance the rover may come to stand."""
    return min(settings.overshoot_m, 0.1 * distance_m)
