"""The EKF with a silent or wrong GPS: its position error, aiding, glitches, the fall-back to DCM, and the EKF failsafe.

Behaviour of NavEKF3 (aiding, time-outs, innovation gate, glitch flag), of the AHRS (fall-back to DCM, which trusts
the GPS) and of Rover's EKF check, ten times a second. Measured: with a silent GPS, HOLD with "EKF failsafe" after 8
s; the rest is from the firmware's source. The estimate is the truth plus ``offset_m``; this module computes that
offset.

Nouns: NavEKF3.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from enum import Enum

import numpy as np

STEP_S = 0.1

GPS_SILENT_S = 4.0
"""After this silence the receiver's driver gives up, and the EKF no longer counts as using GPS."""

ALONE_S, ALONE_WITH_SPEED_S = 7.0, 10.0
"""A position that GPS has not confirmed for this long is given up: without GPS speed, and with it."""

AIDING_ENDS_S = 15.0

GATE_M = 2.7
"""EK3_POS_I_GATE of 5 standard deviations, each EK3_POSNE_M_NSE of 0.5 m and a little of the estimate's own."""

FOLLOWS_S = 1.0
"""Time constant with which the estimate follows an accepted GPS. Our assumption: the gain depends on the EKF's state.
"""

DRIFT_M_S2 = 0.03
"""Acceleration error (standard deviation) with inertial sensors alone. Our assumption, for a small MEMS sensor."""

GLITCH_SEEN_S, GLITCH_OVER_S = 1.0, 10.0

FAILED_CHECKS = 10

GOOD, NO_POSITION, CONSTANT_POSITION, GLITCH = 831, 37, 167, 32768
"""EKF_STATUS_REPORT flags: everything; attitude, vertical speed and height alone; a constant position; the bit for
glitches."""


NO_FIX, RTK_FIXED = 1, 6
"""GPS_FIX_TYPE."""


class Source(Enum):
    """The estimator whose position the autopilot uses."""

    EKF = "EKF3"
    DCM = "DCM"


class Change(Enum):
    """A change in a step that must be reported or acted on; values are texts of the firmware, where it has one."""

    STOPPED_AIDING = "EKF3 IMU0 stopped aiding"
    USING_GPS = "EKF3 IMU0 is using GPS"
    TO_DCM = "AHRS: DCM active"
    TO_EKF = "AHRS: EKF3 active"
    FAILED = "failed"
    CLEARED = "cleared"


@dataclass
class Gps:
    """The GPS receiver: whether it has a position, its error in metres north and east, and what it says of its fix.

    ``fix_type``: by GPS_FIX_TYPE. ``told``: whether GPS_RAW_INT is sent.
    """

    talks: bool = True
    fix_type: int = RTK_FIXED
    told: bool = True
    error_m: tuple[float, float] = (0.0, 0.0)
    heard_s: float = 0.0


