"""Uploads and downloads of missions, fences and rally points, as ArduPilot's item protocol does them."""

import math
import struct
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.autopilot.mission_items import KEPT, NAMES, Item, RefusedError, mission_item
from tests.support.mission_client import FENCE, MISSION, RALLY, at, do, download, heard, home, in_auto, item, upload
from tests.support.quick import examples
from tests.support.sitl_client import Client, open_ground, ready

ACCEPTED, ERROR, BAD_FRAME, UNSUPPORTED, NO_SPACE, BAD_SEQUENCE, DENIED, CANCELLED = 0, 1, 2, 3, 4, 13, 14, 15
SQUARE = [at(5001, n, e, (4,)) for n, e in ((-30, -30), (30, -30), (30, 30), (-30, 30))]


@pytest.fixture
def client() -> Client:
    made = Client(open_ground(), system=255, component=190)
    made.run_to(20.0)
    made.received.clear()
    return made


def parameter(client: Client, name: str) -> float:
    client.send(mavlink.MAVLink_param_request_read_message(1, 1, name.encode(), -1))
    return float(heard(client, "PARAM_VALUE")[-1].param_value)


def count(number: int, kind: int = MISSION) -> mavlink.MAVLink_message:
    return mavlink.MAVLink_mission_count_message(1, 1, number, kind)


def acks(client: Client, seconds: float = 0.06) -> list[int]:
    return [m.type for m in heard(client, "MISSION_ACK", seconds)]


def test_a_mission_comes_back_as_it_was_sent(client: Client) -> None:
    rows = [home(), at(16, 10, 0, (3,)), do(178, 1, 2.5), at(18, 10, 10, (2, 0, -15)), do(177, 1, -1), do(20)]
    assert upload(client, rows) == ACCEPTED
    assert download(client)[1:] == rows[1:]
    assert "Flight plan received" in client.texts()
    assert parameter(client, "MIS_TOTAL") == 6


def test_item_0_is_home_whatever_was_sent(client: Client) -> None:
    assert download(client)[0][3:5] == home()[3:5]
    assert upload(client, [at(16, 500, 500), at(16, 1, 1)]) == ACCEPTED
    assert download(client)[0][:5] == home()[:5]


def test_fence_and_rally_points_are_kept_apart(client: Client) -> None:
    circle, rally = at(5004, 5, 5, (2.5,)), [at(5100, 10, 0), at(5100, 0, 10, frame=0)]
    assert upload(client, [*SQUARE, circle], FENCE) == ACCEPTED
    assert upload(client, rally, RALLY) == ACCEPTED
    assert [row[:5] for row in download(client, FENCE)] == [(r[0], 0, *r[2:5]) for r in [*SQUARE, circle]]
    assert download(client, RALLY) == rally
    assert len(download(client)) == 1
    assert (parameter(client, "FENCE_TOTAL"), parameter(client, "RALLY_TOTAL")) == (7, 2)
    client.send(mavlink.MAVLink_mission_clear_all_message(1, 1, FENCE))
    assert acks(client) == [ACCEPTED]
    assert (download(client, FENCE), len(download(client, RALLY))) == ([], 2)


def test_items_are_asked_for_again_and_the_upload_given_up_after_8_s(client: Client) -> None:
    client.send(count(2))
    asked = []
    for tick in range(100):
        asked += [0.1 * tick] * len(heard(client, "MISSION_REQUEST", 0.1))
    assert len(asked) == 8
    assert all(1.0 - 1e-6 <= later - before <= 1.15 for before, later in pairwise(asked))
    assert [m.type for m in client.of("MISSION_ACK")] == [CANCELLED]
    assert "Mission upload timeout" in client.texts()
    assert upload(client, [home(), at(16, 1, 1)]) == ACCEPTED


