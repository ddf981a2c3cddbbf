"""The rover moves as ArduRover 4.7's simulated skid rover, as measured: 5 % or 0.05 m/s, 0.2 s, 0.1 m."""

import math
from typing import Any

import numpy as np
import pytest

from companion.control.braking import braking_distance_m, overshoot_m
from companion.settings import Settings
from companion.vehicle.recommended_parameters import RECOMMENDED_PARAMETERS
from tests.support.sitl_client import open_ground, ready


def test_ten_metres_from_rest() -> None:
    client = ready(open_ground())
    began_s = client.simulator.time_s
    client.drive_to(10.0, 0.0)
    profile = []
    while client.simulator.time_s < began_s + 10.0:
        client.run_for(0.02)
        truth = client.simulator.truth
        profile.append((client.simulator.time_s - began_s, truth.north_m, truth.speed_m_s))
    moving = [row for row in profile if row[2] > 0.05]
    started_s = next(row[0] for row in profile if row[2] > 0.15)
    assert started_s == pytest.approx(0.8, abs=0.1)
    assert max(row[2] for row in profile) == pytest.approx(2.4, abs=0.05)
    assert moving[-1][0] == pytest.approx(8.0, abs=0.2)
    assert profile[-1][1] - 10.0 == pytest.approx(0.23, abs=0.08)
    assert profile[-1][2] < 0.001


def test_a_target_behind_is_faced_first_at_sixty_degrees_a_second() -> None:
    def seconds_to_drive(north_m: float) -> tuple[float, float]:
        client = ready(open_ground())
        began_s, fastest = client.simulator.time_s, 0.0
        client.drive_to(north_m, 0.1)
        while math.hypot(client.simulator.truth.north_m, 0.0) < 4.0:
            client.run_for(0.02)
            fastest = max(fastest, abs(client.simulator.truth.yaw_rate_rad_s))
            assert client.simulator.time_s < began_s + 30.0
        return client.simulator.time_s - began_s, math.degrees(fastest)

    ahead_s, _ = seconds_to_drive(10.0)
    behind_s, rate_deg_s = seconds_to_drive(-10.0)
    assert rate_deg_s == pytest.approx(63.0, abs=2.0), "measured: 1.1 rad/s"
    # Measured from another start, perhaps with some speed: 4.3 s.
    assert behind_s - ahead_s == pytest.approx(4.3, abs=0.8)


@pytest.mark.parametrize(
    ("left_m", "mean_m_s", "lowest_m_s"), [(3.0, 1.69, 1.61), (2.0, 1.37, 1.24), (1.0, 0.99, 0.78), (0.5, 0.77, 0.44)]
)
def test_chained_targets(left_m: float, mean_m_s: float, lowest_m_s: float) -> None:
    """Targets 3 m apart, the next one sent when so much is left to go, as far as the sender knows (0.1 s late)."""
    client = ready(open_ground())
    target_m, known_m, speeds = 3.0, 0.0, []
    client.drive_to(target_m, 0.0)
    while target_m < 45.0:
        client.run_for(0.1)
        truth = client.simulator.truth
        if target_m - known_m <= left_m:
            target_m += 3.0
            client.drive_to(target_m, 0.0)
        known_m = truth.north_m
        if target_m > 18.0:
            speeds.append(truth.speed_m_s)
    assert float(np.mean(speeds)) == pytest.approx(mean_m_s, rel=0.06)
    assert min(speeds) == pytest.approx(lowest_m_s, rel=0.12)


def resent_at_2_hz(target_of: Any, **options: Any) -> float:
    client = ready(open_ground(**options))
    for _ in range(40):
        known_m = client.simulator.truth.north_m
        client.run_for(0.1)  # what the sender knows is 0.1 s old
        client.drive_to(target_of(known_m), 0.0)
        client.run_for(0.4)
    return client.simulator.truth.speed_m_s


def test_a_carrot_three_metres_ahead_is_followed_slowly() -> None:
    assert resent_at_2_hz(lambda north_m: north_m + 3.0) == pytest.approx(1.2, abs=0.06)


def test_one_far_target_repeated_is_driven_at_full_speed() -> None:
    assert resent_at_2_hz(lambda north_m: 200.0) == pytest.approx(3.0, abs=0.03)


def test_planning_from_rest_keeps_a_repeating_sender_standing() -> None:
    speed_m_s = resent_at_2_hz(lambda north_m: 200.0, parameters={"GUID_OPTIONS": 64})
    assert 0.0 < speed_m_s < 0.15


def test_velocity_targets_time_out_after_three_seconds() -> None:
    client = ready(open_ground())
    for _ in range(10):
        client.drive_at(1.0)
        client.run_for(0.3)
    last_s = client.simulator.time_s - 0.3
    assert client.simulator.truth.speed_m_s == pytest.approx(1.0, abs=0.05)
    client.run_to(last_s + 2.9)
    assert client.simulator.truth.speed_m_s == pytest.approx(1.0, abs=0.05)
    client.run_to(last_s + 3.2)
    assert "target not received last 3secs, stopping" in client.texts()
    client.run_to(last_s + 5.7)
    assert client.simulator.truth.speed_m_s < 0.02


@pytest.mark.parametrize("speed_m_s", [0.0, 0.5, 1.0, 2.0])
@pytest.mark.parametrize("share", [1.0, 1.5])
def test_it_stands_no_farther_beyond_a_near_place_than_the_companion_counts_on(speed_m_s: float, share: float) -> None:
    """Standing, places 0.4 and 0.6 m ahead; rolling, as near as it can brake, which is as near as it is told."""
    guidance = Settings().guidance
    client = ready(open_ground(parameters={**RECOMMENDED_PARAMETERS, "WP_SPEED": 2.0}))
    if speed_m_s > 0.0:
        client.drive_to(60.0, 0.0)
        client.run_for(0.2)
        client.command(178, 1, speed_m_s, -1)
        client.run_for(8.0)
    began = client.simulator.truth
    assert began.speed_m_s == pytest.approx(speed_m_s, abs=0.02)
    ahead_m = share * (braking_distance_m(speed_m_s, guidance) if speed_m_s > 0.0 else 0.4)
    client.drive_to(began.north_m + ahead_m, 0.0)
    client.run_for(10.0)
    beyond_m = client.simulator.truth.north_m - began.north_m - ahead_m
    assert client.simulator.truth.speed_m_s < 0.01
    assert 0.0 < beyond_m <= overshoot_m(ahead_m, speed_m_s, guidance)
