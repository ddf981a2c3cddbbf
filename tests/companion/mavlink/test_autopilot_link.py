"""The conversation with the autopilot, on a made-up clock."""

from itertools import pairwise
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.core.frames import GeoPoint, LocalFrame, NedPoint
from companion.core.tick_marks import Mark
from companion.mavlink.autopilot_link import AutopilotLink
from companion.mavlink.codec import Codec
from companion.mavlink.transport import MemoryLink
from companion.operator.notifications import FAULT_AFTER_S, Notifier
from companion.settings import LinkSettings
from companion.vehicle.commands import (
    Arm,
    ChangeSpeed,
    GuidedHeading,
    GuidedPosition,
    GuidedVelocity,
    NamedValue,
    RequestMessage,
    SetMode,
)
from companion.vehicle.events import AckSeen, HeartbeatSeen
from tests.support.mavlink_vehicle import Station
from tests.support.notices import HandClock
from tests.support.quick import first_of
from tests.support.tlog import messages


class Log:
    """Notes all packets of both directions."""

    def __init__(self) -> None:
        self.packets: list[tuple[float, bytes]] = []

    def heard(self, time_s: float, packets: list[bytes], mark: Mark) -> None:
        self.packets += [(time_s, raw) for raw in packets]

    def said(self, time_s: float, raw: bytes) -> None:
        self.packets.append((time_s, raw))


class Bench:
    """A link whose other end is the test."""

    def __init__(self, *, known: bool = True) -> None:
        near, self.far = MemoryLink.pair()
        log = Log()
        self.log = log.packets
        self.link = AutopilotLink(near, Codec(LinkSettings()), LinkSettings(), log)
        self.rover = Station()
        if known:
            self.hear(0.0, self.rover.heartbeat(4))
            self.link.service(0.0)
            self.said()

    def hear(self, now_s: float, *raw: bytes) -> list[Any]:
        self.far.write(b"".join(raw))
        return list(self.link.poll(now_s))

    def said(self, kind: str | None = None) -> list[Any]:
        return [m for m in messages(self.far.read()) if kind is None or m.get_type() == kind]

    def tick(self, now_s: float, kind: str | None = None) -> list[Any]:
        self.link.service(now_s)
        return self.said(kind)

    def commands(self, now_s: float, number: int) -> list[Any]:
        return [m for m in self.tick(now_s, "COMMAND_LONG") if m.command == number]


def test_it_speaks_first_and_once_a_second() -> None:
    bench = Bench(known=False)
    beats = [len(bench.tick(0.05 * i, "HEARTBEAT")) for i in range(101)]
    assert beats[0] == 1
    assert sum(beats) == 6
    assert bench.tick(10.0) and bench.tick(10.1) == [], "nothing but heartbeats while nobody is there"


def heartbeats(bench: Bench, begin_s: float, end_s: float) -> int:
    before = len(bench.log)
    for tick in range(round((end_s - begin_s) / 0.05)):
        bench.link.service(begin_s + 0.05 * tick)
    said = [raw for _, raw in bench.log[before:]]
    return sum(message.get_type() == "HEARTBEAT" for message in messages(b"".join(said)))


def test_it_speaks_often_once_a_guard_was_heard_which_may_watch_though_its_words_are_lost() -> None:
    bench = Bench()
    assert heartbeats(bench, 1.0, 5.0) == 4
    bench.hear(5.0, bench.rover.pack(mavlink.MAVLink_named_value_float_message(0, b"CMPGRD195", 300.0)))
    assert heartbeats(bench, 5.0, 9.0) == 4, "that one watches another component"
    bench.hear(9.0, bench.rover.pack(mavlink.MAVLink_named_value_float_message(0, b"CMPGRD191", 300.0)))
    assert heartbeats(bench, 9.0, 29.0) >= 195


