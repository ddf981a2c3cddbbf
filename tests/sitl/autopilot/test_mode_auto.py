"""AUTO: what the commands of a mission do on a rover, the words with which they are told, and how legs are driven."""

import math
from itertools import pairwise

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.world import geodesy
from tests.support.mission_client import ORIGIN, at, do, heard, home, in_auto, item, place_m, run_until, upload
from tests.support.sitl_client import Client, open_ground, ready

ACCEPTED, DENIED, FAILED = 0, 2, 4


def reached(client: Client) -> list[int]:
    return [m.seq for m in client.of("MISSION_ITEM_REACHED")]


def speeds(client: Client, seconds: float) -> list[float]:
    found = []
    for _ in range(round(seconds / 0.1)):
        client.run_for(0.1)
        found.append(client.simulator.truth.speed_m_s)
    return found


def current(client: Client) -> mavlink.MAVLink_message:
    client.run_for(1.1)
    return client.of("MISSION_CURRENT")[-1]


def test_waypoints_are_driven_and_told() -> None:
    client = in_auto(open_ground(), [at(16, 15, 0), at(16, 15, 10)])
    run_until(client, "Mission Complete")
    assert math.dist(place_m(client), (15.0, 10.0)) < 0.5
    assert reached(client) == [1, 2]
    assert client.texts()[-5:] == [
        "Mission: 1 WP", "Reached waypoint #1", "Mission: 2 WP", "Reached waypoint #2", "Mission Complete",
    ]  # fmt: skip
    now = current(client)
    assert (now.seq, now.total, now.mission_state, now.mission_mode) == (2, 2, 5, 1)
    client.run_for(5.0)
    assert math.dist(place_m(client), (15.0, 10.0)) < 0.5
    assert client.of("HEARTBEAT")[-1].custom_mode == 10


def test_straight_on_the_rover_does_not_slow_down_and_round_a_bend_it_stays_near() -> None:
    client = in_auto(open_ground(), [at(16, 20, 0), at(16, 40, 0), at(16, 55, 10), at(16, 75, 10)])
    run_until(client, "Reached waypoint #1", 20.0)
    assert min(speeds(client, 4.0)) > 2.8
    nearest_m = 10.0
    while 3 not in reached(client):
        client.run_for(0.1)
        nearest_m = min(nearest_m, math.dist(place_m(client), (40.0, 0.0)), 10.0)
    assert client.simulator.truth.speed_m_s > 2.0
    assert nearest_m < 3.0


def test_at_a_sharp_corner_the_rover_stops_and_pivots() -> None:
    client = in_auto(open_ground(), [at(16, 15, 0), at(16, 15, 15)])
    run_until(client, "Reached waypoint #1", 20.0)
    assert math.dist(place_m(client), (15.0, 0.0)) < 0.5
    assert min(speeds(client, 2.0)) < 0.05


def test_a_waypoint_is_held_for_its_time() -> None:
    client = in_auto(open_ground(), [at(16, 8, 0, (5,)), at(16, 16, 0)])
    run_until(client, "Reached waypoint #1. Loiter for 5 seconds")
    began_s = client.simulator.time_s
    run_until(client, "Mission: 2 WP")
    assert client.simulator.time_s - began_s == pytest.approx(5.0, abs=0.3)
    assert math.dist(place_m(client), (8.0, 0.0)) < 0.5


def test_loitering_for_a_time_and_without_end() -> None:
    client = in_auto(open_ground(), [at(19, 8, 0, (3,)), at(17, 12, 0), at(16, 50, 0)])
    run_until(client, "Reached waypoint #1. Loiter for 3 seconds")
    run_until(client, "Finished active loiter")
    run_until(client, "Reached waypoint #2")
    client.run_for(60.0)
    assert math.dist(place_m(client), (12.0, 0.0)) < 0.5
    assert reached(client) == [1]


@pytest.mark.parametrize("radius_m", [6.0, -6.0])
def test_turns_round_a_place(radius_m: float) -> None:
    client = in_auto(open_ground(), [at(18, 12, 0, (2, 0, radius_m))])
    angles = []
    while "Mission Complete" not in client.texts():
        client.run_for(0.2)
        north_m, east_m = place_m(client)
        angles.append(math.atan2(east_m, north_m - 12.0))
        if len(angles) > 60:
            assert math.hypot(north_m - 12.0, east_m) == pytest.approx(6.0, abs=1.0)
    turned = sum((b - a + math.pi) % (2 * math.pi) - math.pi for a, b in pairwise(angles))
    assert turned / (2.0 * math.pi) == pytest.approx(math.copysign(2.0, radius_m), abs=0.3)


