"""Commands at waypoints, circles and patrols, as files say them."""

from __future__ import annotations

from pathlib import Path

import pytest

from companion.core.frames import GeoPoint, LocalFrame, NedPoint
from companion.mission import mav_commands as mav
from companion.mission.do_commands import TAKEN, DoCommand, command_of_name, why_not
from companion.mission.identity import fingerprint
from companion.mission.load import load_mission
from companion.mission.loiter_circle import corners
from companion.mission.mission import HERE, Mission, MissionError, Patrol, with_laps
from companion.mission.serialization import from_json, to_json
from tests.companion.mission.test_waypoints_reader import HOME, do, names, refusal, waypoint, wpl


def commands_of(mission: Mission) -> list[list[str]]:
    return [[command.name for command in target.commands] for target in mission.targets]


def test_commands_belong_to_the_waypoint_before_and_keep_their_time(tmp_path: Path) -> None:
    rows = (do(1, 216, 1), waypoint(2, hold=3), do(3, 183, 9, 1900), do(4, 93, 5), do(5, 211, 1, 1), waypoint(6))
    mission = load_mission(wpl(tmp_path, HOME, *rows, do(7, 216, 0)))
    assert [command.name for command in mission.commands] == ["DO_SPRAYER 1"]
    assert commands_of(mission) == [["DO_SET_SERVO 9 1900", "DO_GRIPPER 1 1"], ["DO_SPRAYER 0"]]
    first = mission.targets[0]
    assert [command.after_s for command in first.commands] == [3.0, 8.0] and first.hold_s == 8.0
    assert [command.item for command in first.commands] == [3, 5]


def test_conditions_wait_on_the_way_and_end_with_it(tmp_path: Path) -> None:
    rows = (waypoint(1), do(2, 112, 4), do(3, 181, 0, 1), do(4, 181, 0, 0), do(5, 114, 7), do(6, 203, 0, 0, 0))
    mission = load_mission(wpl(tmp_path, HOME, *rows, do(7, 112, 9), waypoint(8), do(9, 181, 1, 1)))
    got = [(command.command, command.delay_s, command.within_m) for command in mission.targets[0].commands]
    assert got == [(181, 4.0, None), (181, None, None), (203, None, 7.0)]
    assert mission.targets[1].commands[0].delay_s is None, "the condition before the waypoint ended with the way"


def test_a_region_of_interest_has_a_place_and_a_camera_none(tmp_path: Path) -> None:
    mission = load_mission(wpl(tmp_path, HOME, waypoint(1), do(2, 201, lat=53.4, lon=23.4), do(3, 201), do(4, 206, 5)))
    roi, off, camera = mission.targets[0].commands
    assert (roi.place, roi.frame) == (GeoPoint(53.4, 23.4), 3) and off.place is None and camera.place is None


def test_a_command_without_what_it_needs_is_named_with_the_remedy(tmp_path: Path) -> None:
    rows = (waypoint(1), do(2, 183, 0, 1900), do(3, 195), do(4, 183, 9, float("nan")), waypoint(5))
    assert refusal(wpl(tmp_path, HOME, *rows)) == (
        "item 2: DO_SET_SERVO (183): there is no output 0; give the number of a SERVOn_FUNCTION, from 1 to 32; "
        "item 3: DO_SET_ROI_LOCATION (195): has no place to look at; give its latitude and longitude, or "
        "DO_SET_ROI_NONE to look ahead again; "
        "item 4: DO_SET_SERVO (183): needs 2 parameters (output from 1, pulse in µs)"
    )


