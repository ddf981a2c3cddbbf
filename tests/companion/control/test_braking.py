"""How far, how fast: the formulas, and what a late link does to them."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.control.braking import (
    GUARD_SLACK_S,
    blind_distance_m,
    counted_s,
    farthest_m,
    fastest_blind_m_s,
    fastest_within_m,
    for_link,
    for_silence,
    late,
    loop_latency_s,
    overshoot_m,
    soonest_s,
    stopping_distance_m,
)
from companion.control.following import Following
from companion.settings import Settings, parse_settings

SETTINGS = Settings()


@given(st.floats(0.0, 50.0))
def test_a_velocity_that_is_the_last_word_ends_within_the_distance(distance_m: float) -> None:
    speed_m_s = fastest_blind_m_s(distance_m, SETTINGS.guidance)
    assert blind_distance_m(speed_m_s, SETTINGS.guidance) == pytest.approx(distance_m, abs=1e-6)
    assert speed_m_s <= fastest_within_m(distance_m, SETTINGS.guidance) + 1e-9


def test_the_default_latency_is_what_the_loop_needs() -> None:
    assert SETTINGS.guidance.latency_s == pytest.approx(loop_latency_s(SETTINGS))


@pytest.mark.parametrize(("link_s", "dead_s"), [(0.0, 0.25), (0.05, 0.25), (0.1, 0.35), (0.6, 0.85), (1.0, 1.25)])
def test_a_late_link_makes_the_dead_time_longer(link_s: float, dead_s: float) -> None:
    """What the link takes up to one step is in the dead time that is set, 0.3 s, and in the 0.25 s that were found."""
    assert late(Following(dead_s=0.25), 0.3, link_s).dead_s == pytest.approx(dead_s)
    assert late(Following(dead_s=2.0), 0.3, link_s).dead_s == 2.0


@pytest.mark.parametrize(("found_s", "link_s", "soon_s"), [(0.25, 0.05, math.inf), (0.25, 0.45, 0.4), (0.5, 0.45, 0.5)])
def test_over_a_late_link_it_may_obey_as_soon_as_was_found(found_s: float, link_s: float, soon_s: float) -> None:
    """But no sooner than the link allows."""
    assert soonest_s(Following(dead_s=found_s), link_s) == pytest.approx(soon_s)


@given(st.floats(0.0, 3.0), st.floats(0.1, 20.0))
def test_a_late_link_makes_slow(link_s: float, sight_m: float) -> None:
    """v * latency + v² / 2a <= sight, with all of the latency."""
    late = for_link(SETTINGS, link_s).guidance
    speed_m_s = fastest_within_m(sight_m, late)
    whole_s = 0.05 + 0.1 + SETTINGS.guidance.brake_delay_s + link_s
    assert speed_m_s * whole_s + speed_m_s**2 / (2.0 * late.deceleration_m_s2) <= sight_m + 1e-6
    assert late.brake_delay_s >= SETTINGS.guidance.brake_delay_s + link_s - 1e-6


def test_steps_of_the_link_are_rounded_up_and_a_setting_may_ask_for_more() -> None:
    assert counted_s(0.0) == 0.0 and counted_s(0.05) == pytest.approx(0.05) and counted_s(0.051) == pytest.approx(0.1)
    cautious = parse_settings({"guidance": {"latency_s": 2.0}}, "test")
    assert for_link(cautious, 0.3).guidance.latency_s == 2.0
    slow = parse_settings({"link": {"tick_hz": 5.0, "range_rate_hz": 2.0}}, "test")
    assert for_link(slow, 0.0).guidance.latency_s == pytest.approx(0.2 + 0.5 + 0.25)


def test_the_farthest_target_is_horizon_and_stopping_distance() -> None:
    guidance = SETTINGS.guidance
    assert farthest_m(2.0, guidance) == guidance.horizon_m + stopping_distance_m(2.0, guidance)
    near_m = farthest_m(1.0, guidance, narrow=True)
    assert near_m == guidance.narrow_horizon_m + stopping_distance_m(1.0, guidance) < farthest_m(1.0, guidance)
    short = guidance.model_copy(update={"horizon_m": 1.0})
    assert farthest_m(1.0, short, narrow=True) == farthest_m(1.0, short)


@pytest.mark.parametrize(
    ("distance_m", "speed_m_s", "beyond_m"),
    [(1.0, 0.0, 0.1), (20.0, 0.0, 0.35), (0.3, 0.5, 0.1), (0.9, 1.0, 0.2), (1.5, 2.0, 0.2), (3.0, 2.0, 0.3)],
)
def test_it_stands_beyond_a_place_by_a_share_of_the_distance_and_farther_if_it_rolls(
    distance_m: float, speed_m_s: float, beyond_m: float
) -> None:
    assert overshoot_m(distance_m, speed_m_s, SETTINGS.guidance) == pytest.approx(beyond_m)


def test_with_a_guard_what_is_told_must_be_safe_until_the_guard_has_acted() -> None:
    """On the real firmware a guard of 300 ms had put HOLD after 317 ms: it looks every 20 ms, and the mode changes."""
    lasts_s = for_silence(SETTINGS, 3.0, 0.3).guidance.velocity_lasts_s
    assert 0.3 + 0.02 + 0.017 < lasts_s < 0.4
    assert for_silence(SETTINGS, 3.0, 9.0).guidance.velocity_lasts_s == SETTINGS.guidance.velocity_lasts_s == 3.0
    assert for_silence(SETTINGS, 3.0, None) is SETTINGS


@pytest.mark.parametrize("told_s", [0.5, 10.0])
def test_a_velocity_lasts_as_long_as_the_autopilot_says(told_s: float) -> None:
    """A companion that dies with GUID_TIMEOUT 10 goes on for ten seconds."""
    assert for_silence(SETTINGS, told_s, None).guidance.velocity_lasts_s == told_s
    assert for_silence(SETTINGS, told_s, 0.3).guidance.velocity_lasts_s == pytest.approx(0.3 + GUARD_SLACK_S)
