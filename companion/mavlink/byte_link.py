"""The protocol of all byte links, a link within the process, and helpers for links."""

from __future__ import annotations

from collections import deque
from typing import Protocol

MAX_READ_BYTES = 65536
"""A read returns at most about this much, so that a flood cannot delay a tick."""


class LinkError(Exception):
    """A link that cannot be opened; the text is one line with the place, the reason and the remedy."""


class ByteLink(Protocol):
    """Reads and writes bytes without waiting. A broken link reconnects or stays silent; it does not raise."""

    @property
    def description(self) -> str:
        """The link and its present state, in words."""
        ...

    @property
    def connected(self) -> bool:
        """Whether there is another end; True where nobody can know, as with UDP."""
        ...

    def read(self) -> bytes:
        """The bytes that have arrived; may be empty."""
        ...

    def write(self, data: bytes) -> None:
        """Send whole packets; they are dropped while the link is down or full."""
        ...

    def close(self) -> None:
        """Close the link. May be called again."""
        ...


class MemoryLink:
    """One end of a link within the process: the other end reads what it writes, at once and without loss."""

    def __init__(self, incoming: deque[bytes], outgoing: deque[bytes]) -> None:
        self._incoming = incoming
        self._outgoing = outgoing

    @classmethod
    def pair(cls) -> tuple[MemoryLink, MemoryLink]:
        """The two ends of a new link."""
        there: deque[bytes] = deque()
        back: deque[bytes] = deque()
        return cls(there, back), cls(back, there)

    @property
    def description(self) -> str:
        """The link in words."""
        return "memory"

    @property
    def connected(self) -> bool:
        """Always."""
        return True

    def read(self) -> bytes:
        """All bytes that the other end has written since the last read."""
        data = b"".join(self._incoming)
        self._incoming.clear()
        return data

    def write(self, data: bytes) -> None:
        """Send bytes to the other end."""
        if data:
            self._outgoing.append(bytes(data))

    def close(self) -> None:
        """Nothing to close."""


class OutBuffer:
    """Bytes that a stream has not accepted yet. When it is full, whole packets are dropped."""

    LIMIT_BYTES = 65536

    def __init__(self) -> None:
        self.waiting = bytearray()
        self.dropped = 0

    def add(self, data: bytes) -> None:
        """Queue a packet, or drop and count it if the buffer is full."""
        if len(self.waiting) + len(data) > self.LIMIT_BYTES:
            self.dropped += 1
        else:
            self.waiting += data

    def taken(self, count: int) -> None:
        """Remove bytes that the stream has accepted."""
        del self.waiting[:count]

    def clear(self) -> None:
        """Drop all bytes: the link was cut, and the peer waits for the start of a packet."""
        self.waiting.clear()


class BackOff:
    """Exponential back-off: the first try at once, then with doubling waits up to a limit, in seconds of any clock."""

    def __init__(self, first_s: float = 0.25, limit_s: float = 5.0) -> None:
        self._first_s = first_s
        self._limit_s = limit_s
        self.reset()

    def reset(self) -> None:
        """Call after success: the next wait is the shortest."""
        self._wait_s = self._first_s
        self._next_s = -float("inf")

    def due(self, now_s: float) -> bool:
        """Whether to try now; if so, the next wait begins."""
        if now_s < self._next_s:
            return False
        self._next_s = now_s + self._wait_s
        self._wait_s = min(2.0 * self._wait_s, self._limit_s)
        return True
