"""ArduRover's start-up: when each part becomes available, which texts are sent when, and delays without GPS.

Nouns: ArduRover's start-up.
"""

from __future__ import annotations

from dataclasses import dataclass

from sitl.world.geodesy import ALTITUDE_M

STREAMS_S = 3.0

EKF_SEEN_S = 4.0

ATTITUDE_S = 7.0

HOME_S = 10.0

LOCAL_POSITION_S = 11.0

ORIGIN_S = 19.0

PREARM_S = 24.0

POSITION_S = 42.0

ARMABLE_S = 43.0
"""The firmware's start-up, seconds since boot (measured)."""


@dataclass
class GpsLate:
    """By how many seconds the parts of the start-up that need GPS are delayed."""

    home_s: float = 0.0
    origin_s: float = 0.0
    position_s: float = 0.0


TIMETABLE: tuple[tuple[float, tuple[str, ...]], ...] = (
    (0.0, ("Calibrating barometer", "Barometer 1 calibration complete", "Barometer 2 calibration complete")),
    (1.0, ("Beginning INS calibration. Do not move vehicle", "ArduPilot Ready", "AHRS: DCM active")),
    (4.0, ("EKF3 IMU0 initialised", "EKF3 IMU1 initialised")),
    (5.0, ("EKF3 IMU0 tilt alignment complete", "EKF3 IMU1 tilt alignment complete")),
    (6.0, ("EKF3 IMU0 MAG0 initial yaw alignment complete", "EKF3 IMU1 MAG0 initial yaw alignment complete")),
    (9.0, ("GPS 1: probing for u-blox at 230400 baud", "GPS 1: detected u-blox")),
    (HOME_S, ()),
    (ORIGIN_S, ("EKF3 IMU0 origin set", "EKF3 IMU1 origin set", f"Field Elevation Set: {ALTITUDE_M:.0f}m")),
    (POSITION_S, ("EKF3 IMU0 is using GPS", "EKF3 IMU1 is using GPS", "AHRS: EKF3 active")),
)
"""Texts of the start-up, by seconds since boot (measured)."""