def test_speed_is_changed_beside_a_leg() -> None:
    client = in_auto(open_ground(), [at(16, 20, 0), do(178, 1, 1.0), at(16, 40, 0), do(178, 1, 2.0), at(16, 70, 0)])
    run_until(client, "speed: 1.0 m/s")
    assert place_m(client)[0] == pytest.approx(20.0, abs=2.0)
    assert max(speeds(client, 3.0)) > 2.5
    assert speeds(client, 6.0) == pytest.approx([1.0] * 60, abs=0.3)
    run_until(client, "speed: 2.0 m/s")
    assert max(speeds(client, 10.0)) == pytest.approx(2.0, abs=0.15)


def test_jumps_are_counted_and_told() -> None:
    client = in_auto(open_ground(), [at(16, 3, 0), at(16, 0, 0), do(177, 1, 2), at(16, 0, 3)])
    run_until(client, "Mission Complete")
    assert reached(client) == [1, 2, 1, 2, 1, 2, 4]
    assert [text for text in client.texts() if "Jump" in text] == ["Mission: 3 Jump 1/2", "Mission: 3 Jump 2/2"]


def test_a_jump_to_a_tag() -> None:
    client = in_auto(open_ground(), [at(16, 3, 0), do(600, 7), at(16, 0, 0), do(601, 7, 1), at(16, 0, 3)])
    run_until(client, "Mission Complete")
    assert [seq for seq in reached(client) if seq != 2] == [1, 3, 3, 5]


def test_a_jump_for_ever() -> None:
    client = in_auto(open_ground(), [at(16, 3, 0), at(16, 0, 0), do(177, 1, -1), at(16, 0, 3)])
    client.run_for(200.0)
    assert len(reached(client)) > 10
    assert set(reached(client)) == {1, 2}


def test_conditions_hold_back_what_is_beside_not_the_driving() -> None:
    client = in_auto(open_ground(), [do(112, 4), do(178, 1, 1.0), do(114, 10), do(178, 1, 2.0), at(16, 30, 0)])
    began_s = client.simulator.time_s
    run_until(client, "speed: 1.0 m/s")
    assert client.simulator.time_s - began_s == pytest.approx(4.0, abs=0.5)
    run_until(client, "speed: 2.0 m/s")
    assert place_m(client)[0] == pytest.approx(20.0, abs=0.5)


def test_a_delay_stops_the_rover() -> None:
    client = in_auto(open_ground(), [at(16, 6, 0), do(93, 5, -1, -1, -1), at(16, 12, 0)])
    run_until(client, "Delaying 5 sec")
    began_s = client.simulator.time_s
    run_until(client, "Mission: 3 WP")
    assert client.simulator.time_s - began_s == pytest.approx(5.0, abs=0.3)


def test_driving_backwards() -> None:
    client = in_auto(open_ground(), [do(194, 1), at(16, -10, 0), do(194, 0), at(16, -10, 0)])
    run_until(client, "Reached waypoint #2")
    assert place_m(client)[0] == pytest.approx(-10.0, abs=0.5)
    assert abs(client.simulator.truth.heading_rad) < 0.3


def test_a_heading_and_a_speed() -> None:
    client = in_auto(open_ground(), [do(213, 90, 0.5, 0), at(16, 0, 10)])
    run_until(client, "Mission: 2 WP")
    assert client.simulator.truth.heading_rad == pytest.approx(math.radians(90.0), abs=0.2)


def test_commands_that_a_rover_has_not() -> None:
    rows = [at(16, 4, 0), do(210, 1), do(211, 1, 1), at(22, 0, 0), at(21, 50, 50), at(16, 6, 0)]
    client = in_auto(open_ground(), rows)
    run_until(client, "Mission Complete")
    assert "Skipping invalid cmd #210" in client.texts()
    assert reached(client) == [1, 2, 6]
    assert place_m(client)[0] == pytest.approx(6.0, abs=0.5)


def test_return_within_a_mission() -> None:
    client = in_auto(open_ground(), [at(16, 12, 0), do(20)])
    run_until(client, "Mission Complete")
    assert math.hypot(*place_m(client)) < 0.6
    assert reached(client) == [1, 2]


@pytest.mark.parametrize(("behaviour", "mode"), [(0, 10), (1, 10), (2, 1), (3, 0)])
def test_the_end_of_the_mission(behaviour: int, mode: int) -> None:
    client = in_auto(open_ground(parameters={"MIS_DONE_BEHAVE": behaviour}), [at(16, 4, 0)])
    run_until(client, "Mission Complete")
    client.run_for(2.0)
    assert client.of("HEARTBEAT")[-1].custom_mode == mode


