"""Doors: exact in time, for rays and for contact alike."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sitl.simulator import Simulator
from sitl.world.doors import FOR_EVER_MS, Door, next_change_s
from sitl.world.truth import SimStart
from sitl.world.world import World
from tests.support.rays import ray_m
from tests.support.sitl_client import HOME, Client, ready

NOTHING = np.zeros((12, 12), dtype=np.bool_)
ROW_8 = NOTHING.copy()
ROW_8[8, :] = True


def door(*open_s: tuple[float, float], period_s: float = 0.0) -> Door:
    spans = tuple((round(begin * 1000), round(end * 1000) if end < math.inf else FOR_EVER_MS) for begin, end in open_s)
    return Door("door", ROW_8, spans, round(period_s * 1000))


def behind(*doors: Door) -> World:
    """12 x 12 m with doors from north 8 to 9."""
    return World(NOTHING, doors=doors)


@pytest.mark.parametrize(
    ("time_s", "is_open"),
    [(0.0, False), (9.999, False), (10.0, True), (19.999, True), (20.0, False), (30.0, True), (1e6, True)],
)
def test_it_is_open_from_the_first_moment_of_a_span_up_to_its_last(time_s: float, is_open: bool) -> None:
    assert door((10.0, 20.0), (30.0, math.inf)).is_open(time_s) is is_open


def test_a_timetable_with_a_period_begins_anew() -> None:
    gate = door((5.0, 10.0), period_s=60.0)
    assert [gate.is_open(t) for t in (4.0, 5.0, 64.99, 65.0, 69.99, 70.0, 605.0)] == [
        False, True, False, True, True, False, True,
    ]  # fmt: skip
    assert [gate.next_change_s(t) for t in (0.0, 5.0, 10.0, 64.0, 65.0)] == [5.0, 10.0, 65.0, 65.0, 70.0]


@given(
    st.lists(st.tuples(st.integers(0, 90_000), st.integers(1, 30_000)), min_size=1, max_size=5),
    st.sampled_from([0, 120_000, 200_020]),
    st.floats(0.0, 500.0),
    st.floats(0.0, 1.0),
)
def test_nothing_moves_before_the_next_change(
    spans: list[tuple[int, int]], period_ms: int, time_s: float, share: float
) -> None:
    doors = (Door("d", ROW_8, tuple((begin, begin + length) for begin, length in spans), period_ms),)
    change_s = next_change_s(doors, time_s)
    assert change_s > time_s
    until_s = min(change_s, time_s + 1000.0)
    between_s = max(time_s, time_s + share * (until_s - time_s) - 2e-3)
    assert doors[0].is_open(between_s) == doors[0].is_open(time_s)


def test_rays_see_it_while_it_is_closed() -> None:
    world = behind(door((10.0, 20.0)))
    ranges = [ray_m(world, 2.0, 5.5, 0.0, 9.0, time_s) for time_s in (0.0, 9.99, 10.0, 19.99, 20.0)]
    assert ranges == pytest.approx([6.0, 6.0, 9.0, 9.0, 6.0])
    assert world.clearance_m(7.0, 5.5, 3.0, 0.0) == pytest.approx(1.0)
    assert world.clearance_m(7.0, 5.5, 3.0, 10.0) == 3.0


@pytest.mark.parametrize("closes_s", [5.0, 5.02, 5.07, 5.1])
def test_the_scanner_sees_it_from_its_time_on_and_not_before(closes_s: float) -> None:
    world = behind(door((0.0, closes_s)))
    client = Client(Simulator(world, SimStart(5.0, 5.5, 0.0, HOME), "lidar-90", noise=False))
    client.run_to(7.0)
    for scan in client.of("OBSTACLE_DISTANCE"):
        closed = scan.time_usec * 1e-6 >= closes_s - 1e-9
        assert (scan.distances[36] == 300) is closed, scan.time_usec


def drives_north(world: World, seconds: float) -> Simulator:
    client = ready(Simulator(world, SimStart(2.0, 5.5, 0.0, HOME), "none", noise=False))
    client.drive_to(9.0, 0.0)
    client.run_for(seconds)
    return client.simulator


def test_a_closed_door_stops_the_rover_and_an_open_one_does_not() -> None:
    stopped = drives_north(behind(door((10.0, 20.0))), 15.0)
    assert len(stopped.collisions) == 1
    assert stopped.truth.north_m == pytest.approx(8.0 - 0.35, abs=0.02)
    assert stopped.clearance_m == pytest.approx(0.0, abs=0.02)
    passed = drives_north(behind(door((10.0, math.inf))), 15.0)
    assert not passed.collisions
    assert passed.truth.north_m > 10.5
    assert passed.clearance_m > 1.0


@pytest.mark.parametrize("closes_s", [50.0, 50.013])
def test_one_that_closes_on_the_rover_touches_it_at_that_moment(closes_s: float) -> None:
    client = ready(Simulator(behind(door((0.0, closes_s))), SimStart(8.5, 5.5, 0.0, HOME), "none", noise=False))
    client.run_to(60.0)
    (touched,) = client.simulator.collisions
    assert touched.what == "door"
    assert touched.time_s == pytest.approx(math.ceil(closes_s * 50.0) / 50.0 + 0.02)


def test_runs_with_doors_repeat() -> None:
    world = behind(door((0.0, 46.0), (48.0, math.inf)))
    one, two = (drives_north(world, 8.0) for _ in range(2))
    assert one.truth == two.truth
