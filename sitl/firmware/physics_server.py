"""The physics on a UDP port, and its lidar on a MAVLink line. It has no clock of its own: the firmware sets the pace."""

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
"""How often it looks whether it shall end, and after its MAVLink line, when the firmware says nothing."""
READ_BYTES = 2048
AT_ONCE = 100
"""So many datagrams are read before the first is answered, in a flood of them."""
Sender = tuple[str, int]


def open_port(host: str, port: int) -> socket.socket:
    """The UDP port at which the firmware asks. Raises ListenError."""
    opened = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    opened.setblocking(False)
    try:
        opened.bind((host, port))
    except (OSError, UnicodeError) as error:
        opened.close()
        reason = getattr(error, "strerror", None) or error
        remedy = "is that an address of this computer?"
        if getattr(error, "errno", None) == errno.EADDRINUSE:
            remedy = "another physics runs already; choose another --port"
        raise ListenError(f"udp {host}:{port}: cannot be opened: {reason}; {remedy}") from error
    return opened


def received(port: socket.socket) -> list[tuple[bytes, Sender]]:
    """Everything that waits at the port. A frame and its copy count once: two answers would make the firmware lag by one."""
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
    """Answer until ``running`` says no; ``look`` is called after every round. ``now_s`` reads real seconds."""
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
