"""The estimate of how a rover follows velocities, on rovers that are known."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from companion.control import model_estimate
from companion.control.following import AS_SHIPPED, Following, following_of, turn_gains, turns_are_limited
from companion.control.local_view import LocalView
from companion.control.model_estimate import GAP_S, KNOWN_S, ModelEstimate, ModelEstimator, bounded, described
from companion.control.told import Told, after
from companion.core.frames import Pose
from companion.core.rover_limits import RoverLimits
from companion.executive import mission_executor
from companion.settings import MotionSettings, Settings
from companion.vehicle.commands import GuidedVelocity
from sitl.experiments import controllers
from sitl.experiments.off_model import off_model
from tests.companion.control.test_motion_ground import ground

TICK_S = 0.05
EVIDENCE, SETTINGS, LIMITS = ground(), Settings(), RoverLimits(0.4, 2.0, 8.0)


def watched(
    rover: Following,
    seconds: float,
    seed: int = 0,
    noise: float = 0.02,
    told: bool = True,
    limited: bool = False,
    most_rad_s: float = 1.5,
) -> ModelEstimator:
    """What is found of a rover that is told other speeds and turn rates every half second."""
    estimator, rng = ModelEstimator(AS_SHIPPED), np.random.default_rng(seed)
    estimator.assume(AS_SHIPPED, limited=limited)
    lately, history, speed, turn = Told(), [GuidedVelocity(0.0, 0.0)] * 40, 0.0, 0.0
    setpoint = history[0]
    for tick in range(round(seconds / TICK_S)):
        now_s = tick * TICK_S
        if tick % 10 == 0:
            setpoint = GuidedVelocity(float(rng.uniform(-0.3, 2.0)), float(rng.uniform(-most_rad_s, most_rad_s)))
        old = history[-max(1, round(rover.dead_s / TICK_S))]
        change, turned = old.forward_m_s - speed, rover.turn_gain * old.yaw_rate_rad_s - turn
        most = TICK_S * (rover.deceleration_m_s2 if change * speed < 0.0 else rover.acceleration_m_s2)
        most_turn = TICK_S * rover.turn_acceleration_rad_s2
        speed += min(max(change, -most), most)
        turn += min(max(turned, -most_turn), most_turn)
        seen_m_s, seen_rad_s = speed + noise * rng.standard_normal(), turn + noise * rng.standard_normal()
        pose = Pose(0.0, 0.0, 0.0, now_s)
        estimator.note(
            LocalView(
                pose, abs(seen_m_s), EVIDENCE, LIMITS, SETTINGS, seen_rad_s, lately=lately, rolls_back=seen_m_s < 0.0
            )
        )
        history.append(setpoint)
        lately = after(lately, setpoint if told else None, now_s)
    return estimator


def test_it_finds_what_the_rover_is_like() -> None:
    """Within 20 %: 400 of 400 rovers drawn so.

    With a dead time of 0.1 s, two seeds of 200 gave an acceleration that was off by 32 %.
    """
    rng, missed = np.random.default_rng(0), 0
    for seed in range(40):
        rover = Following(
            rng.uniform(0.1, 0.6), rng.uniform(0.7, 1.5), rng.uniform(0.7, 1.5), rng.uniform(1.4, 3.0),
            rng.uniform(0.75, 1.3),
        )  # fmt: skip
        estimate = watched(rover, 30.0, seed).estimate
        found = estimate.figures
        assert found.dead_s == pytest.approx(rover.dead_s, abs=0.06) and estimate.known == 1.0
        assert found[1:5] == pytest.approx(rover[1:5], rel=0.35)
        missed += found[1:5] != pytest.approx(rover[1:5], rel=0.2)
    assert missed <= 1


def test_the_more_is_known_the_less_it_may_be_off() -> None:
    shares = [watched(AS_SHIPPED, seconds).estimate.following(0.1).off_model for seconds in (1.0, 4.0, 8.0, 30.0)]
    assert shares == sorted(shares, reverse=True)
    assert shares[0] == AS_SHIPPED.off_model and shares[-1] == pytest.approx(0.1)


@pytest.mark.parametrize("gain", [0.7, 1.3])
def test_a_rover_that_has_hardly_turned_may_turn_by_as_much_off_what_is_told_as_at_first(gain: float) -> None:
    """Braking and the change of the turn rate are known by then; how far it turns is, once it has turned steadily."""
    rover = AS_SHIPPED._replace(turn_gain=gain)
    gentle, turns = (watched(rover, 60.0, most_rad_s=most_rad_s).estimate for most_rad_s in (0.3, 1.5))
    assert gentle.known == turns.known == 1.0
    assert (gentle.turn_known, turns.turn_known) == (0.0, 1.0)
    follows = gentle.following(0.1)
    assert (follows.off_model, follows.turn_off_model) == pytest.approx((0.1, 0.3))
    assert min(turn_gains(follows, 0.3)) <= gain / follows.turn_gain <= max(turn_gains(follows, 0.3))
    assert turns.following(0.1).turn_off_model == pytest.approx(0.1)


def test_what_comes_from_a_file_stays_within_the_bounds_of_the_estimate() -> None:
    wild = Following(50000.0, 900.0, 0.001, 900.0, 50.0, 0.9, 900.0, 0.0)
    kept = bounded(wild, AS_SHIPPED)
    assert kept == AS_SHIPPED._replace(
        dead_s=0.6, acceleration_m_s2=2.0, deceleration_m_s2=0.5, turn_acceleration_rad_s2=4.2, turn_gain=2.0
    )


def test_a_rover_seen_to_gain_little_speed_may_still_gain_as_much_as_its_limit() -> None:
    begun, gentle, quick = (
        watched(AS_SHIPPED._replace(acceleration_m_s2=gains), seconds).estimate.following(0.1).gains_most_m_s2
        for gains, seconds in ((1.0, 1.0), (0.6, 30.0), (1.5, 30.0))
    )
    assert begun == AS_SHIPPED.gains_most_m_s2
    assert gentle == pytest.approx(AS_SHIPPED.acceleration_m_s2) and quick == pytest.approx(1.65, rel=0.15)


def test_a_rover_that_is_known_may_gain_as_much_speed_as_its_autopilot_lets_it() -> None:
    """It is counted on to gain no more than 1 m/s² where there is no limit: what it can is another figure."""
    began = following_of(MotionSettings(), {"ATC_ACCEL_MAX": 0.0})
    estimate = ModelEstimate(began, began._replace(acceleration_m_s2=2.0), KNOWN_S, KNOWN_S, KNOWN_S)
    assert estimate.known == 1.0 and estimate.following(0.1).gains_most_m_s2 == pytest.approx(10.0)


@pytest.mark.parametrize("noise", [0.02, 0.2])
def test_a_rover_that_is_told_to_stand_tells_nothing_of_its_dead_time(noise: float) -> None:
    """A longer dead time leaves fewer moments to compare: that must not make it fit better."""
    rng = np.random.default_rng(7)
    estimator = ModelEstimator(AS_SHIPPED)
    lately = Told()
    for tick in range(200):
        lately = after(lately, GuidedVelocity(0.0, 0.0), tick * TICK_S)
        seen_m_s, seen_rad_s = noise * rng.standard_normal(2)
        pose = Pose(0.0, 0.0, 0.0, tick * TICK_S)
        estimator.note(LocalView(pose, abs(seen_m_s), EVIDENCE, LIMITS, SETTINGS, seen_rad_s, lately=lately))
    assert estimator.estimate.figures.dead_s == AS_SHIPPED.dead_s


def test_nothing_told_nothing_learnt() -> None:
    assert watched(Following(0.5, 0.6, 0.6, 1.2, 0.8), 20.0, told=False).estimate.figures == AS_SHIPPED


def test_moments_that_are_far_apart_do_not_belong_together(monkeypatch: pytest.MonkeyPatch) -> None:
    """A second before a pause and a second after it are too little to learn from."""
    looked = list[int]()

    def fitted(before: ModelEstimate, rows: NDArray[np.float64], *, limited: bool) -> ModelEstimate:
        looked.append(len(rows))
        return before

    monkeypatch.setattr(model_estimate, "_fitted", fitted)
    estimator, lately, now_s = ModelEstimator(AS_SHIPPED), Told(), 100.0
    for tick in range(40):
        now_s += 2.0 * GAP_S if tick == 20 else TICK_S
        lately = after(lately, GuidedVelocity(1.0, 0.0), now_s)
        pose = Pose(0.0, 0.0, 0.0, now_s)
        estimator.note(LocalView(pose, 1.0, EVIDENCE, LIMITS, SETTINGS, 0.0, lately=lately))
    assert looked == []


def test_no_figure_leaves_its_bounds() -> None:
    """A rover that hardly moves, whatever it is told."""
    estimate = watched(Following(0.3, 0.01, 0.01, 0.01, 0.01), 30.0).estimate
    for now, began in zip(estimate.figures[:5], AS_SHIPPED[:5], strict=True):
        assert 0.5 * began <= now <= 2.0 * began
    assert estimate.known < 0.1


def test_what_an_earlier_run_found_counts_once_the_same_is_assumed() -> None:
    began = AS_SHIPPED._replace(acceleration_m_s2=2.0)
    earlier = ModelEstimate(began, began._replace(dead_s=0.15), KNOWN_S, KNOWN_S, KNOWN_S)
    estimator = ModelEstimator(AS_SHIPPED)
    estimator.go_on(earlier)
    assert estimator.estimate.known == 0.0
    estimator.assume(began, limited=False)
    assert estimator.estimate == earlier
    estimator.assume(AS_SHIPPED, limited=False)
    assert estimator.estimate == ModelEstimate(AS_SHIPPED, AS_SHIPPED)


def test_it_is_told_in_one_line() -> None:
    line = described(ModelEstimate(AS_SHIPPED, AS_SHIPPED, KNOWN_S, 0.5 * KNOWN_S, KNOWN_S))
    assert "0.30 s" in line and "50% known" in line and "\n" not in line


def test_what_was_found_stays_while_nothing_tells() -> None:
    """Half a minute at one speed holds neither braking nor gathering speed."""
    rover = Following(0.3, 0.7, 0.6, 1.5, 1.0)
    estimator = watched(rover, 30.0)
    found, lately = estimator.estimate.figures, Told()
    for tick in range(600):
        now_s = 100.0 + tick * TICK_S
        lately = after(lately, GuidedVelocity(1.0, 0.0), now_s)
        estimator.note(LocalView(Pose(0.0, 0.0, 0.0, now_s), 1.0, EVIDENCE, LIMITS, SETTINGS, 0.0, lately=lately))
    kept = estimator.estimate.figures
    assert found.deceleration_m_s2 == pytest.approx(0.6, rel=0.2)
    assert kept[1:4] == found[1:4]


@pytest.mark.parametrize("seed", range(4))
def test_turning_to_and_fro_tells_nothing_of_how_much_a_rover_turns(seed: int) -> None:
    """It obeys sooner than any dead time that is tried: the fit of such turns is anything from half to 1.5 times."""
    estimator = ModelEstimator(AS_SHIPPED._replace(turn_acceleration_rad_s2=20.0))
    lately, rng, seen_rad_s, told = Told(), np.random.default_rng(seed), 0.0, GuidedVelocity(0.3, 0.0)
    for tick in range(400):
        now_s = tick * TICK_S
        if tick % 2 == 0:
            seen_rad_s = told.yaw_rate_rad_s
        estimator.note(
            LocalView(Pose(0.0, 0.0, 0.0, now_s), 0.3, EVIDENCE, LIMITS, SETTINGS, seen_rad_s, lately=lately)
        )
        told = GuidedVelocity(0.3, float(rng.uniform(-1.5, 1.5)))
        lately = after(lately, told, now_s)
    assert estimator.estimate.figures.turn_gain == 1.0


def test_no_turn_rate_is_believed_to_change_faster_than_the_autopilot_may_let_it() -> None:
    """It slews the rate itself; a rover that only obeys sooner fits a faster change as well. Without a limit it may."""
    rovers = [AS_SHIPPED._replace(turn_acceleration_rad_s2=turns) for turns in (1.5, 6.0)]
    found = [watched(rover, 30.0, limited=True).estimate.figures for rover in rovers]
    most = AS_SHIPPED.turn_acceleration_rad_s2 * (1.0 + AS_SHIPPED.off_model)
    assert found[0].turn_acceleration_rad_s2 == pytest.approx(1.5, rel=0.2)
    assert found[1].turn_acceleration_rad_s2 == pytest.approx(most)
    assert watched(rovers[1], 30.0).estimate.figures.turn_acceleration_rad_s2 > 1.4 * most
    assert turns_are_limited(MotionSettings(), {"ATC_STR_ACC_MAX": 120.0})
    assert not any(turns_are_limited(MotionSettings(), {"ATC_STR_ACC_MAX": one}) for one in (0.0, 400.0))
    assert not turns_are_limited(MotionSettings(), {})
    assert turns_are_limited(MotionSettings(turn_acceleration_rad_s2=9.0), {})


@pytest.mark.thorough
def test_on_driven_rovers_off_their_model_the_figures_stay_near_the_true_ones() -> None:
    """Six drawn rovers through narrow rooms: the figures once the rover counts as known, against the true limits.

    The figures drive the model as the last seconds were driven, with one dead time for speed and turning, so they are
    not the limits themselves. Measured: acceleration 0.72 to 0.94 of the true one, braking 0.72 to 1.04, turn
    acceleration 0.85 to 1.30, turn rate 0.93 to 1.03 of what was told.
    """
    for seed in range(3):
        for off in (0.0, 0.3):
            _, limits = off_model(np.random.default_rng((seed, 52)), off)
            found = found_in_rooms(seed, off)
            assert found.acceleration_m_s2 == pytest.approx(limits["ATC_ACCEL_MAX"], rel=0.35)
            assert found.deceleration_m_s2 == pytest.approx(limits["ATC_DECEL_MAX"], rel=0.35)
            assert found.turn_acceleration_rad_s2 == pytest.approx(math.radians(limits["ATC_STR_ACC_MAX"]), rel=0.35)
            assert found.turn_gain == pytest.approx(1.0, abs=0.2)


def found_in_rooms(seed: int, off: float) -> Following:
    """The medians of what is found while the rover counts as known."""
    found: list[Following] = []

    class Watched(ModelEstimator):
        def note(self, view: LocalView) -> None:
            super().note(view)
            if self.estimate.known == 1.0:
                found.append(self.estimate.figures)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(mission_executor, "ModelEstimator", Watched)
        controllers.drive(controllers.GroundKind.ROOMS, "motion-ga", seed, off)
    return Following(*np.median(np.array(found), axis=0))
