"""The battery monitor: thresholds for charge and voltage, each believed only after a while.

Nouns: battery monitor.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import IntEnum

from companion.safety.reasons import PowerReason, Reason, WaitReason
from companion.safety.watchdogs import Monitor
from companion.settings import PowerSettings
from companion.vehicle.events import (
    BatterySeen,
    Event,
)
from companion.vehicle.state import VehicleState

STALE_S = 10.0
"""A reading older than this says nothing; SYS_STATUS counts only while no BATTERY_STATUS is younger."""
LOW, CRITICAL, FAILED = 2, 3, 5
"""MAV_BATTERY_CHARGE_STATE: low, and from critical to failed; what comes after that is no matter of charge."""


class BatteryLevel(IntEnum):
    """What the batteries allow. It never goes back: a battery that recovers at rest is still empty."""

    FINE = 0
    RETURN = 1
    HOLD = 2


@dataclass(frozen=True, slots=True)
class BatteryState:
    """The newest of each battery, since when it has been below which threshold, and what followed (and why)."""

    batteries: Mapping[int, BatterySeen] = field(default_factory=dict)
    since_s: Mapping[BatteryLevel, float] = field(default_factory=dict)
    level: BatteryLevel = BatteryLevel.FINE
    reason: Reason[PowerReason] | None = None


def with_battery(state: BatteryState, seen: BatterySeen) -> BatteryState:
    """One more reading."""
    return replace(state, batteries={**state.batteries, seen.number: seen})


def judged(state: BatteryState, now_s: float, settings: PowerSettings) -> BatteryState:
    """The state at this moment: a level is reached when a reading has asked for it for ``after_s`` without a break."""
    known = _known(state.batteries, now_s)
    reasons = {level: _reason(level, known, settings) for level in (BatteryLevel.RETURN, BatteryLevel.HOLD)}
    since_s = {level: state.since_s.get(level, now_s) for level, reason in reasons.items() if reason is not None}
    if since_s != state.since_s:
        state = replace(state, since_s=since_s)
    for level, began_s in since_s.items():
        if level > state.level and now_s - began_s >= settings.after_s:
            state = replace(state, level=level, reason=reasons[level])
    return state


def _known(batteries: Mapping[int, BatterySeen], now_s: float) -> list[BatterySeen]:
    """The batteries that have been heard of lately; the short form only where there is no other."""
    fresh = [seen for seen in batteries.values() if now_s - seen.time_s <= STALE_S]
    return [seen for seen in fresh if seen.number >= 0] or fresh


def _reason(level: BatteryLevel, batteries: list[BatterySeen], settings: PowerSettings) -> Reason[PowerReason] | None:
    """Why this level is asked for, by the first battery that does; None if none does."""
    percent, volts = settings.return_percent, settings.return_volts
    states = range(LOW, FAILED + 1)
    if level is BatteryLevel.HOLD:
        percent, volts = settings.hold_percent, settings.hold_volts
        states = range(CRITICAL, FAILED + 1)
    for seen in batteries:
        name = "battery" if seen.number <= 0 else f"battery {seen.number + 1}"
        if seen.percent is not None and seen.percent < percent:
            return Reason(PowerReason.CHARGE, (name, seen.percent))
        if seen.volts is not None and seen.volts < volts:
            return Reason(PowerReason.VOLTAGE, (name, round(seen.volts, 1)))
        if settings.heed_autopilot and seen.charge_state in states:
            return Reason(PowerReason.LOW if seen.charge_state == LOW else PowerReason.CRITICAL, (name,))
    return None


class BatteryMonitor(Monitor):
    """Keeps the batteries' state. It has no doubt: with a low battery the rover may move, to return."""

    def __init__(self, settings: PowerSettings) -> None:
        self.state = BatteryState()
        self._settings = settings

    def take(self, event: Event, vehicle: VehicleState) -> None:
        """One more event."""
        if isinstance(event, BatterySeen):
            self.state = with_battery(self.state, event)

    def level(self, now_s: float) -> BatteryLevel:
        """What they allow now."""
        self.state = judged(self.state, now_s, self._settings)
        return self.state.level

    def awaited(self, now_s: float) -> Reason[WaitReason] | None:
        """What a rover that has not begun yet waits for. Unlike a level this ends when the battery is another one."""
        reason = _reason(BatteryLevel.RETURN, _known(self.state.batteries, now_s), self._settings)
        return None if reason is None else Reason(WaitReason.CHARGED_BATTERY, (reason,))

    @property
    def reason(self) -> Reason[PowerReason] | None:
        """Why the level was reached."""
        return self.state.reason
