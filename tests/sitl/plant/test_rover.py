"""The simulated rover with steered wheels: arcs no tighter than it can, in both directions, and never on the spot."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from companion.core.grid import Grid
from companion.mission.mission import HomePoint, Mission, RoverSpec, SitlSpec, Target
from sitl.autopilot.parameters import steered_wheels
from sitl.plant.outline import Outline
from sitl.plant.rover import WHEEL_MOST_RAD, drive, new_rover
from sitl.scenario import ScenarioError, scenario_from_mission
from sitl.simulator import Simulator
from sitl.world.world import World
from tests.support.sitl_client import Client, open_ground, ready

RADIUS_M = 2.0
VELOCITY_AND_RATE, YAW_ONLY, BODY = 1511, 2559, 8
OPEN = World.open()


def car(radius_m: float = RADIUS_M, **changes: float) -> Simulator:
    parameters = {**steered_wheels(radius_m), "WP_RADIUS": 1.0, "WP_SPEED": 2.0, "AVOID_ENABLE": 0.0, **changes}
    return open_ground(parameters=parameters, turning_radius_m=radius_m)


def pushed(rover, servo_1: float, servo_3: float, seconds: float, step_s: float = 0.005):
    for _ in range(round(seconds / step_s)):
        drive(rover[0], OPEN.surroundings(0.0), servo_1, servo_3, step_s)
    return rover[0]


def track(client: Client, seconds: float, again: float = 0.5, **target: float) -> np.ndarray:
    """Rows of north, east, heading, speed, every 0.02 s; the velocity target, if any, is repeated."""
    rows = []
    for tick in range(round(seconds / 0.02)):
        if target and tick % round(again / 0.02) == 0:
            client.drive_at(target["speed"], mask=VELOCITY_AND_RATE, rate=target["rate"], frame=BODY)
        client.run_for(0.02)
        truth = client.simulator.truth
        rows.append((truth.north_m, truth.east_m, truth.heading_rad, truth.speed_m_s))
    return np.array(rows)


@pytest.mark.parametrize("throttle", [0.5, -0.5])
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_full_lock_drives_a_circle_of_the_turning_radius(throttle: float, side: float) -> None:
    rover = new_rover(0.0, 0.0, 0.0, Outline(0.3), RADIUS_M)
    pushed(rover, side, 0.0, 1.0)
    assert rover[0]["heading_rad"] == 0.0, "wheels turn, the rover does not"
    assert rover[0]["wheel_rad"] == pytest.approx(side * WHEEL_MOST_RAD)
    # The circle's middle is beside the rover, on the side to which the wheels point, whichever way it rolls.
    for _ in range(40):
        here = pushed(rover, side, throttle, 0.2)
        assert math.hypot(here["north_m"], here["east_m"] - side * RADIUS_M) == pytest.approx(RADIUS_M, rel=0.01)
    turned = here["yaw_rate_rad_s"] * RADIUS_M
    assert turned == pytest.approx(side * here["speed_m_s"], rel=1e-6)
    assert here["speed_m_s"] == pytest.approx(throttle * 4.0, rel=1e-3)


def test_the_wheels_take_their_time() -> None:
    rover = new_rover(0.0, 0.0, 0.0, Outline(0.3), RADIUS_M)
    assert pushed(rover, 1.0, 0.0, 0.3)["wheel_rad"] == pytest.approx(math.radians(18.0))
    assert pushed(rover, 1.0, 0.0, 0.3)["wheel_rad"] == pytest.approx(WHEEL_MOST_RAD)
    assert pushed(rover, -1.0, 0.0, 0.5)["wheel_rad"] == pytest.approx(math.radians(5.0))


@settings(deadline=None, max_examples=30)
@given(st.lists(st.tuples(st.floats(-3.0, 3.0), st.floats(-1.0, 1.0)), min_size=1, max_size=8), st.floats(0.5, 6.0))
def test_no_outputs_turn_it_tighter_than_its_radius(outputs: list[tuple[float, float]], radius_m: float) -> None:
    rover = new_rover(0.0, 0.0, 0.0, Outline(0.3), radius_m)
    for steering, throttle in outputs:
        heading, driven = float(rover[0]["heading_rad"]), float(rover[0]["driven_m"])
        pushed(rover, steering, throttle, 0.3)
        turned = abs(math.remainder(float(rover[0]["heading_rad"]) - heading, 2.0 * math.pi))
        assert turned <= (float(rover[0]["driven_m"]) - driven) / radius_m + 1e-9


def test_what_it_runs_into_does_not_turn_it() -> None:
    weights = np.full((20, 20), 0.5)
    weights[10:] = 1.0
    world = World.from_grid(Grid(weights, 1.0))
    rover = new_rover(9.0, 10.0, 0.0, Outline(0.3), RADIUS_M)
    for _ in range(400):
        drive(rover[0], world.surroundings(0.0), 1.0, 0.5, 0.005)
    heading = float(rover[0]["heading_rad"])
    assert rover[0]["contacts"] == 1
    for _ in range(400):
        drive(rover[0], world.surroundings(0.0), 1.0, 0.5, 0.005)
    assert rover[0]["heading_rad"] == heading


def test_a_heading_alone_does_not_move_it() -> None:
    client = ready(car())
    for _ in range(8):
        client.drive_at(0.0, mask=YAW_ONLY, yaw=math.pi / 2.0)
        client.run_for(0.5)
    truth = client.simulator.truth
    assert (truth.heading_rad, truth.north_m, truth.east_m) == (0.0, 0.0, 0.0)


def test_a_target_behind_is_reached_on_an_arc() -> None:
    client = ready(car())
    client.drive_to(-10.0, 2.0)
    rows = track(client, 30.0)
    assert client.of("MISSION_ITEM_REACHED")
    assert 0.5 < math.hypot(rows[-1, 0] + 10.0, rows[-1, 1] - 2.0) < 1.2
    steps = np.hypot(*np.diff(rows[:, :2], axis=0).T)
    turns = np.abs((np.diff(rows[:, 2]) + math.pi) % (2.0 * math.pi) - math.pi)
    assert turns.max() > 0.0
    assert (turns <= steps / RADIUS_M * 1.01 + 1e-6).all()
    assert rows[:, 3].min() > -0.05, "it comes round forwards"
    assert np.abs(rows[:, 1]).max() > 1.5 * RADIUS_M


@pytest.mark.parametrize("speed", [0.5, 1.0, 1.8, -0.6])
@pytest.mark.parametrize("share", [0.5, -0.5])
def test_a_turn_rate_at_a_speed_is_an_arc(speed: float, share: float) -> None:
    """Below 1 m/s (MOT_SPD_SCA_BASE) the wheels are turned as if at 1 m/s: so much less of the turn rate is driven."""
    wished = share / RADIUS_M * abs(speed) / min(abs(speed), 1.0)
    client = ready(car())
    rows = track(client, 8.0, speed=speed, rate=wished)[-200:]
    turned = np.unwrap(rows[:, 2])
    rate = (turned[-1] - turned[0]) / (0.02 * (len(rows) - 1))
    assert rows[-1, 3] == pytest.approx(speed, abs=0.1)
    curvature = rate / abs(rows[:, 3]).mean()
    assert curvature == pytest.approx(share / RADIUS_M, rel=0.25)


def test_skid_steering_knows_none_of_it() -> None:
    client = ready(open_ground())
    for _ in range(8):
        client.drive_at(0.0, mask=YAW_ONLY, yaw=math.pi / 2.0)
        client.run_for(0.5)
    assert client.simulator.truth.heading_rad == pytest.approx(math.pi / 2.0, abs=0.05)


def test_the_mission_says_how_it_steers() -> None:
    mission = Mission("m", (Target("t", HomePoint(5.0, 0.0)),), rover=RoverSpec(turning_radius_m=RADIUS_M))
    scenario = scenario_from_mission(mission)
    assert (scenario.turning_radius_m, scenario.parameters["TURN_RADIUS"]) == (RADIUS_M, RADIUS_M)
    assert scenario.simulator(0)._rover[0]["turning_radius_m"] == RADIUS_M
    skid = scenario_from_mission(replace(mission, sitl=SitlSpec(steering="skid")))
    assert skid.turning_radius_m == 0.0
    assert "TURN_RADIUS" not in skid.parameters
    assert scenario_from_mission(replace(mission, rover=RoverSpec())).turning_radius_m == 0.0
    with pytest.raises(ScenarioError, match=r"sitl\.steering: ackermann needs \[rover\] turning_radius_m"):
        scenario_from_mission(replace(mission, rover=RoverSpec(), sitl=SitlSpec(steering="ackermann")))
