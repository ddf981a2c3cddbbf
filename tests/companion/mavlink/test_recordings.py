"""Recordings of ArduRover 4.7, decoded and compared with what they are known to contain."""

import math
from collections import Counter

import pytest

from companion.core.frames import GeoPoint, LocalFrame, NedPoint
from companion.mavlink.codec import Codec
from companion.settings import LinkSettings
from companion.vehicle.events import (
    AckSeen,
    AttitudeSeen,
    EkfStatusSeen,
    Event,
    GlobalPositionSeen,
    HeartbeatSeen,
    HomeSeen,
    LocalPositionSeen,
    OriginSeen,
    ParameterSeen,
    PrearmSeen,
    RangeSeen,
    RoverMode,
    TargetSeen,
    TextSeen,
    ThrottleSeen,
)
from companion.vehicle.state import EkfQuantity, VehicleState, fold
from tests.support.shared_data import SHARED, needs_shared
from tests.support.tlog import messages, raw_packets

RECORDINGS = SHARED / "data" / "ardurover-4.7-transcripts"
NAMES = ["boot-to-armed", "commands-and-acks", "guided-drive", "rangefinders"]
ORIGIN = GeoPoint(-35.3632613, 149.1652299)

pytestmark = needs_shared


def events_of(name: str) -> list[Event]:
    """All events, with the packet's number as the time."""
    codec = Codec(LinkSettings())
    return [
        event
        for number, raw in enumerate(raw_packets(RECORDINGS / f"{name}.tlog"))
        for event in codec.decode(raw, number / 1000.0)
    ]


@pytest.mark.parametrize("name", NAMES)
def test_every_packet_is_recognised(name: str) -> None:
    codec = Codec(LinkSettings())
    path = RECORDINGS / f"{name}.tlog"
    raw = list(raw_packets(path))
    framed = [packet.raw for packet in codec.packets(b"".join(raw))]
    assert framed == raw
    assert codec.counters.bad_bytes == codec.counters.unknown == 0


@pytest.mark.parametrize("name", NAMES)
def test_nothing_is_lost_among_foreign_bytes(name: str) -> None:
    """The log's own time stamps are garbage to a parser of bytes, and contain stray beginnings of packets."""
    codec = Codec(LinkSettings())
    path = RECORDINGS / f"{name}.tlog"
    count = sum(1 for _ in raw_packets(path))
    assert len(codec.packets(path.read_bytes())) == count
    assert codec.counters.bad_bytes == 8 * count


def test_values_agree_with_pymavlink() -> None:
    path = RECORDINGS / "guided-drive.tlog"
    theirs = messages(b"".join(raw_packets(path)))
    events = events_of("guided-drive")
    local = [m for m in theirs if m.get_type() == "LOCAL_POSITION_NED"]
    ours = [e for e in events if isinstance(e, LocalPositionSeen)]
    assert [(e.boot_s, e.north_m, e.east_m, e.north_m_s, e.east_m_s) for e in ours] == [
        (m.time_boot_ms / 1000.0, m.x, m.y, m.vx, m.vy) for m in local
    ]
    attitude = [m for m in theirs if m.get_type() == "ATTITUDE"]
    assert [(e.heading_rad, e.yaw_rate_rad_s) for e in events if isinstance(e, AttitudeSeen)] == [
        (m.yaw, m.yawspeed) for m in attitude
    ]
    flags = [m.flags for m in theirs if m.get_type() == "EKF_STATUS_REPORT"]
    assert [e.flags for e in events if isinstance(e, EkfStatusSeen)] == flags
    shares = [m.throttle / 100.0 for m in theirs if m.get_type() == "VFR_HUD"]
    assert [e.share for e in events if isinstance(e, ThrottleSeen)] == shares and max(shares) > 0.1
    targets = [m for m in theirs if m.get_type() == "POSITION_TARGET_GLOBAL_INT"]
    assert [(e.point.lat_deg, e.point.lon_deg, e.type_mask) for e in events if isinstance(e, TargetSeen)] == [
        (m.lat_int / 1e7, m.lon_int / 1e7, m.type_mask) for m in targets
    ]


def test_local_frame_is_the_autopilots_own() -> None:
    """Degrees become the metres that the autopilot reports at the same moment; the origin is this simulator's."""
    origin = next(e.point for e in events_of("commands-and-acks") if isinstance(e, OriginSeen))
    assert origin == ORIGIN
    frame = LocalFrame(origin)
    events = events_of("guided-drive")
    local = {e.boot_s: e for e in events if isinstance(e, LocalPositionSeen)}
    pairs = [(local[e.boot_s], e.point) for e in events if isinstance(e, GlobalPositionSeen) and e.boot_s in local]
    driving = [(NedPoint(seen.north_m, seen.east_m), point) for seen, point in pairs if seen.boot_s > 45.0]
    assert len(driving) > 1000
    assert max(math.hypot(place.north_m, place.east_m) for place, _ in driving) > 18.0
    assert max(frame.to_ned(point).distance_m(place) for place, point in driving) < 0.02
    assert max(place.distance_m(frame.to_ned(frame.to_geo(place))) for place, _ in driving) < 1e-6


