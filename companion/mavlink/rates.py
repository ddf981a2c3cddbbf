"""Requests message rates, measures them, and repeats requests that had no effect."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.settings import LinkSettings
from companion.vehicle.commands import RequestRate

WINDOW_S = 3.0
"""Rates are measured over this time."""
ENOUGH = 0.6
"""A rate below this share of the requested one is requested again."""
LONGEST_WAIT_S = 30.0
EKF_HZ = 5.0
"""A second without stops the rover: so several in a row may be lost."""
GPS_HZ = 5.0
"""As often as most receivers have a fix: the position follows a change of fix within a second."""
SLOW_HZ = 2.0
STICKS_HZ = 5.0
THROTTLE_HZ = 10.0
POWER_HZ = 1.0
THROTTLE_UNSEEN = "ground that holds the rover back is not noticed"
STICKS_UNSEEN = "the pilot's sticks are not seen"
HEARTBEAT_HZ = 5.0
"""Only the heartbeat shows mode and arming: at its default of 1 Hz a pilot could be overlooked for a second."""


@dataclass(frozen=True, slots=True)
class WantedRate:
    """A message and the rate at which it is needed.

    ``always`` False: sent only under conditions, so that none at all is no fault. ``told`` False: a low rate is not
    reported to people. ``silence``: what it means if none arrives at all; this is reported.
    """

    message_id: int
    rate_hz: float
    always: bool = True
    told: bool = True
    silence: str = ""


@dataclass(frozen=True, slots=True)
class RateFault:
    """A message whose rate is too low."""

    message_id: int
    wanted_hz: float
    measured_hz: float
    means: str = ""
    """What follows from it, if that is not obvious."""

    @property
    def name(self) -> str:
        """The message's name."""
        return str(mavlink.mavlink_map[self.message_id].msgname)


def wanted_rates(settings: LinkSettings) -> tuple[WantedRate, ...]:
    """The rates that the companion needs; ArduRover's default is 1 Hz for every message.

    OBSTACLE_DISTANCE is not requested: ArduRover refuses to stream it, and the lidar's driver sends it. The target is
    read back only while there is one (not while turning or braking), DISTANCE_SENSOR and RANGEFINDER only with a
    rangefinder, BATTERY_STATUS only with a battery monitor, FENCE_STATUS only while a fence is enabled. The last two
    are requested again although they may be missing for good reason: otherwise a lost request would go unnoticed.
    """
    return (
        WantedRate(mavlink.MAVLINK_MSG_ID_HEARTBEAT, HEARTBEAT_HZ, told=False),
        WantedRate(mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED, settings.position_rate_hz),
        WantedRate(mavlink.MAVLINK_MSG_ID_ATTITUDE, settings.attitude_rate_hz),
        WantedRate(mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT, SLOW_HZ),
        WantedRate(mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT, EKF_HZ),
        WantedRate(mavlink.MAVLINK_MSG_ID_GPS_RAW_INT, GPS_HZ, always=False, told=False),
        WantedRate(mavlink.MAVLINK_MSG_ID_VFR_HUD, THROTTLE_HZ, told=False, silence=THROTTLE_UNSEEN),
        WantedRate(mavlink.MAVLINK_MSG_ID_RC_CHANNELS, STICKS_HZ, told=False, silence=STICKS_UNSEEN),
        WantedRate(mavlink.MAVLINK_MSG_ID_DISTANCE_SENSOR, settings.range_rate_hz, always=False),
        WantedRate(mavlink.MAVLINK_MSG_ID_RANGEFINDER, settings.range_rate_hz, always=False),
        WantedRate(mavlink.MAVLINK_MSG_ID_POSITION_TARGET_GLOBAL_INT, SLOW_HZ, always=False, told=False),
        WantedRate(mavlink.MAVLINK_MSG_ID_SYS_STATUS, POWER_HZ, told=False),
        WantedRate(mavlink.MAVLINK_MSG_ID_BATTERY_STATUS, POWER_HZ, told=False),
        WantedRate(mavlink.MAVLINK_MSG_ID_FENCE_STATUS, POWER_HZ, told=False),
    )


class RateRequester:
    """Requests every rate once, then measures; repeats the request with growing pauses while the rate is too low."""

    def __init__(self, wanted: tuple[WantedRate, ...]) -> None:
        self._wanted = wanted
        self._asked = False
        self._began_s = 0.0
        self._counts: dict[int, int] = {}
        self._wait_s = {rate.message_id: WINDOW_S for rate in wanted}
        self._again_s = {rate.message_id: 0.0 for rate in wanted}
        self.faults: tuple[RateFault, ...] = ()
        """The messages whose rate was too low in the last measurement."""

    def due(self, now_s: float, counts: Mapping[int, int]) -> list[RequestRate]:
        """The requests to send now; ``counts``: messages heard so far, by id."""
        if not self._asked:
            self._asked = True
            self._start_window(now_s, counts)
            for rate in self._wanted:
                self._again_s[rate.message_id] = now_s + self._wait_s[rate.message_id]
            return [RequestRate(rate.message_id, rate.rate_hz) for rate in self._wanted]
        if now_s - self._began_s < WINDOW_S:
            return []
        found = [(rate, self._fault(rate, now_s - self._began_s, counts)) for rate in self._wanted]
        faults = [(rate, fault) for rate, fault in found if fault is not None]
        self.faults = tuple(fault for rate, fault in faults if rate.told or fault.means)
        self._start_window(now_s, counts)
        return [RequestRate(fault.message_id, fault.wanted_hz) for _, fault in faults if self._may_ask(fault, now_s)]

    def _start_window(self, now_s: float, counts: Mapping[int, int]) -> None:
        self._began_s, self._counts = now_s, dict(counts)

    def _fault(self, rate: WantedRate, elapsed_s: float, counts: Mapping[int, int]) -> RateFault | None:
        came = counts.get(rate.message_id, 0) - self._counts.get(rate.message_id, 0)
        enough = came / elapsed_s >= ENOUGH * rate.rate_hz
        if enough:
            self._wait_s[rate.message_id] = WINDOW_S
            self._again_s[rate.message_id] = 0.0
        if enough or (came == 0 and not rate.always):
            return None
        return RateFault(rate.message_id, rate.rate_hz, came / elapsed_s, "" if came else rate.silence)

    def _may_ask(self, fault: RateFault, now_s: float) -> bool:
        if now_s < self._again_s[fault.message_id]:
            return False
        self._wait_s[fault.message_id] = min(2.0 * self._wait_s[fault.message_id], LONGEST_WAIT_S)
        self._again_s[fault.message_id] = now_s + self._wait_s[fault.message_id]
        return True