def test_an_item_out_of_its_turn_is_refused_and_the_upload_goes_on(client: Client) -> None:
    client.send(count(2))
    client.send(item(1, at(16, 1, 1)))
    assert acks(client) == [BAD_SEQUENCE]
    client.send(item(0, home()))
    client.send(item(1, at(16, 1, 1)))
    assert acks(client) == [ACCEPTED]


def test_an_item_that_nobody_asked_for(client: Client) -> None:
    client.send(item(0, home()))
    assert acks(client) == [ERROR]


def test_a_second_uploader_is_denied_and_the_first_may_begin_again(client: Client) -> None:
    second = Client(client.simulator, system=255, component=191)
    client.send(count(3))
    client.run_for(0.06)
    second.send(count(1))
    second.send(mavlink.MAVLink_mission_request_list_message(1, 1, MISSION))
    second.send(mavlink.MAVLink_mission_request_int_message(1, 1, 0, MISSION))
    second.send(mavlink.MAVLink_mission_write_partial_list_message(1, 1, 0, 0, MISSION))
    second.send(mavlink.MAVLink_mission_clear_all_message(1, 1, MISSION))
    assert acks(second) == [DENIED, DENIED, DENIED, DENIED, ERROR]
    second.send(item(0, home()))
    second.run_for(0.06)
    assert acks(client) == [DENIED]
    assert upload(second, SQUARE, FENCE) == ACCEPTED
    assert upload(client, [home(), at(16, 1, 1)]) == ACCEPTED


def test_a_cancelling_acknowledgement_is_not_listened_to(client: Client) -> None:
    second = Client(client.simulator, system=255, component=191)
    client.send(count(3))
    client.send(mavlink.MAVLink_mission_ack_message(1, 1, CANCELLED, MISSION))
    client.run_for(1.0)
    second.send(count(1))
    assert acks(second) == [DENIED]
    client.run_for(8.0)
    assert upload(second, [home(), at(16, 1, 1)]) == ACCEPTED


@pytest.mark.parametrize(("kind", "most"), [(MISSION, 724), (FENCE, 84), (RALLY, 50)])
def test_too_many_items(client: Client, kind: int, most: int) -> None:
    client.send(count(most + 1, kind))
    assert acks(client) == [NO_SPACE]
    assert f"Only {most} items are supported" in client.texts()
    client.send(count(most, kind))
    assert len(heard(client, "MISSION_REQUEST")) == 1


def test_a_few_items_are_written_over(client: Client) -> None:
    rows = [home(), at(16, 1, 0), at(16, 2, 0), at(16, 3, 0)]
    assert upload(client, rows) == ACCEPTED
    client.send(mavlink.MAVLink_mission_write_partial_list_message(1, 1, 2, 2, MISSION))
    assert [m.seq for m in heard(client, "MISSION_REQUEST")] == [2]
    client.send(item(2, at(16, 9, 9)))
    assert acks(client) == [ACCEPTED]
    assert download(client)[1:] == [rows[1], at(16, 9, 9), rows[3]]
    for first, last in ((3, 2), (0, 5), (5, 5), (-1, 2)):
        client.send(mavlink.MAVLink_mission_write_partial_list_message(1, 1, first, last, MISSION))
        assert acks(client) == [ERROR]
    assert "Flight plan update rejected" in client.texts()


def test_a_corner_of_the_fence_is_written_over(client: Client) -> None:
    assert upload(client, SQUARE, FENCE) == ACCEPTED
    client.send(mavlink.MAVLink_mission_write_partial_list_message(1, 1, 1, 1, FENCE))
    client.run_for(0.06)
    client.send(item(1, at(5001, 50, -50, (4,)), FENCE))
    assert acks(client) == [ACCEPTED]
    assert download(client, FENCE)[1][3:5] == at(5001, 50, -50)[3:5]
    assert len(download(client, FENCE)) == 4


