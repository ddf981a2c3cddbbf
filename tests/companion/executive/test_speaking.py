"""What guidance wants reaches the autopilot; what cannot be said yet leaves the rover standing."""

from __future__ import annotations

import pytest

from companion.control.controller import ControlCommand, Purpose
from companion.core.frames import NedPoint
from companion.executive.outbox import Outbox
from companion.executive.speaking import Speaker
from companion.mavlink.autopilot_link import AutopilotLink
from companion.mavlink.codec import Codec
from companion.mavlink.transport import MemoryLink
from companion.recording.recorder import NullRecorder
from companion.settings import GuidanceSettings, LinkSettings
from companion.vehicle.commands import GuidedPosition
from tests.support.mavlink_vehicle import Station
from tests.support.tlog import messages

AHEAD = ControlCommand(Purpose.DRIVE, GuidedPosition(NedPoint(8.0, 0.0)), 2.0)


@pytest.mark.parametrize("origin", [True, False])
def test_a_place_in_degrees_needs_the_origin(origin: bool) -> None:
    near, far = MemoryLink.pair()
    settings, rover, told = LinkSettings(setpoint="global"), Station(), list[str]()
    autopilot = AutopilotLink(near, Codec(settings), settings, NullRecorder())
    far.write(rover.heartbeat(15) + (rover.origin() if origin else b""))
    list(autopilot.poll(0.0))
    speaker = Speaker(autopilot, Outbox(GuidanceSettings()), lambda text, severity: told.append(text))
    speaker.guide(AHEAD, 0.1)
    sent = messages(far.read())
    place = "SET_POSITION_TARGET_GLOBAL_INT" if origin else "SET_POSITION_TARGET_LOCAL_NED"
    assert [message.get_type() for message in sent] == [place, "COMMAND_LONG"]
    assert [text[:9] for text in told] == ([] if origin else ["Stopping:"])
    if not origin:
        assert (sent[0].vx, sent[0].vy, sent[0].yaw_rate) == (0.0, 0.0, 0.0), "a standstill"
    speaker.guide(AHEAD, 0.2)
    assert messages(far.read()) == [], "nothing is due again yet"
