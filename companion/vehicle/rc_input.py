"""Whether a pilot moves the RC sticks, by RC_CHANNELS: a transmitter's, or a ground station's that overrides them.

ArduRover in GUIDED ignores the sticks: it follows its target, and more than half throttle only raises the speed
(`Mode::calc_speed_nudge`). So that a pilot can take over with the sticks, the companion gives the rover up.

Nouns: sticks.
"""

from __future__ import annotations

from dataclasses import dataclass

MIDDLE_US = 1500
MOVED_US = 100
"""A fifth of the way from the middle to the end."""
IN_A_ROW = 2
"""Messages that must show the movement: a single one may come from a disturbed receiver."""
PULSES_US = range(800, 2201)
"""Pulses of a receiver; 0 and 65535 stand for a missing channel."""


@dataclass(frozen=True, slots=True)
class SticksSeen:
    """RC_CHANNELS in microseconds: channel 1 steers and channel 3 is the throttle, ArduRover's defaults."""

    time_s: float
    steering_us: int
    throttle_us: int


@dataclass(frozen=True, slots=True)
class Sticks:
    """Where the sticks rest, and how many messages in a row have shown them elsewhere."""

    rest_us: tuple[int, int] | None = None
    away: int = 0

    @property
    def moved(self) -> bool:
        """Whether a pilot has moved them."""
        return self.away >= IN_A_ROW


def sticks_after(sticks: Sticks, event: SticksSeen) -> Sticks:
    """The state after one more message.

    Letting go does not count: a stick that returns towards the middle rests there.
    """
    now_us = (event.steering_us, event.throttle_us)
    if not all(pulse in PULSES_US for pulse in now_us):
        return sticks
    if sticks.rest_us is None:
        return Sticks(now_us)
    rest_us = tuple(_new_rest_us(rest, now) for rest, now in zip(sticks.rest_us, now_us, strict=True))
    away = any(abs(now - rest) > MOVED_US for rest, now in zip(rest_us, now_us, strict=True))
    return Sticks((rest_us[0], rest_us[1]), sticks.away + 1 if away else 0)


def _new_rest_us(rest_us: int, now_us: int) -> int:
    """The value nearest to ``now_us`` between the old rest and the middle."""
    return min(max(now_us, min(rest_us, MIDDLE_US)), max(rest_us, MIDDLE_US))
