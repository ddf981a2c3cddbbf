"""Long texts as chunks, and back."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from companion.mavlink.statustext import CHUNK_BYTES, LATE_S, TextAssembler, chunks_of
from companion.vehicle.events import TextSeen


def seen(text: str, time_s: float = 0.0) -> TextSeen:
    return TextSeen(time_s, 6, text)


@given(st.text(alphabet=st.characters(exclude_characters="\0", exclude_categories=("Cs",)), min_size=1, max_size=300))
def test_chunks_make_the_text_again(text: str) -> None:
    chunks = chunks_of(text)
    assert all(len(chunk) <= CHUNK_BYTES for chunk in chunks)
    assert b"".join(chunks).decode() == text
    assert len(chunks) == 1 or len(chunks[-1]) < CHUNK_BYTES


def test_chunks_are_joined_in_order_whatever_their_order_of_arrival() -> None:
    assembler = TextAssembler()
    assert assembler.add(seen("b" * CHUNK_BYTES), 5, 1) == assembler.add(seen("a" * CHUNK_BYTES), 5, 0) == []
    (text,) = assembler.add(seen("c"), 5, 2)
    assert text.text == "a" * CHUNK_BYTES + "b" * CHUNK_BYTES + "c"


def test_a_text_without_its_end_is_shown_when_another_begins_or_after_a_while() -> None:
    for finish in (lambda one: one.add(seen("short", 0.5), 0, 0), lambda one: one.late(LATE_S + 0.1)):
        assembler = TextAssembler()
        assembler.add(seen("a" * CHUNK_BYTES), 5, 0)
        assert assembler.late(LATE_S / 2.0) == []
        assert finish(assembler)[0].text == "a" * CHUNK_BYTES
        assert assembler.late(100.0) == []
