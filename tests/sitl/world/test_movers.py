"""What moves in the simulator's world: where it is when, what rays and the rover meet of it, what it tells."""

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from companion.core.frames import GeoPoint
from companion.mission.load import load_mission
from companion.mission.mission import MissionError
from sitl.scenario import ScenarioError, scenario_from_mission
from sitl.simulator import Simulator
from sitl.world.movers import Announcement, Mover, timed_track
from sitl.world.truth import SimStart
from sitl.world.world import World
from tests.support.sitl_client import READY_S, Client

HOME = GeoPoint(-35.3632613, 149.1652299)
HEAD = '[[target]]\nnorth_m = 10.0\neast_m = 0.0\n[sitl]\nsensors = "none"\n[[sitl.movers]]\n'


def mover(
    places: list[tuple[float, float]], speed_m_s: float = 1.0, start_s: float = 0.0, *,
    repeats: bool = False, radius_m: float = 0.5, announce: Announcement | None = None,
) -> Mover:  # fmt: skip
    return Mover("m", radius_m, timed_track(places, speed_m_s, start_s, repeats=repeats), repeats, announce)


def world(*movers: Mover) -> World:
    return World(np.zeros((1, 1), np.bool_), movers=movers)


def test_it_stands_goes_and_stands_again() -> None:
    ground = world(mover([(0.0, 0.0), (0.0, 10.0), (5.0, 10.0)], 2.0, 3.0))
    for time_s, there in ((0.0, (0.0, 0.0, 0.0, 0.0)), (5.0, (0.0, 4.0, 0.0, 2.0)), (9.0, (2.0, 10.0, 2.0, 0.0))):
        assert ground.mover_at(0, time_s) == pytest.approx(there)
    assert ground.mover_at(0, 99.0) == pytest.approx((5.0, 10.0, 0.0, 0.0))


@settings(deadline=None)
@given(
    st.lists(st.tuples(st.floats(-50, 50), st.floats(-50, 50)), min_size=2, max_size=6),
    st.floats(0.1, 5.0),
    st.floats(0.0, 500.0),
)
def test_what_repeats_is_never_faster_than_it_may_and_comes_back(
    places: list[tuple[float, float]], speed_m_s: float, time_s: float
) -> None:
    if all(math.dist(one, places[0]) < 0.01 for one in places):
        return
    ground = world(mover(places, speed_m_s, repeats=True))
    period_s = float(ground.fleet.periods_s[0])
    here, soon, later = (ground.mover_at(0, time_s + extra)[:2] for extra in (0.0, 0.01, period_s))
    assert math.dist(here, soon) <= speed_m_s * 0.01 + 1e-6
    assert math.dist(here, later) <= 1e-4 * max(1.0, speed_m_s)


def test_rays_end_at_the_disc_where_it_is_at_that_moment() -> None:
    ground = world(mover([(0.0, 10.0), (20.0, 10.0)], 1.0))
    bearings = np.array([[math.pi / 2], [0.0]])
    assert ground.rays_m(0.0, 0.0, bearings, 30.0, 0.0) == pytest.approx([9.5, 30.0])
    assert ground.rays_m(0.0, 0.0, bearings, 30.0, 2.0) == pytest.approx([30.0, 30.0])
    assert ground.rays_m(20.0, 10.0, bearings, 30.0, 19.8) == pytest.approx([0.0, 0.0])


@settings(deadline=None)
@given(st.floats(-8, 8), st.floats(-8, 8), st.floats(-math.pi, math.pi))
def test_a_ray_meets_the_rim_and_nothing_nearer(north_m: float, east_m: float, bearing_rad: float) -> None:
    ground = world(mover([(3.0, 2.0), (9.0, 9.0)], radius_m=1.0))
    length_m = float(ground.rays_m(north_m, east_m, np.array([[bearing_rad]]), 40.0)[0])
    along = np.linspace(0.0, length_m, 200)
    gaps = np.hypot(north_m + along * math.cos(bearing_rad) - 3.0, east_m + along * math.sin(bearing_rad) - 2.0)
    assert gaps[:-1].min() >= min(1.0, gaps[0]) - 1e-6
    if 0.0 < length_m < 40.0:
        assert gaps[-1] == pytest.approx(1.0, abs=1e-6)


def test_what_drives_into_a_standing_rover_is_one_collision_with_its_name() -> None:
    ground = world(mover([(-20.0, 0.0), (20.0, 0.0)], 1.0))
    simulator = Simulator(ground, SimStart(0.0, 0.0, 0.0, HOME), "none", noise=False)
    simulator.advance_to_s(45.0)
    (collision,) = simulator.collisions
    assert collision.time_s == pytest.approx(20.0 - 0.85, abs=0.03)
    assert (collision.mover, collision.speed_m_s) == ("m", 0.0)


