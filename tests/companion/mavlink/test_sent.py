"""What was told is read back from the packets, in every form in which it is sent."""

from __future__ import annotations

import pytest

from companion.core.frames import GeoPoint, NedPoint
from companion.mavlink.encode import Encoder
from companion.mavlink.sent import told_by
from companion.vehicle.commands import (
    Arm,
    ChangeSpeed,
    Command,
    GuidedHeading,
    GuidedPosition,
    GuidedVelocity,
    Heartbeat,
    RequestMessage,
)

ORIGIN = GeoPoint(52.2, 21.0)


def packet(command: Command, form: str = "local") -> bytes:
    return Encoder(form, 191).encode(command, 1, 1000, ORIGIN)[0]


@pytest.mark.parametrize("form", ["local", "global", "mission-item", "reposition"])
def test_a_position_is_read_back_in_every_form(form: str) -> None:
    told = told_by(packet(GuidedPosition(NedPoint(12.5, -30.25)), form), ORIGIN)
    assert isinstance(told, GuidedPosition) and told.point.distance_m(NedPoint(12.5, -30.25)) < 0.02
    assert (told_by(packet(GuidedPosition(NedPoint(12.5, -30.25)), form), None) is None) == (form != "local")


def test_velocities_headings_and_speeds_are_read_back() -> None:
    velocity = told_by(packet(GuidedVelocity(-0.5, 0.25)), None)
    assert velocity == GuidedVelocity(-0.5, 0.25)
    heading = told_by(packet(GuidedHeading(-1.5)), None)
    assert isinstance(heading, GuidedHeading) and heading.heading_rad == pytest.approx(4.78319, abs=1e-4)
    assert told_by(packet(ChangeSpeed(1.25)), None) == ChangeSpeed(1.25)


@pytest.mark.parametrize("raw", [packet(Heartbeat()), packet(Arm()), packet(RequestMessage(242)), b"\xfd junk"])
def test_other_packets_tell_nothing(raw: bytes) -> None:
    assert told_by(raw, ORIGIN) is None
