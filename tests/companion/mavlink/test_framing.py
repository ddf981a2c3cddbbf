"""From bytes to packets: nothing good is lost, nothing bad gets through."""

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.mavlink.codec import Codec
from companion.mavlink.framing import Framer
from companion.settings import LinkSettings
from companion.vehicle.events import AttitudeSeen, HeartbeatSeen, LocalPositionSeen
from tests.support.mavlink_vehicle import Station


def stream(count: int = 20) -> list[bytes]:
    rover = Station()
    return [rover.heartbeat(), *(rover.local_position(1000 + 100 * i, 0.1 * i, 253.0) for i in range(count))]


def test_pieces_of_any_size_give_the_same_packets() -> None:
    packets = stream()
    data = b"".join(packets)
    for size in (1, 2, 7, 50, len(data)):
        framer = Framer()
        got = [p.raw for i in range(0, len(data), size) for p in framer.feed(data[i : i + size])]
        assert got == packets
        assert framer.bad_bytes == 0


def test_both_versions_are_understood() -> None:
    rover = Station(7, 1)
    data = rover.pack(mavlink.MAVLink_attitude_message(0, 0, 0, 1.0, 0, 0, 0), version_1=True) + rover.heartbeat()
    first, second = Framer().feed(data)
    assert (first.message_id, first.system_id, first.component_id, first.raw[0]) == (30, 7, 1, 0xFE)
    assert (second.message_id, second.system_id, second.sequence, second.raw[0]) == (0, 7, 1, 0xFD)


def test_signed_packets_are_understood() -> None:
    signer = mavlink.MAVLink(None, 1, 1)
    signer.signing.secret_key = b"k" * 32
    signer.signing.sign_outgoing = True
    raw = bytes(mavlink.MAVLink_heartbeat_message(10, 3, 0, 4, 4, 3).pack(signer))
    codec = Codec(LinkSettings())
    (event,) = codec.decode(raw + Station().local_position(1)[:3], 0.0)
    assert isinstance(event, HeartbeatSeen) and event.mode == 4
    assert codec.counters.bad_bytes == 0


def test_a_lost_byte_costs_one_packet() -> None:
    packets = stream()
    for cut in (0, 1, 5, 9, 15, len(packets[3]) - 1):
        damaged = packets[3][:cut] + packets[3][cut + 1 :]
        framer = Framer()
        got = [p.raw for p in framer.feed(b"".join([*packets[:3], damaged, *packets[4:]]))]
        assert got == packets[:3] + packets[4:]


def test_a_changed_byte_costs_one_packet() -> None:
    packets = stream()
    for place in range(len(packets[3])):
        damaged = bytearray(packets[3])
        damaged[place] ^= 0x55
        got = [p.raw for p in Framer().feed(b"".join([*packets[:3], bytes(damaged), *packets[4:]]))]
        assert got == packets[:3] + packets[4:]


def test_a_stray_beginning_does_not_hold_up_what_follows() -> None:
    """It claims 255 bytes, and the valid packet behind it is shorter."""
    packet = Station().heartbeat()
    framer = Framer()
    assert [p.raw for p in framer.feed(b"\xfd\xff\x00" + packet)] == [packet]
    assert framer.bad_bytes == 3


def test_unknown_messages_are_counted_and_passed_over() -> None:
    unknown = bytes([0xFD, 4, 0, 0, 0, 1, 1, 0xFF, 0xFF, 0x70, 1, 2, 3, 4, 9, 9])
    packet = Station().heartbeat()
    framer = Framer()
    assert [p.raw for p in framer.feed(unknown + packet + unknown)] == [packet]
    assert (framer.unknown, framer.bad_bytes) == (2, 0)


def test_unknown_features_are_refused() -> None:
    raw = bytearray(Station().heartbeat())
    raw[2] = 0x02
    framer = Framer()
    assert framer.feed(bytes(raw)) == []
    assert framer.bad_bytes > 0


def test_lost_packets_are_counted_and_repeated_ones_dropped() -> None:
    packets = stream(10)
    codec = Codec(LinkSettings())
    events = codec.decode(b"".join([*packets[:4], packets[3], packets[3], *packets[6:]]), 0.0)
    assert sum(isinstance(event, LocalPositionSeen) for event in events) == 8
    assert codec.counters.lost == 2


def test_packets_that_overtake_each_other_do_not_bring_old_positions_back() -> None:
    rover = Station()
    codec = Codec(LinkSettings())
    codec.decode(rover.heartbeat(), 0.0)
    old, new = rover.local_position(10_000), rover.local_position(10_100)
    events = codec.decode(new + old, 1.0)
    assert [event.boot_s for event in events if isinstance(event, LocalPositionSeen)] == [10.1]
    assert codec.boot_s == 10.1


def test_an_attitude_or_position_counts_once() -> None:
    """Each kind has a time of its own: two messages of the same moment are both taken."""
    rover, codec = Station(), Codec(LinkSettings())
    codec.decode(rover.heartbeat(), 0.0)
    taken: dict[type, list[float]] = {LocalPositionSeen: [], AttitudeSeen: []}
    for boot_ms in (0, 0, 10_000, 10_000, 10_020, 10_000, 10_020):
        attitude = rover.pack(mavlink.MAVLink_attitude_message(boot_ms, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0))
        for event in codec.decode(rover.local_position(boot_ms) + attitude, 1.0):
            assert isinstance(event, LocalPositionSeen | AttitudeSeen)
            taken[type(event)].append(event.boot_s)
    assert taken == {LocalPositionSeen: [0.0, 10.0, 10.02], AttitudeSeen: [0.0, 10.0, 10.02]}


def test_a_restart_of_the_autopilot_is_noticed() -> None:
    rover = Station()
    codec = Codec(LinkSettings())
    codec.decode(rover.heartbeat() + rover.origin() + rover.local_position(60_000), 0.0)
    assert codec.origin is not None
    (event,) = codec.decode(rover.local_position(3_000), 1.0)
    assert isinstance(event, LocalPositionSeen) and event.boot_s == 3.0
    assert codec.origin is None
