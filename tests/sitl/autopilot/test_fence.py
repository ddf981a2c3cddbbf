"""The fence: what is inside, breaches and what follows them, arming outside of it."""

import math

import pytest
import shapely
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.autopilot.fence import inside, outside
from sitl.autopilot.mission_items import Item
from tests.support.mission_client import FENCE, at, do, heard, in_auto, place_m, run_until, upload
from tests.support.quick import examples
from tests.support.sitl_client import Client, open_ground, ready

ACCEPTED, FAILED = 0, 4
BOX = [at(5001, n, e, (4,)) for n, e in ((-10, -10), (10, -10), (10, 10), (-10, 10))]
HOLE = [at(5002, n, e, (3,)) for n, e in ((3, 3), (8, 3), (8, 8))]


def fenced(rows: list, **parameters: float) -> Client:
    """An armed rover in GUIDED within a fence."""
    client = Client(open_ground(parameters={"FENCE_ENABLE": 1, **parameters}))
    client.run_to(20.0)
    assert upload(client, rows, FENCE) == ACCEPTED
    client.run_to(43.5)
    assert client.set_mode(15) == ACCEPTED
    assert client.arm() == ACCEPTED, client.texts()
    client.received.clear()
    return client


def mode(client: Client) -> int:
    client.run_for(1.1)
    return int(client.of("HEARTBEAT")[-1].custom_mode)


@pytest.mark.parametrize(
    ("rows", "goal"),
    [
        (BOX, (25.0, 0.0)),
        ([*BOX, *HOLE], (7.0, 5.0)),
        ([at(5003, 0, 0, (8,))], (15.0, 0.0)),
        ([at(5004, 12, 0, (4,))], (12.0, 0.0)),
    ],
)
def test_a_breach_is_told_and_the_rover_holds(rows: list, goal: tuple[float, float]) -> None:
    client = fenced(rows)
    client.drive_to(*goal)
    run_until(client, "Polygon fence breached", 20.0)
    assert mode(client) == 4
    client.run_for(5.0)
    assert math.hypot(*place_m(client)) < 18.0
    status = client.of("FENCE_STATUS")
    assert (status[0].breach_status, status[-1].breach_status) == (0, 1)
    health = client.of("SYS_STATUS")[-1]
    assert health.onboard_control_sensors_enabled & 1 << 20
    assert not health.onboard_control_sensors_health & 1 << 20
    assert (status[-1].breach_count, status[-1].breach_type) == (1, mavlink.FENCE_BREACH_BOUNDARY)
    assert status[-1].breach_time > 43_000


@pytest.mark.parametrize(("action", "after"), [(0, 15), (1, 11), (2, 4), (3, 12), (4, 12)])
def test_actions(action: int, after: int) -> None:
    client = fenced(BOX, FENCE_ACTION=action)
    client.drive_to(25.0, 0.0)
    run_until(client, "Polygon fence breached", 20.0)
    assert mode(client) == after
    assert client.of("HEARTBEAT")[-1].base_mode & 128


def test_action_disarm() -> None:
    client = fenced(BOX, FENCE_ACTION=5)
    client.drive_to(25.0, 0.0)
    run_until(client, "Throttle disarmed", 20.0)
    client.run_for(1.0)
    assert not client.of("HEARTBEAT")[-1].base_mode & 128


def test_the_circle_round_home_and_its_backup() -> None:
    client = fenced([], FENCE_RADIUS=12, FENCE_ACTION=0)
    client.drive_to(45.0, 0.0)
    run_until(client, "Circle fence breached", 20.0)
    assert place_m(client)[0] == pytest.approx(12.0, abs=0.5)
    client.run_for(4.0)
    assert client.texts().count("Circle fence breached") == 1
    client.run_for(10.0)
    assert client.texts().count("Circle fence breached") == 2


def test_driving_back_by_hand_is_left_alone_for_10_s_and_the_breach_ends() -> None:
    client = fenced(BOX)
    client.drive_to(25.0, 0.0)
    run_until(client, "Polygon fence breached", 20.0)
    client.run_for(3.0)
    assert client.set_mode(15) == ACCEPTED
    client.drive_to(0.0, 0.0)
    client.run_for(15.0)
    assert mode(client) == 15
    assert math.hypot(*place_m(client)) < 1.0
    assert client.of("FENCE_STATUS")[-1].breach_status == 0
    client.drive_to(25.0, 0.0)
    client.run_for(15.0)
    assert client.texts().count("Polygon fence breached") == 2


