"""What systemd is told of a service of ``Type=notify``: that it is ready, that it is alive, what it does, that it ends."""

from __future__ import annotations

import contextlib
import socket
from collections.abc import Mapping

from companion.operator.notifications import Status

ALIVE_S = 1.0


class Service:
    """Talks to systemd's socket; says nothing where there is none. The protocol is that of sd_notify(3)."""

    def __init__(self, environment: Mapping[str, str]) -> None:
        self._socket: socket.socket | None = None
        self._told_s: float | None = None
        self._doing = ""
        address = environment.get("NOTIFY_SOCKET", "")
        if address[:1] in ("/", "@"):
            self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_CLOEXEC | socket.SOCK_NONBLOCK)
            with contextlib.suppress(OSError):
                self._socket.connect("\0" + address[1:] if address[0] == "@" else address)

    def ready(self) -> None:
        """The start is over: all is compiled, the link is open."""
        self._say("READY=1")

    def show(self, status: Status) -> None:
        """A tick is over: once a second, and whenever it does something else, that it is alive and what it does."""
        due = self._told_s is None or status.time_s - self._told_s >= ALIVE_S
        if due or status.doing != self._doing:
            self._told_s, self._doing = status.time_s, status.doing
            self._say(f"WATCHDOG=1\nSTATUS={status.doing}")

    def stopping(self) -> None:
        """It ends: the last that is told."""
        self._say("STOPPING=1")
        if self._socket is not None:
            self._socket.close()

    def _say(self, text: str) -> None:
        if self._socket is not None:
            with contextlib.suppress(OSError):  # nobody listens, or not fast enough
                self._socket.send(text.encode())