@pytest.mark.parametrize(
    ("command", "says"),
    [
        ('name = "DO_SET_SERVO"', "command 1: DO_SET_SERVO: needs 2 parameters (output from 1, pulse in µs)"),
        ('name = "DO_SET_SERVO"\nparams = [9.5, 1900]', "there is no output 9.5; give the number of a SERVOn_FUNCTION"),
        ('name = "DO_SET_RELAY"\nparams = [-1, 1]', "there is no relay -1; relays are counted from 0 to 15"),
        ('name = "SET_SERVO"', "'SET_SERVO' is no MAVLink command known here; did you mean DO_SET_SERVO?"),
        ('name = "NAV_WAYPOINT"', "it moves the rover, and targets do that"),
        ('name = "DO_SPRAYER"', "command 1: DO_SPRAYER: needs 1 parameter (0 off or 1 on)"),
        ('name = "DO_SET_ROI"', "DO_SET_ROI: needs lat_deg and lon_deg; DO_SET_ROI_NONE looks ahead again"),
    ],
)
def test_a_command_in_toml_without_what_it_needs(tmp_path: Path, command: str, says: str) -> None:
    path = tmp_path / "m.toml"
    path.write_text(f"[[target]]\nnorth_m = 9\neast_m = 0\n[[target.command]]\n{command}\n")
    with pytest.raises(MissionError) as error:
        load_mission(path)
    assert says in str(error.value) and len(str(error.value).splitlines()) == 1


def test_home_that_is_set_on_the_way_is_where_the_rover_returns_to(tmp_path: Path) -> None:
    rows = (waypoint(1), do(2, 179, 1), do(3, 20), do(4, 179, 0, lat=53.3, lon=23.3), do(5, 20))
    mission = load_mission(wpl(tmp_path, HOME, *rows))
    assert [target.place for target in mission.targets[1:]] == [GeoPoint(53.2, 23.2), GeoPoint(53.3, 23.3)]


def test_zero_is_where_the_rover_is_and_a_delay_may_come_first(tmp_path: Path) -> None:
    mission = load_mission(wpl(tmp_path, HOME, do(1, 93, 5), waypoint(2, lat=0, lon=0, hold=2), waypoint(3)))
    assert [(target.place, target.hold_s) for target in mission.targets[:2]] == [(HERE, 5.0), (HERE, 2.0)]


def test_all_that_no_rover_can_do_is_named_at_once_and_can_be_left_out(tmp_path: Path) -> None:
    rows = (do(1, 22, lat=1, lon=1), waypoint(2), do(3, 82, lat=1, lon=1), do(4, 22, lat=1, lon=1), do(5, 214, 3))
    path = wpl(tmp_path, HOME, *rows)
    text = refusal(path)
    assert text == (
        "items 1, 4: NAV_TAKEOFF (22): no rover can do it; item 3: NAV_SPLINE_WAYPOINT (82): no rover can do it; "
        "item 5: DO_SET_CAM_TRIGG_INTERVAL (214): ArduRover does not take it; --skip-unknown drives the rest"
    )
    mission = load_mission(path, skip_unknown=True)
    assert names(mission) == ["waypoint 2"]
    assert mission.notes[0] == "left out: items 1, 4: NAV_TAKEOFF (22): no rover can do it"


def test_a_climb_speed_is_left_out_like_what_no_rover_can_do(tmp_path: Path) -> None:
    path = wpl(tmp_path, HOME, waypoint(1), do(2, 178, 2, 3), waypoint(3), do(4, 198, 7))
    assert refusal(path).startswith("item 2: DO_CHANGE_SPEED (178): a speed of kind 2 is not for a rover; --skip-")
    mission = load_mission(path, skip_unknown=True)
    assert (
        names(mission) == ["waypoint 1", "waypoint 3"] and mission.targets[1].commands[0].name == "DO_SET_ROI_SYSID 7 0"
    )


def test_wrong_values_are_named_with_what_no_rover_can_do(tmp_path: Path) -> None:
    rows = (do(1, 22, lat=1, lon=1), waypoint(2, hold=-5), waypoint(3), do(4, 178, 1, -3), do(5, 82, lat=1, lon=1))
    path = wpl(tmp_path, HOME, *rows)
    negative = "item 2: NAV_WAYPOINT (16): a hold of -5 s; it is from 0 to 1000000 s"
    wrong = f"{negative}; item 4: DO_CHANGE_SPEED (178): a speed of -3 m/s; give more than 0 and up to 50"
    unknown = "item 1: NAV_TAKEOFF (22): no rover can do it; item 5: NAV_SPLINE_WAYPOINT (82): no rover can do it"
    assert refusal(path) == f"{wrong}; {unknown}"
    with pytest.raises(MissionError) as error:
        load_mission(path, skip_unknown=True)
    assert str(error.value).endswith(wrong)


