"""Lists fetched from the autopilot: on a made-up line, on a bad one, and from the simulated autopilot's own storage."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.mavlink.autopilot_link import AutopilotLink
from companion.mavlink.codec import Codec
from companion.mavlink.download import MOST_ITEMS, TRIES, Downloaded
from companion.mavlink.transport import MemoryLink
from companion.settings import LinkSettings
from companion.vehicle.events import PlanChangedSeen, PlanKind
from tests.support import mission_client
from tests.support.mavlink_vehicle import Station
from tests.support.mission_client import at
from tests.support.sitl_client import Client, open_ground
from tests.support.tlog import messages

TICK_S = 0.05
REQUEST_LIST, REQUEST_ITEM, ACK = "MISSION_REQUEST_LIST", "MISSION_REQUEST_INT", "MISSION_ACK"


class Storage:
    """The other end: answers as ArduPilot does, through ``line``, which may lose, repeat or keep back what is sent."""

    def __init__(self, size: int) -> None:
        self.size = size
        self.line: Callable[[bytes], list[bytes]] = lambda raw: [raw]
        self.asked: list[Any] = []
        self.rover = Station()
        near, self.far = MemoryLink.pair()
        self.link = AutopilotLink(near, Codec(LinkSettings()), LinkSettings())
        self.now_s = 0.0
        self.far.write(self.rover.heartbeat(4))

    def say(self, message: Any) -> None:
        for raw in self.line(self.rover.pack(message)):
            self.far.write(raw)

    def answer(self, message: Any) -> None:
        kind = message.mission_type
        if message.get_type() == REQUEST_LIST:
            self.say(mavlink.MAVLink_mission_count_message(1, 191, self.size, kind))
        elif message.seq < self.size:
            self.say(item(message.seq, kind))
        else:
            self.say(mavlink.MAVLink_mission_ack_message(1, 191, 13, kind))

    def tick(self) -> None:
        self.now_s += TICK_S
        self.link.poll(self.now_s)
        self.link.service(self.now_s)
        for message in messages(self.far.read()):
            if message.get_type() in (REQUEST_LIST, REQUEST_ITEM, ACK):
                self.asked.append(message)
            if message.get_type() in (REQUEST_LIST, REQUEST_ITEM):
                self.answer(message)

    def fetch(self, kind: PlanKind = PlanKind.FENCE, limit_s: float = 60.0) -> Downloaded:
        self.link.downloads.ask(kind)
        while self.link.downloads.busy(kind):
            assert self.now_s < limit_s
            self.tick()
        self.tick()
        found = self.link.downloads.last(kind)
        assert found is not None
        return found

    def kinds(self) -> list[str]:
        return [message.get_type() for message in self.asked]


def item(seq: int, kind: int = 1, component: int = 191) -> Any:
    place = (-353632613 + seq, 1491652299)
    return mavlink.MAVLink_mission_item_int_message(
        1, component, seq, 0, 5003, 0, 1, 7.5 + seq, 0, 0, 0, *place, 0, kind
    )


def test_a_list_arrives_item_by_item_and_is_acknowledged() -> None:
    storage = Storage(3)
    found = storage.fetch()
    assert found.failure == ""
    assert [one.index for one in found.items] == [0, 1, 2]
    assert [one.params[0] for one in found.items] == [7.5, 8.5, 9.5]
    assert found.items[1].lat_deg == pytest.approx(-35.3632612, abs=1e-9)
    assert storage.kinds() == [REQUEST_LIST, REQUEST_ITEM, REQUEST_ITEM, REQUEST_ITEM, ACK]
    assert (storage.asked[-1].type, storage.asked[-1].mission_type, storage.asked[-1].target_component) == (0, 1, 1)
    assert storage.now_s < 0.5, "one item each tick"


def test_an_empty_list_and_one_the_autopilot_does_not_know_have_no_items() -> None:
    assert Storage(0).fetch(PlanKind.RALLY) == Downloaded(PlanKind.RALLY, pytest.approx(0.1))
    storage = Storage(0)
    unsupported = mavlink.MAVLink_mission_ack_message(1, 191, 3, 2)
    storage.answer = lambda message: storage.say(unsupported)  # type: ignore[method-assign]
    found = storage.fetch(PlanKind.RALLY)
    assert (found.items, found.failure) == ((), "")


def test_silence_is_a_failure_after_so_many_requests() -> None:
    storage = Storage(3)
    storage.line = lambda raw: []
    found = storage.fetch()
    assert found.failure == f"no answer to {TRIES} requests"
    assert storage.kinds() == [REQUEST_LIST] * TRIES
    assert 3.9 < storage.now_s < 4.3
    storage.line = lambda raw: [raw]
    assert storage.fetch().failure == "", "and it can be asked for again"


def test_an_autopilot_that_falls_silent_under_way_is_told_that_no_more_is_wanted() -> None:
    storage = Storage(3)
    storage.line = lambda raw: [] if len(storage.asked) > 2 else [raw]
    assert storage.fetch().failure == f"no answer to {TRIES} requests"
    assert storage.kinds()[-1] == ACK
    assert storage.asked[-1].type == mavlink.MAV_MISSION_OPERATION_CANCELLED


def test_a_list_of_any_length_is_not_taken_in() -> None:
    storage = Storage(MOST_ITEMS + 1)
    assert str(MOST_ITEMS) in storage.fetch().failure
    assert storage.kinds() == [REQUEST_LIST, ACK]


@pytest.mark.parametrize(("result", "words"), [(14, "uploading"), (15, "result 15"), (1, "result 1")])
def test_a_refusal_ends_it_with_a_reason(result: int, words: str) -> None:
    storage = Storage(3)
    refusal = mavlink.MAVLink_mission_ack_message(1, 191, result, 1)
    storage.answer = lambda message: storage.say(refusal)  # type: ignore[method-assign]
    assert words in storage.fetch().failure


def test_a_list_that_becomes_shorter_under_way_is_begun_anew() -> None:
    storage = Storage(5)

    def line(raw: bytes) -> list[bytes]:
        storage.size = 2 if len(storage.asked) == 3 else storage.size
        return [raw]

    storage.line = line
    found = storage.fetch()
    assert len(found.items) == 2
    assert found.failure == ""


def test_a_list_that_never_comes_to_rest_is_given_up() -> None:
    storage = Storage(5)
    refusal = mavlink.MAVLink_mission_ack_message(1, 191, 13, 1)
    answer = storage.answer

    def moody(message: Any) -> None:
        if message.get_type() == REQUEST_ITEM and message.seq == 1:
            storage.say(refusal)
        else:
            answer(message)

    storage.answer = moody  # type: ignore[method-assign]
    assert "changes all the time" in storage.fetch().failure


def test_what_belongs_to_others_is_passed_over() -> None:
    storage = Storage(2)

    def line(raw: bytes) -> list[bytes]:
        others = [item(0, 0), item(0, 1, 190), item(1), mavlink.MAVLink_mission_count_message(1, 190, 9, 1)]
        return [*(storage.rover.pack(one) for one in others), raw, raw]

    storage.line = line
    found = storage.fetch()
    assert [one.params[0] for one in found.items] == [7.5, 8.5]


def test_another_ones_upload_that_was_accepted_is_told() -> None:
    storage = Storage(0)
    storage.tick()
    storage.far.write(storage.rover.pack(mavlink.MAVLink_mission_ack_message(255, 190, 0, 1)))
    storage.far.write(storage.rover.pack(mavlink.MAVLink_mission_ack_message(255, 190, 1, 1)))
    seen = [event for event in storage.link.poll(1.0) if isinstance(event, PlanChangedSeen)]
    assert seen == [PlanChangedSeen(1.0, PlanKind.FENCE)]


def test_one_list_after_the_other_each_wanted_once() -> None:
    storage = Storage(1)
    for kind in (PlanKind.FENCE, PlanKind.RALLY, PlanKind.FENCE):
        storage.link.downloads.ask(kind)
    while storage.link.downloads.busy(PlanKind.RALLY):
        storage.tick()
    lists = [message.mission_type for message in storage.asked if message.get_type() == REQUEST_LIST]
    assert lists == [PlanKind.FENCE, PlanKind.RALLY]


def test_cancelled_it_sends_nothing_more_but_the_end() -> None:
    storage = Storage(5)
    storage.link.downloads.ask(PlanKind.FENCE)
    for _ in range(4):
        storage.tick()
    storage.link.downloads.cancel()
    before = len(storage.asked)
    for _ in range(100):
        storage.tick()
    assert storage.kinds()[before:] == [ACK]
    assert storage.link.downloads.last(PlanKind.FENCE) is None


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 2**32), size=st.integers(0, 12), bad=st.floats(0.0, 0.5))
def test_over_a_bad_line_a_list_arrives_whole_or_not_at_all(seed: int, size: int, bad: float) -> None:
    storage, rng = Storage(size), np.random.default_rng(seed)
    late: list[bytes] = []

    def line(raw: bytes) -> list[bytes]:
        come = [late.pop(0) for _ in range(len(late)) if rng.random() < 0.3]
        if rng.random() < bad / 2:
            late.append(raw)  # it comes later, out of order
            return come
        return come + [raw] * int(rng.choice([0, 1, 2], p=[bad / 2, 1.0 - bad, bad / 2]))

    storage.line = line
    found = storage.fetch(limit_s=200.0)
    assert [one.index for one in found.items] == (list(range(size)) if not found.failure else [])
    if bad < 0.05:
        assert found.failure == ""


def test_from_the_simulated_autopilot_come_the_items_that_a_ground_station_uploaded() -> None:
    simulator = open_ground()
    station = Client(simulator, 255, 190)
    square = [
        at(5001, *corner, params=(4.0,)) for corner in ((-50.0, -50.0), (50.0, -50.0), (50.0, 50.0), (-50.0, 50.0))
    ]
    fence = [*square, at(5004, 20.0, 5.0, params=(3.5,))]
    station.run_for(12.0)
    assert mission_client.upload(station, fence, mission_client.FENCE) == 0
    assert mission_client.upload(station, [at(5100, 5.0, 6.0)], mission_client.RALLY) == 0
    line = simulator.connect()
    near, far = MemoryLink.pair()
    link = AutopilotLink(near, Codec(LinkSettings()), LinkSettings())
    for kind in PlanKind:
        link.downloads.ask(kind)
    while link.downloads.busy(PlanKind.RALLY):
        link.poll(simulator.time_s)
        link.service(simulator.time_s)
        line.receive(far.read())
        simulator.advance_to_s(simulator.time_s + TICK_S)
        far.write(line.take())
        assert simulator.time_s < 30.0
    found = {kind: link.downloads.last(kind) for kind in PlanKind}
    assert all(one is not None and not one.failure for one in found.values())
    rows = [
        (i.command, i.params[0], round(i.lat_deg * 1e7), round(i.lon_deg * 1e7)) for i in found[PlanKind.FENCE].items
    ]  # type: ignore[union-attr]
    assert rows == [(row[0], row[2][0], row[3], row[4]) for row in fence]
    assert [i.command for i in found[PlanKind.RALLY].items] == [5100]  # type: ignore[union-attr]
    assert found[PlanKind.MISSION].items[0].command == 16, "home"  # type: ignore[union-attr]