def test_an_empty_mission_clears(client: Client) -> None:
    assert upload(client, [home(), at(16, 1, 1)]) == ACCEPTED
    client.send(count(0))
    assert acks(client) == [ACCEPTED]
    client.send(mavlink.MAVLink_mission_request_list_message(1, 1, MISSION))
    assert heard(client, "MISSION_COUNT")[0].count == 0


def test_unknown_kinds_of_list(client: Client) -> None:
    client.send(count(1, 7))
    client.send(mavlink.MAVLink_mission_clear_all_message(1, 1, 255))
    client.send(mavlink.MAVLink_mission_request_list_message(1, 1, 7))
    client.send(mavlink.MAVLink_mission_request_int_message(1, 1, 0, 7))
    assert acks(client) == [UNSUPPORTED] * 3


def test_items_beyond_the_end(client: Client) -> None:
    assert upload(client, [home(), at(16, 1, 1)]) == ACCEPTED
    client.send(mavlink.MAVLink_mission_request_int_message(1, 1, 2, MISSION))
    messages = [m for m in client.run_for(0.06) if m.get_type().startswith("MISSION_") and m.get_msgId() != 42]
    assert [m.get_type() for m in messages] == ["MISSION_COUNT", "MISSION_ACK"]
    assert (messages[0].count, messages[1].type) == (2, ERROR)
    client.send(mavlink.MAVLink_mission_request_int_message(1, 1, 0, RALLY))
    assert acks(client) == [BAD_SEQUENCE]


@pytest.mark.parametrize(
    ("row", "result"),
    [
        (do(31000), UNSUPPORTED),
        (do(0), 5),
        (at(16, 0, 0, frame=1), BAD_FRAME),
        ((16, 3, (math.nan, 0.0, 0.0, 0.0), 0, 0, 0.0), 6),
        ((178, 3, (0.0, math.inf, 0.0, 0.0), 0, 0, 0.0), 7),
        ((178, 3, (0.0, 0.0, math.nan, 0.0), 0, 0, 0.0), 8),
        ((178, 3, (0.0, 0.0, 0.0, math.nan), 0, 0, 0.0), 9),
        ((16, 3, (0.0, 0.0, 0.0, 0.0), 910_000_000, 0, 0.0), 10),
        ((16, 3, (0.0, 0.0, 0.0, 0.0), 0, 1_900_000_000, 0.0), 11),
        ((16, 3, (0.0, 0.0, 0.0, 0.0), 0, 0, 90_000.0), 12),
        (do(177, 0, 1), ERROR),
        (do(177, 9, 1), ERROR),
        (do(177, 2, 1), ACCEPTED),
        ((16, 3, (0.0, 0.0, 0.0, math.nan), 0, 0, 0.0), ACCEPTED),
    ],
)
def test_items_that_are_refused(client: Client, row: tuple, result: int) -> None:
    client.send(count(3))
    client.send(item(0, home()))
    client.run_for(0.06)
    client.send(item(1, row))
    if result == ACCEPTED:
        client.send(item(2, at(16, 1, 1)))
    assert acks(client) == [result]


@pytest.mark.parametrize(
    ("rows", "text"),
    [
        (SQUARE[:3], "Incorrect item count"),
        ([at(5001, 1, 1, (2,))] * 2, "Invalid vertex count (2)"),
        ([*SQUARE[:2], *[at(5002, 1, 1, (4,))] * 2], "Received incorrect vertex type (want=98 got=97)"),
        ([*SQUARE[:3], at(5001, 1, 1, (5,))], "Unexpected vertex count want=4 got=5"),
        ([*SQUARE[:3], at(5003, 1, 1, (5,))], "Received incorrect type (want=98 got=92)"),
        ([at(5003, 1, 1, (0,))], "Non-positive circle radius"),
        ([at(5000, 1, 1)] * 2, "Multiple return points"),
    ],
)
def test_a_fence_that_makes_no_sense_leaves_the_old_one(client: Client, rows: list, text: str) -> None:
    assert upload(client, SQUARE, FENCE) == ACCEPTED
    assert upload(client, rows, FENCE) == ERROR
    said = [said.strip() for said in client.texts()]
    assert text in said
    assert "Fence validation failed" in said
    assert len(download(client, FENCE)) == 4


