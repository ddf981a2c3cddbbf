"""Commands, read by pymavlink's own parser."""

import math
from typing import Any, Literal

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.core.frames import GeoPoint, LocalFrame, NedPoint
from companion.mavlink.codec import Codec, EncodeError
from companion.settings import LinkSettings
from companion.vehicle.commands import (
    Arm,
    ChangeSpeed,
    Command,
    GuidedHeading,
    GuidedPosition,
    GuidedVelocity,
    Heartbeat,
    ReadParameter,
    RequestMessage,
    RequestRate,
    SetMode,
    StatusText,
)
from tests.support.mavlink_vehicle import Station
from tests.support.tlog import messages

Form = Literal["local", "global", "mission-item", "reposition"]


def codec_of(form: Form = "local", *, origin: bool = True, system_id: int = 4) -> Codec:
    codec, rover = Codec(LinkSettings(setpoint=form)), Station(system_id, 1)
    codec.decode(rover.heartbeat() + rover.local_position(12_345) + (rover.origin() if origin else b""), 0.0)
    return codec


def said(command: Command, form: Form = "local") -> Any:
    (message,) = messages(codec_of(form).encode(command))
    assert message.get_srcSystem() == 4 and message.get_srcComponent() == 191
    assert message.get_msgbuf()[0] == 0xFD
    return message


def test_heartbeat_of_an_onboard_controller() -> None:
    message = said(Heartbeat())
    assert (message.type, message.autopilot, message.base_mode, message.custom_mode) == (18, 8, 0, 0)


def test_before_the_vehicle_is_known_we_speak_as_system_1() -> None:
    (message,) = messages(Codec(LinkSettings()).encode(Heartbeat()))
    assert (message.get_srcSystem(), message.get_srcComponent()) == (1, 191)


def test_position_in_the_local_frame() -> None:
    message = said(GuidedPosition(NedPoint(12.5, -3.25)))
    assert message.get_type() == "SET_POSITION_TARGET_LOCAL_NED"
    assert (message.target_system, message.target_component) == (4, 1)
    assert (message.coordinate_frame, message.type_mask, message.time_boot_ms) == (1, 3580, 12_345)
    assert (message.x, message.y, message.z) == (12.5, -3.25, 0.0)


@pytest.mark.parametrize("form", ["global", "mission-item", "reposition"])
def test_position_in_degrees(form: Form) -> None:
    place = NedPoint(120.0, -45.0)
    message = said(GuidedPosition(place), form)
    if form == "global":
        assert message.get_type() == "SET_POSITION_TARGET_GLOBAL_INT"
        assert (message.coordinate_frame, message.type_mask) == (6, 3580)
        lat_e7, lon_e7 = message.lat_int, message.lon_int
    elif form == "mission-item":
        assert message.get_type() == "MISSION_ITEM_INT"
        assert (message.current, message.command, message.frame, message.mission_type) == (2, 16, 6, 0)
        lat_e7, lon_e7 = message.x, message.y
    else:
        assert message.get_type() == "COMMAND_INT"
        assert (message.command, message.frame, message.param1, message.param2) == (192, 6, -1.0, 0.0)
        lat_e7, lon_e7 = message.x, message.y
    back = LocalFrame(GeoPoint(-35.3632613, 149.1652299)).to_ned(GeoPoint(lat_e7 / 1e7, lon_e7 / 1e7))
    assert back.distance_m(place) < 0.02


@pytest.mark.parametrize("form", ["global", "mission-item", "reposition"])
def test_degrees_need_the_origin(form: Form) -> None:
    codec = codec_of(form, origin=False)
    with pytest.raises(EncodeError, match="EKF origin"):
        codec.encode(GuidedPosition(NedPoint(1.0, 2.0)))
    assert codec.encode(GuidedVelocity(0.0, 0.0))


@pytest.mark.parametrize("form", ["local", "global", "mission-item", "reposition"])
def test_velocity_along_the_rovers_own_axis(form: Form) -> None:
    message = said(GuidedVelocity(-0.4, 0.25), form)
    assert message.get_type() == "SET_POSITION_TARGET_LOCAL_NED"
    assert (message.coordinate_frame, message.type_mask) == (8, 1511)
    assert (message.vx, message.vy, message.yaw_rate) == (pytest.approx(-0.4), 0.0, 0.25)


def test_heading() -> None:
    message = said(GuidedHeading(-math.pi / 2))
    assert (message.coordinate_frame, message.type_mask) == (1, 2559)
    assert message.yaw == pytest.approx(-math.pi / 2)


@pytest.mark.parametrize(
    ("command", "number", "parameters"),
    [
        (SetMode(15), 176, (1.0, 15.0, 0.0)),
        (Arm(), 400, (1.0, 0.0, 0.0)),
        (ChangeSpeed(1.5), 178, (1.0, 1.5, -1.0)),
        (RequestRate(32, 10.0), 511, (32.0, 100_000.0, 0.0)),
        (RequestRate(32, 0.0), 511, (32.0, -1.0, 0.0)),
        (RequestMessage(49), 512, (49.0, 0.0, 0.0)),
    ],
)
def test_long_commands(command: Command, number: int, parameters: tuple[float, ...]) -> None:
    message = said(command)
    assert (message.get_type(), message.command, message.confirmation) == ("COMMAND_LONG", number, 0)
    assert (message.target_system, message.target_component) == (4, 1)
    assert (message.param1, message.param2, message.param3) == parameters
    (again,) = messages(codec_of().encode(command, confirmation=2))
    assert again.confirmation == 2


def test_read_a_parameter() -> None:
    message = said(ReadParameter("WP_SPEED"))
    assert (message.get_type(), message.param_id, message.param_index) == ("PARAM_REQUEST_READ", "WP_SPEED", -1)


def test_short_text_is_one_message() -> None:
    message = said(StatusText(6, "x" * 50))
    assert (message.text, message.severity, message.id) == ("x" * 50, 6, 0)


@pytest.mark.parametrize("length", [51, 99, 100, 101, 120])
def test_long_text_is_several(length: int) -> None:
    text = ("0123456789" * 20)[:length]
    codec = codec_of()
    parts = [message for raw in codec.encode_packets(StatusText(4, text)) for message in messages(raw)]
    assert "".join(part.text for part in parts) == text
    assert [part.chunk_seq for part in parts] == list(range(len(parts)))
    assert {part.id for part in parts} == {1}
    assert all(len(part.text) == 50 for part in parts[:-1]) and len(parts[-1].text) < 50
    (first, *_) = messages(codec.encode(StatusText(4, text)))
    assert first.id == 2


def test_text_is_never_cut_within_a_character() -> None:
    parts = codec_of().encode_packets(StatusText(6, "ä" * 49))
    pieces = [mavlink.MAVLink(None).decode(bytearray(raw)).get_payload() for raw in parts]
    assert len(pieces) == 2
    text = b"".join(bytes(m._text_raw).rstrip(b"\0") for raw in parts for m in messages(raw))
    assert text.decode("utf-8") == "ä" * 49
    assert bytes(messages(parts[0])[0]._text_raw).rstrip(b"\0").decode("utf-8") == "ä" * 25


def test_packets_are_numbered_in_order() -> None:
    codec = codec_of()
    numbers = [messages(codec.encode(Heartbeat()))[0].get_seq() for _ in range(300)]
    assert numbers == [i % 256 for i in range(300)]
