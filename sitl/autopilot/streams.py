"""Stream rates of each channel: the firmware's defaults and what was requested; sends what is due."""

from __future__ import annotations

from sitl.autopilot.channel import Channel
from sitl.autopilot.start_up import STREAMS_S
from sitl.autopilot.telemetry import MESSAGES, requested_messages
from sitl.autopilot.vehicle import Vehicle

DEFAULT_INTERVAL_US = 1_000_000

GROUPS: dict[int, tuple[int, ...]] = {
    1: (27, 116, 129, 29, 137),
    2: (1, 125, 152, 42, 24, 62, 87),
    3: (36, 65),
    4: (34,),
    6: (33, 32),
    10: (30, 164),
    11: (74,),
    12: (163, 178, 2, 193, 147, 132, 173, 241, 162),
}
"""REQUEST_DATA_STREAM's groups; 0 means all."""


def start_streams(channel: Channel, now_us: int) -> None:
    """Start all default streams at the next whole second, but not before ``STREAMS_S``."""
    first_us = max(int(STREAMS_S * 1e6), (now_us // 1_000_000 + 1) * 1_000_000)
    for number in MESSAGES:
        channel.interval_us[number] = DEFAULT_INTERVAL_US
        channel.due_us[number] = float(first_us)


def set_interval(channel: Channel, number: int, interval_us: int, now_us: int) -> None:
    """Set the interval of a streamed message; -1 stops it."""
    channel.interval_us[number] = interval_us
    channel.due_us.pop(number, None)
    if interval_us > 0:
        channel.due_us[number] = float(max(now_us + min(interval_us, DEFAULT_INTERVAL_US), int(STREAMS_S * 1e6)))


def set_group(channel: Channel, group: int, rate_hz: int, now_us: int) -> None:
    """REQUEST_DATA_STREAM: set the rate of a group, limited by the main loop; 0 stops it."""
    interval_us = -1 if rate_hz <= 0 else max(1_000_000 // rate_hz, 25_000)
    for number in GROUPS.get(group, tuple(MESSAGES) if group == 0 else ()):
        set_interval(channel, number, interval_us, now_us)


def send_due(vehicle: Vehicle, channel: Channel) -> None:
    """Send every streamed message that is due, and single messages that were requested."""
    for number in channel.requested:
        for message in requested_messages(vehicle, number):
            channel.send(message)
    channel.requested.clear()
    now_us = vehicle.time_us
    for number, due_us in channel.due_us.items():
        if due_us <= now_us:
            interval_us = channel.interval_us[number]
            channel.due_us[number] = max(due_us + interval_us, now_us - interval_us)
            for message in requested_messages(vehicle, number):
                channel.send(message)