def test_hold_interrupts_and_auto_goes_on() -> None:
    client = in_auto(open_ground(), [at(16, 10, 0), at(16, 30, 0), at(16, 30, 10)])
    run_until(client, "Mission: 2 WP")
    assert client.set_mode(4) == ACCEPTED
    client.run_for(5.0)
    stopped_m = place_m(client)
    assert stopped_m[0] < 20.0
    now = current(client)
    assert (now.seq, now.mission_state, now.mission_mode) == (2, 2, 0)
    assert client.set_mode(10) == ACCEPTED
    run_until(client, "Mission Complete")
    assert reached(client) == [1, 2, 3]


def test_disarming_outside_of_auto_forgets_where_it_was() -> None:
    client = in_auto(open_ground(), [at(16, 10, 0), at(16, 30, 0)])
    run_until(client, "Mission: 2 WP")
    assert client.set_mode(4) == ACCEPTED
    assert client.ask(400, 0) == ACCEPTED
    assert client.ask(400, 1) == ACCEPTED
    client.received.clear()
    assert client.set_mode(10) == ACCEPTED
    client.run_for(0.3)
    assert "Mission: 1 WP" in client.texts()


def test_home_is_moved_by_a_mission() -> None:
    client = in_auto(open_ground(), [do(179, 0), at(179, 0, 20, (0,)), at(16, 10, 0), do(20)])
    run_until(client, "Mission Complete")
    assert math.dist(place_m(client), (0.0, 20.0)) < 0.6
    moved = client.of("HOME_POSITION")[-1]
    assert (moved.latitude, moved.longitude) == at(179, 0, 20)[3:5]


def test_the_rover_keeps_to_the_line_and_tells_how_well() -> None:
    client = in_auto(open_ground(heading_rad=0.9), [at(16, 30, 0), at(16, 60, 0)])
    client.run_for(8.0)
    output = client.of("NAV_CONTROLLER_OUTPUT")[-1]
    north_m, east_m = place_m(client)
    assert 0.05 < abs(east_m) < 3.0
    assert output.xtrack_error == pytest.approx(-east_m, abs=0.3)
    assert output.wp_dist == pytest.approx(30.0 - north_m, abs=2.0)
    run_until(client, "Mission Complete")
    assert abs(place_m(client)[1]) < 0.3


def test_with_mis_restart_it_begins_anew() -> None:
    client = in_auto(open_ground(parameters={"MIS_RESTART": 1}), [at(16, 10, 0), at(16, 30, 0)])
    run_until(client, "Mission: 2 WP")
    assert client.set_mode(4) == ACCEPTED
    client.received.clear()
    assert client.set_mode(10) == ACCEPTED
    client.run_for(0.3)
    assert "Mission: 1 WP" in client.texts()


def test_set_current_by_message_is_answered_by_the_same_number() -> None:
    client = in_auto(open_ground(), [at(16, 10, 0), at(16, 30, 0), at(16, 0, 10)])
    client.run_for(1.0)
    client.send(mavlink.MAVLink_mission_set_current_message(1, 1, 3))
    assert heard(client, "MISSION_CURRENT")[0].seq == 3
    run_until(client, "Mission Complete")
    assert reached(client) == [3]
    client.send(mavlink.MAVLink_mission_set_current_message(1, 1, 9))
    assert not heard(client, "MISSION_CURRENT")


def test_set_current_by_command() -> None:
    client = ready(open_ground())
    assert client.ask(224, 1) == FAILED
    assert upload(client, [home(), at(16, 10, 0), do(178, 1, 1.5), at(16, 0, 10)]) == ACCEPTED
    assert client.ask(224, 4) == FAILED
    assert client.ask(224, -1) == FAILED
    assert client.ask(224, 2) == ACCEPTED
    assert current(client).seq == 3
    assert client.ask(300, 2, 3) == DENIED
    assert client.ask(300) == ACCEPTED
    run_until(client, "Mission Complete")
    assert reached(client) == [2, 3]
    assert max(abs(m) for m in place_m(client)[:1]) < 1.5


def test_a_leg_changed_under_way_is_begun_again() -> None:
    client = in_auto(open_ground(), [at(16, 30, 0), at(16, 30, 30)])
    client.run_for(4.0)
    client.send(mavlink.MAVLink_mission_write_partial_list_message(1, 1, 1, 1, 0))
    client.run_for(0.1)
    client.send(item(1, at(16, 0, 12)))
    run_until(client, "Auto mission changed, restarted command", 2.0)
    run_until(client, "Reached waypoint #1")
    assert math.dist(place_m(client), (0.0, 12.0)) < 3.2


