"""Every hot loop is compiled before the rover may move."""

from __future__ import annotations

import pytest

from companion.executive.warm_up import kernels_warm, warm_up
from companion.perception.range_age import mean_gaps_m
from companion.settings import Settings


@pytest.mark.parametrize("turning_radius_m", [0.0, 1.0])
def test_after_a_warm_up_nothing_is_left_to_compile(turning_radius_m: float) -> None:
    warm_up(Settings(), turning_radius_m)
    assert kernels_warm(Settings(), turning_radius_m)


def test_scans_are_compared_for_their_age_once() -> None:
    """The kernel is reached only by scans of a rover that turns, with headings of some time."""
    warm_up(Settings())
    assert len(mean_gaps_m.signatures) == 1
