"""ArduRover's parameters change how the simulated rover moves: each by itself, and in the direction its name says."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sitl.autopilot.control.guided import begin_guided, begin_target
from sitl.autopilot.control.records import (
    COAST,
    LOOP_HZ,
    TURN_RATE,
    MotionRecords,
    new_control,
    new_estimate,
    new_tuning,
)
from sitl.autopilot.parameters import DEFAULTS, Parameters, steered_wheels
from sitl.plant.closed_loop import NOISE_COLUMNS, NoiseSettings, run_loops
from sitl.plant.outline import Outline
from sitl.plant.rover import new_rover
from sitl.world.world import World
from tests.support.sitl_client import READY_S, Client, open_ground

SKID = {"WP_SPEED": 2.0, "WP_RADIUS": 1.0, "AVOID_ENABLE": 0.0}
WHEELS = {**SKID, **steered_wheels(1.5)}


class Plant:
    """The compiled loop without autopilot and noise."""

    def __init__(self, changes: dict[str, float], radius_m: float = 0.0) -> None:
        self.rover, self.estimate, self.control = (
            new_rover(0.0, 0.0, 0.0, Outline(0.35), radius_m),
            new_estimate(),
            new_control(),
        )
        self.tuning = new_tuning(Parameters(changes).as_dict())
        self.control["armed"], self.control["tick"] = 1, 0
        self.trace: list[tuple[float, ...]] = []
        begin_guided(self.control[0], self.tuning[0])

    def run(self, seconds: float) -> None:
        world, noise = World.open(), NoiseSettings.none().as_array()
        for _ in range(round(seconds * LOOP_HZ / 5)):
            left = 5
            while left:
                left -= run_loops(
                    self.rover, MotionRecords(self.estimate, self.control, self.tuning), np.zeros(2), noise,
                    np.zeros((left, NOISE_COLUMNS)), world.surroundings(0.0), 0.0,
                )  # fmt: skip
                self.control["arrived"] = 0
            rover, control = self.rover[0], self.control[0]
            names = ("north_m", "east_m", "heading_rad", "speed_m_s", "yaw_rate_rad_s")
            self.trace.append((*(float(rover[name]) for name in names), float(control["reached"])))

    def drive_to(self, north_m: float, east_m: float, seconds: float) -> None:
        begin_target(self.control[0], self.tuning[0], self.estimate[0], north_m, east_m)
        self.run(seconds)

    def turn(self, speed_m_s: float, rate_rad_s: float, seconds: float) -> None:
        control = self.control
        control["task"], control["have_target"], control["target_tick"] = TURN_RATE, 1, control["tick"]
        control["target_speed"], control["target_turn_rate"] = speed_m_s, rate_rad_s
        self.run(seconds)

    def push(self, throttle: float, steering: float, seconds: float) -> None:
        self.control["task"] = COAST
        self.control["stick_throttle"], self.control["stick_steering"] = throttle, steering
        self.run(seconds)


def everything(changes: dict[str, float], radius_m: float = 0.0) -> np.ndarray[Any, Any]:
    """Ahead, to the right behind, turning while driving and on to a place, with the sticks, forwards and backwards."""
    plant = Plant(changes, radius_m)
    plant.drive_to(10.0, 0.0, 11.0)
    plant.drive_to(8.0, 8.0, 8.0)
    plant.turn(2.0, 1.5, 2.0)
    plant.turn(1.5, -1.5, 0.8)
    here = plant.rover[0]
    ahead_n, ahead_e = math.cos(here["heading_rad"]), math.sin(here["heading_rad"])
    plant.drive_to(here["north_m"] + 8.0 * ahead_n, here["east_m"] + 8.0 * ahead_e, 2.0)
    plant.turn(0.0, -1.5, 2.0)
    plant.push(0.9, 0.7, 2.0)
    plant.push(-0.6, -0.3, 2.0)
    return np.array(plant.trace)


OTHERWISE = {
    "ATC_ACCEL_MAX": 0.5, "ATC_BRAKE": 0.0, "ATC_DECEL_MAX": 0.4, "ATC_SPEED_D": 0.05, "ATC_SPEED_FF": 0.1,
    "ATC_SPEED_FLTE": 1.0, "ATC_SPEED_FLTT": 1.0, "ATC_SPEED_I": 0.6, "ATC_SPEED_IMAX": 0.01, "ATC_SPEED_P": 0.6,
    "ATC_STOP_SPEED": 0.01, "ATC_STR_ACC_MAX": 60.0, "ATC_STR_ANG_P": 1.0, "ATC_STR_RAT_D": 0.01,
    "ATC_STR_RAT_FF": 0.5, "ATC_STR_RAT_FLTE": 1.0, "ATC_STR_RAT_FLTT": 1.0, "ATC_STR_RAT_I": 0.6,
    "ATC_STR_RAT_IMAX": 0.001, "ATC_STR_RAT_MAX": 30.0, "ATC_STR_RAT_P": 0.5, "ATC_TURN_MAX_G": 0.1,
    "INS_ACCEL_FILTER": 1.0, "INS_GYRO_FILTER": 1.0, "CRUISE_SPEED": 2.0, "CRUISE_THROTTLE": 40,
    "MOT_SLEWRATE": 20, "MOT_STR_THR_MIX": 1.0, "MOT_THR_MAX": 30,
    "MOT_THR_MIN": 15, "MOT_THST_ASYM": 2.0, "MOT_THST_EXPO": 0.6, "PSC_POS_P": 0.6, "PSC_VEL_FLTE": 1.0,
    "PSC_VEL_P": 0.3, "SERVO1_FUNCTION": 0, "SERVO3_FUNCTION": 73, "SERVO1_REVERSED": 1, "SERVO3_REVERSED": 1,
    "WP_ACCEL": 0.4, "WP_JERK": 0.2, "WP_PIVOT_ANGLE": 170.0, "WP_PIVOT_DELAY": 1, "WP_PIVOT_RATE": 30.0,
    "WP_RADIUS": 0.05, "WP_SPEED": 1.0,
}  # fmt: skip
ON_WHEELS = {"TURN_RADIUS": 0.3, "MOT_SPD_SCA_BASE": 3.0, "SERVO1_FUNCTION": 0, "SERVO3_REVERSED": 1, "MOT_THR_MAX": 30}
TOGETHER = {"ATC_SPEED_FLTD": ("ATC_SPEED_D", 0.05), "ATC_STR_RAT_FLTD": ("ATC_STR_RAT_D", 0.01)}
"""What changes nothing unless another parameter is set."""
ELSEWHERE = {
    "FRAME_CLASS",
    "FRAME_TYPE",
    "SERVO1_FUNCTION",
    *(f"SERVO{n}_{what}" for n in range(2, 17) for what in ("FUNCTION", "REVERSED")),
}


@pytest.fixture(scope="module")
def plain() -> np.ndarray[Any, Any]:
    return everything(SKID)


@pytest.mark.parametrize("name", OTHERWISE)
def test_each_changes_the_motion_of_a_skid_rover(name: str, plain: np.ndarray[Any, Any]) -> None:
    assert OTHERWISE[name] != SKID.get(name, DEFAULTS[name][0])
    moved = everything({**SKID, name: OTHERWISE[name]})
    assert np.isfinite(moved).all()
    assert np.abs(moved - plain).max() > 0.01


@pytest.mark.parametrize("name", ON_WHEELS)
def test_each_changes_the_motion_of_a_rover_with_steered_wheels(name: str) -> None:
    assert np.abs(everything({**WHEELS, name: ON_WHEELS[name]}, 1.5) - everything(WHEELS, 1.5)).max() > 0.01


@pytest.mark.parametrize("name", TOGETHER)
def test_a_slope_filter_counts_when_the_slope_does(name: str) -> None:
    with_slope = {**SKID, TOGETHER[name][0]: TOGETHER[name][1]}
    assert np.abs(everything({**with_slope, name: 0.5}) - everything(with_slope)).max() > 0.001


def test_the_table_holds_every_parameter_of_motion() -> None:
    prefixes = ("ATC_", "MOT_", "CRUISE_", "WP_", "TURN_", "PSC_", "INS_", "SERVO", "FRAME_")
    motion = {name for name in DEFAULTS if name.startswith(prefixes)}
    assert motion - set(OTHERWISE) - set(ON_WHEELS) - set(TOGETHER) <= ELSEWHERE


def test_the_page_says_what_each_of_them_does() -> None:
    page = (Path(__file__).parents[3] / "docs" / "sitl.md").read_text(encoding="utf-8")
    table = page[page.index("## Parameters") : page.index("## AUTO")]
    for name in {*OTHERWISE, *ON_WHEELS, *TOGETHER, "FRAME_CLASS", "FRAME_TYPE"}:
        ending = name[name.rindex("_") :]
        short = name.startswith(("ATC_SPEED_", "ATC_STR_RAT_")) and f"`{ending}`" in table
        assert f"`{name}`" in table or short or name.replace("1", "n").replace("3", "n") in table, name


def top_speed(changes: dict[str, float]) -> float:
    plant = Plant({**SKID, **changes})
    plant.drive_to(40.0, 0.0, 15.0)
    return max(row[3] for row in plant.trace)


@pytest.mark.parametrize("speed_m_s", [0.5, 1.0, 2.5])
def test_it_drives_as_fast_as_wp_speed(speed_m_s: float) -> None:
    assert top_speed({"WP_SPEED": speed_m_s}) == pytest.approx(speed_m_s, rel=0.03)


def test_throttle_has_a_limit() -> None:
    assert top_speed({"MOT_THR_MAX": 30.0}) == pytest.approx(0.3 * 4.0, rel=0.01)


@pytest.mark.parametrize("rate_deg_s", [20.0, 40.0])
def test_it_pivots_as_fast_as_it_may(rate_deg_s: float) -> None:
    plant = Plant({**SKID, "WP_PIVOT_RATE": rate_deg_s})
    plant.drive_to(0.5, 20.0, 4.0)
    assert math.degrees(max(row[4] for row in plant.trace)) == pytest.approx(rate_deg_s, rel=0.08)


def test_the_slower_the_gyros_filter_the_more_a_turn_rate_overshoots() -> None:
    fastest = []
    for hz in (2.0, 4.0, 80.0):
        plant = Plant({**SKID, "WP_PIVOT_RATE": 40.0, "INS_GYRO_FILTER": hz})
        plant.drive_to(0.5, 20.0, 4.0)
        fastest.append(math.degrees(max(row[4] for row in plant.trace)))
    assert fastest[0] > fastest[1] + 1.0 and fastest[1] > fastest[2] + 0.5
    assert fastest[2] == pytest.approx(40.0, rel=0.03)


@pytest.mark.parametrize(("angle_deg", "pivots"), [(60.0, True), (120.0, False), (0.0, False)])
def test_it_pivots_beyond_the_angle_only(angle_deg: float, pivots: bool) -> None:
    plant = Plant({**SKID, "WP_PIVOT_ANGLE": angle_deg})
    plant.drive_to(1.0, 20.0, 3.0)
    assert (max(abs(row[3]) for row in plant.trace if row[2] < math.radians(45.0)) < 0.05) is pivots


def stick(changes: dict[str, float], throttle: float, steering: float) -> tuple[float, float]:
    """Outputs 1 and 3 with the sticks held for a while."""
    plant = Plant({**SKID, **changes})
    plant.push(throttle, steering, 3.0)
    return float(plant.control[0]["servo_1"]), float(plant.control[0]["servo_3"])


def test_outputs_carry_what_their_functions_and_directions_say() -> None:
    assert stick({}, 0.4, 0.2) == pytest.approx((0.6, 0.2))
    assert stick({"SERVO1_FUNCTION": 74, "SERVO3_FUNCTION": 73}, 0.4, 0.2) == pytest.approx((0.2, 0.6))
    assert stick({"SERVO3_REVERSED": 1}, 0.4, 0.2) == pytest.approx((0.6, -0.2))
    assert stick({"SERVO1_FUNCTION": 0, "SERVO2_FUNCTION": 73}, 0.4, 0.2) == pytest.approx((0.0, 0.2))
    assert stick({"SERVO1_FUNCTION": 26, "SERVO3_FUNCTION": 70}, 0.4, 0.2) == pytest.approx((0.2, 0.4))


def test_thrust_has_a_least_value_and_a_curve() -> None:
    assert stick({"MOT_THR_MIN": 10}, 0.5, 0.0) == pytest.approx((0.55, 0.55))
    assert stick({"MOT_THR_MIN": 10}, -0.5, 0.0) == pytest.approx((-0.55, -0.55))
    bent = (0.5 - 1.0 + math.sqrt(0.25 + 2.0 * 0.5)) / 1.0  # the output x with 0.5 x + 0.5 x^2 = 0.5
    assert stick({"MOT_THST_EXPO": 0.5}, 0.5, 0.0) == pytest.approx((bent, bent))
    assert 0.5 * bent + 0.5 * bent**2 == pytest.approx(0.5)


@pytest.mark.parametrize("mix", [0.0, 0.2, 0.5, 0.8, 1.0])
def test_what_does_not_fit_is_shared_between_throttle_and_steering(mix: float) -> None:
    left, right = stick({"MOT_STR_THR_MIX": mix}, 0.9, 0.6)
    throttle, steering = 0.5 * (left + right), 0.5 * (left - right)
    assert max(abs(left), abs(right)) == pytest.approx(1.0)
    even = (0.9 / 1.5, 0.6 / 1.5)
    wanted = {0.0: (0.9, 0.1), 0.5: even, 1.0: (0.4, 0.6)}
    if mix in wanted:
        assert (throttle, steering) == pytest.approx(wanted[mix])
    else:
        assert (throttle > even[0]) is (mix < 0.5) and (steering > even[1]) is (mix > 0.5)


def test_motors_that_push_backwards_weakly_get_more() -> None:
    assert stick({"MOT_THST_ASYM": 2.0}, -0.3, 0.0) == pytest.approx((-0.6, -0.6))
    assert stick({"MOT_THST_ASYM": 2.0}, 0.3, 0.0) == pytest.approx((0.3, 0.3))
    left, right = stick({"MOT_THST_ASYM": 2.0}, 0.0, 0.9)
    assert (left, right) == pytest.approx((0.5, -1.0))


@pytest.mark.parametrize("ahead", [1.0, -1.0])
def test_without_braking_motors_never_push_against_the_way(ahead: float) -> None:
    def least_push(changes: dict[str, float]) -> float:
        plant = Plant({**SKID, **changes, "ATC_ACCEL_MAX": 8.0, "ATC_SPEED_P": 1.0})
        plant.turn(ahead * 2.0, 0.0, 3.0)
        plant.turn(ahead * 1.0, 0.0, 0.1)
        return ahead * float(plant.control[0]["throttle"])

    assert least_push({"ATC_BRAKE": 1}) < -0.05
    assert least_push({"ATC_BRAKE": 0}) == 0.0


@pytest.mark.parametrize(
    ("changes", "complaint"),
    [
        ({"SERVO1_FUNCTION": 0, "SERVO3_FUNCTION": 0}, "no motor, sail or scripting outputs defined"),
        ({"SERVO3_FUNCTION": 0}, "check skid steering config"),
        ({"SERVO2_FUNCTION": 26}, "check steering and throttle config"),
    ],
)
def test_outputs_that_make_no_rover_are_not_armed(changes: dict[str, float], complaint: str) -> None:
    client = Client(open_ground(parameters=changes))
    client.run_for(READY_S)
    assert client.arm() == 4
    assert f"PreArm: {complaint}"[:50] in client.texts()  # longer texts come in pieces
    assert not client.simulator.vehicle.armed


def test_a_boat_says_that_it_is_one() -> None:
    for frame, kind in ((1.0, 10), (2.0, 11), (3.0, 10)):
        client = Client(open_ground(parameters={"FRAME_CLASS": frame}))
        assert {m.type for m in client.run_for(1.5) if m.get_type() == "HEARTBEAT"} == {kind}
