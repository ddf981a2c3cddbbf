"""Messages that wait on their way: when they would have come if they were as quick as the best."""

from __future__ import annotations

import math
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.core.arrival_jitter import AGREE_S, FAILS_S, LEAST_S, MOST_S, ArrivalJitter

DELAYS_S = st.lists(st.floats(0.0, 0.2), min_size=5, max_size=90)


def came(told_s: list[float], time_s: list[float]) -> list[float]:
    """Of each message, when it would have come."""
    jitter, result = ArrivalJitter(), []
    for told, time in zip(told_s, time_s, strict=True):
        jitter = jitter.after(time, told)
        result.append(time - (jitter.late_s(time, told) or 0.0))
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
        if apart_s <= AGREE_S - 1e-6 and late_s <= FAILS_S - 1e-6:
            assert moment == pytest.approx(times[i] - min(late_s, MOST_S), abs=LEAST_S + 1e-6)
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


@pytest.mark.parametrize("slow", [0.0, 1e-3, 0.01, 0.05])
def test_a_clock_that_is_slow_puts_its_messages_off_by_what_it_loses_in_two_seconds(slow: float) -> None:
    """Those of quartz lose 0.1 ms a second."""
    times = [50.0 + 0.1 * i for i in range(200)]
    off_s = [
        time - moment for time, moment in zip(times, came([(1.0 - slow) * one for one in times], times), strict=True)
    ]
    assert min(off_s) >= 0.0 and max(off_s) <= 2.0 * slow


def test_what_was_held_up_together_for_long_stays_together() -> None:
    """For 0.6 s: a message that is later than may be counts as so late as may be, like those beside it."""
    made = [0.05 * i for i in range(120)]
    times = [10.0 + max(one, 4.6 if one > 4.0 else 0.0) for one in made]
    late_s = [time - moment for time, moment in zip(times, came(made, times), strict=True)]
    held = [(one, late) for one, late in zip(made, late_s, strict=True) if 4.0 < one < 4.6]
    assert len(held) > 9 and all(late == pytest.approx(min(4.6 - one, MOST_S), abs=LEAST_S) for one, late in held)


def test_a_link_that_fails_for_long_is_no_jitter() -> None:
    made = [0.05 * i for i in range(90)]
    times = [10.0 + one + (1.1 if one > 4.0 else 0.0) for one in made]
    assert came(made, times) == times
    jitter = ArrivalJitter()
    for time, told in zip(times[:70], made[:70], strict=True):
        jitter = jitter.after(time, told)
    assert jitter.late_s(times[69] + FAILS_S + 0.01, made[69]) is None


def test_nothing_is_known_before_two_whole_windows_agree() -> None:
    """Whenever the first message comes: also in the first second of the companion's clock."""
    for begins_s in (0.0, 0.2, 7.0, -3.3):
        jitter = ArrivalJitter()
        for i in range(25):
            jitter = jitter.after(begins_s + 0.05 * i, 0.05 * i)
            assert jitter.late_s(begins_s + 0.05 * i + 0.1, 0.05 * i) is None
