"""The low-pass filters of gyro and accelerometer."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sitl.autopilot.control.imu_filter import low_passed

STEP_S = 0.005


def answered(samples: list[float], cutoff_hz: float) -> list[float]:
    delayed = np.zeros(2)
    return [low_passed(delayed, sample, cutoff_hz, STEP_S) for sample in samples]


@pytest.mark.parametrize(("hz", "gain"), [(0.4, 1.0), (4.0, math.sqrt(0.5)), (40.0, 0.006)])
def test_a_wave_at_the_cutoff_comes_through_with_half_its_power(hz: float, gain: float) -> None:
    wave = [math.sin(math.tau * hz * STEP_S * i) for i in range(2000)]
    assert max(answered(wave, 4.0)[1000:]) == pytest.approx(gain, abs=0.006)


def test_a_ramp_comes_a_little_more_than_a_twentieth_of_a_second_late() -> None:
    """Delay of a second-order Butterworth filter at low frequencies: sqrt(2) / (2 pi 4 Hz). Measured: 0.058 s."""
    ramp = [STEP_S * i for i in range(400)]
    assert ramp[-1] - answered(ramp, 4.0)[-1] == pytest.approx(math.sqrt(2.0) / (math.tau * 4.0), abs=0.001)


def test_without_a_cutoff_nothing_is_filtered() -> None:
    assert answered([1.0, -2.0, 3.0], 0.0) == [1.0, -2.0, 3.0]
