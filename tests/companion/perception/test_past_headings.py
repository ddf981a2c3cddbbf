"""How far the rover has turned."""

from __future__ import annotations

import math

import numpy as np
import pytest

from companion.perception.past_headings import KEPT_S, PastHeadings
from companion.vehicle.events import AttitudeSeen


def heard(*headings: tuple[float, float], rate_rad_s: float = 0.0) -> PastHeadings:
    past = PastHeadings()
    for time_s, heading_rad in headings:
        past.note(AttitudeSeen(time_s, time_s, heading_rad, rate_rad_s), time_s)
    return past


def turned_rad(past: PastHeadings, time_s: float, *ages_s: float) -> list[float]:
    return [float(one) for one in past.turned_rad(time_s, np.array(ages_s))]


def test_between_attitudes_it_turns_evenly_and_over_north_without_a_jump() -> None:
    past = heard((1.0, 3.0), (1.2, -3.0), (1.4, -2.8))
    over_rad = 2.0 * math.pi - 6.0
    assert turned_rad(past, 1.4, 0.0, 0.1, 0.2, 0.4) == pytest.approx([0.0, 0.1, 0.2, 0.2 + over_rad])
    assert turned_rad(past, 1.2, 0.1) == pytest.approx([0.5 * over_rad])


def test_after_the_last_attitude_it_turns_on_and_before_the_first_it_had_not() -> None:
    past = heard((1.0, 0.0), (1.1, 0.2), rate_rad_s=0.5)
    assert turned_rad(past, 1.2, 0.1, 0.2, 0.9) == pytest.approx([0.05, 0.25, 0.25])
    assert turned_rad(past, 1.1, -0.1) == pytest.approx([-0.05])
    assert past.known_s(1.2) == pytest.approx(0.2) and PastHeadings().known_s(1.2) == 0.0


def test_nothing_heard_is_no_turn_and_what_is_heard_again_is_no_matter() -> None:
    assert turned_rad(PastHeadings(), 1.0, 0.2) == [0.0]
    past = heard((1.0, 0.0), (1.0, 0.0), (1.1, 0.1), (1.1, 0.1))
    assert turned_rad(past, 1.1, 0.1) == pytest.approx([0.1])


def test_an_attitude_counts_from_when_it_would_have_come() -> None:
    """Three of one tick, of which two have waited; one that seems to have come before the last is left out."""
    past = PastHeadings()
    for came_s, heading_rad in ((1.0, 0.0), (1.05, 0.05), (1.1, 0.1), (1.08, 0.5)):
        past.note(AttitudeSeen(1.1, came_s, heading_rad, 1.0), came_s)
    assert turned_rad(past, 1.1, 0.05, 0.1) == pytest.approx([0.05, 0.1])


def test_a_clock_that_goes_back_begins_anew_and_the_past_is_short() -> None:
    past = heard((9.0, 0.0), (9.5, 1.0), (2.0, 1.5), (2.1, 1.6))
    assert turned_rad(past, 2.1, 0.1, 5.0) == pytest.approx([0.1, 0.1])
    long = heard(*((0.1 * step, 0.01 * step) for step in range(100)))
    assert turned_rad(long, 9.9, 5.0) == pytest.approx([0.1 * KEPT_S])
