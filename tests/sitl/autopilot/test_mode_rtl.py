"""RTL to home or a rally point, and SMART_RTL back along the recorded path."""

import math
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sitl.autopilot.mode_smart_rtl import simplified, without_loops
from tests.support.mission_client import FENCE, RALLY, at, place_m, run_until, upload
from tests.support.quick import examples
from tests.support.sitl_client import Client, open_ground, ready

ACCEPTED, FAILED = 0, 4


def drive(client: Client, *stops: tuple[float, float]) -> None:
    """Guided from place to place, each reached."""
    for north_m, east_m in stops:
        client.drive_to(north_m, east_m)
        stop_s = client.simulator.time_s + 60.0
        while math.dist(place_m(client), (north_m, east_m)) > 1.0:
            client.run_for(0.2)
            assert client.simulator.time_s < stop_s


def test_rtl_drives_home_says_so_once_and_stays() -> None:
    client = ready(open_ground())
    drive(client, (15.0, 5.0))
    assert client.set_mode(11) == ACCEPTED
    run_until(client, "Reached destination")
    client.run_for(20.0)
    assert client.texts().count("Reached destination") == 1
    assert math.hypot(*place_m(client)) < 0.6
    assert client.of("HEARTBEAT")[-1].custom_mode == 11


def test_rtl_speed() -> None:
    client = ready(open_ground(parameters={"RTL_SPEED": 1.0}))
    drive(client, (20.0, 0.0))
    assert client.ask(20) == ACCEPTED
    fastest = 0.0
    while "Reached destination" not in client.texts():
        client.run_for(0.2)
        if client.simulator.truth.north_m < 17.0:
            fastest = max(fastest, client.simulator.truth.speed_m_s)
    assert fastest == pytest.approx(1.0, abs=0.15)


@pytest.mark.parametrize(
    ("parameters", "goal"),
    [
        ({}, (30.0, 10.0)),
        ({"RALLY_LIMIT_KM": 0.005}, (0.0, 0.0)),
        ({"FENCE_ENABLE": 1, "FENCE_ACTION": 0}, (24.0, -15.0)),
    ],
)
def test_rtl_goes_to_the_nearest_allowed_rally_point(parameters: dict[str, float], goal: tuple[float, float]) -> None:
    client = Client(open_ground(parameters=parameters))
    client.run_to(20.0)
    assert upload(client, [at(5100, 30, 10), at(5100, 24, -15), at(5100, 60, 60)], RALLY) == ACCEPTED
    assert upload(client, [at(5004, 30, 10, (1,))], FENCE) == ACCEPTED
    client.run_to(43.5)
    assert client.set_mode(15) == ACCEPTED
    assert client.arm() == ACCEPTED
    drive(client, (24.0, 0.0))
    assert client.set_mode(11) == ACCEPTED
    run_until(client, "Reached destination")
    assert math.dist(place_m(client), goal) < 0.6


def test_home_is_taken_when_it_is_nearer_unless_it_does_not_count() -> None:
    for counts, goal in ((1, (0.0, 0.0)), (0, (30.0, 0.0))):
        client = ready(open_ground(parameters={"RALLY_INCL_HOME": counts}))
        assert upload(client, [at(5100, 30, 0)], RALLY) == ACCEPTED
        drive(client, (8.0, 0.0))
        assert client.set_mode(11) == ACCEPTED
        run_until(client, "Reached destination")
        assert math.dist(place_m(client), goal) < 0.6


def test_smart_rtl_drives_the_path_back() -> None:
    client = ready(open_ground())
    drive(client, (20.0, 0.0), (20.0, 20.0), (0.0, 20.0))
    assert client.set_mode(12) == ACCEPTED
    places = []
    while "Reached destination" not in client.texts():
        client.run_for(0.5)
        places.append(place_m(client))
        assert len(places) < 300
    assert min(math.dist(place, (20.0, 20.0)) for place in places) < 2.0
    assert min(math.dist(place, (20.0, 0.0)) for place in places) < 2.0
    assert math.hypot(*places[-1]) < 1.5
    client.run_for(10.0)
    assert math.dist(place_m(client), places[-1]) < 0.6


def test_smart_rtl_leaves_loops_out() -> None:
    client = ready(open_ground())
    drive(client, (15.0, 0.0), (15.0, 15.0), (8.0, 15.0), (8.0, -8.0))
    assert client.set_mode(12) == ACCEPTED
    furthest = 0.0
    while "Reached destination" not in client.texts():
        client.run_for(0.5)
        furthest = max(furthest, place_m(client)[0])
    assert furthest < 11.0


def test_smart_rtl_needs_a_path() -> None:
    client = Client(open_ground(parameters={"SRTL_POINTS": 0}))
    client.run_to(43.5)
    assert client.set_mode(12) == FAILED


@pytest.mark.thorough
def test_a_long_crooked_drive_keeps_a_path_of_limited_length() -> None:
    simulator = open_ground(parameters={"SRTL_POINTS": 40, "SRTL_ACCURACY": 1.0})
    client = ready(simulator)
    for turn in range(12):
        drive(client, (10.0 * turn, 6.0 * (turn % 2)))
    way = simulator._vehicle.smart_rtl
    assert way.active
    assert 3 < len(way.points) <= 40
    assert client.set_mode(12) == ACCEPTED
    run_until(client, "Reached destination", 400.0)
    assert math.hypot(*place_m(client)) < 2.0


points = st.lists(st.tuples(st.floats(-50, 50), st.floats(-50, 50)), min_size=2, max_size=30)


def away_m(point: tuple[float, float], path: list[tuple[float, float]]) -> float:
    """Metres from a point to a path, by looking at many places along it."""
    best = math.inf
    for (n, e), (m, f) in pairwise(path):
        steps = 200
        best = min(
            best, *(math.dist(point, (n + (m - n) * k / steps, e + (f - e) * k / steps)) for k in range(steps + 1))
        )
    return best


@settings(max_examples=examples(60), deadline=None)
@given(points, st.floats(0.5, 5.0))
def test_a_simplified_path_stays_near_and_keeps_its_ends(path: list[tuple[float, float]], tolerance_m: float) -> None:
    short = simplified(path, tolerance_m)
    assert short[0] == path[0] and short[-1] == path[-1]
    assert len(short) <= len(path)
    assert all(away_m(point, short) <= tolerance_m + 0.5 for point in path)


@settings(max_examples=examples(60), deadline=None)
@given(points, st.floats(0.5, 5.0))
def test_a_path_without_loops_is_no_longer_and_keeps_its_ends(path: list[tuple[float, float]], near_m: float) -> None:
    def length_m(some: list[tuple[float, float]]) -> float:
        return sum(math.dist(a, b) for a, b in pairwise(some))

    short = without_loops(path, near_m)
    assert short[0] == path[0] and short[-1] == path[-1]
    assert length_m(short) <= length_m(path) + near_m * len(path)
    assert len(short) <= len(path)
