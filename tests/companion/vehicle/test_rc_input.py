"""Sticks in RC_CHANNELS, and commands that a person may have overtaken: the pilot wins."""

from __future__ import annotations

import pytest

from companion.mavlink.confirmation import CommandTracker
from companion.safety.mode_latch import Control, LatchState, Reaction
from companion.safety.reasons import Doubt, Reason
from companion.supervision.arming import overruled
from companion.vehicle.commands import ChangeSpeed, SetMode
from companion.vehicle.events import AckSeen, HeartbeatSeen
from companion.vehicle.rc_input import Sticks, SticksSeen, sticks_after
from companion.vehicle.state import fold
from tests.companion.safety.test_mode_latch import HOLD, checked, vehicle


def after(*places_us: tuple[int, int]) -> Sticks:
    sticks = Sticks()
    for steering_us, throttle_us in places_us:
        sticks = sticks_after(sticks, SticksSeen(0.0, steering_us, throttle_us))
    return sticks


@pytest.mark.parametrize(
    ("places_us", "moved"),
    [
        ([(1500, 1500)] * 5, False),
        ([(1500, 1500), (1620, 1500), (1620, 1500)], True),
        ([(1500, 1500), (1500, 1380), (1500, 1380)], True),
        ([(1500, 1500), (1620, 1500)], False),
        ([(1500, 1500), (1620, 1500), (1500, 1500), (1620, 1500)], False),  # disturbed now and then
        ([(1500, 1500)] + [(1590, 1410)] * 5, False),
        ([(1500, 1100)] * 5, False),  # a throttle that rests at the bottom
        ([(1500, 1100)] + [(1500, 1500)] * 5, False),  # let go
        ([(1500, 1100), (1500, 1500), (1500, 1100), (1500, 1100)], True),
        ([(1800, 1500), (1500, 1500), (1500, 1500)], False),
        ([(1450, 1500), (1560, 1500), (1560, 1500)], False),  # through the middle, but not far beyond
        ([(1900, 1500), (1100, 1500), (1100, 1500)], True),
        ([(1800, 1500), (1950, 1500), (1950, 1500)], True),
        ([(1500, 1500), (0, 0), (65535, 65535), (0, 0)], False),  # no receiver
        ([(0, 0)] * 3 + [(1700, 1500)] * 3, False),  # switched on with the stick held
    ],
)
def test_what_counts_as_taking_hold(places_us: list[tuple[int, int]], moved: bool):
    assert after(*places_us).moved is moved


def test_moved_sticks_are_a_hold_at_once_and_then_silence_until_guided_is_set_anew():
    state = vehicle(10.0)
    for steering_us in (1500, 1900, 1900):
        state = fold(state, SticksSeen(10.0, steering_us, 1500))
    watch, verdict = checked(LatchState(Control.COMPANION), state, 10.0)
    assert (verdict.reaction, verdict.reason) == (Reaction.HOLD, Reason(Doubt.STICKS_MOVED))
    assert checked(watch, state, 10.1)[1].reaction is Reaction.SILENT
    for seen, reaction in ((vehicle(11.0, HOLD), Reaction.SILENT), (vehicle(12.0), Reaction.DRIVE)):
        state = fold(state, seen.heartbeat)
        fresh = fold(seen, seen.heartbeat)
        watch, verdict = checked(watch, fresh, seen.heartbeat.time_s)
        assert verdict.reaction is reaction
    assert not state.sticks.moved


@pytest.mark.parametrize(("silent_s", "repeated"), [(1.5, 1), (30.0, 0)])
def test_a_mode_is_not_asked_for_again_after_a_silence_in_which_a_person_may_have_chosen(
    silent_s: float, repeated: int
):
    """The vehicle is as it was, but what was between nobody knows."""
    acks, command = CommandTracker(), SetMode(15)
    acks.heard(HeartbeatSeen(10.0, HOLD, True, 1))
    acks.sent(command, 10.1)
    acks.due(10.1 + 0.9 * silent_s)
    acks.heard(HeartbeatSeen(10.1 + silent_s, HOLD, True, 1))
    assert len(acks.due(10.2 + silent_s)) == repeated


def test_a_speed_is_not_said_again_to_a_rover_in_another_mode():
    acks = CommandTracker()
    acks.heard(HeartbeatSeen(10.0, 15, True, 1))
    acks.sent(ChangeSpeed(1.0), 10.1)
    assert len(acks.due(11.2)) == 1
    acks.heard(HeartbeatSeen(11.3, 0, True, 1))
    assert acks.due(12.5) == []


@pytest.mark.parametrize(
    ("ack", "heartbeat", "taken"),
    [
        (None, HeartbeatSeen(12.0, HOLD, True, 1), False),
        (AckSeen(10.0, 176, 0), None, False),
        (AckSeen(10.0, 176, 0), HeartbeatSeen(10.2, HOLD, True, 1), False),  # on its way before the change
        (AckSeen(10.0, 176, 0), HeartbeatSeen(11.0, HOLD, True, 1), True),
        (AckSeen(10.0, 176, 0), HeartbeatSeen(11.0, 15, True, 1), False),
        (AckSeen(10.0, 176, 4), HeartbeatSeen(11.0, HOLD, True, 1), False),  # refused
    ],
)
def test_a_mode_that_was_taken_and_is_not_there_has_been_changed_by_a_person(ack, heartbeat, taken):
    assert overruled(ack, heartbeat) is taken