def test_rates_and_places_are_asked_for_when_the_vehicle_is_heard() -> None:
    bench = Bench(known=False)
    (event,) = bench.hear(1.0, bench.rover.heartbeat())
    assert isinstance(event, HeartbeatSeen)
    asked = bench.tick(1.0, "COMMAND_LONG")
    intervals = {int(m.param1): m.param2 for m in asked if m.command == 511}
    assert intervals[32] == 100_000.0 and intervals[30] == 50_000.0 and intervals[193] == 200_000.0
    assert 330 not in intervals and {33, 87, 132} <= set(intervals)
    assert [m.param1 for m in asked if m.command == 512] == [49.0, 242.0]


def test_places_are_asked_for_until_known_and_seldom_after() -> None:
    bench = Bench()
    assert bench.commands(1.9, 512) == []
    assert len(bench.commands(2.0, 512)) == 2
    bench.hear(2.1, bench.rover.origin(), bench.rover.home())
    assert bench.commands(10.0, 512) == []
    assert len(bench.commands(33.0, 512)) == 2


QUIET = {74: 10.0, 65: 5.0, 147: 1.0, 162: 1.0}
"""What is asked for again without a word."""


def feed_rates(bench: Bench, begin_s: float, end_s: float, rates_hz: dict[int, float]) -> list[tuple[float, int]]:
    """Let messages come at these rates; returns when which rate was asked for."""
    asked = []
    makers = {
        0: lambda ms: bench.rover.heartbeat(),
        30: lambda ms: bench.rover.pack(mavlink.MAVLink_attitude_message(ms, 0, 0, 0.5, 0, 0, 0)),
        32: bench.rover.local_position,
        33: lambda ms: bench.rover.pack(mavlink.MAVLink_global_position_int_message(ms, 1, 1, 0, 0, 0, 0, 0, 0)),
        1: lambda ms: bench.rover.pack(mavlink.MAVLink_sys_status_message(0, 0, 0, 0, 12600, -1, -1, *[0] * 6)),
        193: lambda ms: bench.rover.pack(mavlink.MAVLink_ekf_status_report_message(831, 0, 0, 0, 0, 0)),
        74: lambda ms: bench.rover.pack(mavlink.MAVLink_vfr_hud_message(0, 1, 90, ms % 100, 0, 0)),
        65: lambda ms: bench.rover.pack(mavlink.MAVLink_rc_channels_message(ms, 16, *[1500] * 18, 0)),
        147: lambda ms: bench.rover.pack(mavlink.MAVLink_battery_status_message(0, 0, 0, 0, [0] * 10, 0, ms, 0, 90)),
        162: lambda ms: bench.rover.pack(mavlink.MAVLink_fence_status_message(0, 0, 0, ms)),
        132: lambda ms: bench.rover.distance(300 + ms % 7),
    }
    ticks = round((end_s - begin_s) / 0.05)
    for i in range(ticks):
        now_s = begin_s + 0.05 * i
        for message_id, rate_hz in rates_hz.items():
            if int(now_s * rate_hz) != int((now_s - 0.05) * rate_hz):
                bench.hear(now_s, makers[message_id](round(now_s * 1000)))
        asked += [(now_s, int(m.param1)) for m in bench.commands(now_s, 511)]
    return asked


def test_rates_that_arrive_are_not_asked_for_again() -> None:
    bench = Bench()
    assert feed_rates(bench, 0.05, 20.0, {0: 5.0, 30: 20.0, 32: 10.0, 33: 2.0, 193: 5.0, 1: 1.0, **QUIET}) == []
    assert bench.link.rate_faults == ()


def test_a_rate_that_falls_is_asked_for_again_with_growing_pauses() -> None:
    bench = Bench()
    asked = feed_rates(bench, 0.05, 90.0, {0: 5.0, 30: 20.0, 32: 1.0, 33: 2.0, 193: 5.0, 1: 1.0, **QUIET})
    times = [time_s for time_s, message_id in asked if message_id == 32]
    assert {message_id for _, message_id in asked} == {32}
    pauses = [later - earlier for earlier, later in pairwise(times)]
    assert times[0] < 7.0 and len(times) >= 4
    assert pauses == sorted(pauses) and pauses[0] < 10.0 and pauses[-1] <= 33.0
    (fault,) = bench.link.rate_faults
    assert (fault.message_id, fault.wanted_hz) == (32, 10.0) and fault.measured_hz == pytest.approx(1.0, abs=0.4)


