"""Guided inside AUTO: the autopilot drives its own mission, the companion only the legs that it hands over."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest

from companion.executive.mission_progress import TargetStatus
from companion.mission.load import load_mission
from companion.mission.mission import Mission
from companion.navigation.field_step import Action
from companion.safety.reasons import LatchReason, RunPhase, WaitReason
from tests.clients.scene import HOME_DEG
from tests.scenarios.test_requested_goals import low_battery
from tests.support.asker import Asker
from tests.support.quick import first_of
from tests.support.rig import ARM, AUTO, GUIDED, HOLD, MANUAL, SET_MODE, without, yard

WAYPOINT, GUIDED_ENABLE, LIMITS, DELAY = 16, 92, 222, 93
ON = (1.0, 0.0, 0.0, 0.0)
NONE = (0.0,) * 4
Row = tuple[int, tuple[float, ...], tuple[int, int] | None]
"""Command, four parameters, field of the yard."""
ROUND_THE_WALL: list[Row] = [(WAYPOINT, NONE, (4, 7)), (GUIDED_ENABLE, ON, (15, 7)), (WAYPOINT, NONE, (20, 7))]


def place_deg(field: tuple[int, int] | None) -> tuple[float, float]:
    if field is None:
        return 0.0, 0.0
    lat_deg = HOME_DEG[0] + (field[1] - 7) / 111_318.84502145034
    scale = math.cos(math.radians((lat_deg + HOME_DEG[0]) / 2.0))
    return lat_deg, HOME_DEG[1] + (field[0] - 2) / (111_318.84502145034 * scale)


def as_file(folder: Path, rows: list[Row]) -> Mission:
    lines = ["QGC WPL 110", f"0 1 0 16 0 0 0 0 {HOME_DEG[0]:.7f} {HOME_DEG[1]:.7f} 0 1"]
    for index, (command, params, field) in enumerate(rows, start=1):
        lat, lon = place_deg(field)
        lines.append(" ".join(map(str, (index, 0, 3, command, *params, f"{lat:.7f}", f"{lon:.7f}", 0, 1))))
    path = folder / "auto.waypoints"
    path.write_text("\n".join(lines) + "\n")
    return load_mission(path)


def in_auto(folder: Path, rows: list[Row], *, sealed: bool = False) -> Asker:
    """The rover has just been armed and put into AUTO by a person."""
    rig = Asker(yard(folder, sealed=sealed), arm=False, late_s=46.0, state=folder / "state")
    rig.restart_companion(as_file(folder, rows))
    rig.run_for(3.0)
    assert rig.awaits(WaitReason.PERSON_STARTS_AUTO)
    uploaded = [tuple(round(value * 1e7) for value in place_deg(field)) for _, _, field in rows]
    rig.upload([(command, params, place) for (command, params, _), place in zip(rows, uploaded, strict=True)])
    rig.pilot(ARM, 1)
    rig.run_for(1.0)
    rig.pilot_mode(AUTO)
    return rig


def item(rig: Asker) -> int:
    """The navigation item under way, as the autopilot knows it."""
    return int(rig.simulator.vehicle.mission.current)


def assert_steered_only_in_the_leg(rig: Asker) -> None:
    moves = [one for one in rig.sent if one.moves_or_changes]
    assert moves
    assert all(one.armed and (one.mode == AUTO or one.command == SET_MODE) for one in moves)


@pytest.mark.thorough
def test_the_leg_that_is_handed_over_is_driven_round_the_wall(tmp_path: Path) -> None:
    rig = in_auto(tmp_path, ROUND_THE_WALL)
    rig.until(lambda: item(rig) == 2, 30.0)
    assert [one for one in rig.sent if one.moves_or_changes] == []
    rig.until(lambda: item(rig) == 3, 60.0)
    over_s = rig.now_s()
    assert rig.passed_m(15, 7) < 2.5
    rig.until(lambda: rig.companion.done, 5.0)
    assert [one for one in rig.sent_since(over_s + 0.2) if one.moves_or_changes] == []
    assert rig.companion.outcome.complete and set(rig.goals) == {"guided item 2"}
    rig.simulator.advance_to_s(rig.simulator.time_s + 10.0)
    assert rig.passed_m(20, 7) < 1.0, "the autopilot drives the rest by itself"
    assert_steered_only_in_the_leg(rig)
    assert rig.simulator.collisions == ()


def in_leg(folder: Path, rows: list[Row] = ROUND_THE_WALL, metres: float = 4.0, **more: Any) -> Asker:
    """So far driven in all, and in the leg."""
    rig = in_auto(folder, rows, **more)
    rig.until(lambda: "guided item 2" in rig.goals and rig.does(RunPhase.DRIVING), 60.0)
    rig.until_driven(metres)
    return rig


def assert_silent_since(rig: Asker, since_s: float) -> None:
    assert [one for one in rig.sent_since(since_s) if one.moves_or_changes] == []


@pytest.mark.thorough
@first_of(
    1,
    ("mode", "metres"),
    [
        (MANUAL, 2.2),  # setting off
        (HOLD, 6.0),  # at speed
        *(
            pytest.param(*one, marks=pytest.mark.thorough)
            for one in ((HOLD, 2.2), (GUIDED, 2.2), (MANUAL, 6.0), (GUIDED, 6.0))
        ),
    ],
)
def test_a_person_who_takes_the_rover_in_a_leg_has_it(tmp_path: Path, mode: int, metres: float) -> None:
    """Not one setpoint after it, in GUIDED neither; with AUTO set again the leg is driven on."""
    rig = in_leg(tmp_path, metres=metres)
    rig.pilot_mode(mode)
    rig.until(lambda: rig.mode == mode, 1.5)
    since_s = rig.now_s()
    rig.run_for(6.0)
    assert_silent_since(rig, since_s)
    assert rig.awaits(WaitReason.PERSON_SETS_MODE) and rig.gave(LatchReason.OTHER_MODE, "AUTO")
    rig.pilot_mode(AUTO)
    rig.finish(120.0)
    assert rig.companion.outcome.complete
    assert_steered_only_in_the_leg(rig)


def test_a_mission_of_the_companions_own_is_never_driven_in_auto(tmp_path: Path) -> None:
    """A leg is handed over to a companion that drives in GUIDED: a person has chosen AUTO, so it is silent."""
    rig = Asker(yard(tmp_path))
    rig.until_driven(1.0)
    rig.upload([(GUIDED_ENABLE, ON, rig.field(15, 7)), (WAYPOINT, NONE, rig.field(4, 7))])
    rig.pilot_mode(AUTO)
    rig.until(lambda: rig.mode == AUTO, 1.5)
    since_s = rig.now_s()
    rig.run_for(5.0)
    assert rig.companion.vehicle.leg is not None, "it was handed over"
    assert_silent_since(rig, since_s)


@first_of(1, "limits", [(3.0, 0, 0, 0), (0, 0, 0, 3.0)], ids=["time", "distance"])
def test_the_limits_of_a_leg_are_the_autopilots(tmp_path: Path, limits: tuple[float, ...]) -> None:
    rows: list[Row] = [(LIMITS, limits, None), (GUIDED_ENABLE, ON, (15, 7)), (WAYPOINT, NONE, (3, 7))]
    rig = in_auto(tmp_path, rows)
    rig.until(lambda: item(rig) == 3, 60.0)
    over_s = rig.now_s()
    rig.until(lambda: rig.companion.done, 5.0)
    assert_silent_since(rig, over_s + 0.2)
    assert [status for _, status in rig.companion.statuses()] == [TargetStatus.SKIPPED]


@pytest.mark.thorough
def test_a_place_that_cannot_be_reached_is_stood_before_until_the_limit(tmp_path: Path) -> None:
    rows: list[Row] = [(LIMITS, (150.0, 0, 0, 0), None), (GUIDED_ENABLE, ON, (15, 7)), (WAYPOINT, NONE, (3, 7))]
    rig = in_auto(tmp_path, rows, sealed=True)
    rig.until(lambda: rig.times_decided(Action.UNREACHABLE, "guided item 2") > 0, 149.0)
    rig.run_for(2.0)
    assert item(rig) == 2 and rig.speed_m_s < 0.05
    rig.until(lambda: item(rig) == 3, 150.0)
    assert rig.simulator.collisions == ()
    assert_steered_only_in_the_leg(rig)


@pytest.mark.thorough
def test_range_data_that_fails_in_a_leg_stops_the_rover_and_then_holds(tmp_path: Path) -> None:
    rig = in_leg(tmp_path)
    rig.change, since_s = without("OBSTACLE_DISTANCE", "DISTANCE_SENSOR"), rig.now_s()
    rig.until(lambda: rig.speed_m_s < 0.05, 4.0)
    rig.until(lambda: rig.mode == HOLD, 3.0)
    assert [one for one in rig.sent_since(since_s + 1.1) if one.is_setpoint and not one.is_standstill] == []
    held_s = rig.now_s()
    rig.run_for(5.0)
    assert_silent_since(rig, held_s)
    rig.change = None
    rig.pilot_mode(AUTO)
    rig.finish(120.0)
    assert rig.companion.outcome.complete and rig.simulator.collisions == ()


def test_the_end_of_the_companion_in_a_leg_leaves_the_rover_in_hold(tmp_path: Path) -> None:
    rig = in_leg(tmp_path)
    rig.companion.stop()
    rig.finish(3.0)
    rig.simulator.advance_to_s(rig.simulator.time_s + 4.0)
    assert rig.simulator.vehicle.mode == HOLD and rig.speed_m_s < 0.05


def test_the_end_of_the_companion_while_auto_drives_changes_nothing(tmp_path: Path) -> None:
    rig = in_auto(tmp_path, ROUND_THE_WALL)
    rig.until_driven(0.5)
    rig.companion.stop()
    rig.finish(3.0)
    assert [one for one in rig.sent if one.moves_or_changes] == []
    assert rig.simulator.vehicle.mode == AUTO


class Shutdown:
    """The line from the autopilot: what is handed over is changed, or lost from a moment on."""

    def __init__(self, rig: Asker, lost_s: float = 0.0, **fields: int) -> None:
        self.rig, self.fields, self.until_s = rig, fields, rig.now_s() + lost_s
        self.lost: tuple[str, ...] = ()

    def __call__(self, message: Any) -> Any:
        if message.get_type() in self.lost:
            return None
        if message.get_type() == "SET_POSITION_TARGET_GLOBAL_INT":
            for name, value in self.fields.items():
                setattr(message, name, value)
            return None if self.rig.now_s() < self.until_s else message
        return message


@pytest.mark.parametrize("frame", [0, 3])
def test_a_leg_may_be_said_in_any_frame_with_a_latitude(tmp_path: Path, frame: int) -> None:
    rig = in_auto(tmp_path, ROUND_THE_WALL)
    rig.change = Shutdown(rig, coordinate_frame=frame)
    rig.until(lambda: "guided item 2" in rig.goals and rig.does(RunPhase.DRIVING), 60.0)
    assert rig.companion.status().target == "guided item 2"


OTHERS = {
    "component": {"target_component": 195},
    "everybody": {"target_component": 0},
    "system": {"target_system": 2},
    "local": {"coordinate_frame": 1},
    "velocity": {"type_mask": 3527},
    "elsewhere": {"lat_int": 531_335_000},
}


@first_of(1, "fields", OTHERS.values(), ids=OTHERS)
def test_what_is_no_leg_of_ours_is_not_driven(tmp_path: Path, fields: dict[str, int]) -> None:
    rig = in_auto(tmp_path, ROUND_THE_WALL)
    rig.change = Shutdown(rig, **fields)
    rig.until(lambda: item(rig) == 2, 60.0)
    driven_m = rig.simulator.driven_m
    rig.run_for(8.0)
    assert rig.simulator.driven_m - driven_m < 1.3, "it rolls out"
    assert not any(one.is_setpoint and not one.is_standstill for one in rig.sent)
    assert ("lat_int" in fields) == any("not in the mission as it was read" in text for text in rig.texts())


@pytest.mark.thorough
def test_a_leg_that_falls_silent_is_driven_for_two_seconds_and_no_longer(tmp_path: Path) -> None:
    rig = in_leg(tmp_path)
    rig.change = Shutdown(rig, lost_s=1.4)
    rig.run_for(1.4)
    assert rig.companion.vehicle.is_ours, "one repetition or two were lost on the way"
    rig.change = Shutdown(rig, lost_s=6.0)
    since_s = rig.now_s()
    rig.run_for(5.9)
    assert_silent_since(rig, since_s + 4.6)
    assert any(one.is_setpoint for one in rig.sent_since(since_s))
    rig.finish(120.0)
    assert rig.companion.outcome.complete


@pytest.mark.thorough
@pytest.mark.parametrize("lost", [("MISSION_ITEM_REACHED",), ("MISSION_CURRENT",)])
def test_either_news_of_its_end_ends_a_leg(tmp_path: Path, lost: tuple[str, ...]) -> None:
    rig = in_auto(tmp_path, ROUND_THE_WALL)
    change = Shutdown(rig)
    change.lost = lost
    rig.change = change
    rig.until(lambda: item(rig) == 3, 90.0)
    over_s = rig.now_s()
    rig.finish(5.0)
    assert_silent_since(rig, over_s + 1.2)
    assert rig.companion.outcome.complete


@pytest.mark.thorough
def test_a_small_radius_of_the_autopilots_is_driven_into(tmp_path: Path) -> None:
    """The companion is content half a metre off; the autopilot ends the leg later."""
    rig = in_leg(tmp_path)
    rig.simulator.vehicle.parameters.set("WP_RADIUS", 0.3)
    rig.finish(60.0)
    assert rig.companion.outcome.complete and item(rig) == 3


def test_two_legs_with_a_way_of_the_autopilots_between(tmp_path: Path) -> None:
    second: list[Row] = [(DELAY, (2.0, -1.0, -1.0, -1.0), None), (GUIDED_ENABLE, ON, (5, 2)), (WAYPOINT, NONE, (3, 7))]
    rig = in_auto(tmp_path, [*ROUND_THE_WALL[:2], *second])
    rig.finish(200.0)
    assert list(dict.fromkeys(rig.goals)) == ["guided item 2", "guided item 4"]
    assert rig.companion.outcome.complete and rig.simulator.collisions == ()
    assert_steered_only_in_the_leg(rig)


def test_requested_goals_are_not_for_legs_of_auto(tmp_path: Path) -> None:
    rig = in_leg(tmp_path)
    rig.reposition(rig.field(5, 12))
    assert rig.answered() == 1


def test_a_companion_that_is_killed_in_a_leg_takes_it_up_again(tmp_path: Path) -> None:
    rig = in_leg(tmp_path)
    rig.restart_companion(as_file(tmp_path, ROUND_THE_WALL), resume=True)
    rig.finish(120.0)
    assert rig.companion.outcome.complete and rig.simulator.collisions == ()
    assert_steered_only_in_the_leg(rig)


@pytest.mark.thorough
def test_a_battery_that_runs_low_in_a_leg_is_the_autopilots_affair(tmp_path: Path) -> None:
    """The companion never turns back inside a leg of AUTO."""
    rig = in_leg(tmp_path)
    rig.change = low_battery
    rig.finish(120.0)
    assert rig.companion.outcome.complete
    assert rig.companion.outcome.broken_off is None


@pytest.mark.thorough
def test_a_run_of_auto_that_is_taken_up_leaves_a_rover_in_guided_to_its_person(tmp_path: Path) -> None:
    rig = in_leg(tmp_path)
    rig.pilot_mode(GUIDED)
    rig.sleep_until_s(rig.now_s() + 1.0)  # the companion is dead
    rig.restart_companion(as_file(tmp_path, ROUND_THE_WALL), resume=True)
    since_s = rig.now_s()
    rig.run_for(15.0)
    assert_silent_since(rig, since_s)
    assert rig.awaits(WaitReason.PERSON_STARTS_AUTO)