def test_read_back_shows_the_target_in_the_local_frame() -> None:
    frame = LocalFrame(ORIGIN)
    targets = [frame.to_ned(e.point) for e in events_of("guided-drive") if isinstance(e, TargetSeen)]
    assert min(target.distance_m(NedPoint(10.0, 0.0)) for target in targets) < 0.02
    assert min(target.distance_m(NedPoint(10.0, 8.0)) for target in targets) < 0.02


def test_boot_leads_to_a_rover_that_may_be_armed() -> None:
    state = VehicleState()
    modes = []
    ready_before_gps = []
    arming = []
    for event in events_of("boot-to-armed"):
        state = fold(state, event)
        if isinstance(event, HeartbeatSeen):
            modes.append((event.mode, event.armed))
        if isinstance(event, AckSeen) and event.command == 400:
            arming.append(event.result)
        if isinstance(event, PrearmSeen) and event.ok:
            ready_before_gps.append(state.ekf_lacks is EkfQuantity.POSITION)
    assert modes[0] == (16, False), "INITIALISING"
    assert (RoverMode.MANUAL, False) in modes
    assert modes[-1][0] == RoverMode.GUIDED
    assert arming[-1] == 0 and 4 in arming, "refused at first, accepted in the end"
    assert any(ready_before_gps), "the pre-arm bit comes before the EKF has a position"
    assert state.ekf_ok
    assert state.home is not None and state.home.point == ORIGIN


def test_texts_and_parameters() -> None:
    events = events_of("commands-and-acks")
    texts = [e.text for e in events if isinstance(e, TextSeen)]
    assert "Requested rate for message ID 33 too fast. Increase SCHED_LOOP_RATE" in texts
    assert "No Mission. Can't set AUTO." in texts
    assert not any(text == "e SCHED_LOOP_RATE" for text in texts)
    parameters = {e.name: e.value for e in events if isinstance(e, ParameterSeen)}
    assert parameters["WP_SPEED"] == 2.5


def test_answers_to_others_are_not_ours() -> None:
    """In one recording a ground station (255/190) asked, in the others component 191."""
    assert not any(isinstance(e, AckSeen) for e in events_of("commands-and-acks"))
    acks = Counter((e.command, e.result) for e in events_of("guided-drive") if isinstance(e, AckSeen))
    assert acks[(176, 0)] == 3 and acks[(400, 0)] == 1 and acks[(-1, 0)] == 1
    assert acks[(511, 0)] == 10


def test_rangefinder_orientations_count_clockwise() -> None:
    """The rover drives at a post, then turns right: the left-front sensor (7) sees the post, not the front one."""
    state = VehicleState()
    hits: dict[str, list[NedPoint]] = {}
    nothing: Counter[str] = Counter()
    for event in events_of("rangefinders"):
        state = fold(state, event)
        if not isinstance(event, RangeSeen):
            continue
        scan = event.scan
        if math.isinf(scan.range_m[0]):
            nothing[scan.source] += 1
            continue
        assert state.position is not None and state.attitude is not None
        here = NedPoint(state.position.north_m, state.position.east_m)
        bearing_rad = state.attitude.heading_rad + scan.bearing_rad[0]
        hits.setdefault(scan.source, []).append(here.moved(bearing_rad, scan.range_m[0]))
    assert len(hits["distance sensor 0"]) == 111 and len(hits["distance sensor 1"]) == 2
    post = NedPoint(14.7, 0.1)
    assert all(hit.distance_m(post) < 0.75 for places in hits.values() for hit in places)
    assert nothing["distance sensor 2"] == 332, "2100 cm with a maximum of 2000 is nothing seen, not a hit"


def test_home_is_where_the_simulator_starts() -> None:
    homes = [e.point for e in events_of("rangefinders") if isinstance(e, HomeSeen)]
    assert homes == [ORIGIN]


@pytest.mark.parametrize("name", ["metu_kalfa_short", "strawberry_pixhawk1"])
def test_real_rovers_with_older_firmware(name: str) -> None:
    path = SHARED / "data" / "telemetry" / "real_rover" / f"{name}.tlog"
    if not path.exists():
        pytest.skip("recording not there")
    codec = Codec(LinkSettings())
    events = codec.decode(path.read_bytes(), 0.0)
    assert codec.vehicle_known
    assert sum(isinstance(e, AttitudeSeen) for e in events) >= 8
    assert sum(isinstance(e, HeartbeatSeen) for e in events) >= 5
