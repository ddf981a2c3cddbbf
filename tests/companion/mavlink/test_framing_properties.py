"""The framer against a plain one, and against lines full of nonsense."""

from __future__ import annotations

from hypothesis import given, settings
from hypothesis import strategies as st

from companion.mavlink.framing import Framer
from tests.support.mavlink_vehicle import Station
from tests.support.quick import examples

PACKETS = [Station().heartbeat(), Station().local_position(5), Station(1, 191).heartbeat()]
PIECES = st.lists(
    st.sampled_from(
        [
            *PACKETS,
            PACKETS[0][:7],
            b"\xfd\xfd",
            b"\xfe",
            b"\xfd\xff\x00\x00",
            b"\xfd\x02\x00\x00\x00\x01\x01\xff\xff\xffab\x00\x00",
        ]
    )
    | st.binary(max_size=12),
    max_size=30,
)


@given(PIECES, st.integers(1, 40))
@settings(max_examples=examples(300))
def test_no_byte_is_counted_twice_and_it_goes_on_listening(pieces: list[bytes], size: int) -> None:
    data = b"".join(pieces) + b"\0" * 600  # so that every beginning has its end
    framer, found = Framer(), []
    for at in range(0, len(data), size):
        found += framer.feed(data[at : at + size])
    assert framer.bad_bytes + sum(len(packet.raw) for packet in found) <= len(data)
    assert [packet.raw for packet in framer.feed(b"".join(PACKETS))] == PACKETS


def test_nonsense_is_looked_at_once(monkeypatch) -> None:  # type: ignore[no-untyped-def]
    """Any beginning might be one of 280 bytes: looking through them all for each takes half a round."""
    import companion.mavlink.framing as framing

    looked = 0
    real = framing._packet

    def counted(buffer: bytes, at: int, end: int) -> framing.Packet | None:
        nonlocal looked
        looked += 1
        return real(buffer, at, end)

    monkeypatch.setattr(framing, "_packet", counted)
    framer = Framer()
    for _ in range(100):
        assert framer.feed(b"\xfd" * 300) == []
    assert looked < 200_000, "twenty times as often if every beginning looks for itself"
    assert framer.feed(PACKETS[0] * 2 + b"\0" * 300), "it still listens"
