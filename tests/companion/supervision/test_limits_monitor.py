"""The limits by which motions are planned are read from the autopilot."""

from __future__ import annotations

import math
from typing import Any, cast

import pytest

from companion.core.severity import Severity
from companion.mavlink.autopilot_link import AutopilotLink
from companion.safety.reasons import Doubt
from companion.settings import Settings
from companion.settings.live_settings import LiveSettings
from companion.supervision.limits_monitor import TRIES, LimitsMonitor
from companion.vehicle.commands import ReadParameter
from companion.vehicle.events import HeartbeatSeen, ParameterSeen
from companion.vehicle.motion_limits import LIMITS, THROTTLE_SCALE, TIMEOUT
from companion.vehicle.state import VehicleState, fold

PLANS = tuple(dict.fromkeys((TIMEOUT, *LIMITS, *THROTTLE_SCALE)))
"""What planned motions need."""


class Asked:
    def __init__(self) -> None:
        self.names: list[str] = []
        self.said: list[str] = []

    def tell(self, text: str, severity: Severity) -> None:
        self.said.append(text)

    def send(self, command: ReadParameter, now_s: float) -> None:
        self.names.append(command.name)


def asked(controller: str, answers: tuple[str, ...], seconds: int = 30) -> Asked:
    """What is asked for and told; those named are answered at once."""
    autopilot, state = Asked(), VehicleState()
    settings = Settings.model_validate({"guidance": {"controller": controller}})
    monitor = LimitsMonitor(cast(AutopilotLink, cast(Any, autopilot)), LiveSettings(settings), autopilot)
    heartbeat = HeartbeatSeen(0.0, 4, True, 1)
    state = fold(state, heartbeat)
    monitor.take(heartbeat, state)
    for tick in range(10 * seconds):
        before = len(autopilot.names)
        monitor.tick(0.1 * tick)
        for name in autopilot.names[before:]:
            if name in answers:
                event = ParameterSeen(0.1 * tick, name, 1.0)
                state = fold(state, event)
                monitor.take(event, state)
        assert monitor.doubt(0.1 * tick) is None
    return autopilot


def test_each_limit_is_asked_for_until_it_is_known() -> None:
    assert asked("motion-ga", PLANS).names == list(PLANS)


def test_one_that_is_never_answered_is_asked_for_a_few_times_and_then_told() -> None:
    found = asked("motion-ga", tuple(name for name in PLANS if name != "ATC_STR_RAT_MAX"))
    assert found.names.count(LIMITS[0]) == 1 and found.names.count("ATC_STR_RAT_MAX") == TRIES
    assert found.said == ["The autopilot does not tell ATC_STR_RAT_MAX: taken to be no limit"]
    several = asked("motion-ga", (TIMEOUT, *PLANS[2:-2])).said
    assert several == [
        "The autopilot does not tell ATC_ACCEL_MAX, CRUISE_THROTTLE: taken to be as shipped; "
        "ATC_STR_RAT_MAX: taken to be no limit"
    ]


def test_without_planned_motions_only_its_timeout_and_what_its_throttle_does_is_needed() -> None:
    needed = {TIMEOUT, *THROTTLE_SCALE}
    assert {*asked("points", tuple(needed)).names} == needed
    assert asked("points", (TIMEOUT,)).said == [
        "The autopilot does not tell CRUISE_SPEED, CRUISE_THROTTLE: taken to be as shipped"
    ]


def test_older_firmware_has_no_timeout_that_could_be_told() -> None:
    """What is taken instead is told where motions are planned; a ground station may set one later on newer firmware."""
    rest = tuple(name for name in PLANS if name != TIMEOUT)
    found = asked("motion-ga", rest, seconds=100)
    assert found.said == ["The autopilot does not tell GUID_TIMEOUT: a velocity is taken to last 3 s"]
    assert TRIES + 2 <= found.names.count(TIMEOUT) <= TRIES + 4
    assert asked("points", rest).said == []
    assert 3 <= asked("points", PLANS, seconds=100).names.count(TIMEOUT) <= 5


@pytest.mark.parametrize(("timeout_s", "doubted"), [(1.0, False), (30.0, False), (31.0, True), (math.inf, True)])
def test_with_a_timeout_that_is_too_long_to_plan_with_the_rover_stands(timeout_s: float, doubted: bool) -> None:
    autopilot = Asked()
    monitor = LimitsMonitor(cast(AutopilotLink, cast(Any, autopilot)), LiveSettings(Settings()), autopilot)
    event = ParameterSeen(0.0, TIMEOUT, timeout_s)
    monitor.take(event, fold(VehicleState(), event))
    found = monitor.doubt(0.0)
    assert (found is not None and found.kind is Doubt.TIMEOUT_LONG) is doubted
