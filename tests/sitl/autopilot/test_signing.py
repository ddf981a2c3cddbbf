"""Signed packets: who is heard, and what is sent."""

from __future__ import annotations

from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.autopilot.signing import MINUTE
from sitl.simulator import Simulator
from tests.support.party import ARM, HOLD, KEY, REBOOT, SET_MODE, TIME, Party, booted, split
from tests.support.sitl_client import open_ground


@pytest.fixture
def simulator() -> Simulator:
    return booted()


@pytest.fixture
def signed(simulator: Simulator) -> tuple[Party, Party]:
    """The owner on the cable (SERIAL0), somebody on the radio (SERIAL1); the key is set."""
    owner, other = Party(simulator, 255, 190, 0), Party(simulator, 254, 190, 1)
    owner.set_up()
    simulator.advance_to_s(simulator.time_s + 0.1)
    owner.link.take()
    other.link.take()
    return owner, other


def listener(timestamp: int = TIME, key: bytes = KEY) -> Any:
    """A receiver that takes signed packets only."""
    mav = mavlink.MAVLink(None)
    mav.robust_parsing = True
    mav.signing.secret_key, mav.signing.timestamp = key, timestamp
    return mav


def test_outgoing_packets_are_signed_with_growing_timestamps(signed: tuple[Party, Party]) -> None:
    data = signed[1].raw(3.0)
    times = [int.from_bytes(packet[-12:-6], "little") for packet in split(data)]
    assert times == sorted(set(times))
    assert times[0] >= TIME + MINUTE
    mav = listener()
    good = [m for m in mav.parse_buffer(data) or [] if m.get_type() != "BAD_DATA"]
    assert len(good) == len(times) > 30
    wrong = [m for m in listener(key=bytes(32)).parse_buffer(data) or [] if m.get_type() != "BAD_DATA"]
    assert wrong == []


def test_unsigned_packets_are_refused_but_on_the_first_port(signed: tuple[Party, Party]) -> None:
    owner, other = signed
    other.command(SET_MODE, 1, HOLD)
    assert other.acks() == []
    other.version_1 = True
    other.command(SET_MODE, 1, HOLD)
    assert other.acks() == []
    owner.command(SET_MODE, 1, HOLD)
    assert owner.acks() == [0]


def test_a_radios_own_status_needs_no_signature(signed: tuple[Party, Party]) -> None:
    """It is taken in, unlike an unsigned heartbeat: but it goes nowhere and makes no link active."""
    owner, other = signed
    owner.beat()
    sent = other.send(mavlink.MAVLink_radio_status_message(200, 200, 99, 30, 30, 0, 0))
    assert sent not in owner.raw()
    channel = other.link.channel
    assert [m.get_type() for m in channel.parse(sent)] == ["RADIO_STATUS"]
    assert channel.parse(other.pack(mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3))) == []


def test_the_right_key_is_accepted_and_a_replay_is_not(signed: tuple[Party, Party]) -> None:
    other = signed[1]
    other.sign(timestamp=TIME + MINUTE)
    sent = other.command(SET_MODE, 1, HOLD)
    assert other.acks() == [0]
    other.link.receive(sent)
    assert other.acks() == []
    other.command(SET_MODE, 1, HOLD)
    assert other.acks() == [0]
    other.mav.signing.timestamp -= 2
    other.command(SET_MODE, 1, HOLD)
    assert other.acks() == []


def test_wrong_keys_and_damaged_signatures_are_refused(signed: tuple[Party, Party]) -> None:
    other = signed[1]
    other.sign(bytes(32), TIME + 10 * MINUTE)
    other.command(SET_MODE, 1, HOLD)
    assert other.acks() == []
    other.sign(timestamp=TIME + 10 * MINUTE)
    data = bytearray(other.pack(mavlink.MAVLink_command_long_message(1, 1, SET_MODE, 0, 1, HOLD, 0, 0, 0, 0, 0)))
    data[-1] ^= 1
    other.link.receive(bytes(data))
    assert other.acks() == []
    # Neither has spoilt the timestamps for the one who has the key.
    other.sign(timestamp=TIME + MINUTE)
    other.command(SET_MODE, 1, HOLD)
    assert other.acks() == [0]


def test_a_new_senders_clock_may_be_a_minute_late_but_no_more(signed: tuple[Party, Party]) -> None:
    other = signed[1]
    other.sign(timestamp=TIME - 1)
    other.command(SET_MODE, 1, HOLD)
    assert other.acks() == []
    other.sign(timestamp=TIME + 10_000)  # the vehicle itself is a minute and some packets further
    other.command(SET_MODE, 1, HOLD)
    assert other.acks() == [0]


