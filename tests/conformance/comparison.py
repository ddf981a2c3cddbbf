"""What a replay differs in from its recording, each difference as a name that the list of tolerated ones can hold."""

from __future__ import annotations

from collections import Counter
from typing import Any

from tests.conformance.recordings import Heard, Replay
from tests.conformance.sheet import ANSWERS

DRIVABLE_S = 43.5
NOT_COMPARED = (
    "time_boot_ms",
    "time_usec",
    "time_unix_usec",
    "lat",
    "lon",
    "lng",
    "lat_int",
    "lon_int",
    "hdg",
    "heading",
    "cog",
    "yaw",
    "bearing",
)
"""Fields of a stream whose values are not compared as numbers: clocks, places and directions, which the motion
decides."""
WINDOW_S = 5.0
"""Rates are compared over windows of this length."""
BOOTED_S = 3.2
"""Until then the firmware sends heartbeats as its set-up goes along, faster than in vehicle seconds."""
ANSWERED = {
    "COMMAND_ACK": ("command", "result", "target_system", "target_component"),
    "MISSION_ACK": ("type", "target_system", "target_component"),
    "MISSION_COUNT": ("count", "target_system", "target_component"),
    "MISSION_REQUEST": ("seq", "target_system", "target_component"),
    "MISSION_ITEM_INT": ("seq", "frame", "command", "current", "autocontinue", "param1", "param2", "x", "y"),
    "PARAM_VALUE": ("param_id", "param_value", "param_type", "param_index"),
    "AUTOPILOT_VERSION": ("capabilities",),
    "HOME_POSITION": ("latitude", "longitude"),
    "GPS_GLOBAL_ORIGIN": ("latitude", "longitude"),
}
"""Kinds that somebody asked for, and what in them is compared."""
STATES = {
    "HEARTBEAT": ("type", "autopilot", "base_mode", "custom_mode", "system_status"),
    "EKF_STATUS_REPORT": ("flags",),
    "GPS_RAW_INT": ("fix_type", "satellites_visible", "eph", "epv"),
    "SYS_STATUS": (
        "onboard_control_sensors_present", "onboard_control_sensors_enabled", "onboard_control_sensors_health",
    ),
    "MISSION_CURRENT": ("seq", "total", "mission_state", "mission_mode"),
    "POSITION_TARGET_GLOBAL_INT": ("coordinate_frame", "type_mask"),
    "RC_CHANNELS": ("chancount", "chan1_raw", "chan3_raw", "chan5_raw", "rssi"),
    "NAV_CONTROLLER_OUTPUT": ("nav_roll", "nav_pitch", "alt_error", "aspd_error"),
    "DISTANCE_SENSOR": ("min_distance", "max_distance", "type", "covariance"),
    "MISSION_ITEM_REACHED": ("seq",),
    "BATTERY_STATUS": ("id", "battery_function", "type", "charge_state"),
}  # fmt: skip
"""Fields whose sequence of values is compared."""


def fields_of(message: Any, names: tuple[str, ...]) -> tuple[Any, ...]:
    """The values of some fields."""
    return tuple(getattr(message, name) for name in names)


def asked_parameters(replay: Replay) -> set[str]:
    """Parameters that the client read or set; the firmware tells others by itself."""
    return {message.param_id for message in replay.asked if message.get_type() in ("PARAM_REQUEST_READ", "PARAM_SET")}


def answered(replay: Replay, heard: tuple[Heard, ...]) -> list[tuple[Any, ...]]:
    """Every answer in order, with what is compared of it."""
    asked = asked_parameters(replay)
    found = []
    for message in (
        one.message for one in heard if one.time_s > BOOTED_S + 10.0 or one.message.get_type() == "COMMAND_ACK"
    ):
        kind = message.get_type()
        if kind in ANSWERED and (kind != "PARAM_VALUE" or message.param_id in asked):
            found.append((kind, *fields_of(message, ANSWERED[kind])))
    return found


def answers_differ(replay: Replay) -> set[str]:
    """Answers that only one of the two gave, or gave in another order."""
    real, ours = answered(replay, replay.real), answered(replay, replay.ours)
    real_count, our_count = Counter(real), Counter(ours)
    wrong = {f"answer missing: {one}" for one in real_count - our_count}
    wrong |= {f"answer of our own: {one}" for one in our_count - real_count}
    common = {one for one, count in real_count.items() if our_count[one] == count}
    pairs = zip((one for one in real if one in common), (one for one in ours if one in common), strict=False)
    return wrong | {f"order of answers: {one} / {other}" for one, other in pairs if one != other}


def said(heard: tuple[Heard, ...]) -> list[str]:
    """Texts with their severity, in order."""
    return [f"{one.message.severity} {one.message.text}" for one in heard if one.message.get_type() == "STATUSTEXT"]


def texts_differ(replay: Replay) -> set[str]:
    """Texts of one of the two, chunks as they are; those after the recording's end do not count."""
    real, ours = said(replay.real), said(tuple(one for one in replay.ours if one.time_s <= replay.real[-1].time_s))
    wrong = {f"text missing: {text}" for text in Counter(real) - Counter(ours)}
    return wrong | {f"text of our own: {text}" for text in Counter(ours) - Counter(real)}


def parameters_told(replay: Replay) -> set[str]:
    """Groups of parameters that only one of the two tells of unasked."""
    asked = asked_parameters(replay)

    def told(heard: tuple[Heard, ...]) -> set[str]:
        messages = (one.message for one in heard if one.message.get_type() == "PARAM_VALUE")
        return {
            message.param_id.split("_")[0].rstrip("0123456789") for message in messages if message.param_id not in asked
        }

    real, ours = told(replay.real), told(replay.ours)
    return {f"parameter untold: {name}" for name in real - ours} | {f"parameter told: {name}" for name in ours - real}


