"""The closed loop, compiled: estimate, motion control, battery and plant; runs many passes of it in one call.

Nouns: NoiseSettings.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from sitl.autopilot.battery import FULL_A, RESISTANCE_OHM
from sitl.autopilot.control.imu_filter import low_passed
from sitl.autopilot.control.records import LOOP_S, MotionRecords
from sitl.autopilot.control.tasks import run_task
from sitl.plant.rover import drive, meet_movers
from sitl.world.world import Surroundings

SUBSTEPS = 4
"""Steps of the plant per main loop."""

NOISE_COLUMNS = 5
"""Normal variates per loop: velocity error north, east; position jitter north, east; heading error."""


@dataclass(frozen=True, slots=True)
class NoiseSettings:
    """Errors of the autopilot's estimate and of the range sensors (standard deviations)."""

    position_bias_m: float = 0.12
    position_jitter_m: float = 0.01
    heading_bias_deg: float = 0.5
    range_m: float = 0.02
    bias_time_s: float = 20.0
    """Time constant with which the position error wanders."""

    @classmethod
    def none(cls) -> NoiseSettings:
        """No errors at all."""
        return cls(0.0, 0.0, 0.0, 0.0)

    def as_array(self) -> NDArray[np.float64]:
        """For the compiled loop: velocity error, its time, bias time, jitter, heading error, its time."""
        drift_time_s = self.bias_time_s / 5.0
        total_s = self.bias_time_s + drift_time_s
        drift_m_s = self.position_bias_m / math.sqrt(drift_time_s * self.bias_time_s**2 / total_s)
        heading_rad = math.radians(self.heading_bias_deg)
        jitter_m = self.position_jitter_m
        return np.array([drift_m_s, drift_time_s, self.bias_time_s, jitter_m, heading_rad, 2.0 * self.bias_time_s])


@njit(cache=True, nogil=True)
def update_estimate(estimate: Any, rover: Any, origin: Any, noise: Any, draw: Any) -> None:
    """Update the autopilot's estimate: the truth, a slowly wandering error, some jitter."""
    keep = math.exp(-LOOP_S / noise[1])
    kick = noise[0] * math.sqrt(1.0 - keep * keep)
    estimate.drift_n = keep * estimate.drift_n + kick * draw[0]
    estimate.drift_e = keep * estimate.drift_e + kick * draw[1]
    rate_n = estimate.drift_n - estimate.bias_n / noise[2]
    rate_e = estimate.drift_e - estimate.bias_e / noise[2]
    estimate.bias_n += rate_n * LOOP_S
    estimate.bias_e += rate_e * LOOP_S
    keep = math.exp(-LOOP_S / noise[5])
    estimate.bias_heading = keep * estimate.bias_heading + noise[4] * math.sqrt(1.0 - keep * keep) * draw[4]
    ahead_n, ahead_e = math.cos(rover.heading_rad), math.sin(rover.heading_rad)
    estimate.north_m = rover.north_m - origin[0] + estimate.bias_n + noise[3] * draw[2] + estimate.offset_n
    estimate.east_m = rover.east_m - origin[1] + estimate.bias_e + noise[3] * draw[3] + estimate.offset_e
    estimate.vel_n = rover.speed_m_s * ahead_n + rate_n + estimate.offset_vn
    estimate.vel_e = rover.speed_m_s * ahead_e + rate_e + estimate.offset_ve
    if rover.slide_m_s != 0.0:
        estimate.vel_n -= rover.slide_m_s * ahead_e
        estimate.vel_e += rover.slide_m_s * ahead_n
    estimate.accel_n = estimate.imu_ahead * ahead_n - estimate.imu_aside * ahead_e
    estimate.accel_e = estimate.imu_ahead * ahead_e + estimate.imu_aside * ahead_n
    heading_rad = rover.heading_rad + estimate.bias_heading
    estimate.heading_rad = (heading_rad + math.pi) % (2.0 * math.pi) - math.pi
    estimate.yaw_rate_rad_s = estimate.imu_yaw_rate


@njit(cache=True, nogil=True)
def measure(estimate: Any, tuning: Any, yaw_rate_rad_s: float, ahead_m_s2: float, aside_m_s2: float) -> None:
    """What gyro and accelerometer tell of one step of the plant, filtered: turn rate, acceleration ahead and aside."""
    filters, hz, step_s = estimate.imu_filters, tuning.accel_filter_hz, LOOP_S / SUBSTEPS
    estimate.imu_yaw_rate = low_passed(filters[0], yaw_rate_rad_s, tuning.gyro_filter_hz, step_s)
    estimate.imu_ahead = low_passed(filters[1], ahead_m_s2, hz, step_s)
    estimate.imu_aside = low_passed(filters[2], aside_m_s2, hz, step_s)


@njit(cache=True, nogil=True)
def draw_current(rover: Any, control: Any) -> None:
    """Draw one loop's current from the battery and count it: by mean motor output, with steered wheels by throttle."""
    first, third = abs(control.servo_1), abs(control.servo_3)
    control.amps = FULL_A * (third if rover.turning_radius_m > 0.0 else 0.5 * (first + third))
    drawn_ah = control.amps * LOOP_S / 3600.0
    rover.drawn_ah += drawn_ah
    control.used_mah += 1000.0 * drawn_ah
    control.used_wh += drawn_ah * (control.rest_v - RESISTANCE_OHM * control.amps)


@njit(cache=True, nogil=True)
def run_loops(
    rovers: Any, records: MotionRecords, origin: Any, noise: Any, draws: Any, surroundings: Surroundings, time_s: float
) -> int:
    """Run main loops from ``time_s`` on until the draws are used up, or something must be reported at once.

    ``noise``: see ``NoiseSettings.as_array``; ``draws``: shape (loops, NOISE_COLUMNS), normal variates. Returns how
    many loops were run: a target reached, a time-out and a new contact end the batch early.
    """
    rover, estimate, control, tuning = rovers[0], records.estimates[0], records.controls[0], records.tunings[0]
    contacts = rover.contacts
    for loop in range(draws.shape[0]):
        control.tick += 1
        update_estimate(estimate, rover, origin, noise, draws[loop])
        run_task(control, tuning, estimate)
        draw_current(rover, control)
        first, third = control.servo_1 * rover.grip_1, control.servo_3 * rover.grip_3
        for _ in range(SUBSTEPS):
            drive(rover, surroundings, first, third, LOOP_S / SUBSTEPS)
            measure(estimate, tuning, rover.yaw_rate_rad_s, rover.accel_m_s2, rover.yaw_rate_rad_s * rover.speed_m_s)
        if surroundings.fleet.radii_m.size > 0:
            meet_movers(rover, surroundings.fleet, time_s + (loop + 1) * LOOP_S)
        if control.arrived or control.timed_out or rover.contacts != contacts:
            return loop + 1
    return int(draws.shape[0])
