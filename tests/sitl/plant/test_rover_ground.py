"""Slippery and rough ground against the mechanics that it stands for."""

import itertools
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sitl.plant.outline import Outline
from sitl.plant.rover import GRAVITY_M_S2, drive, new_rover
from sitl.simulator import Simulator
from sitl.world.truth import SimStart
from sitl.world.world import TOP_SPEED_M_S, Ground, World
from tests.support.quick import examples
from tests.support.sitl_client import HOME, ready

STEP_S = 0.005
FORWARD_AND_TURN_MASK = 1511


def ground(grip: float = 1.0, pace: float = 1.0, north_m: float = 0.0) -> World:
    """400 x 400 m round 0, 0; from ``north_m`` on northwards the ground is like that."""
    layers: Ground = np.ones((2, 400, 400), dtype=np.float32)
    layers[0, 200 + round(north_m) :], layers[1, 200 + round(north_m) :] = grip, pace
    return World(np.zeros((400, 400), dtype=np.bool_), south_m=-200.0, west_m=-200.0, ground=layers)


def step(rover: Any, world: World, servo_1: float, servo_3: float) -> None:
    drive(rover[0], world.surroundings(0.0), servo_1, servo_3, STEP_S)


def velocity(rover: Any) -> complex:
    """North and east (as real and imaginary part), m/s."""
    state = rover[0]
    return complex(state.speed_m_s, state.slide_m_s) * complex(math.cos(state.heading_rad), math.sin(state.heading_rad))


def rolling(speed_m_s: float, turning_radius_m: float = 0.0, north_m: float = 0.5) -> Any:
    rover = new_rover(north_m, 0.5, 0.0, Outline(0.35), turning_radius_m).view(np.recarray)
    rover[0].speed_m_s = speed_m_s
    return rover


@pytest.mark.parametrize("grip", [0.05, 0.1, 0.3])
def test_braking_takes_the_distance_that_friction_allows(grip: float) -> None:
    rover, world = rolling(3.0), ground(grip)
    while rover[0].speed_m_s > 0.0:
        step(rover, world, -1.0, -1.0)
    assert rover[0].north_m - 0.5 == pytest.approx(3.0**2 / (2.0 * grip * GRAVITY_M_S2), rel=0.01)


def test_pulling_away_takes_as_long_as_friction_needs() -> None:
    rover, world = rolling(0.0), ground(0.1)
    for _ in range(200):
        step(rover, world, 1.0, 1.0)
    assert rover[0].speed_m_s == pytest.approx(0.1 * GRAVITY_M_S2, rel=0.01)


@settings(max_examples=examples(60), deadline=None)
@given(
    st.floats(0.02, 0.99),
    st.floats(-3.0, 3.0),
    st.sampled_from([0.0, 2.0]),
    st.lists(st.tuples(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0)), min_size=1, max_size=20),
)
def test_friction_is_all_that_changes_the_velocity(
    grip: float, speed_m_s: float, turning_radius_m: float, servos: list[tuple[float, float]]
) -> None:
    rover, world = rolling(speed_m_s, turning_radius_m, north_m=50.5), ground(grip)
    for servo_1, servo_3 in servos:
        for _ in range(10):
            before = velocity(rover)
            step(rover, world, servo_1, servo_3)
            assert abs(velocity(rover) - before) <= float(np.float32(grip)) * GRAVITY_M_S2 * STEP_S + 1e-9


def test_a_skid_rover_slides_on_sideways_when_it_turns_fast() -> None:
    rover, world = rolling(2.0), ground(0.05)
    for _ in range(200):
        step(rover, world, 1.0, 0.0)
    assert rover[0].heading_rad > 0.3
    course_rad = math.atan2(velocity(rover).imag, velocity(rover).real)
    assert course_rad < rover[0].heading_rad - 0.05, "where it goes lags behind where it looks"
    assert rover[0].slide_m_s < -0.1


def test_steered_wheels_turn_it_less_than_they_ask_for() -> None:
    """At 3 m/s on grip 0.2 no circle is tighter than v * v / (grip * g) = 4.6 m, whatever the wheels do."""
    rover, firm = rolling(3.0, 2.0), rolling(3.0, 2.0)
    for _ in range(300):
        step(rover, ground(0.2), 1.0, 0.75)
        step(firm, ground(), 1.0, 0.75)
    assert firm[0].speed_m_s / firm[0].yaw_rate_rad_s == pytest.approx(2.0, rel=0.02)
    radius_m = rover[0].speed_m_s / rover[0].yaw_rate_rad_s
    assert radius_m == pytest.approx(rover[0].speed_m_s ** 2 / (0.2 * GRAVITY_M_S2), rel=0.02)
    assert radius_m > 2.5