def test_no_more_than_sixteen_senders(signed: tuple[Party, Party]) -> None:
    other = signed[1]
    results = []
    for link in range(20):
        other.sign(timestamp=TIME + MINUTE + link, link=link)
        other.command(SET_MODE, 1, HOLD)
        results.append(other.acks())
    assert results == [[0]] * 16 + [[]] * 4


def test_no_new_key_while_armed(simulator: Simulator) -> None:
    owner = Party(simulator, 255, 190)
    owner.command(ARM, 1)
    assert owner.acks() == [0]
    owner.set_up()
    heard = owner.heard(0.1)
    assert [m.text for m in heard if m.get_type() == "STATUSTEXT"] == ["ERROR: Won't setup signing when armed"]
    assert {packet[2] for packet in split(owner.raw(2.0))} == {0}


def test_the_key_outlives_a_reboot_and_zeros_end_it(signed: tuple[Party, Party]) -> None:
    owner, other = signed
    other.raw(35.0)  # long enough for the timestamp to be saved
    other.sign(timestamp=TIME + MINUTE)
    old = other.command(SET_MODE, 1, HOLD)
    assert other.acks() == [0]
    newest = int.from_bytes(split(other.raw(2.0))[-1][-12:-6], "little")
    owner.command(REBOOT, 1)
    owner.raw()
    owner.reconnect()
    other.reconnect()
    data = other.raw(5.0)
    assert {packet[2] for packet in split(data)} == {1}
    assert int.from_bytes(split(data)[0][-12:-6], "little") > newest
    other.link.receive(old)  # a replay of before the reboot
    assert other.acks() == []
    owner.set_up(bytes(32), 0)
    owner.raw()
    other.link.take()
    assert {packet[2] for packet in split(other.raw(2.0))} == {0}
    other.mav.signing.sign_outgoing = False
    other.command(SET_MODE, 1, HOLD)
    assert other.acks() == [0]


def test_the_newest_timestamp_heard_is_gone_on_from_also_after_a_reboot(signed: tuple[Party, Party]) -> None:
    owner, other = signed
    other.raw(40.0)  # the first saving is over
    late = TIME + 20 * MINUTE
    other.sign(timestamp=late)
    other.command(SET_MODE, 1, HOLD)
    assert other.acks() == [0]
    assert int.from_bytes(split(other.raw(2.0))[0][-12:-6], "little") > late
    other.raw(35.0)
    owner.command(REBOOT, 1)
    owner.raw()
    other.reconnect()
    assert int.from_bytes(split(other.raw(5.0))[0][-12:-6], "little") >= late + MINUTE


def test_a_key_can_be_changed_only_by_who_has_it(signed: tuple[Party, Party]) -> None:
    owner, other = signed
    other.set_up(bytes([9] * 32))
    owner.command(SET_MODE, 1, HOLD)
    assert owner.acks() == [0]
    other.sign(timestamp=TIME + MINUTE)
    other.command(SET_MODE, 1, HOLD)
    assert other.acks() == [0]


@pytest.mark.parametrize("timestamp", [2**64 - 1, 2**48 - 1, 2**48 - MINUTE - 3, 1])
def test_absurd_timestamps_are_survived(simulator: Simulator, timestamp: int) -> None:
    owner = Party(simulator, 255, 190)
    owner.set_up(bytes(32), timestamp)
    assert len(split(owner.raw(5.0))) > 50
    owner.command(SET_MODE, 1, HOLD)
    assert owner.acks() == [0]


def test_signed_packets_are_passed_on_as_they_are(signed: tuple[Party, Party]) -> None:
    owner, other = signed
    owner.beat()
    owner.raw()
    other.sign(timestamp=TIME + MINUTE)
    sent = other.beat()
    assert sent[2] == 1
    assert sent in owner.raw()


def test_the_scanner_signs_as_well() -> None:
    simulator = open_ground(sensors="lidar-90")
    owner = Party(simulator, 255, 190)
    owner.beat()
    owner.set_up()
    owner.raw()
    mav = listener()
    heard = [m for m in mav.parse_buffer(owner.raw(5.0)) or [] if m.get_type() != "BAD_DATA"]
    told = [(m.get_srcComponent(), m.get_type()) for m in heard]
    assert told.count((196, "OBSTACLE_DISTANCE")) >= 49
    assert (1, "HEARTBEAT") in told
