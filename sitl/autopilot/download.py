"""Downloads of mission, fence and rally points (behaviour of MissionItemProtocol): how many there are, and one by one."""

from __future__ import annotations

from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.autopilot.items import WAYPOINT, Item, Result
from sitl.autopilot.link import Channel
from sitl.autopilot.plan import FENCE, MISSION, RALLY
from sitl.autopilot.vehicle import ALTITUDE_M, WARNING, Vehicle

MOST = {MISSION: 724, FENCE: 84, RALLY: 50}
"""How many items fit into the storage of a usual flight controller (16 kB)."""


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
    """A complaint that is made once for each list."""
    if (kind, text) not in vehicle.plan.warned:
        vehicle.plan.warned.add((kind, text))
        vehicle.say(WARNING, text)


def stored(vehicle: Vehicle, kind: int) -> list[Item]:
    """The items of a type as they are stored; the first of a mission is home."""
    storage = vehicle.plan.storage
    return {MISSION: storage.mission, FENCE: storage.fence, RALLY: storage.rally}[kind]


def request_list(vehicle: Vehicle, channel: Channel, message: Any) -> None:
    """MISSION_REQUEST_LIST: how many items there are."""
    kind = type_of(message)
    if kind not in MOST:
        acknowledge(channel, message, Result.UNSUPPORTED)
    elif kind in vehicle.plan.uploads:
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
    if kind in vehicle.plan.uploads:
        acknowledge(channel, message, Result.DENIED)
    elif kind in MOST:
        _send_item(vehicle, channel, message, kind, as_int=True)


def request(vehicle: Vehicle, channel: Channel, message: Any) -> None:
    """MISSION_REQUEST: one item as the older MISSION_ITEM, which has places in single precision."""
    kind = type_of(message)
    if kind in MOST and _send_item(vehicle, channel, message, kind, as_int=False):
        warn_once(vehicle, kind, "got MISSION_REQUEST; use MISSION_REQUEST_INT!")


def _send_item(vehicle: Vehicle, channel: Channel, message: Any, kind: int, as_int: bool) -> bool:
    """Answer with an item; False if there is none."""
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
    # The firmware compares the command, not the index, with the command under way.
    current = int(kind == MISSION and one.command == vehicle.plan.mission.nav_index)
    scale = 1 if as_int or one.command in (mavlink.MAV_CMD_DO_DIGICAM_CONFIGURE, 203) else 1e-7
    kinds = (mavlink.MAVLink_mission_item_message, mavlink.MAVLink_mission_item_int_message)
    channel.send(
        kinds[as_int](
            message.get_srcSystem(), message.get_srcComponent(), seq, one.frame, one.command, current,
            int(kind == MISSION), *one.params, one.x * scale, one.y * scale, one.z, kind,
        )
    )  # fmt: skip
    return True
