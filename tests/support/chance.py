"""How often something random may happen. scipy.stats is loaded by the test that asks: it is large."""

from __future__ import annotations


def more_than(tries: int, rate: float) -> int:
    """So many successes that a success rate of ``rate`` or less would give more of them once in 1000 times."""
    from scipy.stats import binom

    return int(binom.isf(1e-3, tries, rate))


def usual_counts(tries: int, rate: float) -> tuple[int, int]:
    """The fewest and the most successes; a success rate of ``rate`` gives others once in 100,000 times."""
    from scipy.stats import binom

    low, high = binom.interval(1 - 1e-5, tries, rate)
    return int(low), int(high)
