"""Whom the codec believes, and what it makes of single messages."""

import math

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.core.frames import GeoPoint
from companion.mavlink.codec import Codec
from companion.settings import LinkSettings
from companion.vehicle.events import AckSeen, BatterySeen, FenceStatusSeen, HeartbeatSeen, PrearmSeen, TextSeen
from tests.support.mavlink_vehicle import Station


def listening(system_id: int = 1) -> tuple[Codec, Station]:
    codec, rover = Codec(LinkSettings()), Station(system_id, 1)
    codec.decode(rover.heartbeat(), 0.0)
    return codec, rover


def test_the_vehicle_is_the_first_rover_heard() -> None:
    codec = Codec(LinkSettings())
    assert codec.decode(Station(9, 1).local_position(1), 0.0) == []
    assert not codec.vehicle_known
    (event,) = codec.decode(Station(9, 1).heartbeat(15, armed=True), 2.0)
    assert event == HeartbeatSeen(2.0, 15, True, 9)
    assert codec.system_id == 9 and codec.vehicle_known
    assert codec.decode(Station(3, 1).heartbeat(), 3.0) == []
    assert codec.system_id == 9
    assert codec.counters.other_systems == 2


@pytest.mark.parametrize(
    ("sender", "kind", "autopilot", "refused"),
    [
        (Station(255, 190), 6, 8, None),
        (Station(255, 1), 6, 3, None),
        (Station(1, 191), 18, 8, None),
        (Station(1, 1), 2, 3, 2),
        (Station(1, 1), 10, 12, 10),
    ],
)
def test_others_are_not_taken_for_the_vehicle(sender: Station, kind: int, autopilot: int, refused: int | None) -> None:
    codec = Codec(LinkSettings())
    assert codec.decode(sender.heartbeat(kind=kind, autopilot=autopilot), 0.0) == []
    assert not codec.vehicle_known
    assert codec.refused_type == refused


def test_a_boat_is_a_rover() -> None:
    codec = Codec(LinkSettings())
    assert len(codec.decode(Station().heartbeat(kind=11), 0.0)) == 1


def test_only_component_1_speaks_for_the_vehicle() -> None:
    codec, _ = listening()
    lidar = Station(1, 196)
    raw = lidar.heartbeat(kind=18, autopilot=8) + lidar.local_position(1) + lidar.origin() + lidar.text(b"hello")
    assert codec.decode(raw, 1.0) == []
    assert codec.decode(Station(1, 191).text(b"our own, on the way back"), 1.0) == []


def test_answers_are_taken_when_they_are_for_us() -> None:
    codec, rover = listening()
    assert codec.decode(rover.ack(176, 4), 1.0) == [AckSeen(1.0, 176, 4)]
    assert codec.decode(rover.ack(176, 0, 0, 0), 1.0) == [AckSeen(1.0, 176, 0)]
    assert codec.decode(rover.ack(176, 0, 255, 190), 1.0) == []
    mission = rover.pack(mavlink.MAVLink_mission_ack_message(1, 191, 1))
    assert codec.decode(mission, 1.0) == [AckSeen(1.0, -1, 1)]


def test_places_that_are_not_known_are_no_places() -> None:
    codec, rover = listening()
    assert codec.decode(rover.origin(0, 0) + rover.home(0, 0) + rover.target(0, 0), 1.0) == []
    assert codec.decode(rover.home(2_000_000_000, 0), 1.0) == []
    assert codec.origin is None
    codec.decode(rover.origin(), 1.0)
    assert codec.origin == GeoPoint(-35.3632613, 149.1652299)


def test_numbers_that_are_none_are_dropped() -> None:
    codec, rover = listening()
    raw = rover.pack(mavlink.MAVLink_attitude_message(1, 0, 0, math.nan, 0, 0, 0))
    assert codec.decode(raw + rover.local_position(1, math.inf), 1.0) == []


