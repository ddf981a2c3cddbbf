"""A reader in the tick: faults of lidar and line, and the same again from what was logged."""

from __future__ import annotations

import math
from collections import deque

import numpy as np
import pytest

from companion.core.scan import RangeScan
from companion.lidar.reader import Chunk, LidarReader, Lidars, in_bursts, lidars_on
from companion.lidar.spec import parsed
from companion.perception.scan_filter import SAME, newest_ranges
from companion.vehicle.events import RangeSeen
from sitl.sensors.range_sensors import Defect
from tests.support.lidars import NAMES, Desk, desk, faulty, to_walls_m

TURNS_HZ = {"LD06": 10.0, "LD19": 10.0, "RPLIDAR-A1": 5.5, "RPLIDAR-C1": 10.0, "YDLIDAR-X4": 7.0}


def wrong(scan: RangeScan) -> int:
    """Readings that are not on the walls of the room."""
    hit = np.isfinite(scan.range_m)
    return int((np.abs(scan.range_m[hit] - to_walls_m(scan.bearing_rad[hit])) > 0.06).sum())


@pytest.mark.parametrize("name", NAMES)
def test_scans_come_at_the_rate_of_the_turns(name: str) -> None:
    rig = desk(name)
    scans = rig.run(3.0)
    assert abs(len(scans) - 3.0 * TURNS_HZ[name]) <= 2
    assert all(rig.now_s - scan.time_s >= 0.0 for scan in scans)
    assert rig.reader.counters.incomplete == 0 and rig.reader.counters.bad_bytes <= 7
    assert rig.reader.name == f"lidar 1 ({name})"


@pytest.mark.parametrize("name", NAMES)
def test_lost_and_damaged_bytes_cost_readings_but_show_nothing_that_is_not_there(name: str) -> None:
    rig = desk(name)
    rig.run(0.5)
    rig.device.faults = faulty(lost=0.001, damaged=0.001)
    scans = rig.run(4.0)
    assert len(scans) >= 0.6 * 4.0 * TURNS_HZ[name]
    false = sum(wrong(scan) for scan in scans)
    read = sum(len(scan.range_m) for scan in scans)
    # Without a check sum a damaged distance passes: two bytes of five.
    assert false <= (0.004 * read if name.startswith("RPLIDAR") else 0)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("fault", [{"stalled": True}, {"unplugged": True}, {"defect": Defect.SILENT}])
def test_no_scan_while_it_stands_or_is_silent_and_again_afterwards(name: str, fault: dict[str, object]) -> None:
    rig = desk(name)
    assert rig.run(1.0)
    rig.device.faults = faulty(**fault)
    rig.run(0.3)  # what had been measured
    assert rig.run(2.0) == []
    rig.device.faults = faulty()
    scans = rig.run(3.5)
    assert len(scans) >= 3 and sum(wrong(scan) for scan in scans) == 0


def test_after_a_pulled_cable_a_lidar_is_told_to_start_again() -> None:
    rig = desk("RPLIDAR-C1")
    rig.run(1.0)
    rig.device.faults = faulty(unplugged=True)
    rig.run(1.0)
    rig.device.faults = faulty()
    assert rig.run(2.5)
    assert (1, pytest.approx(2.05), b"") in rig.logged


def test_a_stuck_lidar_repeats_its_readings_though_the_rover_turns() -> None:
    rig = desk("RPLIDAR-A1", noise_m=0.01)
    first, second = rig.run(1.0)[-2:]
    assert not np.array_equal(first.range_m, second.range_m)
    rig.device.faults = faulty(defect=Defect.STUCK)
    rig.run(0.6)
    third, fourth = rig.run(1.5, rate_rad_s=1.0)[-2:]
    assert np.array_equal(third.range_m, fourth.range_m, equal_nan=True)


def test_what_was_logged_gives_the_same_scans() -> None:
    rig = desk("LD19", noise_m=0.02)
    rig.device.faults = faulty(lost=0.002, damaged=0.002)
    scans = rig.run(2.0)
    again = LidarReader(parsed("LD19:desk"), _Again(rig), 1)
    repeated = [scan for tick in range(1, 41) for scan in again.poll(0.05 * tick, rig)]
    assert len(scans) == len(repeated) > 10
    for one, other in zip(scans, repeated, strict=True):
        assert one.time_s == other.time_s and np.array_equal(one.range_m, other.range_m, equal_nan=True)
        assert np.array_equal(one.bearing_rad, other.bearing_rad)


class _Again:
    """A port that gives what was logged, tick by tick."""

    def __init__(self, rig: Desk) -> None:
        self._chunks = [Chunk(time_s, data) for _, time_s, data in rig.logged]

    def read(self) -> list[Chunk]:
        if not self._chunks:
            return []
        time_s = self._chunks[0].time_s
        now, self._chunks = [[one for one in self._chunks if (one.time_s == time_s) is same] for same in (True, False)]
        return now

    def write(self, data: bytes) -> None:
        """Nobody is there."""

    def close(self) -> None:
        """Nothing to close."""