def test_arming_is_refused_outside() -> None:
    client = Client(open_ground(parameters={"FENCE_ENABLE": 1}))
    client.run_to(20.0)
    assert upload(client, [at(5003, 50, 50, (20,))], FENCE) == ACCEPTED
    client.run_to(43.5)
    for flight_mode in (0, 15):
        assert client.set_mode(flight_mode) == ACCEPTED
        assert client.arm() == FAILED
    assert client.texts().count("Arm: Vehicle breaching Polygon fence") == 2
    client.run_for(31.0)
    assert "PreArm: Vehicle breaching Polygon fence" in client.texts()
    assert not client.of("SYS_STATUS")[-1].onboard_control_sensors_health & 1 << 28
    assert client.ask(400, 1, 21196) == ACCEPTED


@pytest.mark.parametrize(
    ("parameters", "text"),
    [
        ({"FENCE_TYPE": 4}, "Fences enabled, but none selected"),
        ({"FENCE_RADIUS": -1}, "Invalid Circle FENCE_RADIUS value"),
        ({"FENCE_RADIUS": 1}, "Circle FENCE_MARGIN is greater than FENCE_RADIUS"),
        ({"FENCE_MARGIN": -1}, "Invalid FENCE_MARGIN value"),
    ],
)
def test_fences_that_cannot_be_armed_with(parameters: dict[str, float], text: str) -> None:
    client = Client(open_ground(parameters={"FENCE_ENABLE": 1, **parameters}))
    client.run_to(43.5)
    assert client.arm() == FAILED
    assert f"Arm: {text}"[:50] in client.texts()


def test_the_fence_is_switched_by_command() -> None:
    client = ready(open_ground(parameters={"FENCE_TYPE": 4}))
    assert client.ask(207, 1) == FAILED
    assert upload(client, BOX, FENCE) == ACCEPTED
    assert client.ask(207, 7) == FAILED
    assert client.ask(207, 1) == ACCEPTED
    assert len(heard(client, "FENCE_STATUS", 1.1)) == 1
    client.drive_to(25.0, 0.0)
    run_until(client, "Polygon fence breached", 20.0)
    assert client.ask(207, 0) == ACCEPTED
    client.run_for(1.1)
    assert not heard(client, "FENCE_STATUS", 2.1)


def test_the_fence_is_switched_by_parameter() -> None:
    client = ready(open_ground())
    assert upload(client, BOX, FENCE) == ACCEPTED
    client.drive_to(25.0, 0.0)
    client.run_for(15.0)
    assert not client.of("FENCE_STATUS")
    client.send(mavlink.MAVLink_param_set_message(1, 1, b"FENCE_ENABLE", 1, 2))
    run_until(client, "Polygon fence breached", 1.0)
    assert mode(client) == 4


def test_the_fence_is_switched_by_a_mission() -> None:
    simulator = open_ground(parameters={"FENCE_TYPE": 4})
    client = in_auto(simulator, [do(207, 1), at(16, 20, 0), do(207, 0), at(16, 30, 0)])
    client.run_for(0.3)
    assert "Polygon fence enabled" in client.texts()
    run_until(client, "Polygon fence disabled")


def test_either_of_two_areas_is_enough_when_wanted() -> None:
    items = [Item(5003, 0, (100.0, 0, 0, 0), 0, 0), Item(5003, 0, (100.0, 0, 0, 0), 20_000, 0)]
    for place, both, either in (((0, 0), True, False), ((9_000, 0), True, True), ((20_000, 0), True, False)):
        assert outside(items, place) == both
        assert outside(items, place, 2) == either


corner = st.tuples(st.integers(-1000, 1000), st.integers(-1000, 1000))


@settings(max_examples=examples(200), deadline=None)
@given(st.lists(corner, min_size=3, max_size=8, unique=True), corner)
def test_inside_is_what_shapely_says(corners: list[tuple[int, int]], place: tuple[int, int]) -> None:
    polygon = shapely.Polygon(corners)
    assume(polygon.is_valid and polygon.exterior.distance(shapely.Point(place)) > 1e-9)
    assert inside(place, corners) == polygon.contains(shapely.Point(place))
