"""A place sent to the companion while it drives: driven first, then the mission goes on; or refused with a reason."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.core.frames import GeoPoint, LocalFrame, NedPoint
from companion.executive.requested_goals import REPEAT_S
from companion.navigation.field_step import Action
from companion.safety.reasons import RunPhase, WaitReason
from companion.settings import parse_settings
from tests.scenarios.test_safety import Frame
from tests.support.asker import COMPANION, NAN, Asker
from tests.support.quick import first_of
from tests.support.rig import MANUAL, yard

ACCEPTED, NOT_NOW, DENIED = 0, 1, 2


@pytest.fixture
def driving(tmp_path: Path) -> Asker:
    rig = Asker(yard(tmp_path))
    rig.until_driven(1.5)
    return rig


def test_a_place_asked_for_is_driven_first_and_then_the_mission_goes_on(driving: Asker) -> None:
    driving.reposition(driving.field(5, 12))
    assert driving.answered() == ACCEPTED
    driving.until(lambda: driving.has_reached("requested goal 1"), 60.0)
    assert driving.passed_m(5, 12) < 0.7
    driving.finish()
    assert driving.companion.outcome.complete
    assert driving.passed_m(15, 7) < 0.7
    assert driving.goals == ["gate", "requested goal 1", "gate"]
    assert driving.texts()[-1] == "Mission ended: 1 of 1 targets reached"
    assert driving.simulator.collisions == ()


def messages(rig: Asker) -> dict[str, Any]:
    """The same place in every form that may be sent."""
    to, place = (1, COMPANION), rig.field(5, 12)
    degrees = (place[0] * 1e-7, place[1] * 1e-7, 0.0)
    whole = (*place, 0.0)
    zeros = (0.0,) * 4
    return {
        "command": mavlink.MAVLink_command_int_message(*to, 6, 192, 0, 0, -1.0, 0.0, 0.0, NAN, *whole),
        "zeros": mavlink.MAVLink_command_int_message(*to, 3, 192, 0, 0, 0.0, 0.0, 0.0, 0.0, *whole),
        "nans": mavlink.MAVLink_command_int_message(*to, 0, 192, 0, 0, NAN, NAN, NAN, NAN, *place, NAN),
        "long": mavlink.MAVLink_command_long_message(*to, 192, 0, -1.0, 0.0, 0.0, NAN, *degrees),
        "item": mavlink.MAVLink_mission_item_int_message(*to, 0, 6, 16, 2, 0, *zeros, *whole),
        "old item": mavlink.MAVLink_mission_item_message(*to, 0, 3, 16, 2, 0, *zeros, *degrees),
    }


@first_of(2, "form", ["zeros", "nans", "long", "item", "old item"])
def test_every_form_of_a_guided_target_leads_to_the_same_place(driving: Asker, form: str) -> None:
    wanted = messages(driving)
    driving.ask(wanted[form])
    assert driving.answered() == ACCEPTED
    progress = driving.companion.progress
    assert progress is not None and progress.requested is not None
    # Floats in degrees are good to a metre here, whole numbers to a centimetre.
    room_m = 1.0 if form in ("long", "old item") else 0.02
    assert progress.requested.point.distance_m(_local(driving, driving.field(5, 12))) < room_m


def _local(rig: Asker, place: tuple[int, int]) -> NedPoint:
    origin = rig.companion.vehicle.origin
    assert origin is not None
    return LocalFrame(origin.point).to_ned(GeoPoint(place[0] * 1e-7, place[1] * 1e-7))


UNSAFE = {
    "fence": ((9, 7), "beyond keep_out 1"),
    "edge of a fence": ((10, 8), "too near a fence"),
    "beyond the grid": ((40, 7), "outside the mission's grid"),
    "far": ((902, 7), "farther than 300 m"),
}


@first_of(2, ("field", "reason"), UNSAFE.values(), ids=UNSAFE)
def test_a_place_that_is_not_safe_is_refused_with_the_reason(
    tmp_path: Path, field: tuple[int, int], reason: str
) -> None:
    rig = Asker(yard(tmp_path, FENCED))
    rig.until_driven(1.5)
    rig.reposition(rig.field(*field))
    assert rig.answered() == DENIED
    assert reason in rig.texts()[-1] and rig.said, "the ground station hears why"
    assert rig.goals == ["gate"]
    rig.finish()
    assert rig.companion.outcome.complete


FENCED = """
[[target]]
name = "gate"
field = [15, 7]
[[keep_out]]
polygon_fields = [[8, 5], [8, 9], [10, 9], [10, 5]]
"""


@pytest.mark.thorough
def test_a_place_refused_again_is_told_again(driving: Asker) -> None:
    for _ in range(3):
        driving.reposition(driving.field(40, 7))
        assert driving.answered() == DENIED
        driving.run_for(1.0)
    told = [text for text in driving.texts() if text.startswith("Requested goal refused")]
    reason = "outside the mission's grid"
    assert told == [f"Requested goal refused{again}: {reason}" for again in ("", " (2 times)", " (3 times)")]


def test_a_place_where_an_obstacle_was_seen_is_refused(driving: Asker) -> None:
    driving.reposition(driving.field(8, 7))
    assert driving.answered() == DENIED
    assert driving.goals == ["gate"]


def test_what_is_no_place_is_refused(driving: Asker) -> None:
    to, place = (1, COMPANION), driving.field(5, 12)
    local = mavlink.MAVLink_command_int_message(*to, 1, 192, 0, 0, -1.0, 0.0, 0.0, NAN, 50000, 0, 0.0)
    body = mavlink.MAVLink_mission_item_int_message(*to, 0, 8, 16, 2, 0, 0, 0, 0, 0, 50000, 0, 0.0)
    land = mavlink.MAVLink_mission_item_int_message(*to, 0, 6, 21, 2, 0, 0, 0, 0, 0, *place, 0.0)
    nowhere = mavlink.MAVLink_command_long_message(*to, 192, 0, -1.0, 0.0, 0.0, NAN, NAN, NAN, NAN)
    for message, result in ((local, DENIED), (body, 2), (land, 3), (nowhere, DENIED)):
        driving.ask(message)
        assert driving.answered() == result
    for place in ((0, 0), (2**31 - 1, 2**31 - 1), (910_000_000, 0)):
        driving.reposition(place)
        assert driving.answered() == DENIED
    driving.reposition(driving.field(5, 12), speed=-3.0)
    assert driving.answered() == DENIED
    driving.finish()
    assert driving.goals == ["gate"]


def test_nothing_is_accepted_while_the_rover_is_not_driven(tmp_path: Path) -> None:
    rig = Asker(yard(tmp_path), arm=False)
    rig.until(lambda: rig.awaits(WaitReason.PERSON_ARMS))
    rig.reposition(rig.field(5, 12))
    assert rig.answered() == NOT_NOW
    rig.run_for(3.0)
    rig.pilot(400, 1)
    rig.until_driven(1.5)
    rig.pilot_mode(MANUAL)
    rig.until(lambda: rig.mode == MANUAL, 1.5)
    rig.reposition(rig.field(5, 12))
    assert rig.answered() == NOT_NOW
    rig.pilot_mode(15)
    rig.until(lambda: rig.does(RunPhase.DRIVING), 3.0)
    rig.reposition(rig.field(5, 12))
    assert rig.answered() == ACCEPTED


@pytest.mark.thorough
def test_a_repeated_request_changes_nothing(driving: Asker) -> None:
    place = driving.field(5, 12)
    for _ in range(3):
        driving.reposition(place)
        assert driving.answered() == ACCEPTED
    driving.until(lambda: driving.passed_m(5, 12) < 1.5, 60.0)
    driving.reposition(place)
    driving.until(lambda: driving.has_reached("requested goal 1"), 60.0)
    driving.answers.clear()
    driving.reposition(place)  # once more by a ground station that has not heard the answer
    assert driving.answered() == ACCEPTED
    assert driving.goals == ["gate", "requested goal 1", "gate"]
    driving.run_for(REPEAT_S)
    driving.reposition(place)  # and this time it is meant
    assert driving.answered() == ACCEPTED
    driving.finish()
    assert driving.goals == ["gate", "requested goal 1", "gate", "requested goal 2", "gate"]
    assert driving.companion.outcome.complete


@pytest.mark.thorough
def test_the_newest_request_counts(driving: Asker) -> None:
    driving.reposition(driving.field(5, 12))
    assert driving.answered() == ACCEPTED
    driving.reposition(driving.field(4, 2))
    assert driving.answered() == ACCEPTED
    driving.finish()
    assert driving.has_reached("requested goal 2") and not driving.has_reached("requested goal 1")
    assert driving.companion.outcome.complete


@pytest.mark.thorough
def test_a_place_that_cannot_be_reached_is_given_up_and_the_mission_goes_on(tmp_path: Path) -> None:
    walled = '[[target]]\nname = "corner"\nfield = [20, 2]\n'
    rig = Asker(yard(tmp_path, walled, sealed=True))
    rig.until_driven(1.5)
    rig.reposition(rig.field(15, 7))
    assert rig.answered() == ACCEPTED
    rig.finish(600.0)
    assert rig.times_decided(Action.UNREACHABLE, "requested goal 1") == 1
    assert rig.companion.outcome.complete
    assert rig.simulator.collisions == ()


def test_what_is_meant_for_others_is_left_alone(driving: Asker) -> None:
    """Targets for the autopilot itself, for everybody and for another vehicle; an upload; another command."""
    place = driving.field(5, 12)
    for to in ((1, 1), (1, 0), (0, 0), (2, COMPANION), (1, 190)):
        driving.reposition(place, to=to)
    upload = (1, COMPANION, 0, 6, 16, 0, 0, 0.0, 0.0, 0.0, 0.0, *place, 0.0)
    driving.ask(mavlink.MAVLink_mission_item_int_message(*upload))
    driving.ask(mavlink.MAVLink_command_long_message(1, COMPANION, 400, 0, *[0.0] * 7))
    driving.run_for(2.0)
    assert driving.answers == []
    assert driving.goals == ["gate"]
    driving.finish()
    assert driving.companion.outcome.complete


def test_a_speed_is_a_limit_and_never_more_than_the_mission_allows(driving: Asker) -> None:
    for speed_m_s, taken_m_s in ((0.6, 0.6), (9.0, 2.0), (0.0, None)):
        driving.reposition(driving.field(5, 12), speed=speed_m_s)
        assert driving.answered() == ACCEPTED
        progress = driving.companion.progress
        assert progress is not None and progress.requested is not None
        assert progress.requested.speed_m_s == (None if taken_m_s is None else pytest.approx(taken_m_s))


def test_a_requested_goal_keeps_its_place_when_the_origin_moves(tmp_path: Path) -> None:
    rig = Asker(yard(tmp_path), parse_settings({"link": {"setpoint": "global"}}, "test"))
    rig.until_driven(1.5)
    rig.reposition(rig.field(5, 12))
    assert rig.answered() == ACCEPTED
    rig.change = Frame(20.0, -35.0)
    origin = rig.companion.origin
    rig.until(lambda: rig.companion.origin != origin, 3.0)
    rig.until(lambda: rig.has_reached("requested goal 1"), 60.0)
    assert rig.passed_m(5, 12) < 1.5
    rig.finish()
    assert rig.companion.outcome.complete


def low_battery(message: Any) -> Any:
    if message.get_type() == "BATTERY_STATUS":
        message.battery_remaining = 15
    return message


@pytest.mark.thorough
def test_a_battery_that_runs_low_ends_a_requested_goal(driving: Asker) -> None:
    driving.reposition(driving.field(20, 12))
    assert driving.answered() == ACCEPTED
    driving.run_for(2.0)
    driving.change = low_battery
    driving.finish()
    assert driving.companion.outcome.broken_off is not None
    assert not driving.has_reached("requested goal 1")
    assert driving.passed_m(2, 7) < 1.5, "back where it began"
    driving.change = None


def test_a_rover_on_its_way_back_takes_no_requested_goal(driving: Asker) -> None:
    driving.until_driven(6.0)
    driving.change = low_battery
    driving.until(lambda: driving.companion.outcome.broken_off is not None, 12.0)
    driving.reposition(driving.field(20, 12))
    assert driving.answered() == NOT_NOW
    assert "requested goal 1" not in driving.goals
