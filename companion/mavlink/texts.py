"""STATUSTEXT in pieces: long texts come and go as chunks of 50 bytes (MAVLink definition of STATUSTEXT)."""

from __future__ import annotations

from dataclasses import replace

from companion.vehicle.events.vehicle import TextSeen

CHUNK_BYTES = 50
LATE_S = 1.0
"""A chunk that has not come after so long is lost; the text is shown without it."""


class TextAssembler:
    """Puts chunks together; gives every text once, when its end has come or it can no longer come."""

    def __init__(self) -> None:
        self._id = 0
        self._first: TextSeen | None = None
        self._chunks: dict[int, str] = {}

    def add(self, text: TextSeen, text_id: int, chunk: int) -> list[TextSeen]:
        """The texts that this piece completes."""
        done = self._take() if text_id != self._id else []
        if text_id == 0:
            return [*done, text]
        self._id = text_id
        self._first = self._first or text
        self._chunks[chunk] = text.text
        if len(text.text) < CHUNK_BYTES:
            done += self._take()
        return done

    def late(self, time_s: float) -> list[TextSeen]:
        """What has waited too long for its end."""
        return self._take() if self._first is not None and time_s - self._first.time_s > LATE_S else []

    def _take(self) -> list[TextSeen]:
        if self._first is None:
            return []
        whole = "".join(self._chunks[number] for number in sorted(self._chunks))
        text = replace(self._first, text=whole)
        self._id, self._first, self._chunks = 0, None, {}
        return [text]


def chunks_of(text: str) -> list[bytes]:
    """A text as UTF-8 pieces of at most 50 bytes, no character cut; the last is shorter than 50, which marks the end."""
    pieces = [b""]
    for character in text.replace("\0", " "):  # a zero byte would mark the end
        data = character.encode("utf-8", errors="replace")
        if len(pieces[-1]) + len(data) > CHUNK_BYTES:
            pieces.append(b"")
        pieces[-1] += data
    if len(pieces) > 1 and len(pieces[-1]) == CHUNK_BYTES:
        pieces.append(b"")
    return pieces
