"""How fast the rover goes with its throttle fully open is found from steady driving, and a wrong scale is told."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import pytest

from companion.control.full_throttle import ENOUGH_S, STALE_S, FullThrottle
from companion.core.frames import Pose
from companion.executive.mission_run import MissionRun
from companion.mission.load import load_mission
from companion.recording.recorder import NullRecorder
from companion.safety.mode_latch import LatchState
from companion.settings import Settings
from companion.vehicle.events import ThrottleSeen
from companion.vehicle.state import VehicleState
from sitl.lockstep import Drive
from sitl.plant.rover import SIM_ROVER
from sitl.scenario import scenario_from_mission
from tests.companion.control.test_drag import FULL_M_S
from tests.companion.control.test_safe_reach import ground, view
from tests.companion.operator.test_notifications import notifier
from tests.support.records import MISSIONS

TICK_S = 0.05
HERE = view(ground(), Pose(2.0, 2.0, 0.0, 0.0), 0.0)


def driven(*parts: tuple[float, float, float], turn_rad_s: float = 0.0, age_s: float = 0.0) -> FullThrottle:
    """After parts of a drive: seconds, share of the throttle, speed."""
    found, now_s = FullThrottle(), 0.0
    for seconds, share, speed_m_s in parts:
        for _ in range(round(seconds / TICK_S)):
            now_s += TICK_S
            pose = Pose(0.0, 0.0, 0.0, now_s)
            here = replace(HERE, pose=pose, speed_m_s=speed_m_s, yaw_rate_rad_s=turn_rad_s)
            found.note(ThrottleSeen(now_s - age_s, share), FULL_M_S, here)
    return found


@pytest.mark.parametrize(("share", "speed_m_s"), [(1.0, 0.8), (0.5, 2.0), (0.3, 2.0)])
def test_steady_driving_tells_it(share: float, speed_m_s: float) -> None:
    found = driven((ENOUGH_S + 2.0, share, speed_m_s))
    assert found.m_s == pytest.approx(speed_m_s / share)


def test_little_turning_standing_changing_or_stale_driving_does_not() -> None:
    assert driven((ENOUGH_S - 1.0, 1.0, 0.8)).m_s is None
    assert driven((60.0, 1.0, 0.8), turn_rad_s=0.5).m_s is None
    assert driven((60.0, 1.0, 0.1)).m_s is None
    assert driven((60.0, 0.1, 0.4)).m_s is None
    assert driven((60.0, 1.0, 0.8), age_s=2.0 * STALE_S).m_s is None
    assert driven(*[(0.5, 1.0, 0.8), (0.5, 0.5, 1.6)] * 60).m_s is None


def test_what_was_between_two_times_that_it_was_led_does_not_count() -> None:
    found = driven((2.0, 1.0, 0.8))
    later = replace(HERE, pose=Pose(0.0, 0.0, 0.0, 100.0), speed_m_s=0.8)
    found.note(ThrottleSeen(100.0, 1.0), FULL_M_S, later)
    assert found.m_s is None and not found.doubted


@pytest.mark.parametrize(
    ("parts", "doubted"),
    [
        ([(30.0, 0.5, 0.5 * FULL_M_S)], False),
        ([(30.0, 0.5, 0.35 * FULL_M_S)], False),
        ([(30.0, 0.5, 0.25 * FULL_M_S)], True),
        ([(30.0, 0.25, 0.5 * FULL_M_S)], True),
        ([(12.0, 1.0, 0.2 * FULL_M_S), (18.0, 0.5, 0.5 * FULL_M_S)], False),  # gravel on the way
    ],
)
def test_the_scale_is_doubted_where_it_is_mostly_far_off(
    parts: list[tuple[float, float, float]], doubted: bool
) -> None:
    assert driven(*parts).doubted == doubted


@pytest.mark.parametrize(
    ("fastest_m_s", "says"),
    [(2.0, "set them to 0.60 and 75, and WP_SPEED to 0.72"), (0.5, "set them to 0.60 and 75")],
)
def test_what_to_set_is_told_once(fastest_m_s: float, says: str) -> None:
    one, _ = notifier()
    parameters: Mapping[str, float] = {"WP_SPEED": fastest_m_s}
    vehicle = replace(VehicleState(), parameters=parameters)
    found = SimpleNamespace(doubted=True, m_s=0.8)
    run = cast(MissionRun, SimpleNamespace(executor=object(), vehicle=vehicle, full_throttle=found, latch=LatchState()))
    for now_s in (1.0, 2.0):
        one.tell_faults(run, now_s, ())
        found.m_s += 0.1
    (text,) = one.said
    assert text.startswith("The rover drives 0.80 m/s at full throttle, not 4.00") and text.endswith(says)


def test_a_weak_rover_is_told_on_a_real_drive() -> None:
    mission = load_mission(MISSIONS / "open.toml")
    scenario = replace(scenario_from_mission(mission), drivetrain=SIM_ROVER._replace(top_speed_m_s=1.2))
    run = Drive(mission, scenario, Settings(), 1, NullRecorder(), time_limit_s=90.0)
    report = run.run()
    assert run.companion.mission_run.full_throttle.m_s == pytest.approx(1.2, abs=0.05)
    assert sum("m/s at full throttle, not 4.00" in text for text in report.said) == 1
