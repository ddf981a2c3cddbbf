"""Notifications to systemd for a service of ``Type=notify``: ready, watchdog, status, stopping."""

from __future__ import annotations

import contextlib
import socket
from collections.abc import Mapping

from companion.operator.notifications import Status

ALIVE_S = 1.0


class Service:
    """Sends sd_notify(3) messages to systemd's socket; does nothing without one."""

    def __init__(self, environment: Mapping[str, str]) -> None:
        self._socket: socket.socket | None = None
        self._sent_s: float | None = None
        self._doing = ""
        address = environment.get("NOTIFY_SOCKET", "")
        if address[:1] in ("/", "@"):
            self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_CLOEXEC | socket.SOCK_NONBLOCK)
            with contextlib.suppress(OSError):
                self._socket.connect("\0" + address[1:] if address[0] == "@" else address)

    def ready(self) -> None:
        """Call when the start is over: all compiled, the link open."""
        self._send("READY=1")

    def show(self, status: Status) -> None:
        """Call after every tick. Sends watchdog and status once a second and on each change."""
        due = self._sent_s is None or status.time_s - self._sent_s >= ALIVE_S
        if due or status.doing != self._doing:
            self._sent_s, self._doing = status.time_s, status.doing
            self._send(f"WATCHDOG=1\nSTATUS={status.doing}")

    def stopping(self) -> None:
        """Call at the end."""
        self._send("STOPPING=1")
        if self._socket is not None:
            self._socket.close()

    def _send(self, text: str) -> None:
        if self._socket is not None:
            with contextlib.suppress(OSError):  # systemd does not listen, or not fast enough
                self._socket.send(text.encode())
