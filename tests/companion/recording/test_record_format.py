"""The bytes of ticks, which must stay as they are: old records have them."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from companion.core.tick_marks import Mark
from companion.recording.record_format import TickEntry, packed_tick, unpacked_ticks

COUNT = st.integers(0, 2**32 - 1)
TICK_ENTRY = st.builds(TickEntry, st.floats(allow_nan=False), COUNT, COUNT, COUNT)


def test_the_bytes_of_a_tick() -> None:
    entry = TickEntry(1.5, heard=3, said=2, marks=Mark.ANSWER | Mark.SIGNED)
    assert packed_tick(entry).hex() == "000000000000f83f0300000002000000220000003e53194a"


@given(st.lists(TICK_ENTRY, max_size=5))
def test_rounds_come_back(ticks: list[TickEntry]) -> None:
    data = b"".join(packed_tick(entry) for entry in ticks)
    assert unpacked_ticks(data) == (ticks, len(data))


@given(st.integers(0, 47), st.integers(0, 7))
def test_reading_ends_before_a_damaged_or_torn_tick(at: int, bit: int) -> None:
    entries = [TickEntry(0.0, 1), TickEntry(0.05, 2)]
    data = bytearray(b"".join(packed_tick(entry) for entry in entries))
    assert unpacked_ticks(bytes(data[:at]))[0] == entries[: at // 24]
    data[at] ^= 1 << bit
    assert unpacked_ticks(bytes(data)) == (entries[: at // 24], 24 * (at // 24))
