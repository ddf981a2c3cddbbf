"""All links of the vehicle: open and close them, forward packets between them, set their common signing key."""

from __future__ import annotations

from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.core.severity import Severity
from sitl.autopilot.channel import Channel, new_channel
from sitl.autopilot.routing import AUTOPILOT
from sitl.autopilot.signing import ACCEPTED_UNSIGNED, SECURE_PORT, StoredKey
from sitl.autopilot.streams import start_streams
from sitl.autopilot.vehicle import Vehicle, text_messages

MAVLINK_1 = 1
"""SERIALn_PROTOCOL."""


def open_channel(vehicle: Vehicle, number: int, port: int = SECURE_PORT) -> Channel:
    """Open a channel through a serial port, with the protocol version of SERIALn_PROTOCOL; streams start at once."""
    name = f"SERIAL{port}_PROTOCOL"
    version_1 = name in vehicle.parameters and vehicle.parameters[name] == MAVLINK_1
    channel = new_channel(number, vehicle.system, vehicle.signing, port, version_1)
    start_streams(channel, vehicle.time_us)
    vehicle.channels[number] = channel
    return channel


def close_channel(vehicle: Vehicle, channel: Channel) -> None:
    """Forget a channel and its routes."""
    vehicle.channels.pop(channel.number, None)
    vehicle.router.forget(channel.number)


def forward(vehicle: Vehicle, channel: Channel, message: Any) -> bool:
    """Forward a packet to other channels; True if the autopilot must handle it as well."""
    system, component, kind = message.get_srcSystem(), message.get_srcComponent(), message.get_msgId()
    channel.spoken |= kind not in ACCEPTED_UNSIGNED
    if (system, component) == (vehicle.system, AUTOPILOT):
        return False  # our own packet, from a link that is looped back
    router = vehicle.router
    router.learn(system, component, channel.number)
    if kind in ACCEPTED_UNSIGNED:
        return True  # the status of a radio is for its own end only
    if kind == mavlink.MAVLINK_MSG_ID_HEARTBEAT:
        active = (number for number, other in vehicle.channels.items() if other.spoken)
        _copy(vehicle, message, router.heartbeat_to(system, component, channel.number, active))
        return True
    target = (getattr(message, "target_system", 0), getattr(message, "target_component", 0))
    channels = router.forward_to(vehicle.system, *target, channel.number)
    _copy(vehicle, message, channels)
    return router.is_for_autopilot(vehicle.system, *target, forwarded=bool(channels))


def _copy(vehicle: Vehicle, message: Any, channels: set[int]) -> None:
    """Forward the packet unchanged: same version, sequence number and signature."""
    for number in sorted(channels):
        if number in vehicle.channels:
            vehicle.channels[number].outbox += message.get_msgbuf()


def set_up_signing(vehicle: Vehicle, channel: Channel, message: Any) -> None:
    """SETUP_SIGNING: a new key for all links; a key of zeros with timestamp 0 ends signing."""
    if vehicle.armed:
        for text in text_messages(channel, Severity.ERROR, "ERROR: Won't setup signing when armed"):
            channel.send(text)
        return
    vehicle.signing.stored = StoredKey(bytes(message.secret_key), message.initial_timestamp)
    for other in vehicle.channels.values():
        vehicle.signing.prepare(other.codec, other.number)