def test_an_endless_jump_is_a_patrol_of_one_lap(tmp_path: Path) -> None:
    mission = load_mission(wpl(tmp_path, HOME, waypoint(1), waypoint(2), do(3, 177, 1, -1)))
    assert names(mission) == ["waypoint 1", "waypoint 2"] and mission.patrol == Patrol(0)
    later = load_mission(wpl(tmp_path, HOME, waypoint(1), waypoint(2), waypoint(3), do(4, 177, 2, -1)))
    assert len(later.targets) == 3 and later.patrol == Patrol(1)


def test_what_follows_the_jump_belongs_to_the_laps_last_waypoint(tmp_path: Path) -> None:
    rows = (do(1, 216, 1), waypoint(2), waypoint(3), do(4, 177, 1, -1))
    mission = load_mission(wpl(tmp_path, HOME, *rows))
    assert [command.name for command in mission.commands] == ["DO_SPRAYER 1"]
    assert mission.patrol == Patrol(0) and commands_of(mission) == [[], ["DO_SPRAYER 1"]]


def test_a_speed_that_changes_within_the_lap_makes_the_first_one_different(tmp_path: Path) -> None:
    rows = (waypoint(1), do(2, 178, 0, 1), waypoint(3), do(4, 177, 1, -1))
    mission = load_mission(wpl(tmp_path, HOME, *rows))
    assert [target.speed_m_s for target in mission.targets] == [None, 1.0, 1.0, 1.0] and mission.patrol == Patrol(2)


def test_loops_within_a_patrol_and_tags(tmp_path: Path) -> None:
    rows = (do(1, 600, 7), waypoint(2), do(3, 177, 2, 1), waypoint(4), do(5, 601, 7, -1))
    mission = load_mission(wpl(tmp_path, HOME, *rows))
    assert [target.name[:10] for target in mission.targets] == ["waypoint 2", "waypoint 2", "waypoint 4"]
    assert mission.patrol == Patrol(0)


def test_a_circle_is_driven_through_places_on_it(tmp_path: Path) -> None:
    mission = load_mission(wpl(tmp_path, HOME, waypoint(1), do(2, 18, 1, 0, -20, lat=53.201, lon=23.2)))
    frame = LocalFrame(GeoPoint(53.201, 23.2))
    places = [frame.to_ned(target.place) for target in mission.targets[1:]]
    assert all(place.distance_m(NedPoint(0.0, 0.0)) == pytest.approx(20.0, abs=1e-6) for place in places)
    assert places[0].north_m == pytest.approx(-20.0, abs=0.01), "it begins where the rover comes from"
    assert places[1].east_m > 0.0, "from the south, counterclockwise is to the east"
    assert places[-1].distance_m(places[0]) < 0.01 and names(mission)[1] == "waypoint 2 (1 of 16)"


@pytest.mark.parametrize(
    ("radius_m", "turns", "count"), [(20.0, 0.0, 0), (0.2, 3.0, 1), (20.0, 0.5, 9), (1e6, 1.0, 73)]
)
def test_circles_of_every_size(radius_m: float, turns: float, count: int) -> None:
    assert len(corners(GeoPoint(53.0, 23.0), radius_m, turns, None)) == count


TOML = """
[[command]]
name = "DO_SPRAYER"
params = [1]
[[target]]
name = "gate"
north_m = 10.0
east_m = 0.0
hold_s = 2.0
[[target.command]]
name = "do_set_servo"
params = [9, 1900]
after_s = 2.0
[[target.command]]
name = "MAV_CMD_DO_SET_ROI_LOCATION"
lat_deg = 53.1
lon_deg = 23.1
altitude_m = 2.0
within_m = 3.0
[[target]]
north_m = 0.0
east_m = 0.0
[patrol]
first = "gate"
laps = 3
"""