def test_the_older_messages(client: Client) -> None:
    client.send(count(2))
    for seq in range(2):
        client.send(mavlink.MAVLink_mission_item_message(1, 1, seq, 3, 16, 0, 1, 0, 0, 0, 0, -35.3632, 149.16523, 7.5))
    assert acks(client) == [ACCEPTED]
    client.send(mavlink.MAVLink_mission_request_message(1, 1, 1, MISSION))
    (back,) = heard(client, "MISSION_ITEM")
    client.send(mavlink.MAVLink_mission_request_message(1, 1, 0, MISSION))
    client.run_for(0.06)
    assert [m.text for m in client.of("STATUSTEXT") if m.text.startswith("got")] == [
        "got MISSION_ITEM; GCS should send MISSION_ITEM_INT",
        "got MISSION_REQUEST; use MISSION_REQUEST_INT!",
    ]
    assert (back.x, back.y, back.z) == pytest.approx((-35.3632, 149.16523, 7.5), abs=2e-5)
    client.send(mavlink.MAVLink_mission_item_message(1, 1, 0, 3, 16, 2, 1, 0, 0, 0, 0, -95.0, 149.16523, 7.5))
    assert acks(client) == [10]


def test_a_running_mission_cannot_be_cleared() -> None:
    client = in_auto(open_ground(), [at(16, 50, 0)])
    client.run_for(1.0)
    client.send(mavlink.MAVLink_mission_clear_all_message(1, 1, MISSION))
    assert acks(client) == [ERROR]
    assert client.set_mode(4) == 0
    client.send(mavlink.MAVLink_mission_clear_all_message(1, 1, MISSION))
    assert acks(client) == [ACCEPTED]
    assert client.set_mode(10) == 4


def test_everything_survives_a_reboot(client: Client) -> None:
    rows = [home(), at(16, 1, 1)]
    assert upload(client, rows) == ACCEPTED
    assert upload(client, SQUARE, FENCE) == ACCEPTED
    assert client.ask(246, 1) == 0
    again = Client(client.simulator)
    again.run_for(12.0)
    assert download(again)[1:] == rows[1:]
    assert len(download(again, FENCE)) == 4
    assert parameter(again, "MIS_TOTAL") == 2


any_single = st.floats(width=32)
any_kind = st.sampled_from([0, 0, 0, 1, 2, 3, 255])
any_seq = st.one_of(st.integers(0, 4), st.integers(0, 65535))
any_place = st.one_of(st.integers(-(2**31), 2**31 - 1), st.integers(-900_000_000, 900_000_000))
any_command = st.one_of(st.sampled_from([*sorted(KEPT), 18, 5000, 5001, 5002, 5003, 5004, 5100]), st.integers(0, 65535))
any_byte = st.integers(0, 255)
any_item = st.tuples(
    any_seq, st.sampled_from([0, 1, 2, 3, 6, 10, 77]), any_command, st.sampled_from([0, 1, 2, 3]), any_byte,
    any_single, any_single, any_single, any_single,
)  # fmt: skip
any_message = st.one_of(
    st.builds(lambda n, k: mavlink.MAVLink_mission_count_message(1, 1, n, k), any_seq, any_kind),
    st.builds(
        lambda head, x, y, z, k: mavlink.MAVLink_mission_item_int_message(1, 1, *head, x, y, z, k),
        any_item, any_place, any_place, any_single, any_kind,
    ),
    st.builds(
        lambda head, x, y, z, k: mavlink.MAVLink_mission_item_message(1, 1, *head, x, y, z, k),
        any_item, any_single, any_single, any_single, any_kind,
    ),
    st.builds(lambda n, k: mavlink.MAVLink_mission_request_message(1, 1, n, k), any_seq, any_kind),
    st.builds(lambda n, k: mavlink.MAVLink_mission_request_int_message(1, 1, n, k), any_seq, any_kind),
    st.builds(lambda k: mavlink.MAVLink_mission_request_list_message(1, 1, k), any_kind),
    st.builds(lambda k: mavlink.MAVLink_mission_clear_all_message(1, 1, k), any_kind),
    st.builds(
        lambda a, b, k: mavlink.MAVLink_mission_write_partial_list_message(1, 1, a, b, k),
        st.integers(-5, 5), st.integers(-5, 5), any_kind,
    ),
    st.builds(lambda n: mavlink.MAVLink_mission_set_current_message(1, 1, n), any_seq),
    st.builds(
        lambda c, a, b: mavlink.MAVLink_command_long_message(1, 1, c, 0, a, b, 0, 0, 0, 0, 0),
        st.sampled_from([207, 224, 300, 20]), any_single, any_single,
    ),
)  # fmt: skip


