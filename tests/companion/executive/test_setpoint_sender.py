"""The autopilot brakes for every new setpoint: only what has changed, or is due again, goes out."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest

from companion.control.controller import STOP, ControlCommand, Purpose
from companion.core.frames import NedPoint
from companion.executive.setpoint_sender import SentSetpoints, SetpointSender
from companion.mavlink.autopilot_link import AutopilotLink
from companion.mavlink.codec import Codec
from companion.mavlink.transport import MemoryLink
from companion.recording.recorder import NullRecorder
from companion.settings import GuidanceSettings, LinkSettings, Settings
from companion.settings.live_settings import LiveSettings
from companion.vehicle.commands import ChangeSpeed, GuidedHeading, GuidedPosition, GuidedVelocity, SetMode
from tests.support.mavlink_vehicle import Station
from tests.support.notices import Notices
from tests.support.tlog import messages

SETTINGS = GuidanceSettings()


def drive(north_m: float, speed_m_s: float = 2.0) -> ControlCommand:
    return ControlCommand(Purpose.DRIVE, GuidedPosition(NedPoint(north_m, 0.0)), speed_m_s)


def look(heading_deg: float) -> ControlCommand:
    return ControlCommand(Purpose.LOOK, GuidedHeading(math.radians(heading_deg)), 0.5)


def times_sent(guides, confirmed: bool | None = True, kind: type = GuidedPosition) -> list[float]:
    """When setpoints of a kind went out; ``guides``: time and guide, tick by tick."""
    sent = SentSetpoints()
    return [
        t
        for t, guide in guides
        if any(isinstance(c, kind) for c in sent.due(guide, t, SETTINGS, 3.0, confirmed=confirmed))
    ]


def ticks(until_s: float, step_s: float = 0.05) -> list[float]:
    return [round(i * step_s, 3) for i in range(round(until_s / step_s))]


def test_a_target_that_stays_is_repeated_and_no_more():
    times_s = times_sent([(t, drive(8.0)) for t in ticks(5.0)])
    assert times_s == [0.0, 1.0, 2.0, 3.0, 4.0]


def test_a_target_that_rolls_ahead_is_sent_sooner_but_not_at_every_tick():
    times_s = times_sent([(t, drive(8.0 + 2.0 * t)) for t in ticks(4.0)])
    gaps = [b - a for a, b in pairwise(times_s)]
    assert all(SETTINGS.change_after_s - 1e-9 <= gap <= SETTINGS.resend_s for gap in gaps)
    assert len(times_s) >= 8


def test_small_movements_of_a_target_wait_for_the_next_repetition():
    times_s = times_sent([(t, drive(8.0 + 0.1 * t)) for t in ticks(3.0)])
    assert times_s == [0.0, 1.0, 2.0]


@pytest.mark.parametrize(("confirmed", "count"), [(True, 3), (None, 3), (False, 6)])
def test_what_the_autopilot_does_not_follow_is_said_again_sooner(confirmed, count):
    assert len(times_sent([(t, drive(8.0)) for t in ticks(3.0)], confirmed)) == count


def test_stopping_goes_out_at_once_and_is_kept_alive():
    """The autopilot stops by itself 3 s after the last velocity."""
    times_s = times_sent([(t, ControlCommand(Purpose.BRAKE, STOP, 0.0)) for t in ticks(2.0)], kind=GuidedVelocity)
    assert times_s[0] == 0.0 and max(b - a for a, b in pairwise(times_s)) < 1.0
    sent = SentSetpoints()
    sent.due(drive(8.0), 0.0, SETTINGS, 3.0, confirmed=True)
    assert sent.due(ControlCommand(Purpose.BRAKE, STOP, 0.0), 0.05, SETTINGS, 3.0, confirmed=True) == [STOP]
    assert GuidedPosition(NedPoint(8.0, 0.0)) in sent.due(drive(8.0), 0.1, SETTINGS, 3.0, confirmed=True), (
        "and so does driving on"
    )


def test_a_changed_velocity_goes_out_at_once():
    sent = SentSetpoints()
    sent.due(ControlCommand(Purpose.BRAKE, STOP, 0.0), 0.0, SETTINGS, 3.0, confirmed=None)
    back = GuidedVelocity(-0.4, 0.0)
    assert sent.due(ControlCommand(Purpose.DRIVE, back, 0.0), 0.05, SETTINGS, 3.0, confirmed=None) == [back]


def test_headings_are_repeated_slowly_and_followed_when_they_turn():
    assert len(times_sent([(t, look(90.0)) for t in ticks(3.0)], kind=GuidedHeading)) == 3
    assert len(times_sent([(t, look(90.0 + t)) for t in ticks(3.0)], kind=GuidedHeading)) == 3
    assert len(times_sent([(t, look(40.0 * t)) for t in ticks(3.0)], kind=GuidedHeading)) > 6
    assert len(times_sent([(t, look(179.0 + 2 * (i % 2))) for i, t in enumerate(ticks(3.0))], kind=GuidedHeading)) == 3


def test_speed_goes_with_positions_when_it_changes_and_now_and_then():
    def speeds(guides):
        sent = SentSetpoints()
        return [
            (t, c.speed_m_s)
            for t, guide in guides
            for c in sent.due(guide, t, SETTINGS, 3.0, confirmed=True)
            if isinstance(c, ChangeSpeed)
        ]

    steady = speeds([(t, drive(8.0, 2.0)) for t in ticks(7.0)])
    assert [t for t, _ in steady] == [0.0, 3.0, 6.0]
    slower = speeds([(t, drive(8.0, 2.0 if t < 1.0 else 0.8)) for t in ticks(2.0)])
    assert slower == [(0.0, 2.0), (1.0, 0.8)]
    trembling = speeds([(t, drive(8.0, 2.0 + 0.1 * (i % 2))) for i, t in enumerate(ticks(2.0))])
    assert len(trembling) == 1
    assert not speeds([(0.0, look(10.0)), (0.1, ControlCommand(Purpose.BRAKE, STOP, 0.0))])


def test_positions_are_driven_to_as_fast_as_was_told_last_or_before():
    """The slower speed may not have come yet."""
    sent = SentSetpoints()
    told = []
    for t, speed_m_s in ((0.0, 2.0), (3.0, 2.0), (4.0, 1.0), (7.0, 1.0)):
        sent.due(drive(8.0, speed_m_s), t, SETTINGS, 3.0, confirmed=True)
        told.append(sent.placed_m_s)
    assert told == [math.inf, 2.0, 2.0, 1.0]
    sent.reset()
    assert sent.placed_m_s == math.inf


def test_after_a_reset_everything_is_new():
    sent = SentSetpoints()
    sent.due(drive(8.0), 0.0, SETTINGS, 3.0, confirmed=True)
    assert sent.due(drive(8.0), 0.1, SETTINGS, 3.0, confirmed=True) == []
    sent.reset()
    assert sent.due(drive(8.0), 0.2, SETTINGS, 3.0, confirmed=True) == [
        GuidedPosition(NedPoint(8.0, 0.0)),
        ChangeSpeed(2.0),
    ]


AHEAD = ControlCommand(Purpose.DRIVE, GuidedPosition(NedPoint(8.0, 0.0)), 2.0)


@pytest.mark.parametrize("origin", [True, False])
def test_a_place_in_degrees_needs_the_origin(origin: bool) -> None:
    near, far = MemoryLink.pair()
    settings, rover, notices = LinkSettings(setpoint="global"), Station(), Notices()
    autopilot = AutopilotLink(near, Codec(settings), settings, NullRecorder())
    far.write(rover.heartbeat(15) + (rover.origin() if origin else b""))
    list(autopilot.poll(0.0))
    sender = SetpointSender(autopilot, LiveSettings(Settings()), notices)
    sender.speak(AHEAD, 0.1, 3.0)
    sent = messages(far.read())
    place = "SET_POSITION_TARGET_GLOBAL_INT" if origin else "SET_POSITION_TARGET_LOCAL_NED"
    assert [message.get_type() for message in sent] == [place, "COMMAND_LONG"]
    assert [text[:9] for text in notices.texts] == ([] if origin else ["Stopping:"])
    if not origin:
        assert (sent[0].vx, sent[0].vy, sent[0].yaw_rate) == (0.0, 0.0, 0.0), "a standstill"
    sender.speak(AHEAD, 0.2, 3.0)
    assert messages(far.read()) == [], "nothing is due again yet"
    sender.speak(None, 0.3, 3.0)
    assert messages(far.read()) == [], "nothing to say"
    sender.speak(SetMode(4), 0.4, 3.0)
    assert [message.command for message in messages(far.read())] == [176]


@pytest.mark.parametrize(("lasts_s", "within_s"), [(3.0, 1.0), (1.0, 0.4), (0.3, 0.15)])
def test_a_turn_is_said_again_before_the_autopilot_ends_it(lasts_s: float, within_s: float) -> None:
    sent, turn = SentSetpoints(), ControlCommand(Purpose.LOOK, GuidedHeading(1.0), 0.0)
    at_s = [t for t in np.arange(0.0, 4.0, 0.05) if sent.due(turn, t, SETTINGS, lasts_s, confirmed=None)]
    assert np.diff(at_s).max() <= within_s + 1e-6 and np.diff(at_s).max() <= 0.5 * lasts_s + 1e-6
