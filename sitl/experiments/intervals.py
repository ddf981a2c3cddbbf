"""95 % intervals of means and of quotients of means, by resampling. The same values give the same interval."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

DRAWS = 2000
WITHIN = (2.5, 97.5)
Values = Sequence[float] | NDArray[np.float64]


def mean_interval(values: Values) -> tuple[float, float]:
    """The interval of the mean; of a single value that value."""
    low, high = np.percentile(np.asarray(values)[_drawn(len(values))].mean(axis=1), WITHIN)
    return float(low), float(high)


def mean_with_interval(values: Values, digits: int) -> str:
    """The mean with its interval, which a single value does not have; a dash for none."""
    if len(values) < 2:
        return f"{values[0]:.{digits}f}" if len(values) else "-"
    low, high = mean_interval(values)
    return f"{np.mean(values):.{digits}f} ({low:.{digits}f} to {high:.{digits}f})"


def ratio_with_interval(pairs: NDArray[np.float64]) -> str:
    """The first column's mean over the second's, with its interval by resampling rows; ``pairs``: shape (n, 2).

    A single pair has no interval; a dash for none.
    """
    if len(pairs) < 2:
        return f"{pairs[0, 0] / pairs[0, 1]:.3f}" if len(pairs) else "-"
    means = pairs[_drawn(len(pairs))].mean(axis=1)
    low, high = np.percentile(means[:, 0] / means[:, 1], WITHIN)
    return f"{pairs[:, 0].mean() / pairs[:, 1].mean():.3f} ({low:.3f} to {high:.3f})"


def _drawn(count: int) -> NDArray[np.int64]:
    """Rows drawn with replacement, shape (DRAWS, count)."""
    return np.random.default_rng(0).integers(count, size=(DRAWS, count))
