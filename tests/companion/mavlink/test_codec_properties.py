"""Whatever bytes come, the codec goes on; what it encodes, others read."""

import math

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.core.frames import GeoPoint, LocalFrame, NedPoint
from companion.mavlink.codec import Codec
from companion.mavlink.transport import MemoryLink
from companion.settings import LinkSettings
from companion.vehicle.commands import GuidedPosition, GuidedVelocity, StatusText
from companion.vehicle.events import LocalPositionSeen, RangeSeen
from companion.vehicle.state import VehicleState, fold
from tests.support.mavlink_vehicle import Station
from tests.support.quick import examples
from tests.support.tlog import messages

MESSAGE_IDS = [0, 1, 22, 30, 32, 33, 47, 49, 77, 87, 132, 173, 193, 242, 253, 330]


def listening() -> Codec:
    codec = Codec(LinkSettings())
    codec.decode(Station().heartbeat(), 0.0)
    return codec


def with_checksum(message_id: int, payload: bytes, sequence: int) -> bytes:
    """A packet whose frame is right and whose contents are anything."""
    payload = payload.rstrip(b"\0") or b"\0"
    body = bytes([len(payload), 0, 0, sequence, 1, 1]) + message_id.to_bytes(3, "little") + payload
    crc = mavlink.x25crc(body + bytes([mavlink.mavlink_map[message_id].crc_extra])).crc
    return b"\xfd" + body + crc.to_bytes(2, "little")


@given(st.lists(st.binary(max_size=400), max_size=10))
def test_any_bytes_are_survived(pieces: list[bytes]) -> None:
    codec = listening()
    state = VehicleState()
    for number, piece in enumerate(pieces):
        for event in codec.decode(piece, float(number)):
            state = fold(state, event)
    state.pose_at(1.0)
    beat = Station().heartbeat(15)
    assert codec.decode(b"".join([beat, Station().local_position(1)] * 10), 99.0), "it still listens"


@given(st.lists(st.tuples(st.sampled_from(MESSAGE_IDS), st.binary(min_size=1, max_size=167)), max_size=8))
@settings(max_examples=examples(300))
def test_any_contents_are_survived(packets: list[tuple[int, bytes]]) -> None:
    codec = listening()
    state = VehicleState()
    for number, (message_id, payload) in enumerate(packets):
        for event in codec.decode(with_checksum(message_id, payload, number), float(number)):
            state = fold(state, event)
            if isinstance(event, RangeSeen):
                scan = event.scan
                assert scan.bearing_rad.shape == scan.range_m.shape
                assert np.isfinite(scan.bearing_rad).all() and not np.isnan(scan.range_m).all()
                assert (scan.range_m[np.isfinite(scan.range_m)] > 0.0).all()
                assert (scan.range_m[np.isfinite(scan.range_m)] < scan.max_range_m).all()
                assert 0.0 <= scan.min_range_m < scan.max_range_m and 0.0 < scan.beam_width_rad <= 2 * math.pi
    pose = state.pose_at(3.0)
    assert pose is None or all(map(math.isfinite, (pose.north_m, pose.east_m, pose.heading_rad)))
    assert codec.counters.bad_bytes == 0


@given(st.lists(st.binary(max_size=30), min_size=1, max_size=12), st.data())
def test_packets_among_garbage_are_found(garbage: list[bytes], data: st.DataObject) -> None:
    """Without bytes that look like a beginning, garbage costs nothing, however the stream is cut."""
    rover = Station()
    codec = listening()
    clean = [bytes(b for b in piece if b not in (0xFD, 0xFE)) for piece in garbage]
    stream = b"".join(
        piece + rover.local_position(1000 + 100 * i, float(i), 253.0) for i, piece in enumerate(clean, start=1)
    )
    cuts = sorted(data.draw(st.lists(st.integers(0, len(stream)), max_size=6)))
    near, far = MemoryLink.pair()
    seen = []
    for begin, end in zip([0, *cuts], [*cuts, len(stream)], strict=True):
        far.write(stream[begin:end])
        seen += codec.decode(near.read(), 1.0)
    assert [event.north_m for event in seen if isinstance(event, LocalPositionSeen)] == [
        float(i) for i in range(1, len(clean) + 1)
    ]
    assert codec.counters.bad_bytes == sum(map(len, clean))


@given(
    st.floats(-5000.0, 5000.0), st.floats(-5000.0, 5000.0), st.sampled_from(["global", "mission-item", "reposition"])
)
def test_positions_in_degrees_lead_to_the_same_place(north_m: float, east_m: float, form: str) -> None:
    codec = Codec(LinkSettings.model_validate({"setpoint": form}))
    codec.decode(Station().heartbeat() + Station().origin(), 0.0)
    place = NedPoint(north_m, east_m)
    (message,) = messages(codec.encode(GuidedPosition(place)))
    lat_e7, lon_e7 = (message.lat_int, message.lon_int) if form == "global" else (message.x, message.y)
    frame = LocalFrame(GeoPoint(-35.3632613, 149.1652299))
    assert frame.to_ned(GeoPoint(lat_e7 / 1e7, lon_e7 / 1e7)).distance_m(place) < 0.01


@given(st.floats(-10.0, 10.0), st.floats(-3.0, 3.0))
def test_velocities_come_out_as_they_went_in(forward_m_s: float, yaw_rate_rad_s: float) -> None:
    (message,) = messages(listening().encode(GuidedVelocity(forward_m_s, yaw_rate_rad_s)))
    assert (message.vx, message.yaw_rate) == (np.float32(forward_m_s), np.float32(yaw_rate_rad_s))
    assert (message.type_mask, message.coordinate_frame) == (1511, 8)


@given(st.text(max_size=300))
def test_any_text_can_be_said(text: str) -> None:
    parts = messages(listening().encode(StatusText(6, text)))
    data = b"".join(bytes(part._text_raw).rstrip(b"\0") for part in parts)
    assert data == text.replace("\0", " ").encode("utf-8", errors="replace")
    assert [part.chunk_seq for part in parts] == list(range(len(parts)))