def test_arming_starts_a_mission_that_is_waiting() -> None:
    client = Client(open_ground())
    client.run_to(43.5)
    assert upload(client, [home(), at(16, 10, 0)]) == ACCEPTED
    assert client.set_mode(10) == ACCEPTED
    client.run_for(5.0)
    assert place_m(client) == (0.0, 0.0)
    assert client.arm() == ACCEPTED
    run_until(client, "Mission Complete")
    assert place_m(client)[0] == pytest.approx(10.0, abs=0.5)


def test_guided_within_auto() -> None:
    simulator = open_ground(parameters={"WP_RADIUS": 2.0})
    client = in_auto(simulator, [at(16, 5, 0), at(92, 20, 0, (1,)), at(16, 25, 0)])
    heartbeat = mavlink.MAVLink_heartbeat_message(18, 8, 0, 0, 4, 3)
    client.send(heartbeat)
    other = Client(simulator, component=195)
    other.run_for(0.1)
    other.send(heartbeat)
    run_until(client, "Mission: 2 GuidedEnable")
    client.received.clear()
    other.received.clear()
    client.run_for(10.0)
    other.run_for(0.1)
    told = client.of("SET_POSITION_TARGET_GLOBAL_INT")
    assert 9 <= len(told) <= 11
    assert not other.of("SET_POSITION_TARGET_GLOBAL_INT")
    assert (told[0].lat_int, told[0].lon_int) == at(92, 20, 0)[3:5]
    assert (told[0].target_system, told[0].target_component, told[0].coordinate_frame) == (1, 191, 6)
    assert client.simulator.truth.speed_m_s == pytest.approx(0.0, abs=0.01)
    assert place_m(client)[0] < 10.0
    client.drive_to(12.0, 8.0)
    client.run_for(15.0)
    assert math.dist(place_m(client), (12.0, 8.0)) < 0.6
    client.drive_to(20.0, 1.0)
    run_until(client, "Mission: 3 WP")
    assert math.dist(place_m(client), (20.0, 0.0)) < 2.1
    client.received.clear()
    client.run_for(3.0)
    assert not client.of("SET_POSITION_TARGET_GLOBAL_INT")


@pytest.mark.parametrize(("limits", "ends_s"), [((4, 0, 0, 0), 4.0), ((0, 0, 0, 6), 6.0)])
def test_limits_of_guided_within_auto(limits: tuple[float, ...], ends_s: float) -> None:
    client = in_auto(open_ground(), [do(222, *limits), at(92, 0, 60, (1,)), at(16, 0, 5)])
    run_until(client, "Mission: 2 GuidedEnable")
    began_s = client.simulator.time_s
    while "Mission: 3 WP" not in client.texts():
        client.drive_at(1.5)
        client.run_for(0.5)
        assert client.simulator.time_s < began_s + 20.0
    if limits[0]:
        assert client.simulator.time_s - began_s == pytest.approx(ends_s, abs=0.7)
    else:
        assert place_m(client)[0] == pytest.approx(6.0, abs=1.5)


def test_guided_switched_off_in_a_mission_does_nothing() -> None:
    client = in_auto(open_ground(), [at(92, 0, 60, (0,)), at(16, 5, 0)])
    run_until(client, "Mission Complete")
    assert reached(client) == [1, 2]


def test_setpoints_in_auto_vanish_unless_it_hands_over() -> None:
    client = in_auto(open_ground(), [at(16, 15, 0)])
    client.run_for(1.0)
    client.drive_to(-20.0, -20.0)
    run_until(client, "Mission Complete")
    assert math.dist(place_m(client), (15.0, 0.0)) < 0.5


def test_steered_wheels_drive_a_mission() -> None:
    from sitl.autopilot.parameters import steered_wheels

    simulator = open_ground(parameters=steered_wheels(2.0), turning_radius_m=2.0)
    client = in_auto(simulator, [at(16, 20, 0), at(16, 20, 20), at(16, 0, 20)])
    run_until(client, "Mission Complete")
    assert math.dist(place_m(client), (0.0, 20.0)) < 3.2


def test_the_place_that_is_driven_to_is_read_back() -> None:
    client = in_auto(open_ground(), [at(16, 25, 0), at(16, 25, 25)])
    client.run_for(4.0)
    target = client.of("POSITION_TARGET_GLOBAL_INT")[-1]
    assert geodesy.offset_m(ORIGIN, (target.lat_int, target.lon_int)) == pytest.approx((25.0, 0.0), abs=0.05)