@dataclass
class Ekf:
    """The EKF's position, once it has had one. Times in seconds since boot."""

    gps: Gps = field(default_factory=Gps)
    offset_m: tuple[float, float] = (0.0, 0.0)
    drift_m_s: tuple[float, float] = (0.0, 0.0)
    aiding: bool = True
    source: Source = Source.EKF
    test_ratio: float = 0.0
    """Position innovation relative to the gate; from 1 on the GPS is rejected."""
    failsafe: bool = False
    late_s: float = 0.0
    """How many seconds the GPS part of the start-up is delayed."""
    _passed_s: float = 0.0
    _consistent_s: float = 0.0
    _inconsistent_s: float = -math.inf
    _glitch: bool = False
    _drift_m_s2: tuple[float, float] = (0.0, 0.0)
    _failed_checks: int = 0

    @property
    def has_position(self) -> bool:
        """Whether the autopilot navigates with the EKF."""
        return self.source is Source.EKF and self.aiding and not self._timed_out

    @property
    def shown_m(self) -> tuple[float, float] | None:
        """The error of the reported position; None when there is none, and the last position is reported again."""
        if self.source is Source.EKF:
            return self.offset_m
        return self.gps.error_m if self.gps_has_fix else None

    @property
    def gps_has_fix(self) -> bool:
        """As the receiver's driver sees it: the last fix counts for some seconds."""
        return self.gps.talks or self._silence_s < GPS_SILENT_S

    @property
    def flags(self) -> int:
        """EKF_STATUS_REPORT's flags."""
        if not self.aiding:
            return CONSTANT_POSITION
        return (NO_POSITION if self._timed_out else GOOD) | (GLITCH if self._glitch else 0)

    _timed_out: bool = False
    _silence_s: float = 0.0

    def step(self, now_s: float, armed: bool, rng: np.random.Generator) -> list[Change]:
        """One step of ``STEP_S``: fuse the GPS, or continue by dead reckoning, then run the checks."""
        self._silence_s = 0.0 if self.gps.talks else now_s - self.gps.heard_s
        changes = self._fuse(now_s) if self.gps.talks else self._dead_reckon(now_s, rng)
        limit_s = ALONE_WITH_SPEED_S if self._silence_s < ALONE_S else ALONE_S
        self._timed_out = now_s - self._passed_s > limit_s + 1e-6
        changes += self._choose_source(now_s, armed)
        return changes + self._check(armed)

    def begin(self, now_s: float) -> None:
        """End of the start-up: the EKF has a position."""
        self._passed_s = self._consistent_s = self.gps.heard_s = now_s
        self.offset_m = self.gps.error_m

    def _fuse(self, now_s: float) -> list[Change]:
        self.gps.heard_s = now_s
        self.drift_m_s = self._drift_m_s2 = (0.0, 0.0)
        error_n, error_e = self.gps.error_m
        gap_n, gap_e = error_n - self.offset_m[0], error_e - self.offset_m[1]
        self.test_ratio = math.hypot(gap_n, gap_e) / GATE_M
        changes = []
        if not self.aiding:
            self.aiding = True
            changes.append(Change.USING_GPS)
            self._reset_to_gps(now_s)
        elif self._timed_out or now_s - self._passed_s > ALONE_WITH_SPEED_S:
            self._reset_to_gps(now_s)
        elif self.test_ratio < 1.0:
            share = 1.0 - math.exp(-STEP_S / FOLLOWS_S)
            self.offset_m = self.offset_m[0] + share * gap_n, self.offset_m[1] + share * gap_e
            self._passed_s = now_s
        self._check_glitch(now_s)
        return changes

    def _reset_to_gps(self, now_s: float) -> None:
        """Reset the estimate to the GPS position."""
        self.offset_m = self.gps.error_m
        self._passed_s = now_s
        self.test_ratio = 0.0

    def _check_glitch(self, now_s: float) -> None:
        if self.test_ratio < 1.0:
            self._consistent_s = now_s
        else:
            self._inconsistent_s = now_s
        if now_s - self._consistent_s > GLITCH_SEEN_S:
            self._glitch = True
        elif now_s - self._inconsistent_s > GLITCH_OVER_S:
            self._glitch = False

    def _dead_reckon(self, now_s: float, rng: np.random.Generator) -> list[Change]:
        """Dead reckoning with inertial sensors: the velocity error grows."""
        if self._drift_m_s2 == (0.0, 0.0):
            north, east = rng.normal(0.0, DRIFT_M_S2, size=2)
            self._drift_m_s2 = float(north), float(east)
        if not self.aiding:
            return []
        vn, ve = (v + a * STEP_S for v, a in zip(self.drift_m_s, self._drift_m_s2, strict=True))
        self.drift_m_s = vn, ve
        self.offset_m = self.offset_m[0] + vn * STEP_S, self.offset_m[1] + ve * STEP_S
        self._consistent_s = now_s
        if now_s - self._passed_s <= AIDING_ENDS_S + 1e-6:
            return []
        self.aiding = self._glitch = False
        self.drift_m_s = (0.0, 0.0)
        return [Change.STOPPED_AIDING]

    def _choose_source(self, now_s: float, armed: bool) -> list[Change]:
        """Rover's AHRS switches to DCM when the EKF rejects a GPS with a fix, or has no position."""
        uses_gps = self.aiding and now_s - self._passed_s < GPS_SILENT_S
        refuses_gps = armed and self.gps_has_fix and not uses_gps
        lost = self._timed_out or not self.aiding
        source = Source.DCM if refuses_gps or lost else Source.EKF
        if source is self.source:
            return []
        self.source = source
        return [Change.TO_DCM if source is Source.DCM else Change.TO_EKF]

    def _check(self, armed: bool) -> list[Change]:
        """Rover's EKF check: one second without a position is a failure, one second with a position clears it."""
        if not armed:
            self._failed_checks = 0
        elif not self.has_position:
            self._failed_checks = min(self._failed_checks + 1, FAILED_CHECKS)
        else:
            self._failed_checks = max(self._failed_checks - 1, 0)
        if not self.failsafe and self._failed_checks == FAILED_CHECKS:
            self.failsafe = True
            return [Change.FAILED]
        if self.failsafe and self._failed_checks == 0:
            self.failsafe = False
            return [Change.CLEARED]
        return []
