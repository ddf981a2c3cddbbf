"""Guided targets addressed to the companion: what is one, what it says, and how it is answered."""

from __future__ import annotations

import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.mavlink.codec import Codec
from companion.settings import LinkSettings
from companion.vehicle.commands import AnswerRequest
from companion.vehicle.events import Asker, GoalRequested, RequestAnswer, RequestForm

PLACE = (531_325_000, 231_688_000)
NAN = math.nan
GROUND = (255, 190)


def packed(message: Any, sender: tuple[int, int] = GROUND) -> bytes:
    return bytes(message.pack(mavlink.MAVLink(None, *sender)))


def heard(message: Any, sender: tuple[int, int] = GROUND) -> list[Any]:
    """The events of a message, once the rover is known."""
    codec = Codec(LinkSettings())
    codec.decode(packed(mavlink.MAVLink_heartbeat_message(10, 3, 0, 0, 4, 3), (1, 1)), 0.0)
    return codec.decode(packed(message, sender), 1.0)


def asked(message: Any) -> GoalRequested:
    (event,) = heard(message)
    assert isinstance(event, GoalRequested)
    return event


def reposition(p1: float = -1.0, frame: int = 6, place: tuple[int, int] = PLACE, to: tuple[int, int] = (1, 191)) -> Any:
    return mavlink.MAVLink_command_int_message(*to, frame, 192, 0, 0, p1, 0.0, 0.0, NAN, *place, 0.0)


def item(frame: int = 6, command: int = 16, current: int = 2, mission_type: int = 0) -> Any:
    return mavlink.MAVLink_mission_item_int_message(
        1, 191, 0, frame, command, current, 0, *[0.0] * 4, *PLACE, 0.0, mission_type
    )


@pytest.mark.parametrize("message", [reposition(), reposition(frame=0), item(), item(frame=11)])
def test_whole_numbers_are_taken_as_they_are(message: Any) -> None:
    event = asked(message)
    assert event.point is not None and event.asker == Asker(*GROUND)
    assert (event.point.lat_deg, event.point.lon_deg) == (53.1325, 23.1688)
    assert event.fault is RequestAnswer.ACCEPTED


@pytest.mark.parametrize("message", [
    mavlink.MAVLink_command_long_message(1, 191, 192, 0, -1.0, 0.0, 0.0, NAN, 53.1325, 23.1688, 0.0),
    mavlink.MAVLink_mission_item_message(1, 191, 0, 3, 16, 2, 0, *[0.0] * 4, 53.1325, 23.1688, 0.0),
])  # fmt: skip
def test_degrees_as_floats_are_good_to_half_a_metre(message: Any) -> None:
    event = asked(message)
    assert event.point is not None
    assert event.point.lat_deg == pytest.approx(53.1325, abs=2e-6)
    assert event.point.lon_deg == pytest.approx(23.1688, abs=1e-6)


@pytest.mark.parametrize(("p1", "speed_m_s"), [(-1.0, None), (0.0, None), (NAN, None), (1.5, 1.5)])
def test_a_speed_is_taken_where_one_is_given(p1: float, speed_m_s: float | None) -> None:
    assert asked(reposition(p1)).speed_m_s == speed_m_s


@pytest.mark.parametrize(
    ("message", "fault"),
    [
        (reposition(frame=1), RequestAnswer.BAD_FRAME),
        (item(frame=8), RequestAnswer.BAD_FRAME),
        (reposition(-2.0), RequestAnswer.BAD_VALUE),
        (reposition(math.inf), RequestAnswer.BAD_VALUE),
        (reposition(place=(0, 0)), RequestAnswer.BAD_VALUE),
        (reposition(place=(2**31 - 1, 2**31 - 1)), RequestAnswer.BAD_VALUE),
        (item(command=21), RequestAnswer.UNSUPPORTED),
        (item(mission_type=1), RequestAnswer.UNSUPPORTED),
    ],
)
def test_what_cannot_be_driven_to_says_why(message: Any, fault: RequestAnswer) -> None:
    event = asked(message)
    assert event.point is None and event.fault is fault and event.reason


@pytest.mark.parametrize("message", [
    reposition(to=(1, 1)), reposition(to=(1, 0)), reposition(to=(0, 191)), reposition(to=(2, 191)), item(current=0),
    item(current=3), mavlink.MAVLink_command_long_message(1, 191, 400, 0, 1.0, *[0.0] * 6),
])  # fmt: skip
def test_what_is_meant_for_others_or_is_no_target_is_none_of_ours(message: Any) -> None:
    assert heard(message) == []


def test_before_the_rover_is_known_nobody_is_listened_to() -> None:
    assert Codec(LinkSettings()).decode(packed(reposition()), 1.0) == []


@given(st.floats(width=32), st.floats(width=32), st.floats(width=32), st.integers(0, 255), st.integers(0, 255))
def test_whatever_stands_in_a_request_is_a_place_or_a_reason(
    p1: float, lat: float, lon: float, frame: int, current: int
) -> None:
    long = mavlink.MAVLink_command_long_message(1, 191, 192, 0, p1, 0.0, 0.0, NAN, lat, lon, 0.0)
    old = mavlink.MAVLink_mission_item_message(1, 191, 0, frame, 16, current, 0, *[0.0] * 4, lat, lon, 0.0)
    for message in (long, old):
        for event in heard(message):
            assert (event.point is None) == bool(event.reason) == (event.fault is not RequestAnswer.ACCEPTED)
            assert event.point is None or (abs(event.point.lat_deg) <= 90.0 and abs(event.point.lon_deg) <= 180.0)


@pytest.mark.parametrize("answer", RequestAnswer)
def test_the_asker_is_answered_in_the_form_in_which_he_asked(answer: RequestAnswer) -> None:
    codec = Codec(LinkSettings())
    for form, kind in ((RequestForm.COMMAND, "COMMAND_ACK"), (RequestForm.ITEM, "MISSION_ACK")):
        raw = codec.encode(AnswerRequest(Asker(254, 7), form, answer))
        (message,) = mavlink.MAVLink(None).parse_buffer(raw)
        assert message.get_type() == kind and (message.target_system, message.target_component) == (254, 7)
        result = message.result if form is RequestForm.COMMAND else message.type
        assert (result == 0) == (answer is RequestAnswer.ACCEPTED)
        assert form is RequestForm.ITEM or message.command == 192
