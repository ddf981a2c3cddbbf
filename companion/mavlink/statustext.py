"""STATUSTEXT: long texts are sent and received as chunks of 50 bytes (MAVLink definition of STATUSTEXT).

Nouns: STATUSTEXT.
"""

from __future__ import annotations

from dataclasses import replace

from companion.vehicle.events import TextSeen

CHUNK_BYTES = 50
LATE_S = 1.0
"""A chunk that has not arrived after this time is lost; the text is shown without it."""


class TextAssembler:
    """Joins chunks; gives every text once, when its end has arrived or can no longer arrive."""

    def __init__(self) -> None:
        self._id = 0
        self._first: TextSeen | None = None
        self._chunks: dict[int, str] = {}

    def add(self, text: TextSeen, text_id: int, chunk: int) -> list[TextSeen]:
        """The texts that this chunk completes."""
        done = self._finish() if text_id != self._id else []
        if text_id == 0:
            return [*done, text]
        self._id = text_id
        self._first = self._first or text
        self._chunks[chunk] = text.text
        if len(text.text) < CHUNK_BYTES:
            done += self._finish()
        return done

    def late(self, time_s: float) -> list[TextSeen]:
        """The text that has waited too long for its end."""
        return self._finish() if self._first is not None and time_s - self._first.time_s > LATE_S else []

    def _finish(self) -> list[TextSeen]:
        if self._first is None:
            return []
        whole = "".join(self._chunks[number] for number in sorted(self._chunks))
        text = replace(self._first, text=whole)
        self._id, self._first, self._chunks = 0, None, {}
        return [text]


def chunks_of(text: str) -> list[bytes]:
    """A text as UTF-8 chunks of at most 50 bytes with whole characters; a last one of less than 50 marks the end."""
    chunks = [b""]
    for character in text.replace("\0", " "):  # a zero byte would mark the end
        data = character.encode("utf-8", errors="replace")
        if len(chunks[-1]) + len(data) > CHUNK_BYTES:
            chunks.append(b"")
        chunks[-1] += data
    if len(chunks) > 1 and len(chunks[-1]) == CHUNK_BYTES:
        chunks.append(b"")
    return chunks
