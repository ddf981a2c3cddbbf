"""Decoders of all lidars: what the simulator encodes, what others decode, and anything else."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from companion.lidar.ldrobot import crc8
from companion.lidar.models import MODELS, model_named
from companion.lidar.points import Decoder
from sitl.sensors.serial_lidar import RoverPose
from tests.support.lidars import NAMES, decoded, gateway, room, started, stream, to_walls_m

BYTES = st.binary(max_size=400)
CUTS = st.lists(st.integers(0, 3000), max_size=12)


def model(name: str) -> Any:
    found = model_named(name)
    assert found is not None
    return found


def decoder(name: str) -> Decoder:
    made: Decoder = model(name).decoder()
    return made


def sent(name: str, seconds: float = 0.4, noise_m: float = 0.0) -> bytes:
    return stream(started(room(noise_m, name), b"".join(model(name).start)), seconds)


STREAMS = {name: sent(name) for name in NAMES}


def test_every_model_of_the_reader_is_simulated() -> None:
    assert {one.name for one in MODELS} == set(NAMES)


@pytest.mark.parametrize("name", NAMES)
def test_ranges_and_directions_are_those_of_the_room(name: str) -> None:
    points = decoded(decoder(name), STREAMS[name])
    assert len(points) > 700
    true_m = to_walls_m(np.radians(points.angle_deg))
    # An eighth of a degree of rounding is 2 cm on a wall seen at 45 degrees; LD06 and YDLIDAR interpolate.
    assert np.abs(points.range_m - true_m).max() < 0.04
    assert np.all((points.angle_deg >= 0.0) & (points.angle_deg < 360.0))


@pytest.mark.parametrize("name", NAMES)
def test_nothing_stands_where_no_echo_comes_from(name: str) -> None:
    device, world = gateway(name)
    pose = RoverPose(20.2, 20.4, 0.0)
    data = stream(started(device, b"".join(model(name).start)), 0.4, pose)
    points = decoded(decoder(name), data)
    silent_deg = points.angle_deg[points.range_m == 0.0]
    seen_m = world.rays_m(pose.north_m, pose.east_m, np.radians(silent_deg).reshape(-1, 1), model(name).max_m, 0.0)
    through = np.abs((silent_deg + 180.0) % 360.0 - 180.0) < 10.0
    assert through.sum() > 10  # the gap is 20 degrees wide
    met = (seen_m < model(name).max_m).mean()
    assert met < 0.02  # directions are rounded and interpolated


@pytest.mark.parametrize("name", NAMES)
def test_few_bytes_of_a_clean_stream_are_bad(name: str) -> None:
    reader = decoder(name)
    decoded(reader, STREAMS[name])
    assert reader.bad_bytes <= 7  # the descriptor before the first point


@pytest.mark.parametrize("name", NAMES)
@given(cuts=CUTS, garbage=BYTES, at=st.integers(0, 3000))
@settings(max_examples=30, deadline=None)
def test_how_the_stream_is_cut_does_not_matter(name: str, cuts: list[int], garbage: bytes, at: int) -> None:
    data = STREAMS[name][:at] + garbage + STREAMS[name][at:3000]
    whole, pieces = (decoder(name) for _ in range(2))
    one, other = decoded(whole, data), decoded(pieces, data, cuts)
    assert np.array_equal(one.angle_deg, other.angle_deg) and np.array_equal(one.range_m, other.range_m)
    assert whole.bad_bytes == pieces.bad_bytes


@pytest.mark.parametrize("name", NAMES)
@given(garbage=st.binary(max_size=3000))
@settings(max_examples=40, deadline=None)
def test_garbage_raises_nothing_and_the_stream_behind_it_is_found(name: str, garbage: bytes) -> None:
    data = STREAMS[name]
    points = decoded(decoder(name), garbage + data)
    clean = decoded(decoder(name), data)
    # What is left of garbage may hide a packet, or be taken for the beginning of one.
    assert len(points) >= len(clean) - 50
    kept = len(clean) - 60
    assert np.array_equal(points.range_m[-kept:], clean.range_m[-kept:])


@pytest.mark.parametrize("name", NAMES)
@given(garbage=st.binary(min_size=2000, max_size=2000))
@settings(max_examples=20, deadline=None)
def test_garbage_alone_gives_no_points(name: str, garbage: bytes) -> None:
    assert len(decoded(decoder(name), garbage)) == 0


@pytest.mark.parametrize("name", NAMES)
def test_a_lost_byte_gives_no_wrong_point(name: str) -> None:
    """Of 300 places; the RPLIDAR has no check sum, so one wrong point among all of them is borne."""
    data, right = STREAMS[name][:4000], {}
    whole = decoded(decoder(name), data)
    right = set(zip(whole.angle_deg.tolist(), whole.range_m.tolist(), strict=True))
    wrong = 0
    for at in np.linspace(20, 3900, 300).astype(int).tolist():
        points = decoded(decoder(name), data[:at] + data[at + 1 :])
        assert len(points) >= len(whole) - 50
        wrong += sum(one not in right for one in zip(points.angle_deg.tolist(), points.range_m.tolist(), strict=True))
    assert wrong <= (1 if name.startswith("RPLIDAR") else 0)


@pytest.mark.parametrize("name", ["LD06", "LD19", "YDLIDAR-X4"])
def test_a_damaged_packet_is_left_out(name: str) -> None:
    data = bytearray(STREAMS[name])
    at = 500
    data[at] ^= 0x10
    points, clean = decoded(decoder(name), bytes(data)), decoded(decoder(name), STREAMS[name])
    assert 1 <= len(clean) - len(points) <= 40
    assert np.abs(points.range_m - to_walls_m(np.radians(points.angle_deg))).max() < 0.04


def test_a_packet_of_the_ld06_manual_is_read_as_it_stands_there() -> None:
    """The example of the development manual, whose check sum is 0x50."""
    body = bytes.fromhex("542C6808AB7EE000E4DC00E2D900E5D500E3D300E4D000E9CD00E4CA00E2C700E9C500E5C200E5C000E5BE823A1A")
    assert crc8(body) == 0x50
    points = decoder("LD06").feed(body + b"\x50")
    assert points.angle_deg[0] == pytest.approx(324.27) and points.angle_deg[-1] == pytest.approx(
        334.7 - 184.9, abs=360
    )
    assert points.range_m[:2].tolist() == [0.224, 0.220] and points.quality[0] == 228


def test_points_of_the_rplidar_protocol_are_read_bit_by_bit() -> None:
    nodes = b"".join(
        bytes([47 << 2 | 2, (angle << 1 | 1) & 255, angle >> 7, 0xA0, 0x0F]) for angle in range(6400, 7360, 64)
    )
    points = decoder("RPLIDAR-A1").feed(nodes)
    assert points.angle_deg.tolist() == [float(one) for one in range(100, 112)]
    assert points.range_m.tolist() == [1.0] * 12 and points.quality.tolist() == [47.0] * 12


@pytest.mark.parametrize(("name", "theirs"), [("LD19", "LDROBOT-LD19"), ("YDLIDAR-X4", "YDLIDAR-X4")])
def test_another_library_finds_the_same_points(name: str, theirs: str) -> None:
    lds2d = pytest.importorskip("lds2d")

    class Line:
        def __init__(self) -> None:
            self.data = STREAMS[name]

        def read(self, size: int) -> bytes:
            if not self.data:
                raise EOFError
            taken, self.data = self.data[:size], self.data[size:]
            return taken

    found = []
    with pytest.raises(EOFError):
        for point in lds2d.Lidar.open(theirs, transport=Line()).points():
            found.append((point.angle_deg, point.dist_mm))
    ours = decoded(decoder(name), STREAMS[name])
    other = np.array(found)
    assert len(other) == len(ours)
    aside_deg = (other[:, 0] - ours.angle_deg + 180.0) % 360.0 - 180.0
    assert np.abs(aside_deg).max() < 0.02
    assert np.abs(other[:, 1] / 1000.0 - ours.range_m).max() < 0.001
