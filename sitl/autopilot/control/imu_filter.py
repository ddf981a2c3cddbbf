"""The low-pass filters of gyro and accelerometer (behaviour of LowPassFilter2p; compiled).

A rover's are slow: turn rate and acceleration reach the controllers some hundredths of a second late.

Nouns: LowPassFilter2p.
"""

from __future__ import annotations

import math
from typing import Any

from numba import njit

RESOLUTION = 1e-9
"""Less is nothing: what is left of a signal that has ended fades for ever, and its last digits differ by machine."""


@njit(cache=True, nogil=True)
def low_passed(delayed: Any, sample: float, cutoff_hz: float, step_s: float) -> float:
    """One step of a second-order Butterworth filter; ``delayed``: its state, shape (2,). Without a cutoff: the sample.

    The bilinear transform of 1 / (s^2 + sqrt(2) s + 1), with the frequency warped so that the cutoff is exact.
    """
    if cutoff_hz <= 0.0:
        return sample
    warped = math.tan(math.pi * cutoff_hz * step_s)
    scale = 1.0 + math.sqrt(2.0) * warped + warped * warped
    newest = sample - delayed[0] * 2.0 * (warped * warped - 1.0) / scale
    newest -= delayed[1] * (1.0 - math.sqrt(2.0) * warped + warped * warped) / scale
    if abs(newest) < RESOLUTION:
        newest = 0.0
    output = (newest + 2.0 * delayed[0] + delayed[1]) * warped * warped / scale
    delayed[1] = delayed[0]
    delayed[0] = newest
    return float(output)
