"""Signed packets: the key's file, timestamps that never go back, and whom to believe."""

from __future__ import annotations

import hashlib
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.mavlink.codec import Codec
from companion.mavlink.framing import Framer
from companion.mavlink.signing import (
    AGAIN,
    AHEAD,
    LAST_TICK,
    MINUTE,
    MOST_STREAMS,
    Signer,
    SigningKeyError,
    load_key,
)
from companion.settings import Settings
from companion.vehicle.commands import Heartbeat
from tests.support.mavlink_vehicle import Station

KEY = bytes(range(32))
TIME = 40_000_000_000_000


def key_file(folder: Path, data: bytes, mode: int = 0o600) -> Path:
    path = folder / "key"
    path.write_bytes(data)
    path.chmod(mode)
    return path


def signed(station: Station, message: Any, timestamp: int = TIME, key: bytes = KEY, link: int = 0) -> bytes:
    """Signed by pymavlink itself."""
    signing = station._mav.signing
    signing.secret_key, signing.timestamp, signing.link_id, signing.sign_outgoing = key, timestamp, link, True
    data = station.pack(message)
    signing.sign_outgoing = False
    return data


def beat() -> Any:
    return mavlink.MAVLink_heartbeat_message(10, 3, 0, 0, 4, 3)


def accepted(signer: Signer, data: bytes) -> list[bool]:
    return [signer.accepts(packet) for packet in Framer().feed(data)]


# The key ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("ending", [b"", b"\n", b"\r\n"])
def test_a_passphrase_makes_the_key_that_ground_stations_make_of_it(tmp_path: Path, ending: bytes) -> None:
    assert (
        load_key(key_file(tmp_path, "grüne Wiese".encode() + ending)) == hashlib.sha256("grüne Wiese".encode()).digest()
    )
    assert load_key(key_file(tmp_path, KEY.hex().upper().encode() + ending)) == KEY
    odd = KEY.hex()[:-1].encode()  # 63 digits are a passphrase
    assert load_key(key_file(tmp_path, odd + ending)) == hashlib.sha256(odd).digest()


@pytest.mark.parametrize("mode", [0o640, 0o601, 0o777])
def test_a_key_that_others_may_use_is_refused(tmp_path: Path, mode: int) -> None:
    path = key_file(tmp_path, b"secret", mode)
    with pytest.raises(SigningKeyError) as caught:
        load_key(path)
    assert str(caught.value) == f"{path}: others may use this file (mode {mode:04o}); chmod 600 {path}"
    assert "secret" not in str(caught.value)


@pytest.mark.parametrize("data", [b"", b"\n", b"a\nb", b"\xff\xfe", b"0" * 64, b"x" * 100_000])
def test_a_file_without_a_key_is_one_line(tmp_path: Path, data: bytes) -> None:
    with pytest.raises(SigningKeyError) as caught:
        load_key(key_file(tmp_path, data))
    assert "\n" not in str(caught.value) and len(str(caught.value)) < 400


def test_no_file_at_all(tmp_path: Path) -> None:
    for path in (tmp_path, tmp_path / "none"):
        path.chmod(0o700) if path.exists() else None
        with pytest.raises(SigningKeyError, match=str(path)):
            load_key(path)


# Timestamps ---------------------------------------------------------------------------------------------------------


class Disk:
    """Saves when told to; a crash loses what has not been saved."""

    def __init__(self, saved: float = 0) -> None:
        self.saved = saved
        self.asked: list[int] = []

    def save(self, timestamp: int) -> None:
        self.asked.append(timestamp)

    def finish(self) -> None:
        if self.asked:
            self.saved = self.asked[-1]


@given(
    st.lists(
        st.one_of(
            st.tuples(st.just("clock"), st.integers(0, LAST_TICK)),
            st.tuples(st.just("send"), st.integers(1, 30)),
            st.tuples(st.sampled_from(["disk", "crash"]), st.just(0)),
        ),
        max_size=60,
    )
)
@example([("clock", TIME), ("send", 3), ("disk", 0), ("send", 3), ("crash", 0), ("clock", 0), ("send", 3)])
def test_timestamps_never_go_back_whatever_clock_disk_and_power_do(steps: list[tuple[str, int]]) -> None:
    """The loop sends fewer than AGAIN packets while the disk works: so no timestamp is used again after a crash."""
    disk, now = Disk(), [TIME]
    signer = Signer(KEY, lambda: now[0], disk)
    sent: list[int] = []
    for what, count in steps:
        if what == "clock":
            now[0] = count
        elif what == "send":
            sent += [signer.next_timestamp() for _ in range(count)]
        elif what == "disk":
            disk.finish()
        elif not sent or sent[-1] <= disk.saved:  # the disk has been given the time to write once
            disk.asked.clear()
            signer = Signer(KEY, lambda: now[0], disk)
    # Only at the very end of time, in the year 2104, is there nothing later left.
    rising = [stamp for stamp in sent if stamp < LAST_TICK]
    assert all(a < b for a, b in pairwise(rising))


def test_no_time_is_used_that_has_not_been_saved_but_the_next_one() -> None:
    disk = Disk()
    signer = Signer(KEY, lambda: TIME, disk)
    assert [signer.next_timestamp() for _ in range(3)] == [1, 2, 3]
    assert disk.asked == [TIME + AHEAD]
    disk.finish()
    assert signer.next_timestamp() == TIME
    assert Signer(KEY, lambda: 0, disk).next_timestamp() > TIME


