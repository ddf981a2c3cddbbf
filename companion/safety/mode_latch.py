"""Who may drive, and whether it is safe to: the pilot-wins latch and the watchdogs. Pure functions, no I/O."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from enum import StrEnum

from companion.settings import SafetySettings
from companion.vehicle.state import VehicleState

HOLD_AGAIN_S = 2.0
"""A heartbeat that still shows GUIDED so long after our HOLD means that HOLD never arrived."""


class Control(StrEnum):
    """Who drives."""

    NOBODY = "nobody"
    """The companion has not had the rover yet."""
    COMPANION = "companion"
    PERSON = "person"
    """A person (or a failsafe) took over: the companion is silent until the mode is GUIDED again."""


@dataclass(frozen=True, slots=True)
class LatchState:
    """The state of latch and watchdogs."""

    control: Control = Control.NOBODY
    unsafe_since_s: float | None = None
    hold_sent: bool = False
    hold_s: float = math.inf
    """When HOLD was sent."""


class Reaction(StrEnum):
    """What the companion does in this tick."""

    SILENT = "silent"
    DRIVE = "drive"
    STOP = "stop"
    HOLD = "hold"


@dataclass(frozen=True, slots=True)
class Verdict:
    """The reaction and its reason (empty when all is well)."""

    reaction: Reaction
    reason: str = ""


def latched(control: Control, vehicle: VehicleState) -> Control:
    """Who drives, by the mode: GUIDED (or a leg that AUTO hands over) is the companion's; a rover that leaves it is a person's."""
    if vehicle.is_ours:
        return Control.COMPANION
    return Control.NOBODY if control is Control.NOBODY else Control.PERSON


def check(
    watch: LatchState, vehicle: VehicleState, now_s: float, settings: SafetySettings, doubt: str = ""
) -> tuple[LatchState, Verdict]:
    """One tick of latch and watchdogs. ``doubt``: a reason of the caller's own why the rover must not move.

    Setpoints may be sent only on DRIVE and STOP. Unsafe for longer than ``hold_after_s``: HOLD once, then silence until a
    person puts the vehicle back into GUIDED.
    """
    control = latched(watch.control, vehicle)
    heartbeat = vehicle.heartbeat
    if heartbeat is None or control is not Control.COMPANION:
        return LatchState(control), Verdict(Reaction.SILENT, "" if control is Control.NOBODY else _not_ours(vehicle))
    if watch.hold_sent:
        # The heartbeat may still show GUIDED just after our own HOLD: wait until it has been seen to leave GUIDED.
        if heartbeat.armed and heartbeat.time_s >= watch.hold_s + HOLD_AGAIN_S:
            return replace(watch, hold_s=now_s), Verdict(Reaction.HOLD, "the first HOLD was not taken")
        return watch, Verdict(Reaction.SILENT, "HOLD was asked for")
    watch = replace(watch, control=control)
    if not heartbeat.armed:
        return replace(watch, unsafe_since_s=None), Verdict(Reaction.SILENT, "disarmed")
    if vehicle.sticks.moved:
        return LatchState(Control.PERSON, None, hold_sent=True, hold_s=now_s), Verdict(
            Reaction.HOLD, "the sticks were moved"
        )
    reason = unsafe_reason(vehicle, now_s, settings) or doubt
    if not reason:
        return replace(watch, unsafe_since_s=None), Verdict(Reaction.DRIVE)
    since_s = now_s if watch.unsafe_since_s is None else watch.unsafe_since_s
    if now_s - since_s >= settings.hold_after_s:
        return LatchState(Control.PERSON, since_s, hold_sent=True, hold_s=now_s), Verdict(Reaction.HOLD, reason)
    return replace(watch, unsafe_since_s=since_s), Verdict(Reaction.STOP, reason)


def awaited(vehicle: VehicleState, now_s: float, settings: SafetySettings) -> str:
    """What a companion that has fallen silent waits for, in words, so that a person knows what to do; empty for nothing.

    A rover that has been disarmed, as one is whose autopilot has restarted, is never armed by this run again.
    """
    heartbeat = vehicle.heartbeat
    if heartbeat is None or now_s - heartbeat.time_s > settings.heartbeat_s:
        return "the autopilot to be heard again"
    wanted = [] if heartbeat.mode == vehicle.own_mode else [f"set {vehicle.own_mode.name}"]
    if not heartbeat.armed:
        wanted.append("arm (or end this run, and start it again with --arm)")
    if not wanted:
        return ""
    data = data_reason(vehicle, now_s, settings)
    return f"{f'good data ({data}) and ' if data else ''}a person to {' and '.join(wanted)}"


def unsafe_reason(vehicle: VehicleState, now_s: float, settings: SafetySettings) -> str:
    """Why the rover must not move now, in words; empty when it may. The latter two are over when a person sets GUIDED."""
    if reason := data_reason(vehicle, now_s, settings):
        return reason
    if vehicle.restarted:
        return "the autopilot's clock has run back"
    return "position stands still while the velocity says otherwise" if vehicle.frozen else ""


def data_reason(vehicle: VehicleState, now_s: float, settings: SafetySettings) -> str:
    """What is missing, old or wrong in the data itself, so that nobody may drive on it; empty when it is good."""
    ages = (
        ("autopilot heartbeat", vehicle.heartbeat, settings.heartbeat_s),
        ("position", vehicle.position, settings.stale_s),
        ("attitude", vehicle.attitude, settings.stale_s),
        ("range data ahead", vehicle.scan_ahead, settings.stale_s),
        ("EKF status", vehicle.ekf, settings.stale_s),
    )
    for name, event, limit_s in ages:
        if event is None:
            return f"no {name}"
        if now_s - event.time_s > limit_s:
            return f"{name} silent for over {limit_s:g} s"
    if vehicle.ekf_lacks:
        return f"EKF has no {vehicle.ekf_lacks}"
    if now_s - vehicle.latency.jumped_s < settings.settle_s:
        return "the autopilot's clock has jumped"
    if vehicle.latency.lasting_s > settings.latency_s:
        return f"link later than {settings.latency_s:g} s"
    return ""


def _not_ours(vehicle: VehicleState) -> str:
    """Why the companion must not steer, by the mode."""
    heartbeat = vehicle.heartbeat
    if vehicle.in_auto and heartbeat is not None and heartbeat.mode == vehicle.own_mode:
        return "AUTO goes on by itself"
    return f"mode is not {vehicle.own_mode.name}"