def test_missing_range_data_is_no_fault_but_slow_range_data_is() -> None:
    bench = Bench()
    steady = {0: 5.0, 30: 20.0, 32: 10.0, 33: 2.0, 193: 5.0, 1: 1.0, **QUIET}
    assert feed_rates(bench, 0.05, 10.0, steady) == []
    asked = feed_rates(bench, 10.0, 20.0, {**steady, 132: 1.0})
    assert {message_id for _, message_id in asked} == {132}


def test_seldom_heartbeats_are_asked_for_again_but_nobody_is_told() -> None:
    bench = Bench()
    asked = feed_rates(bench, 0.05, 20.0, {0: 1.0, 30: 20.0, 32: 10.0, 33: 2.0, 193: 5.0, 1: 1.0, **QUIET})
    assert {message_id for _, message_id in asked} == {0} and bench.link.rate_faults == ()


@first_of(1, "message_id", QUIET)
def test_what_never_comes_is_asked_for_again_and_again(message_id: int) -> None:
    bench = Bench()
    steady = {0: 5.0, 30: 20.0, 32: 10.0, 33: 2.0, 193: 5.0, 1: 1.0, **QUIET}
    del steady[message_id]
    asked = feed_rates(bench, 0.05, 100.0, steady)
    assert {number for _, number in asked} == {message_id} and len(asked) >= 4


def test_that_the_sticks_are_never_seen_is_told_but_not_that_they_are_seen_seldom() -> None:
    bench = Bench()
    steady = {0: 5.0, 30: 20.0, 32: 10.0, 33: 2.0, 193: 5.0, 1: 1.0, 74: 10.0, 147: 1.0, 162: 1.0}
    feed_rates(bench, 0.05, 10.0, {**steady, 65: 1.0})
    assert bench.link.rate_faults == ()
    feed_rates(bench, 10.0, 20.0, steady)
    (fault,) = bench.link.rate_faults
    assert (fault.name, fault.means) == ("RC_CHANNELS", "the pilot's sticks are not seen")
    notifier = Notifier(bench.link, HandClock(), [])
    assert [notifier.lasting_faults((fault,), (), time_s) for time_s in (0.0, FAULT_AFTER_S, 100.0)] == [
        [],
        ["RC_CHANNELS: 0.0 Hz instead of 5, asking again: the pilot's sticks are not seen"],
        [],
    ]


def test_a_command_is_repeated_twice_and_then_given_up() -> None:
    bench = Bench()
    bench.link.send(SetMode(15), 1.0)
    assert [m.confirmation for m in bench.said("COMMAND_LONG")] == [0]
    bench.hear(1.5, bench.rover.heartbeat(4))
    assert bench.commands(1.9, 176) == []
    assert [m.confirmation for m in bench.commands(2.0, 176)] == [1]
    bench.hear(2.5, bench.rover.heartbeat(4))
    assert [m.confirmation for m in bench.commands(3.0, 176)] == [2]
    bench.hear(3.5, bench.rover.heartbeat(4))
    assert bench.commands(4.0, 176) == []
    assert bench.link.last_ack(SetMode(15)) == AckSeen(4.0, 176, -1)
    bench.hear(4.5, bench.rover.heartbeat(4))
    assert bench.commands(6.0, 176) == []


