"""Serves the physics on a UDP port, and its lidar on a MAVLink link; the firmware sets the pace."""

from __future__ import annotations

import contextlib
import errno
import select
import socket
from collections.abc import Callable

from sitl.firmware.physics import Physics
from sitl.network import ListenError
from sitl.network.mavlink_client import ClientLink

WAIT_S = 0.2
"""Interval at which it checks for the end and serves its MAVLink link while the firmware is silent."""
READ_BYTES = 2048
AT_ONCE = 100
"""Datagrams that are read at most before the first is answered."""
Sender = tuple[str, int]


def open_port(host: str, port: int) -> socket.socket:
    """Open the UDP port for the firmware. Raises ListenError."""
    opened = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    opened.setblocking(False)
    try:
        opened.bind((host, port))
    except (OSError, UnicodeError) as error:
        opened.close()
        reason = getattr(error, "strerror", None) or error
        remedy = "is that an address of this computer?"
        if getattr(error, "errno", None) == errno.EADDRINUSE:
            remedy = "another physics is running already; choose another --port"
        raise ListenError(f"udp {host}:{port}: cannot be opened: {reason}; {remedy}") from error
    return opened


def received(port: socket.socket) -> list[tuple[bytes, Sender]]:
    """The waiting datagrams; a repeated frame counts once: two answers would delay the firmware by one."""
    waiting: list[tuple[bytes, Sender]] = []
    with contextlib.suppress(OSError):
        for _ in range(AT_ONCE):
            one = port.recvfrom(READ_BYTES)
            if not waiting or one != waiting[-1]:
                waiting.append(one)
    return waiting


def run(
    physics: Physics,
    port: socket.socket,
    link: ClientLink | None,
    now_s: Callable[[], float],
    running: Callable[[], bool],
    look: Callable[[], None],
) -> None:
    """Answer until ``running`` returns False; ``look`` is called in every round. ``now_s`` reads real seconds."""
    next_exchange_s = now_s()
    while running():
        ready, _, _ = select.select([port, *(link.sockets() if link else [])], [], [], WAIT_S)
        if port in ready:
            for datagram, sender in received(port):
                answer = physics.answer(datagram, sender)
                if answer:
                    with contextlib.suppress(OSError):
                        port.sendto(answer, sender)
        if link is not None:
            packets = physics.take()
            if packets or len(ready) > (port in ready) or now_s() >= next_exchange_s:
                next_exchange_s = now_s() + WAIT_S
                physics.hear(link.exchange(packets, now_s()))
        look()