def kinds_differ(replay: Replay) -> set[str]:
    """Kinds of messages that only one of the two sent."""
    real, ours = ({one.message.get_type() for one in heard} - {"PARAM_VALUE"} for heard in (replay.real, replay.ours))
    return {f"kind missing: {kind}" for kind in real - ours} | {f"kind of our own: {kind}" for kind in ours - real}


def rates(heard: tuple[Heard, ...]) -> Counter[tuple[str, int]]:
    """How many of each streamed kind came in each window."""
    return Counter(
        (f"{one.message.get_type()} {getattr(one.message, 'id', '')}".strip(), int(one.time_s / WINDOW_S))
        for one in heard
        if one.time_s > BOOTED_S and one.message.get_type() not in ANSWERS and one.message.get_type() != "STATUSTEXT"
    )


def rates_differ(replay: Replay) -> set[str]:
    """Streams that came more or less often than recorded, by more than 4 % and two messages in a window.

    The recording's clock is good to a tenth of a second, and a message may fall on either side of a window's end.
    """
    real, ours = rates(replay.real), rates(replay.ours)
    last = int(replay.real[-1].time_s / WINDOW_S)
    both = {kind for kind, _ in real} & {kind for kind, _ in ours}
    return {
        f"rate of {kind}: {real[kind, window]} / {ours[kind, window]} in 5 s from {window * WINDOW_S:.0f} s"
        for kind, window in {*real, *ours}
        if kind in both
        and window < last
        and abs(real[kind, window] - ours[kind, window]) > 2.0 + 0.04 * real[kind, window]
    }


def changes(heard: tuple[Heard, ...], kind: str) -> list[tuple[Any, ...]]:
    """The values that the fields of a kind take, one after the other."""
    values = [fields_of(one.message, STATES[kind]) for one in heard if one.message.get_type() == kind]
    return [value for value, before in zip(values, [None, *values], strict=False) if value != before]


def states_differ(replay: Replay) -> set[str]:
    """States that are told in other values or another order."""
    wrong = set()
    for kind in STATES:
        real, ours = changes(replay.real, kind), changes(replay.ours, kind)
        if real and ours and real != ours:
            at = next(i for i, pair in enumerate(zip([*real, None], [*ours, None], strict=False)) if pair[0] != pair[1])
            wrong.add(f"state of {kind}: {[*real, None][at]} / {[*ours, None][at]}")
    return wrong


def ranges_of(heard: tuple[Heard, ...]) -> dict[str, tuple[float, float]]:
    """Smallest and largest value of every plain number that is streamed once the rover can be driven."""
    found: dict[str, tuple[float, float]] = {}
    for one in heard:
        kind = one.message.get_type()
        if one.time_s < DRIVABLE_S or kind in ANSWERS or kind == "STATUSTEXT":
            continue
        for name, value in one.message.to_dict().items():
            if isinstance(value, int | float) and not name.endswith(NOT_COMPARED):
                least, most = found.get(f"{kind}.{name}", (value, value))
                found[f"{kind}.{name}"] = min(least, value), max(most, value)
    return found


def values_differ(replay: Replay) -> set[str]:
    """Streamed numbers that leave the recorded range by over a tenth of the largest, 0.05 or 5 (integers)."""
    real, ours = ranges_of(replay.real), ranges_of(replay.ours)
    wrong = set()
    for name in set(real) & set(ours):
        room = 0.1 * max(map(abs, real[name])) + (5 if isinstance(real[name][0], int) else 0.05)
        if not (real[name][0] - room <= ours[name][0] and ours[name][1] <= real[name][1] + room):
            wrong.add(f"value of {name}")
    return wrong


def empty_ranges_differ(replay: Replay) -> set[str]:
    """What a rangefinder tells when it sees nothing."""
    real, ours = (
        max((one.message.current_distance for one in heard if one.message.get_type() == "DISTANCE_SENSOR"), default=0)
        for heard in (replay.real, replay.ours)
    )
    return set() if real == ours else {f"largest range: {real} / {ours}"}


def places_differ(replay: Replay) -> set[str]:
    """Read-back targets that are not the recorded ones, to 1e-7 degree."""

    def places(heard: tuple[Heard, ...]) -> list[tuple[int, int]]:
        found = [
            (one.message.lat_int, one.message.lon_int)
            for one in heard
            if one.message.get_type() == "POSITION_TARGET_GLOBAL_INT"
        ]
        return [place for place, before in zip(found, [None, *found], strict=False) if place != before]

    real, ours = places(replay.real), places(replay.ours)
    if len(real) != len(ours):
        return {f"targets read back: {len(real)} / {len(ours)}"}
    apart = [max(abs(a - b) for a, b in zip(one, other, strict=True)) for one, other in zip(real, ours, strict=True)]
    return {f"target read back {at}: {real[at]} / {ours[at]}" for at, units in enumerate(apart) if units > 1}


def differences(replay: Replay) -> set[str]:
    """Everything that is compared message by message."""
    return (
        answers_differ(replay) | texts_differ(replay) | parameters_told(replay) | kinds_differ(replay)
        | rates_differ(replay) | states_differ(replay) | places_differ(replay)
        | values_differ(replay) | empty_ranges_differ(replay)
    )  # fmt: skip
