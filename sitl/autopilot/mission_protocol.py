"""Upload and download of mission, fence and rally points (behaviour of MissionItemProtocol).

One uploader at a time. Mission and rally points are written as they arrive, the fence only when it is complete. A
cancelling MISSION_ACK is ignored: an abandoned upload ends after eight seconds.

Nouns: MissionItemProtocol.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.core.severity import Severity
from sitl.autopilot.channel import Channel
from sitl.autopilot.destination import go_to
from sitl.autopilot.mission_items import (
    JUMP,
    WAYPOINT,
    Item,
    RefusedError,
    Result,
    fence_fault,
    fence_item,
    mission_item,
    rally_item,
)
from sitl.autopilot.state import FENCE, MISSION, RALLY, Mode, Upload
from sitl.autopilot.vehicle import Vehicle, text_messages
from sitl.world.geodesy import ALTITUDE_M

MOST = {MISSION: 724, FENCE: 84, RALLY: 50}
"""Number of items that fit into the storage of a common flight controller (16 kB)."""


def type_of(message: Any) -> int:
    """MAV_MISSION_TYPE of a message; the first version of MAVLink knows missions only."""
    return int(getattr(message, "mission_type", 0))


def acknowledge(channel: Channel, message: Any, result: int) -> None:
    """MISSION_ACK to the sender of a message."""
    channel.send(
        mavlink.MAVLink_mission_ack_message(
            message.get_srcSystem(), message.get_srcComponent(), int(result), type_of(message)
        )
    )


def warn_once(vehicle: Vehicle, kind: int, text: str) -> None:
    """Send a complaint, once for each type of list."""
    if (kind, text) not in vehicle.complaints:
        vehicle.complaints.add((kind, text))
        vehicle.say(Severity.WARNING, text)


def stored(vehicle: Vehicle, kind: int) -> list[Item]:
    """The stored items of a type; the first of a mission is home."""
    storage = vehicle.storage
    return {MISSION: storage.mission, FENCE: storage.fence, RALLY: storage.rally}[kind]


def request_list(vehicle: Vehicle, channel: Channel, message: Any) -> None:
    """MISSION_REQUEST_LIST: how many items there are."""
    kind = type_of(message)
    if kind not in MOST:
        acknowledge(channel, message, Result.UNSUPPORTED)
    elif kind in vehicle.uploads:
        acknowledge(channel, message, Result.DENIED)
    else:
        _send_count(vehicle, channel, message, kind)


def _send_count(vehicle: Vehicle, channel: Channel, message: Any, kind: int) -> None:
    channel.send(
        mavlink.MAVLink_mission_count_message(
            message.get_srcSystem(), message.get_srcComponent(), len(stored(vehicle, kind)), kind
        )
    )


def request_int(vehicle: Vehicle, channel: Channel, message: Any) -> None:
    """MISSION_REQUEST_INT: one item; not while a new list is arriving."""
    kind = type_of(message)
    if kind in vehicle.uploads:
        acknowledge(channel, message, Result.DENIED)
    elif kind in MOST:
        _send_item(vehicle, channel, message, kind, as_int=True)


def request(vehicle: Vehicle, channel: Channel, message: Any) -> None:
    """MISSION_REQUEST: one item as the older MISSION_ITEM, with coordinates in single precision."""
    kind = type_of(message)
    if kind in MOST and _send_item(vehicle, channel, message, kind, as_int=False):
        warn_once(vehicle, kind, "got MISSION_REQUEST; use MISSION_REQUEST_INT!")


def _send_item(vehicle: Vehicle, channel: Channel, message: Any, kind: int, as_int: bool) -> bool:
    """Send an item; False if there is none."""
    items, seq = stored(vehicle, kind), int(message.seq)
    if seq >= len(items) and not (kind == MISSION and seq == 0):
        if kind == MISSION:
            _send_count(vehicle, channel, message, kind)
        beyond = kind == RALLY or (kind == FENCE and seq > len(items))
        acknowledge(channel, message, Result.INVALID_SEQUENCE if beyond else Result.ERROR)
        return False
    one = Item(WAYPOINT, 0, x=vehicle.home[0], y=vehicle.home[1], z=ALTITUDE_M)
    if kind != MISSION or seq > 0:
        one = items[seq]
    # The firmware compares the command, not the index, with the present index.
    current = int(kind == MISSION and one.command == vehicle.mission.nav_index)
    scale = 1 if as_int or one.command in (mavlink.MAV_CMD_DO_DIGICAM_CONFIGURE, 203) else 1e-7
    kinds = (mavlink.MAVLink_mission_item_message, mavlink.MAVLink_mission_item_int_message)
    channel.send(
        kinds[as_int](
            message.get_srcSystem(), message.get_srcComponent(), seq, one.frame, one.command, current,
            int(kind == MISSION), *one.params, one.x * scale, one.y * scale, one.z, kind,
        )
    )  # fmt: skip
    return True


ASK_AGAIN_US, GIVE_UP_US = 1_000_000, 8_000_000

DONE_TEXTS = {MISSION: "Flight plan received", RALLY: "Rally points received"}

TIMEOUT_TEXTS = {MISSION: "Mission upload timeout", FENCE: "Fence upload timeout", RALLY: "Rally upload timeout"}

TOTALS = {MISSION: "MIS_TOTAL", FENCE: "FENCE_TOTAL", RALLY: "RALLY_TOTAL"}

Handler = Callable[[Vehicle, Channel, Any], None]


def _say(channel: Channel, severity: Severity, text: str) -> None:
    """Send a text on this channel alone."""
    for piece in text_messages(channel, severity, text):
        channel.send(piece)


def keep_home(vehicle: Vehicle) -> None:
    """Make home item 0 of an empty mission, once it is known."""
    if not vehicle.mission.items:
        vehicle.mission.write(0, Item(WAYPOINT))
        _save_total(vehicle, MISSION)


def _save_total(vehicle: Vehicle, kind: int) -> None:
    """Update MIS_TOTAL, FENCE_TOTAL or RALLY_TOTAL, and send it on every channel."""
    total = len(stored(vehicle, kind))
    if kind == FENCE:
        corners = sum(item.command != mavlink.MAV_CMD_NAV_FENCE_RETURN_POINT for item in stored(vehicle, kind))
        total = corners + 2 if corners >= 3 else 0
    vehicle.parameters.set(TOTALS[kind], total)
    vehicle.send_parameter(TOTALS[kind])


def count(vehicle: Vehicle, channel: Channel, message: Any) -> None:
    """MISSION_COUNT: begin an upload."""
    kind, uploads = type_of(message), vehicle.uploads
    if kind not in MOST:
        acknowledge(channel, message, Result.UNSUPPORTED)
        return
    upload = uploads.get(kind)
    sender = (message.get_srcSystem(), message.get_srcComponent())
    if upload is not None and (upload.system, upload.component) != sender:
        acknowledge(channel, message, Result.DENIED)
        return
    if message.count > MOST[kind]:
        acknowledge(channel, message, Result.NO_SPACE)
        vehicle.say(Severity.WARNING, f"Only {MOST[kind]} items are supported")
        return
    items = stored(vehicle, kind)
    if kind != FENCE and len(items) > message.count:
        del items[message.count :]
        vehicle.mission.changes += 1
        _save_total(vehicle, kind)
    if message.count == 0:
        uploads.pop(kind, None)
        _finish(vehicle, channel, message, kind, [])
        return
    fence: list[Item | None] = [None] * message.count if kind == FENCE else []
    _begin(vehicle, channel, message, 0, message.count - 1, fence)


def write_partial(vehicle: Vehicle, channel: Channel, message: Any) -> None:
    """MISSION_WRITE_PARTIAL_LIST: begin an upload of a few items."""
    kind = type_of(message)
    if kind not in MOST:
        acknowledge(channel, message, Result.UNSUPPORTED)
        return
    if kind in vehicle.uploads:
        acknowledge(channel, message, Result.DENIED)
        return
    items, first, last = stored(vehicle, kind), message.start_index, message.end_index
    # The firmware takes a negative index for a very large one.
    if not 0 <= first <= last <= len(items):
        acknowledge(channel, message, Result.ERROR)
        vehicle.say(Severity.WARNING, "Flight plan update rejected")
        return
    _begin(vehicle, channel, message, first, last, list(items) if kind == FENCE else [])


def _begin(vehicle: Vehicle, channel: Channel, message: Any, first: int, last: int, fence: list[Item | None]) -> None:
    now_us = vehicle.time_us
    vehicle.uploads[type_of(message)] = Upload(
        channel.number, message.get_srcSystem(), message.get_srcComponent(), first, last, now_us, now_us, fence
    )
    _ask(vehicle, type_of(message))


def _ask(vehicle: Vehicle, kind: int) -> None:
    """Send MISSION_REQUEST for the next item; it may be answered with MISSION_ITEM_INT as well."""
    upload = vehicle.uploads[kind]
    upload.asked_us = vehicle.time_us
    channel = vehicle.channels.get(upload.channel)
    if channel is not None:
        channel.send(mavlink.MAVLink_mission_request_message(upload.system, upload.component, upload.next, kind))


def run_uploads(vehicle: Vehicle) -> None:
    """Request missing items again, and end uploads that have fallen silent."""
    for kind, upload in list(vehicle.uploads.items()):
        if vehicle.time_us - upload.heard_us > GIVE_UP_US:
            del vehicle.uploads[kind]
            channel = vehicle.channels.get(upload.channel)
            if channel is not None:
                _say(channel, Severity.WARNING, TIMEOUT_TEXTS[kind])
                channel.send(
                    mavlink.MAVLink_mission_ack_message(upload.system, upload.component, int(Result.CANCELLED), kind)
                )
        elif vehicle.time_us - upload.asked_us > ASK_AGAIN_US:
            _ask(vehicle, kind)


def item(vehicle: Vehicle, channel: Channel, message: Any) -> None:
    """MISSION_ITEM and MISSION_ITEM_INT: one of an upload, or (current = 2) a guided target."""
    kind = type_of(message)
    try:
        if kind == MISSION and message.current in (2, 3):
            result = _guided(vehicle, message)
        elif kind not in MOST:
            result = Result.UNSUPPORTED
        else:
            if message.get_type() == "MISSION_ITEM":
                warn_once(vehicle, kind, "got MISSION_ITEM; GCS should send MISSION_ITEM_INT")
            if kind in vehicle.uploads:
                _take(vehicle, channel, message, kind)
                return
            result = Result.ERROR
    except RefusedError as refusal:
        result = refusal.result
    acknowledge(channel, message, result)


def _guided(vehicle: Vehicle, message: Any) -> Result:
    target = mission_item(message)
    if message.current == 3:  # a change of height, which a rover ignores
        return Result.ACCEPTED
    if vehicle.mode != Mode.GUIDED or not vehicle.has_origin:
        return Result.ERROR
    go_to(vehicle, target.place)
    return Result.ACCEPTED


def _take(vehicle: Vehicle, channel: Channel, message: Any, kind: int) -> None:
    """One item of an upload; it must be the next one, from the same sender."""
    upload = vehicle.uploads[kind]
    reply = vehicle.channels.get(upload.channel, channel)
    if message.seq != upload.next:
        acknowledge(reply, message, Result.INVALID_SEQUENCE)
        return
    if (message.get_srcSystem(), message.get_srcComponent()) != (upload.system, upload.component):
        acknowledge(reply, message, Result.DENIED)
        return
    try:
        _write(vehicle, message, kind, upload)
    except RefusedError as refusal:
        del vehicle.uploads[kind]
        acknowledge(reply, message, refusal.result)
        return
    upload.heard_us = vehicle.time_us
    upload.next += 1
    if upload.next <= upload.last:
        _ask(vehicle, kind)
        return
    del vehicle.uploads[kind]
    _finish(vehicle, reply, message, kind, upload.fence)


def _write(vehicle: Vehicle, message: Any, kind: int, upload: Upload) -> None:
    if kind == FENCE:
        if message.seq >= len(upload.fence):
            raise RefusedError(Result.INVALID_SEQUENCE)
        upload.fence[message.seq] = fence_item(message)
        return
    items = stored(vehicle, kind)
    new = mission_item(message) if kind == MISSION else rally_item(message)
    total = len(items)
    if kind == MISSION and new.command == JUMP:
        target = int(new.params[0])
        if target == 0 or (target >= total and target > upload.last):
            raise RefusedError(Result.ERROR)
    if message.seq > total or message.seq >= MOST[kind]:
        raise RefusedError(Result.ERROR)
    if kind == MISSION:
        vehicle.mission.write(message.seq, new)
    elif message.seq < total:
        items[message.seq] = new
    else:
        items.append(new)
    if len(items) > total:
        _save_total(vehicle, kind)


def _finish(vehicle: Vehicle, channel: Channel, message: Any, kind: int, fence: list[Item | None]) -> None:
    """End a complete transfer; a fence is only now validated as a whole."""
    result = Result.ACCEPTED
    if kind == FENCE and not _keep_fence(vehicle, [part for part in fence if part is not None]):
        result = Result.ERROR
    acknowledge(channel, message, result)
    if kind in DONE_TEXTS:
        _say(channel, Severity.INFO, DONE_TEXTS[kind])


def _keep_fence(vehicle: Vehicle, items: list[Item]) -> bool:
    fault = fence_fault(items)
    if fault is not None:
        vehicle.say(Severity.WARNING, fault)
        vehicle.say(Severity.WARNING, "Fence validation failed")
        return False
    vehicle.storage.fence[:] = items
    _save_total(vehicle, FENCE)
    return True


def clear(vehicle: Vehicle, channel: Channel, message: Any) -> None:
    """MISSION_CLEAR_ALL; refused during an upload, and while the mission is running."""
    kind = type_of(message)
    if kind not in MOST:
        acknowledge(channel, message, Result.UNSUPPORTED)
        return
    cleared = kind not in vehicle.uploads
    if cleared and kind == MISSION:
        cleared = vehicle.mission.clear()
    elif cleared:
        stored(vehicle, kind).clear()
    if cleared:
        _save_total(vehicle, kind)
    acknowledge(channel, message, Result.ACCEPTED if cleared else Result.ERROR)


TRANSFERS: dict[str, Handler] = {
    "MISSION_CLEAR_ALL": clear,
    "MISSION_COUNT": count,
    "MISSION_ITEM": item,
    "MISSION_ITEM_INT": item,
    "MISSION_REQUEST": request,
    "MISSION_REQUEST_INT": request_int,
    "MISSION_REQUEST_LIST": request_list,
    "MISSION_WRITE_PARTIAL_LIST": write_partial,
}