def toml(folder: Path, text: str) -> Path:
    path = folder / "m.toml"
    path.write_text(text)
    return path


def test_toml_says_the_same(tmp_path: Path) -> None:
    mission = load_mission(toml(tmp_path, TOML))
    servo, roi = mission.targets[0].commands
    assert (servo.command, servo.params[:2], servo.after_s) == (183, (9.0, 1900.0), 2.0)
    assert (roi.place, roi.params[6], roi.within_m) == (GeoPoint(53.1, 23.1), 2.0, 3.0)
    assert mission.patrol == Patrol(0, 3) and mission.commands[0].name == "DO_SPRAYER 1"
    again = from_json(to_json(mission), "test")
    assert again == mission and fingerprint(again) == fingerprint(mission)


@pytest.mark.parametrize(
    ("old", "new", "reason"),
    [
        ('"do_set_servo"', '"DO_FLY"', "target 1: command 1: name: 'DO_FLY' is no MAVLink command known here"),
        ('"do_set_servo"', '"NAV_LAND"', "target 1: command 1: name: NAV_LAND cannot be given at a place: no rover"),
        ("[9, 1900]", "[9, 1900, 3]", "target 1: command 1: params: do_set_servo has at most 2, not 3"),
        ("lon_deg = 23.1\n", "", "target 1: command 2: lat_deg and lon_deg are both needed"),
        ("params = [1]", "lat_deg = 1.0", "command 1: DO_SPRAYER has no place"),
        ("after_s = 2.0", "after_s = 2.0\ndelay_s = 1.0", "target 1: command 1: after_s counts at the target"),
        ('first = "gate"', 'first = "door"', "patrol.first: there is no target 'door'"),
        ("laps = 3", "laps = 0", "patrol.laps"),
    ],
)
def test_wrong_toml_gets_one_line(tmp_path: Path, old: str, new: str, reason: str) -> None:
    assert old in TOML
    assert reason in refusal(toml(tmp_path, TOML.replace(old, new)))


def test_any_mission_may_be_driven_in_laps(tmp_path: Path) -> None:
    mission = load_mission(toml(tmp_path, TOML))
    assert with_laps(mission, None) is mission and with_laps(mission, 5).patrol == Patrol(0, 5)
    auto = load_mission(wpl(tmp_path, HOME, do(1, 92, 1, lat=53.3, lon=23.3)))
    with pytest.raises(MissionError, match="it has no laps"):
        with_laps(auto, 2)


def test_every_command_that_is_taken_has_a_name_and_only_those_may_be_given() -> None:
    assert all(command_of_name(mav.NAMES[number]) == number for number in TAKEN)
    assert why_not(21) == "no rover can do it" and "AUTO" in why_not(217)


@pytest.mark.parametrize(
    ("command", "params", "repeatable"),
    [
        (183, (9, 1900), True),
        (181, (0, 1), True),
        (181, (0, 2), False),
        (182, (0, 3, 1), False),
        (184, (9,), False),
        (203, (0, 0, 0, 0, 1), False),
        (2000, (0, 0, 1), True),
        (2000, (0, 2, 5), False),
        (2000, (0, 2, 0), False),
    ],
)
def test_what_switches_over_must_not_arrive_twice(command: int, params: tuple[float, ...], repeatable: bool) -> None:
    assert DoCommand(command, (*params, *(None,) * (7 - len(params)))).repeatable is repeatable


def test_what_a_jump_leads_past_is_named(tmp_path: Path) -> None:
    rows = (waypoint(1), waypoint(2), do(3, 177, 1, -1), waypoint(4), do(5, 22))
    mission = load_mission(wpl(tmp_path, HOME, *rows))
    assert names(mission) == ["waypoint 1", "waypoint 2"]
    assert "item 4: NAV_WAYPOINT (16): never comes, a jump leads past it" in mission.notes
    assert "item 5: NAV_TAKEOFF (22): never comes, a jump leads past it" in mission.notes