def test_several_lidars_have_names_of_their_own_and_are_all_heard() -> None:
    desks = [desk("LD19"), desk("LD19", "yaw=180", yaw_rad=math.pi)]
    lidars = lidars_on([parsed("LD19:a"), parsed("LD19:b:yaw=180")], desks)
    seen: list[RangeSeen] = []
    for tick in range(1, 21):
        for one in desks:
            one.now_s = 0.05 * tick
            one.device.advance(one.now_s, one.pose(0.0, 0.0))
        seen += lidars.poll(0.05 * tick)
    assert lidars.names == ("lidar 1 (LD19)", "lidar 2 (LD19)")
    assert {one.scan.source for one in seen} == set(lidars.names)
    assert Lidars().poll(0.0) == []


def test_turns_that_pile_up_are_taken_no_oftener_than_other_scans() -> None:
    scans = [RangeSeen(scan.time_s, scan) for scan in desk("LD19").run(1.0)]
    assert len(scans) > SAME == len(newest_ranges(scans))


@pytest.mark.parametrize(("options", "free"), [("", False), ("mask=30..330", False), ("empty=5", True)])
def test_a_lidar_without_any_echo_says_nothing_unless_somebody_said_what_no_echo_means(
    options: str, free: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    rig = desk("LD19", options)
    rig.run(0.5)
    assert rig.run(0.5)[-1].tells
    with monkeypatch.context() as patched:
        patched.setattr(rig.device, "_measure", lambda angle_deg, *rest: np.zeros(len(angle_deg)))
        rig.run(0.3)
        dark = rig.run(0.5)
        assert len(dark) >= 4
        assert all(bool(np.isinf(scan.range_m).any()) is free and scan.tells is free for scan in dark)
    rig.run(0.3)
    assert rig.run(0.3)[-1].tells


def backlog(gap_s: float, piece: int = 4097) -> tuple[Desk, list[RangeScan]]:
    """A rover that drives north at 1 m/s, whose reader was not scheduled for a while; and what it reads then."""
    rig = desk("LD19")
    rig.run(1.0, speed_m_s=1.0)
    data = b""
    for _ in range(round(gap_s / 0.01)):
        rig.now_s += 0.01
        rig.device.advance(rig.now_s, rig.pose(1.0, 0.0))
        data += rig.device.take()
    pieces = [data[at : at + piece] for at in range(0, len(data), piece)]
    chunks = [Chunk(rig.now_s + 0.005 * (number + 1 - len(pieces)), one) for number, one in enumerate(pieces)]
    port = _Given(chunks)
    rig.reader._port = port
    return rig, rig.reader.poll(rig.now_s, rig)


class _Given:
    """A port with these chunks."""

    def __init__(self, chunks: list[Chunk]) -> None:
        self.chunks = chunks
        self.written: list[bytes] = []

    def read(self) -> list[Chunk]:
        chunks, self.chunks = self.chunks, []
        return chunks

    def write(self, data: bytes) -> None:
        self.written.append(data)

    def close(self) -> None:
        """Nothing to close."""


@pytest.mark.parametrize("gap_s", [0.2, 0.3, 0.5, 0.8])
def test_of_bytes_that_have_waited_only_the_newest_turn_counts_with_the_time_at_which_it_was_taken(
    gap_s: float,
) -> None:
    rig, (scan,) = backlog(gap_s)
    assert scan.age_s is not None and rig.now_s - scan.time_s < 0.11 and scan.age_s.max() < 0.11
    ahead = np.abs(scan.bearing_rad) < math.radians(2.0)
    wall_m = 4.0 - (scan.time_s - scan.age_s[ahead]) * 1.0
    assert np.abs(scan.range_m[ahead] - wall_m).max() < 0.03


def test_what_comes_after_a_pause_is_no_burst_and_a_cut_stays_where_it_was() -> None:
    chunks = [Chunk(1.0, b"a"), Chunk(1.01, b"b"), Chunk(1.2, b"c"), Chunk(1.2, b""), Chunk(1.21, b"d")]
    assert in_bursts(chunks) == [Chunk(1.01, b"ab"), Chunk(1.2, b"c"), Chunk(1.2, b""), Chunk(1.21, b"d")]


def test_the_clock_of_an_ld19_shows_that_its_bytes_have_become_late() -> None:
    rig, held = desk("LD19"), deque[list[Chunk]]()
    take = rig.read

    def late() -> list[Chunk]:
        held.append(take())
        return [Chunk(rig.now_s, one.data) for one in held.popleft()] if len(held) > 10 else []

    assert rig.run(1.0)[-1].late_s < 0.05
    rig.read = late  # type: ignore[method-assign]
    assert rig.run(2.0)[-1].late_s == pytest.approx(0.5, abs=0.05)


def test_an_rplidar_is_told_to_stop_and_to_scan_one_after_the_other() -> None:
    port = _Given([])
    LidarReader(parsed("A1:x"), port, 1).poll(0.0, desk("LD19"))
    assert port.written == [b"\xa5\x25", b"\xa5\x20"]