def test_prearm_bit() -> None:
    codec, rover = listening()

    def status(health: int) -> bytes:
        return rover.pack(mavlink.MAVLink_sys_status_message(health, health, health, *[0] * 10))

    assert codec.decode(status(1 << 28), 1.0)[0] == PrearmSeen(1.0, True)
    assert codec.decode(status(~(1 << 28) & 0xFFFFFFFF), 2.0)[0] == PrearmSeen(2.0, False)


@pytest.mark.parametrize(
    ("voltage_mv", "remaining", "volts", "percent"),
    [(12600, 87, 12.6, 87), (0, -1, None, None), (65535, -1, None, None), (0, 0, None, None), (11100, 0, 11.1, 0)],
)
def test_what_is_known_of_the_battery(
    voltage_mv: int, remaining: int, volts: float | None, percent: int | None
) -> None:
    codec, rover = listening()
    short = mavlink.MAVLink_sys_status_message(0, 0, 0, 0, voltage_mv, -1, remaining, *[0] * 6)
    assert codec.decode(rover.pack(short), 1.0)[1] == BatterySeen(1.0, -1, volts, percent)
    cells = [voltage_mv or 65535, *[65535] * 9]
    long = mavlink.MAVLink_battery_status_message(2, 0, 0, 32767, cells, -1, -1, -1, remaining, 0, 3)
    assert codec.decode(rover.pack(long), 1.0) == [BatterySeen(1.0, 2, volts, percent, 3)]


@pytest.mark.parametrize(("current_ca", "amperes"), [(1234, 12.34), (0, 0.0), (-1, None)])
def test_the_current_that_is_drawn_from_the_battery(current_ca: int, amperes: float | None) -> None:
    codec, rover = listening()
    short = mavlink.MAVLink_sys_status_message(0, 0, 0, 0, 12600, current_ca, 87, *[0] * 6)
    long = mavlink.MAVLink_battery_status_message(0, 0, 0, 32767, [12600, *[65535] * 9], current_ca, -1, -1, 87)
    for raw in (rover.pack(short), rover.pack(long)):
        (seen,) = (one for one in codec.decode(raw, 1.0) if isinstance(one, BatterySeen))
        assert seen.amperes == amperes


def test_a_battery_told_in_cells_or_in_pieces_has_their_sum() -> None:
    codec, rover = listening()
    cells = [4100, 4000, 3900, *[65535] * 7]
    raw = rover.pack(mavlink.MAVLink_battery_status_message(0, 0, 0, 32767, cells, -1, -1, -1, -1))
    (seen,) = codec.decode(raw, 1.0)
    assert isinstance(seen, BatterySeen) and seen.volts == pytest.approx(12.0) and seen.percent is None


@pytest.mark.parametrize("status", [0, 1])
def test_whether_the_fence_is_breached(status: int) -> None:
    codec, rover = listening()
    raw = rover.pack(mavlink.MAVLink_fence_status_message(status, 3, 3, 5000))
    assert codec.decode(raw, 1.0) == [FenceStatusSeen(1.0, bool(status))]


def test_long_texts_are_put_together() -> None:
    codec, rover = listening()
    first, second = b"x" * 50, b"end"
    assert codec.decode(rover.text(first, 5, 0), 1.0) == []
    assert codec.decode(rover.text(second, 5, 1), 1.1) == [TextSeen(1.0, 6, "x" * 50 + "end")]


def test_a_text_whose_end_is_lost_is_still_shown() -> None:
    codec, rover = listening()
    assert codec.decode(rover.text(b"x" * 50, 5, 0), 1.0) == []
    assert codec.decode(rover.text(b"next"), 1.1) == [TextSeen(1.0, 6, "x" * 50), TextSeen(1.1, 6, "next")]
    assert codec.decode(rover.text(b"y" * 50, 6, 0), 2.0) == []
    late, beat = codec.decode(rover.heartbeat(), 3.5)
    assert late == TextSeen(2.0, 6, "y" * 50) and isinstance(beat, HeartbeatSeen)