@settings(max_examples=12, deadline=None)
@given(st.lists(any_message, min_size=1, max_size=30))
def test_whatever_is_sent_the_vehicle_stays_up(messages: list) -> None:
    client = ready(open_ground(parameters={"FENCE_ENABLE": 1, "FENCE_ACTION": 0}))
    client.set_mode(10)
    for message in messages:
        client.send(message)
        client.run_for(0.1)
    client.run_for(10.0)
    truth = client.simulator.truth
    assert all(map(math.isfinite, (truth.north_m, truth.east_m, truth.speed_m_s)))
    client.run_for(1.1)
    assert client.received[-1].get_srcComponent() == 1
    client.send(mavlink.MAVLink_mission_request_list_message(1, 1, MISSION))
    assert heard(client, "MISSION_COUNT")


@settings(max_examples=10, deadline=None)
@given(st.lists(st.tuples(any_item, any_place, any_place, any_single), min_size=1, max_size=6))
def test_whatever_mission_is_kept_can_be_run(items: list) -> None:
    client = ready(open_ground())
    stored: list = [home()]
    for head, x, y, z in items:
        row = (head[2], head[1], head[5:], x, y, z)
        if upload(client, [*stored, row]) == ACCEPTED:
            stored.append(row)
        else:
            upload(client, stored)
    client.set_mode(10)
    client.run_for(30.0)
    truth = client.simulator.truth
    assert all(map(math.isfinite, (truth.north_m, truth.east_m, truth.speed_m_s)))
    assert len(download(client)) == len(stored)


single = st.floats(width=32, allow_nan=False, allow_infinity=False, min_value=-1e5, max_value=1e5)


@settings(max_examples=examples(200), deadline=None)
@given(
    st.sampled_from(sorted(KEPT)), st.sampled_from([0, 3, 6, 10]), st.tuples(single, single, single, single),
    st.integers(-900_000_000, 900_000_000), st.integers(-1_800_000_000, 1_800_000_000), single,
)  # fmt: skip
def test_what_was_kept_once_is_kept_whole(
    command: int, frame: int, params: tuple[float, ...], x: int, y: int, z: float
) -> None:
    def kept(row: tuple) -> Item:
        message = item(1, row)
        packer = mavlink.MAVLink(None, 255, 190)
        return mission_item(mavlink.MAVLink(None).parse_buffer(message.pack(packer))[0])

    try:
        first = kept((command, frame, params, x, y, z))
    except RefusedError:
        assert abs(z) >= 83_000.0
        return
    again = kept(
        (first.command, first.frame, first.params, first.x, first.y, struct.unpack("f", struct.pack("f", first.z))[0])
    )
    assert (again.command, again.frame, again.params, again.place) == (command, first.frame, first.params, first.place)
    assert again.z == pytest.approx(first.z, abs=0.0101)
    assert command in NAMES or command == 176
