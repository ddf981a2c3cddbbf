"""What every link can do, and the link within one process."""

from __future__ import annotations

from collections import deque
from typing import Protocol

MAX_READ_BYTES = 65536
"""A read hands over about this much at most, so that a flood cannot hold up a tick."""


class LinkError(Exception):
    """A link that cannot be opened; the text is one line with the place, the reason and the remedy."""


class ByteLink(Protocol):
    """Bytes in, bytes out. Neither call ever waits; a broken line mends itself or stays silent, it does not raise."""

    @property
    def description(self) -> str:
        """The link in words for people, with its present state."""
        ...

    def read(self) -> bytes:
        """What has arrived; empty when nothing has."""
        ...

    def write(self, data: bytes) -> None:
        """Send these bytes (whole packets); dropped when the line is down or full."""
        ...

    def close(self) -> None:
        """Let go of the line; more than once is fine."""
        ...


class MemoryLink:
    """One end of a line within the process: what one end writes the other reads, in order, at once and without loss."""

    def __init__(self, incoming: deque[bytes], outgoing: deque[bytes]) -> None:
        self._incoming = incoming
        self._outgoing = outgoing

    @classmethod
    def pair(cls) -> tuple[MemoryLink, MemoryLink]:
        """The two ends of a new line."""
        there: deque[bytes] = deque()
        back: deque[bytes] = deque()
        return cls(there, back), cls(back, there)

    @property
    def description(self) -> str:
        """The link in words."""
        return "memory"

    def read(self) -> bytes:
        """All that the other end has written since the last read."""
        data = b"".join(self._incoming)
        self._incoming.clear()
        return data

    def write(self, data: bytes) -> None:
        """Hand bytes to the other end."""
        if data:
            self._outgoing.append(bytes(data))

    def close(self) -> None:
        """Nothing to let go of."""


class OutBuffer:
    """Bytes that a stream has not taken yet. When it is full, whole packets are dropped, never part of one."""

    LIMIT_BYTES = 65536

    def __init__(self) -> None:
        self.waiting = bytearray()
        self.dropped = 0

    def add(self, data: bytes) -> None:
        """Queue a packet, or drop and count it when the stream has stood still for too long."""
        if len(self.waiting) + len(data) > self.LIMIT_BYTES:
            self.dropped += 1
        else:
            self.waiting += data

    def taken(self, count: int) -> None:
        """The stream has taken so many bytes."""
        del self.waiting[:count]

    def clear(self) -> None:
        """Forget everything: the line has been cut, and its other end waits for the start of a packet."""
        self.waiting.clear()


class BackOff:
    """When to try again: at once, then after twice the last wait each time, up to a limit; seconds of any clock."""

    def __init__(self, first_s: float = 0.25, limit_s: float = 5.0) -> None:
        self._first_s = first_s
        self._limit_s = limit_s
        self.reset()

    def reset(self) -> None:
        """It worked: the next failure waits the shortest time."""
        self._wait_s = self._first_s
        self._next_s = -float("inf")

    def due(self, now_s: float) -> bool:
        """Whether to try now; if so, the next try is put off."""
        if now_s < self._next_s:
            return False
        self._next_s = now_s + self._wait_s
        self._wait_s = min(2.0 * self._wait_s, self._limit_s)
        return True