def test_an_answer_ends_the_repetition() -> None:
    bench = Bench()
    bench.link.send(Arm(), 1.0)
    assert len(bench.said("COMMAND_LONG")) == 1
    assert bench.link.last_ack(Arm()) is None
    bench.hear(1.2, bench.rover.ack(400, 4), bench.rover.heartbeat(4))
    assert bench.link.last_ack(Arm()) == AckSeen(1.2, 400, 4)
    bench.hear(2.2, bench.rover.heartbeat(4))
    assert bench.commands(2.5, 400) == []
    assert bench.link.last_ack(RequestMessage(49)) is None
    assert bench.link.last_ack(GuidedVelocity(0.0, 0.0)) is None


def test_an_answer_in_progress_gives_more_time() -> None:
    bench = Bench()
    bench.link.send(SetMode(15), 1.0)
    bench.said()
    bench.hear(1.9, bench.rover.ack(176, 5))
    bench.hear(2.0, bench.rover.heartbeat(4))
    assert bench.commands(2.5, 176) == []
    assert len(bench.commands(3.0, 176)) == 1


def test_the_pilot_is_never_overruled_by_a_repetition() -> None:
    """The answer is lost, the mode was set, and the pilot has chosen another one since."""
    bench = Bench()
    bench.link.send(SetMode(15), 1.0)
    bench.said()
    assert bench.commands(2.1, 176) == [], "no heartbeat since: it is not known what has become of it"
    bench.hear(2.5, bench.rover.heartbeat(0))
    assert bench.commands(2.6, 176) == []
    bench.hear(3.5, bench.rover.heartbeat(4))
    assert bench.commands(10.0, 176) == []


def test_arming_is_not_repeated_once_armed() -> None:
    bench = Bench()
    bench.link.send(Arm(), 1.0)
    bench.said()
    bench.hear(1.5, bench.rover.heartbeat(4, armed=True))
    assert bench.commands(3.0, 400) == []


def test_a_newer_speed_takes_the_place_of_the_older() -> None:
    bench = Bench()
    bench.link.send(ChangeSpeed(1.0), 1.0)
    bench.link.send(ChangeSpeed(2.0), 1.5)
    bench.said()
    assert [m.param2 for t in (2.0, 2.5) for m in bench.commands(t, 178)] == [2.0]


def test_everything_is_logged_in_both_directions() -> None:
    bench = Bench(known=False)
    heard = [bench.rover.heartbeat(), bench.rover.local_position(1), Station(255, 190).heartbeat(kind=6)]
    bench.hear(1.0, b"noise", *heard)
    bench.link.service(1.05)
    said = b"".join(raw for time_s, raw in bench.log if time_s == 1.05)
    assert [raw for time_s, raw in bench.log if time_s == 1.0] == heard
    assert said == bench.far.read() and len(messages(said)) > 5


