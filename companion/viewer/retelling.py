"""The retelling: what a feed keeps for a web process that begins anew, and tells it a piece at a time.

What was queued for the process before is lost, and so is everything that it knew.

Nouns: retelling.
"""

from __future__ import annotations

import json
import secrets
from collections import deque
from typing import Any, Protocol

from companion.viewer import wire
from companion.viewer.past import Past

Json = dict[str, Any]


def run_id() -> str:
    """Another one for each run, so that a page never takes one for the other. It is in live scenes alone.

    A simulation that is begun again has the same clock, seed and map.
    """
    return secrets.token_hex(8)


class Receiver(Protocol):
    """Takes messages without waiting: ``WebProcess``, or what stands in for it."""

    begins_anew: Any

    @property
    def is_full(self) -> bool:
        """Whether nothing more can be taken now."""
        ...

    def put(self, kind: bytes, payload: bytes, *, last: bool = False) -> bool:
        """One more message; False if it was not taken. ``last``: one of the last ones, for which room is kept."""
        ...


class Retelling:
    """``past`` is written by the feed: all news, and all frames whether they were taken or not."""

    def __init__(self, receiver: Receiver) -> None:
        self.past = Past()
        self._receiver = receiver
        self._pieces: deque[Json] = deque()

    def begins(self) -> bool:
        """Whether a new process must be told everything. All news until now are told by ``tell`` then."""
        if not self._receiver.begins_anew.is_set():
            return False
        self._receiver.begins_anew.clear()
        self._pieces = deque(self.past.pieces())
        return True

    def tell(self) -> bool:
        """The next piece, if there is one, at each tick; whether all have been told. The scene comes after them."""
        if self._pieces and self._receiver.put(wire.JSON, json.dumps(self._pieces[0], allow_nan=False).encode()):
            self._pieces.popleft()
        return not self._pieces
