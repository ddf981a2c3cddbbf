"""The pilot's sticks, as RC_CHANNELS shows them: a transmitter's, or those of a ground station that overrides them.

ArduRover in GUIDED does not obey them: it steers as it is told, and takes more than half throttle as a wish to go faster than
that (`Mode::calc_speed_nudge`). So a pilot who grabs the sticks would be left without the rover: the companion gives it up.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

MIDDLE_US = 1500
MOVED_US = 100
"""A fifth of the way from the middle to the end."""
IN_A_ROW = 2
"""So many messages must show it: one alone may be a disturbed receiver."""
PULSES_US = range(800, 2201)
"""Anything else is no pulse of a receiver: 0 and 65535 stand for a channel that is not there."""


@dataclass(frozen=True, slots=True)
class SticksSeen:
    """RC_CHANNELS: channel 1 steers and channel 3 is the throttle, as ArduRover has it by default, in microseconds."""

    time_s: float
    steering_us: int
    throttle_us: int


@dataclass(frozen=True, slots=True)
class Sticks:
    """Where the sticks were when the companion was given the rover, and for how many messages they have been elsewhere."""

    rest_us: tuple[int, int] | None = None
    away: int = 0

    @property
    def moved(self) -> bool:
        """Whether a person has taken hold of them."""
        return self.away >= IN_A_ROW


def followed(sticks: Sticks, event: SticksSeen) -> Sticks:
    """After one more message. Letting go is not taking hold: a stick that comes back to the middle rests there."""
    now_us = (event.steering_us, event.throttle_us)
    if not all(pulse in PULSES_US for pulse in now_us):
        return sticks
    if sticks.rest_us is None:
        return Sticks(now_us)
    rest_us = tuple(_between(still, now) for still, now in zip(sticks.rest_us, now_us, strict=True))
    away = any(abs(now - rest) > MOVED_US for rest, now in zip(rest_us, now_us, strict=True))
    return replace(sticks, rest_us=(rest_us[0], rest_us[1]), away=sticks.away + 1 if away else 0)


def _between(rest_us: int, now_us: int) -> int:
    """The place nearest to ``now_us`` from where it rested to the middle."""
    return min(max(now_us, min(rest_us, MIDDLE_US)), max(rest_us, MIDDLE_US))
