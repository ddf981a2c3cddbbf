"""The bytes of rounds, which must stay as they are: old records have them."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from companion.core.round_marks import Mark
from companion.recording.record_format import Round, packed_round, unpacked_rounds

COUNT = st.integers(0, 2**32 - 1)
ROUND = st.builds(Round, st.floats(allow_nan=False), COUNT, COUNT, COUNT)


def test_the_bytes_of_a_round() -> None:
    entry = Round(1.5, heard=3, said=2, marks=Mark.ANSWER | Mark.SIGNED)
    assert packed_round(entry).hex() == "000000000000f83f0300000002000000220000003e53194a"


@given(st.lists(ROUND, max_size=5))
def test_rounds_come_back(rounds: list[Round]) -> None:
    data = b"".join(packed_round(entry) for entry in rounds)
    assert unpacked_rounds(data) == (rounds, len(data))


@given(st.integers(0, 47), st.integers(0, 7))
def test_reading_ends_before_a_damaged_or_torn_round(at: int, bit: int) -> None:
    entries = [Round(0.0, 1), Round(0.05, 2)]
    data = bytearray(b"".join(packed_round(entry) for entry in entries))
    assert unpacked_rounds(bytes(data[:at]))[0] == entries[: at // 24]
    data[at] ^= 1 << bit
    assert unpacked_rounds(bytes(data)) == (entries[: at // 24], 24 * (at // 24))
