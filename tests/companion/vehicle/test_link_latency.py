"""How late the link is, by answers and by the autopilot's clock; what is drift, what is delay, what is a jump."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.mavlink.autopilot_link import AutopilotLink
from companion.mavlink.codec import Codec
from companion.mavlink.transport import MemoryLink
from companion.safety.reasons import Doubt
from companion.settings import LinkSettings
from companion.vehicle.commands import TimeSync
from companion.vehicle.events import HeartbeatSeen, LocalPositionSeen, RoverMode
from companion.vehicle.link_latency import Latency, TimeAnswered, latency_after_answer, latency_after_report
from companion.vehicle.state import fold
from tests.companion.safety.test_mode_latch import doubt_of, vehicle


def run(down_s: float, up_s: float, seconds: float, latency: Latency, start_s: float, drift: float = 0.0) -> Latency:
    """Ten reports and two answers a second over a link that is so late both ways."""
    for i in range(round(10 * seconds)):
        now_s = start_s + 0.1 * i
        latency = latency_after_report(latency, now_s, (now_s - down_s) * (1.0 + drift) - 7.0)
        if i % 5 == 0:
            latency = latency_after_answer(latency, TimeAnswered(now_s, round((now_s - down_s - up_s) * 1e9)))
    return latency


def test_nothing_is_known_before_anything_is_heard():
    assert Latency().longest_s == Latency().lasting_s == 0.0


def test_a_link_that_becomes_late_is_noticed_by_the_next_reports_and_by_the_answers():
    good = run(0.02, 0.03, 5.0, Latency(), 100.0)
    assert good.longest_s == pytest.approx(0.05) and good.growth_s == pytest.approx(0.0, abs=1e-9)
    three_reports = run(1.02, 1.03, 0.3, good, 105.0)
    assert three_reports.growth_s == pytest.approx(1.0, abs=1e-3)
    assert three_reports.longest_s == pytest.approx(2.05)
    late = run(1.02, 1.03, 2.0, good, 105.0)
    assert late.lasting_s == pytest.approx(2.05)
    assert run(0.02, 0.03, 2.0, late, 107.0).longest_s == pytest.approx(0.05)


def test_one_late_packet_is_driven_for_but_does_not_last():
    good = run(0.02, 0.03, 5.0, Latency(), 100.0)
    spiked = latency_after_report(
        latency_after_answer(good, TimeAnswered(105.0, round(103.5e9))), 105.0, 105.0 - 1.5 - 7.0
    )
    assert spiked.longest_s == pytest.approx(1.5) and spiked.lasting_s < 0.1


@given(st.floats(-3e-4, 3e-4), st.floats(0.0, 0.4), st.floats(0.0, 0.4))
def test_clocks_that_drift_apart_for_an_hour_are_no_delay(drift: float, down_s: float, up_s: float):
    latency = Latency()
    for start_s in range(100, 3700, 300):
        latency = run(down_s, up_s, 3.0, latency, float(start_s), drift)
        assert latency.lasting_s <= down_s + up_s + 0.3 * 1e-3 * 300.0 + 1e-6
        latency = run(down_s, up_s, 3.0, latency, float(start_s) + 3.0, drift)
        assert latency.longest_s == pytest.approx(down_s + up_s, abs=0.01)


def unanswered(latency: Latency, start_s: float, seconds: int, late_s: float, drift: float) -> Latency:
    """A position report a second."""
    for i in range(seconds):
        now_s = start_s + i
        latency = latency_after_report(latency, now_s, (now_s - late_s) * (1.0 - drift))
    return latency


@pytest.mark.parametrize("drift", [-5e-5, 5e-5, 9e-5])
def test_clocks_that_drift_without_answers_are_no_delay_after_a_day_and_a_delay_still_is_one(drift: float):
    latency = unanswered(Latency(), 100.0, 86_400, 0.05, drift)
    assert latency.growth_s < 0.01
    late = unanswered(latency, 86_500.0, 60, 1.55, drift)
    assert late.lasting_s == pytest.approx(1.5, abs=0.02)


def test_a_clock_that_jumps_ahead_is_a_jump_and_no_delay():
    good = run(0.02, 0.03, 5.0, Latency(), 100.0)
    jumped = latency_after_report(good, 105.0, 105.0 + 30.0)
    assert jumped.jumped_s == 105.0 and good.jumped_s == -math.inf
    assert jumped.lasting_s == pytest.approx(0.05)


def test_a_clock_that_jumps_ahead_stops_the_rover_for_a_moment_and_moves_nothing():
    state, doubts = vehicle(10.0), []
    for i in range(1, 40):
        now_s = 10.0 + 0.1 * i
        boot_s = now_s + (30.0 if i >= 20 else 0.0)
        state = fold(state, LocalPositionSeen(now_s, boot_s, 0.1 * i, 0.0, 1.0, 0.0))
        assert state.jump_m < 0.2 and not state.frozen
        fresh = replace(vehicle(now_s), position=state.position, latency=state.latency)
        doubts.append(doubt_of(fresh, now_s))
    assert set(doubts[:19]) == set(doubts[24:]) == {None}
    assert set(doubts[19:24]) == {Doubt.CLOCK_JUMPED}


def test_a_clock_that_runs_back_stops_the_rover_until_a_person_sets_guided():
    state = fold(vehicle(10.0), LocalPositionSeen(10.1, 2.0, 0.0, 0.0, 0.0, 0.0))
    assert doubt_of(state, 10.1) is Doubt.AUTOPILOT_RESTARTED
    state = fold(state, HeartbeatSeen(10.2, RoverMode.GUIDED, True, 1))
    assert state.restarted
    state = fold(state, HeartbeatSeen(10.3, RoverMode.HOLD, True, 1))
    state = fold(state, HeartbeatSeen(10.4, RoverMode.GUIDED, True, 1))
    assert doubt_of(state, 10.4) is None


@pytest.mark.parametrize(("round_trip_s", "safe"), [(0.9, True), (1.1, False)])
def test_a_link_later_than_the_limit_is_unsafe(round_trip_s: float, safe: bool):
    state = vehicle(10.0)
    for _ in range(3):
        assert doubt_of(state, 10.0) is None, "two late answers are chance"
        state = fold(state, TimeAnswered(10.0, round((10.0 - round_trip_s) * 1e9)))
    assert doubt_of(state, 10.0) is (None if safe else Doubt.LINK_LATE)
    assert state.latency_s == pytest.approx(round_trip_s)


def test_answers_to_others_and_answers_heard_twice_do_not_count():
    near, far = MemoryLink.pair()
    link = AutopilotLink(near, Codec(LinkSettings()), LinkSettings())
    autopilot = Autopilot()
    far.write(autopilot.heartbeat())
    link.poll(1.0)
    link.service(1.0)
    asked = [m.ts1 for m in autopilot.heard(far.read()) if m.get_type() == "TIMESYNC"]
    assert asked == [round(1.0e9)] == [TimeSync(round(1.0e9)).asked_ns]
    far.write(autopilot.time(5, asked[0] - 1) + autopilot.time(5, asked[0]) + autopilot.time(6, asked[0]))
    far.write(autopilot.time(0, asked[0]))
    assert [event for event in link.poll(1.3) if isinstance(event, TimeAnswered)] == [TimeAnswered(1.3, asked[0])]


class Autopilot:
    """Just enough of one, with pymavlink alone."""

    def __init__(self) -> None:
        from pymavlink.dialects.v20 import ardupilotmega as mavlink

        self._mavlink = mavlink
        self._mav = mavlink.MAVLink(None, 1, 1)
        self._ears = mavlink.MAVLink(None)

    def _packed(self, message):
        raw = bytes(message.pack(self._mav))
        self._mav.seq = (self._mav.seq + 1) % 256
        return raw

    def heartbeat(self) -> bytes:
        return self._packed(self._mavlink.MAVLink_heartbeat_message(10, 3, 0, 15, 4, 3))

    def time(self, tc1: int, ts1: int) -> bytes:
        return self._packed(self._mavlink.MAVLink_timesync_message(tc1, ts1))

    def heard(self, data: bytes):
        return self._ears.parse_buffer(data) or []