def test_sliding_ends_on_firm_ground() -> None:
    rover, world = rolling(2.0, north_m=-0.5), ground(0.05, north_m=-1.0)
    for _ in range(100):
        step(rover, world, 1.0, 0.0)
    assert rover[0].slide_m_s != 0.0
    for _ in range(100):
        step(rover, ground(), 0.5, 0.5)
    assert rover[0].slide_m_s == 0.0
    assert rover[0].speed_m_s == pytest.approx(0.5 * TOP_SPEED_M_S, rel=0.2)


def test_rough_ground_has_a_top_speed() -> None:
    rover, world = rolling(0.0), ground(pace=0.2)
    for _ in range(1000):
        step(rover, world, 1.0, 1.0)
    assert rover[0].speed_m_s == pytest.approx(0.2 * TOP_SPEED_M_S, rel=1e-3)


def driven(world: World, metres: float = 20.0, seconds: float = 15.0) -> Simulator:
    client = ready(Simulator(world, SimStart(0.5, 0.5, 0.0, HOME), "none", seed=4, parameters={"WP_SPEED": 2.0}))
    client.drive_to(metres, 0.0)
    client.run_for(seconds)
    return client.simulator


def test_the_autopilot_drives_slowly_over_rough_ground_however_much_it_wants() -> None:
    assert driven(ground(), 100.0, 10.0).truth.speed_m_s == pytest.approx(2.0, abs=0.1)
    assert driven(ground(pace=0.2), 100.0, 10.0).truth.speed_m_s == pytest.approx(0.8, abs=0.02)


def rolls_on_m(told_m_s: float) -> float:
    """How far a rover that rough ground holds comes in 15 s; told so until it is slow, and then to stand."""
    client = ready(Simulator(ground(pace=0.125), SimStart(0.5, 0.5, 0.0, HOME), "none", noise=False))

    def tell(forward_m_s: float, seconds: float) -> None:
        client.drive_at(forward_m_s, mask=FORWARD_AND_TURN_MASK, frame=8)
        client.run_for(seconds)

    for _ in range(60):
        tell(2.0, 0.2)
    before_m = client.simulator.truth.north_m
    for _ in range(300):
        tell(told_m_s if client.simulator.truth.speed_m_s > 0.1 else 0.0, 0.05)
    return client.simulator.truth.north_m - before_m


def test_a_rover_that_is_held_stands_far_sooner_where_it_is_told_to_roll_back() -> None:
    """The autopilot's integrator has opened the throttle, and closes it slowly for a rover that is told to stand."""
    stops_m, back_m = rolls_on_m(0.0), rolls_on_m(-1.0)
    assert 0.5 < back_m < 0.6 * stops_m


def test_on_slippery_ground_it_comes_to_rest_later() -> None:
    assert driven(ground(0.04)).truth.north_m > driven(ground()).truth.north_m + 0.3


def test_what_is_reported_is_the_velocity_over_ground_also_while_it_slides() -> None:
    client = ready(Simulator(ground(0.05), SimStart(0.5, 0.5, 0.0, HOME), "none", noise=False))
    client.command(511, 32, 1e5)
    client.drive_to(15.0, 0.0)
    client.run_for(6.0)
    client.drive_to(20.0, 12.0)
    client.received.clear()
    client.run_for(4.0)
    told = client.of("LOCAL_POSITION_NED")
    errors, sideways = [], 0.0
    for one, two in itertools.pairwise(told):
        span_s = (two.time_boot_ms - one.time_boot_ms) / 1000.0
        errors.append(math.hypot((two.x - one.x) / span_s - 0.5 * (one.vx + two.vx),
                                 (two.y - one.y) / span_s - 0.5 * (one.vy + two.vy)))  # fmt: skip
        sideways = max(sideways, abs(client.simulator.truth.slide_m_s))
    assert max(errors) < 0.05
    assert sideways > 0.05


@pytest.mark.parametrize("turning_radius_m", [0.0, 2.0])
def test_firm_ground_said_in_an_array_is_the_same_to_the_last_bit(turning_radius_m: float) -> None:
    tracks = []
    for world in (World(np.zeros((400, 400), dtype=np.bool_), south_m=-200.0, west_m=-200.0), ground()):
        rover, rows = rolling(1.0, turning_radius_m), []
        for i in range(400):
            step(rover, world, math.sin(i / 30.0), math.cos(i / 50.0))
            rows.append(bytes(rover.tobytes()))
        tracks.append(rows)
    assert tracks[0] == tracks[1]
