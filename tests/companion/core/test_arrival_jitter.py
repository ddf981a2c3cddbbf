"""Messages that wait on their way: when they would have come if they were as quick as the best."""

from __future__ import annotations

import math
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.core.arrival_jitter import AGREE_S, LEAST_S, MOST_S, ArrivalJitter

DELAYS_S = st.lists(st.floats(0.0, 0.2), min_size=5, max_size=90)


def came(told_s: list[float], time_s: list[float]) -> list[float]:
    """Of each message, when it would have come."""
    jitter, result = ArrivalJitter(), []
    for told, time in zip(told_s, time_s, strict=True):
        jitter = jitter.after(time, told)
        result.append(jitter.came_s(time, told))
    return result


def test_what_comes_as_quickly_each_time_comes_when_it_comes() -> None:
    times = [5.0 + 0.05 * i for i in range(100)]
    assert came([time - 3.2 for time in times], times) == times
    rounded = [round(time - 3.2, 3) for time in times]  # boot times are told in milliseconds
    assert came(rounded, times) == times


@given(DELAYS_S, st.floats(-1e6, 1e6))
def test_what_waits_on_the_way_would_have_come_as_the_best_does(delays_s: list[float], shift_s: float) -> None:
    told = [0.05 * i for i in range(len(delays_s))]
    times = [100.0 + made_s + delay_s for made_s, delay_s in zip(told, delays_s, strict=True)]
    times = [max(times[: i + 1]) for i in range(len(times))]  # none overtakes another
    for i, moment in enumerate(came([one + shift_s for one in told], times)):
        best_s = [
            min((times[k] - told[k] for k in range(i + 1) if int(times[k]) == int(times[i]) - back), default=math.inf)
            for back in range(4)
        ]
        pairs = [(one, other) for one, other in pairwise(best_s[1:]) if math.isfinite(one + other)]
        apart_s = min((abs(one - other) for one, other in pairs), default=math.inf)
        late_s = times[i] - told[i] - min(best_s[:2])
        assert times[i] - MOST_S <= moment <= times[i]
        if apart_s <= AGREE_S - 1e-6 and late_s <= MOST_S - 1e-6:
            assert moment == pytest.approx(times[i] - late_s, abs=LEAST_S + 1e-6)
        if apart_s > AGREE_S + 1e-6:
            assert moment == times[i]


def test_ticks_that_take_in_what_has_come_meanwhile_do_not_count() -> None:
    """Each message is made every 0.1 s and taken in at the next tick of 0.05 s: 0 to 0.05 s later, as clocks drift."""
    made = [0.1003 * i for i in range(300)]
    times = [0.05 * math.ceil((20.0 + one) / 0.05) for one in made]
    late_s = [moment - made_s for moment, made_s in zip(came(made, times), made, strict=True)][40:]
    raw_s = [time - made_s for time, made_s in zip(times, made, strict=True)][40:]
    steps_s = [abs(a - b) for a, b in pairwise(late_s)]
    assert max(raw_s) - min(raw_s) > 0.045
    assert sum(one > 0.01 for one in steps_s) <= 4


def test_two_senders_stay_together_when_all_comes_later_from_now_on() -> None:
    """As by a computer that is busy from then on: else a scan would be put where the rover was long before."""
    made = [i / 20.0 for i in range(200)]
    times = [10.0 + made_s + (0.1 if made_s >= 4.27 else 0.0) for made_s in made]
    positions = dict(zip(made, came(made, times), strict=True))
    scans = dict(zip(made[::2], came([one + 70.0 for one in made[::2]], times[::2]), strict=True))
    assert max(abs(scans[one] - positions[one]) for one in made[::2]) <= LEAST_S
    assert positions[made[-1]] == times[-1], "what comes so from now on comes when it comes"


@pytest.mark.parametrize("rate", [0.0, 1e-3, 0.9, 1.1, -1.0, 1e3])
def test_a_clock_that_is_none_says_nothing(rate: float) -> None:
    times = [50.0 + 0.1 * i for i in range(100)]
    assert came([rate * time_s for time_s in times], times) == times


def test_a_link_that_fails_for_long_is_no_jitter() -> None:
    made = [0.05 * i for i in range(60)]
    times = [10.0 + one + (0.6 if one > 2.0 else 0.0) for one in made]
    assert came(made, times) == times