class TestReadBack:
    """Does the autopilot follow what it was sent?"""

    frame = LocalFrame(GeoPoint(-35.3632613, 149.1652299))

    def bench(self) -> Bench:
        bench = Bench()
        bench.hear(0.5, bench.rover.origin(), bench.rover.home())
        return bench

    def target(self, bench: Bench, now_s: float, place: NedPoint) -> None:
        geo = self.frame.to_geo(place)
        bench.hear(now_s, bench.rover.target(round(geo.lat_deg * 1e7), round(geo.lon_deg * 1e7)))

    def test_nothing_can_be_said_at_first(self) -> None:
        bench = self.bench()
        assert bench.link.target_confirmed is None
        self.target(bench, 1.0, NedPoint(5.0, 5.0))
        assert bench.link.target_confirmed is None

    def test_agreement(self) -> None:
        bench = self.bench()
        bench.link.send(GuidedPosition(NedPoint(10.0, 0.0)), 1.0)
        assert bench.link.target_confirmed is None
        self.target(bench, 1.5, NedPoint(10.2, 0.1))
        assert bench.link.target_confirmed is True

    @pytest.mark.parametrize("place", [NedPoint(10.7, 0.0), None])
    def test_disagreement_or_silence(self, place: NedPoint | None) -> None:
        bench = self.bench()
        bench.link.send(GuidedPosition(NedPoint(10.0, 0.0)), 1.0)
        for now_s in (1.5, 2.0, 2.5, 2.9):
            if place is not None:
                self.target(bench, now_s, place)
            bench.link.service(now_s)
            assert bench.link.target_confirmed is None
        bench.link.service(3.1)
        assert bench.link.target_confirmed is False
        self.target(bench, 3.2, NedPoint(10.0, 0.0))
        assert bench.link.target_confirmed is True

    def test_a_rolling_target_may_lag(self) -> None:
        bench = self.bench()
        for i in range(40):
            now_s = 1.0 + 0.25 * i
            bench.link.send(GuidedPosition(NedPoint(10.0 + i, 0.0)), now_s)
            if i >= 4:
                self.target(bench, now_s + 0.1, NedPoint(10.0 + i - 4, 0.0))
            bench.link.service(now_s + 0.1)
            assert bench.link.target_confirmed is (True if i >= 4 else None)

    def test_a_rolling_target_that_is_not_followed(self) -> None:
        bench = self.bench()
        bench.link.send(GuidedPosition(NedPoint(0.0, 0.0)), 0.9)
        self.target(bench, 1.0, NedPoint(0.0, 0.0))
        for i in range(12):
            bench.link.send(GuidedPosition(NedPoint(10.0 + i, 0.0)), 1.0 + 0.5 * i)
            self.target(bench, 1.1 + 0.5 * i, NedPoint(0.0, 0.0))
            bench.link.service(1.1 + 0.5 * i)
        assert bench.link.target_confirmed is False

    def test_a_target_that_is_dropped_later(self) -> None:
        """After HOLD and back to GUIDED the autopilot follows nothing and sends no read-back."""
        bench = self.bench()
        bench.link.send(GuidedPosition(NedPoint(10.0, 0.0)), 1.0)
        self.target(bench, 1.5, NedPoint(10.0, 0.0))
        for i in range(10):
            bench.link.send(GuidedPosition(NedPoint(10.0, 0.0)), 2.0 + 0.5 * i)
            bench.link.service(2.0 + 0.5 * i)
        assert bench.link.target_confirmed is False

    @pytest.mark.parametrize("other", [GuidedVelocity(0.0, 0.0), GuidedHeading(1.0)])
    def test_other_setpoints_have_no_read_back(self, other: GuidedVelocity | GuidedHeading) -> None:
        bench = self.bench()
        bench.link.send(GuidedPosition(NedPoint(10.0, 0.0)), 1.0)
        self.target(bench, 1.5, NedPoint(10.0, 0.0))
        bench.link.send(other, 2.0)
        assert bench.link.target_confirmed is None
        bench.link.service(20.0)
        assert bench.link.target_confirmed is None


def test_another_companion_is_noticed_and_our_own_echo_is_not() -> None:
    bench, twin = Bench(), Station(1, 191)
    bench.link.service(1.0)
    bench.hear(1.1, bench.far.read())
    assert not bench.link.twin_heard(1.2), "a network that sends everything back is no second companion"
    for _ in range(20):
        raw = twin.heartbeat(kind=18, autopilot=8)
    bench.hear(2.0, raw)
    assert bench.link.twin_heard(2.1) and not bench.link.twin_heard(6.0)
    assert not bench.link.rival_heard(2.1), "it may be only beginning"


def test_figures_of_another_companion_tell_that_it_drives_and_our_own_do_not() -> None:
    bench, twin = Bench(), Station(1, 191)
    bench.link.send(NamedValue("PROGRESS", 50.0), 1.0)
    bench.hear(1.1, bench.far.read())
    assert not bench.link.rival_heard(1.2)
    raw = twin.pack(mavlink.MAVLink_named_value_float_message(0, b"PROGRESS", 50.0))
    bench.hear(2.0, raw)
    assert bench.link.rival_heard(2.1) and bench.link.twin_heard(2.1) and not bench.link.rival_heard(6.0)