def test_what_passes_by_is_none() -> None:
    ground = world(mover([(-20.0, 0.9), (20.0, 0.9)], 1.0))
    simulator = Simulator(ground, SimStart(0.0, 0.0, 0.0, HOME), "none", noise=False)
    simulator.advance_to_s(20.0)
    assert simulator.clearance_m == pytest.approx(0.05, abs=0.01)
    simulator.advance_to_s(45.0)
    assert not simulator.collisions


def test_the_rover_stops_at_what_it_runs_into() -> None:
    ground = world(mover([(5.0, 0.0), (5.0, 1.0)], 1.0, 500.0))
    client = Client(Simulator(ground, SimStart(0.0, 0.0, 0.0, HOME), "none", noise=False))
    client.run_to(READY_S)
    client.set_mode(15)
    client.arm()
    client.drive_to(20.0, 0.0)
    client.run_for(4.0)
    (collision,) = client.simulator.collisions
    assert collision.speed_m_s > 0.5
    assert collision.north_m == pytest.approx(5.0 - 0.85, abs=0.05)


def test_what_announces_itself_tells_the_truth() -> None:
    kinds = tuple(Announcement)
    routes = [[(10.0 * i, 0.0), (10.0 * i, 40.0)] for i in range(1, 4)]
    movers = [mover(route, 1.5, announce=kind) for route, kind in zip(routes, kinds, strict=True)]
    client = Client(Simulator(world(*movers), SimStart(0.0, 0.0, 0.0, HOME), "none", noise=False))
    client.run_to(6.0)
    told = [message for message in client.of("GLOBAL_POSITION_INT") if message.get_srcSystem() == 101]
    assert len(told) == pytest.approx(24, abs=2)
    assert told[-1].vy == 150 and told[-1].vx == 0
    assert len([m for m in client.of("HEARTBEAT") if m.get_srcSystem() == 101]) == 6
    for kind, count in (("ADSB_VEHICLE", 6), ("AIS_VESSEL", 6)):
        assert len(client.of(kind)) == pytest.approx(count, abs=1)
        message = client.of(kind)[-1]
        assert message.get_srcSystem() == 1
        row = 2 if kind == "ADSB_VEHICLE" else 3
        assert (message.lat / 1e7 - HOME.lat_deg) * 111_318.8 == pytest.approx(10.0 * row, abs=0.1)
    assert client.of("ADSB_VEHICLE")[-1].hor_velocity == client.of("AIS_VESSEL")[-1].velocity == 150


def test_nobody_talks_where_nothing_announces_itself() -> None:
    client = Client(Simulator(world(mover([(9.0, 9.0), (9.0, 20.0)])), SimStart(0.0, 0.0, 0.0, HOME), "none"))
    client.run_to(10.0)
    assert {message.get_srcSystem() for message in client.received} == {1}


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("speed_m_s = 1.0\nroute_m = [[0, 9], [5, 9]]", "sitl.movers 1.radius_m: is missing"),
        ("radius_m = 0.0\nspeed_m_s = 1.0\nroute_m = [[0, 9], [5, 9]]", "sitl.movers 1.radius_m"),
        ("radius_m = 0.5\nspeed_m_s = -1.0\nroute_m = [[0, 9], [5, 9]]", "sitl.movers 1.speed_m_s"),
        (
            "radius_m = 0.5\nspeed_m_s = 1.0\nroute_m = [[0, 9], [0, 9]]",
            "sitl.movers 1: route_m needs at least two",
        ),
        ("radius_m = 0.5\nspeed_m_s = 1.0\nroute_m = []", "sitl.movers 1: route_m needs at least two"),
        ("radius_m = 0.5\nspeed_m_s = 1.0\nroute_m = [[0, 9, 1], [0, 1]]", "sitl.movers 1.route_m 1"),
        ("radius_m = 0.5\nspeed_m_s = 1.0\nroute_m = [[0, 9], [5, 9]]\nrepeats = true", "did you mean 'repeat'?"),
        (
            'radius_m = 0.5\nspeed_m_s = 1.0\nroute_m = [[0, 9], [5, 9]]\nannounce = "radio"',
            "sitl.movers 1.announce",
        ),
        ("radius_m = 0.5\nspeed_m_s = 1.0\nroute_m = [[0, nan], [5, 9]]", "sitl.movers 1.route_m"),
    ],
)
def test_bad_movers_get_one_line(tmp_path: Path, text: str, words: str) -> None:
    path = tmp_path / "m.toml"
    path.write_text(HEAD + text)
    with pytest.raises(MissionError) as caught:
        load_mission(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert words in str(caught.value) and "\n" not in str(caught.value)


def test_a_mover_must_not_begin_on_the_rover(tmp_path: Path) -> None:
    path = tmp_path / "m.toml"
    path.write_text(HEAD + "radius_m = 0.5\nspeed_m_s = 1.0\nroute_m = [[0.5, 0.0], [5, 9]]")
    with pytest.raises(ScenarioError, match=r"sitl.movers 1: starts where the rover stands") as caught:
        scenario_from_mission(load_mission(path))
    assert "\n" not in str(caught.value)
