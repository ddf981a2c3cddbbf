"""The station within the program: heard like one on the link, also where only signed packets are."""

from __future__ import annotations

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.core.frames import GeoPoint
from companion.mavlink.autopilot_link import AutopilotLink
from companion.mavlink.codec import Codec
from companion.mavlink.local_station import ASKER, LocalStation
from companion.mavlink.signing import Signer
from companion.mavlink.transport import MemoryLink
from companion.settings import LinkSettings
from companion.vehicle.commands import AnswerRequest, SetMode
from companion.vehicle.events import Asker, GoalRequested, PauseAsked, RequestAnswer, RequestForm, TargetAsked

PLACE = GeoPoint(53.1325, 23.1688)


def rover_known(near: MemoryLink, key: bytes | None) -> None:
    vehicle = mavlink.MAVLink(None, 1, 1)
    if key is not None:
        vehicle.signing.secret_key, vehicle.signing.sign_outgoing = key, True
        vehicle.signing.timestamp = 1
    near.write(mavlink.MAVLink_heartbeat_message(10, 3, 0, 0, 4, 3).pack(vehicle))


def link_with(station: LocalStation, signer: Signer | None = None) -> tuple[AutopilotLink, MemoryLink]:
    near, far = MemoryLink.pair()
    settings = LinkSettings()
    link = AutopilotLink(near, Codec(settings, signer=signer), settings, None, station)
    rover_known(far, None if signer is None else signer.key)
    link.poll(0.0)
    return link, far


def test_what_it_says_is_heard_as_requests_and_its_answers_come_back() -> None:
    station = LocalStation()
    link, _ = link_with(station)
    station.pause(True)
    station.skip_to(3)
    station.send_to(PLACE)
    assert link.poll(1.0) == [
        PauseAsked(1.0, ASKER, True), TargetAsked(1.0, ASKER, 3), GoalRequested(1.0, ASKER, RequestForm.COMMAND, PLACE),
    ]  # fmt: skip
    assert link.poll(2.0) == []
    answer = AnswerRequest(ASKER, RequestForm.SKIP, RequestAnswer.DENIED, "why")
    for command in (answer, AnswerRequest(Asker(255, 190), RequestForm.SKIP, RequestAnswer.ACCEPTED), SetMode(4)):
        link.send(command, 2.0)
    assert station.answers() == [answer] and station.answers() == []


def test_a_packet_that_is_half_there_is_not_broken_by_it() -> None:
    """A serial line may bring half a packet with one read, and the rest with the next."""
    station = LocalStation()
    link, far = link_with(station)
    ask = mavlink.MAVLink_command_long_message(1, 191, 193, 0, 1.0, 0, 0, 0, 0, 0, 0)
    raw = ask.pack(mavlink.MAVLink(None, 255, 190))
    far.write(raw[:9])
    station.pause(True)
    assert link.poll(1.0) == [PauseAsked(1.0, ASKER, True)]
    far.write(raw[9:])
    assert link.poll(2.0) == [PauseAsked(2.0, Asker(255, 190), False)]


def test_where_only_signed_packets_are_heard_it_signs() -> None:
    signer = Signer(bytes(range(32)), lambda: 5_000)
    station, other = LocalStation(signer), LocalStation()
    link, _ = link_with(station, signer)
    for _ in range(3):
        station.pause(False)
    assert link.poll(1.0) == 3 * [PauseAsked(1.0, ASKER, False)]
    link, _ = link_with(other, Signer(bytes(range(32)), lambda: 5_000))
    other.pause(False)
    assert link.poll(1.0) == []
