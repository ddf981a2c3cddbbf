"""The rover's outline: circles about it, and discs that cover it."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.core.footprint import Footprint

JACKAL = Footprint.rectangle(0.508, 0.430)


def test_a_circle_is_one_disc() -> None:
    circle = Footprint.circle(0.4)
    places_m, radius_m = circle.discs()
    assert list(places_m) == [0.0] and radius_m == circle.radius_m == circle.inscribed_m == 0.4


def test_a_rectangle_lies_between_two_circles() -> None:
    assert JACKAL.radius_m == pytest.approx(math.hypot(0.254, 0.215)) and JACKAL.inscribed_m == 0.215
    ahead = Footprint.rectangle(1.0, 0.6, 0.3)
    assert (ahead.front_m, ahead.rear_m) == pytest.approx((0.8, 0.2))
    assert ahead.radius_m == pytest.approx(math.hypot(0.8, 0.3)) and ahead.inscribed_m == pytest.approx(0.2)


@given(st.floats(0.1, 5.0), st.floats(0.1, 2.0), st.floats(-0.45, 0.45))
def test_its_discs_cover_a_rectangle(length_m: float, width_m: float, share: float) -> None:
    footprint = Footprint.rectangle(length_m, width_m, share * length_m)
    places_m, radius_m = footprint.discs()
    ahead = np.linspace(-footprint.rear_m, footprint.front_m, 101)
    gaps = np.hypot(ahead[:, None] - places_m, footprint.half_width_m).min(axis=1)
    assert gaps.max() <= radius_m + 1e-9
    assert len(places_m) == 24 or radius_m <= footprint.half_width_m + min(0.0101, 0.0301 * footprint.half_width_m)