def test_it_is_saved_every_half_minute_and_not_more_often() -> None:
    disk, now = Disk(), [TIME]
    signer = Signer(KEY, lambda: now[0], disk)
    for _ in range(20 * 600):
        signer.next_timestamp()
        disk.finish()
        now[0] += 5_000  # 50 ms
    assert 19 <= len(disk.asked) <= 22
    assert disk.asked[-1] - now[0] >= AGAIN - 10_000


# Whom to believe ----------------------------------------------------------------------------------------------------


def test_what_pymavlink_signs_is_believed_once() -> None:
    signer, station = Signer(KEY, lambda: TIME), Station()
    data = signed(station, beat())
    assert accepted(signer, data) == [True]
    assert accepted(signer, data) == [False]  # heard again
    assert accepted(signer, signed(station, beat(), TIME - 1)) == [False]
    assert accepted(signer, signed(station, beat(), TIME + 1)) == [True]
    assert (signer.refused.unsigned, signer.refused.wrong, signer.refused.old) == (0, 0, 2)
    assert str(signer.refused) == "packets refused: 2 signed too long ago"


def test_each_sender_and_link_has_a_time_of_its_own_and_a_new_one_may_be_a_minute_late() -> None:
    signer = Signer(KEY, lambda: TIME)
    signer.next_timestamp()
    assert accepted(signer, signed(Station(1, 1), beat(), TIME + 5)) == [True]
    assert accepted(signer, signed(Station(255, 190), beat(), TIME + 5 - MINUTE)) == [True]
    assert accepted(signer, signed(Station(255, 190), beat(), TIME + 6 - MINUTE, link=3)) == [True]
    assert accepted(signer, signed(Station(254, 190), beat(), TIME + 4 - MINUTE)) == [False]
    assert signer.next_timestamp() >= TIME + 5  # what was heard moves our own time on


def test_unsigned_packets_are_not_believed_but_a_radios_own() -> None:
    signer, station = Signer(KEY, lambda: TIME), Station()
    assert accepted(signer, station.pack(beat())) == [False]
    assert accepted(signer, station.pack(beat(), version_1=True)) == [False]
    radio = mavlink.MAVLink_radio_status_message(1, 2, 3, 4, 5, 6, 7)
    assert accepted(signer, station.pack(radio)) == [True]
    assert accepted(signer, signed(station, radio, key=bytes(32))) == [False]
    assert (signer.refused.unsigned, signer.refused.wrong) == (2, 1)


def test_a_forger_cannot_silence_a_sender() -> None:
    """Wrongly signed packets of the far future leave no trace."""
    signer = Signer(KEY, lambda: TIME)
    assert accepted(signer, signed(Station(), beat(), LAST_TICK, key=b"x" * 32)) == [False]
    assert accepted(signer, signed(Station(), beat(), TIME)) == [True]
    assert signer.next_timestamp() < TIME + 10


def test_streams_are_bounded() -> None:
    signer = Signer(KEY, lambda: TIME)
    results = [accepted(signer, signed(Station(255, 190), beat(), TIME, link=link))[0] for link in range(100)]
    assert results == [True] * MOST_STREAMS + [False] * (100 - MOST_STREAMS)


@given(st.integers(0, 60), st.integers(1, 255))
def test_no_changed_byte_is_believed(place: int, change: int) -> None:
    data = bytearray(signed(Station(), mavlink.MAVLink_param_set_message(1, 191, b"CMP_STALE", 2.0, 9)))
    data[place % len(data)] ^= change
    signer = Signer(KEY, lambda: TIME)
    assert True not in accepted(signer, bytes(data))


@given(st.binary(max_size=400))
def test_any_bytes_are_survived_and_nothing_of_them_believed(data: bytes) -> None:
    codec = Codec(Settings().link, signer=Signer(KEY, lambda: TIME))
    codec.decode(signed(Station(), beat()), 0.0)
    assert codec.vehicle_known
    assert codec.decode(data, 1.0) == []


def test_what_we_send_is_believed_by_pymavlink() -> None:
    codec = Codec(Settings().link, signer=Signer(KEY, lambda: TIME))
    data = b"".join(codec.encode(Heartbeat()) for _ in range(5))
    for key, good in ((KEY, 5), (bytes(32), 0)):
        mav = mavlink.MAVLink(None)
        mav.robust_parsing = True
        mav.signing.secret_key, mav.signing.timestamp = key, TIME
        assert [m.get_type() for m in mav.parse_buffer(data) or []].count("HEARTBEAT") == good


# What people are told -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("signer", "data", "said"),
    [
        (None, signed(Station(), beat()), "The autopilot signs: without --signing-key"),
        (None, Station().heartbeat(), ""),
        (Signer(KEY, lambda: TIME), Station().heartbeat(), "Heard only unsigned packets"),
        (Signer(KEY, lambda: TIME), signed(Station(), beat(), key=b"y" * 32), "signed with another key: is it"),
        (Signer(KEY, lambda: TIME), signed(Station(), beat(), TIME - 2 * MINUTE), "is this computer's clock ahead?"),
        (Signer(KEY, lambda: TIME), signed(Station(), beat()), ""),
        (Signer(KEY, lambda: TIME), signed(Station(), beat()) + Station(255, 190).heartbeat(), "Ignoring unsigned"),
    ],
)  # fmt: skip
def test_trouble_is_told_in_words(signer: Signer | None, data: bytes, said: str) -> None:
    codec = Codec(Settings().link, signer=signer)
    codec.encode(Heartbeat())
    codec.decode(data, 0.0)
    assert codec.signing_trouble.startswith(said) if said == "" else said in codec.signing_trouble
    assert bool(codec.signing_trouble) == bool(said)
