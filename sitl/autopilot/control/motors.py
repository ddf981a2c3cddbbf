"""Motor outputs: throttle and steering become the plant's two servo outputs (behaviour of AP_MotorsUGV; compiled).

Nouns: AP_MotorsUGV.
"""

from __future__ import annotations

import math
from typing import Any

from numba import njit

from sitl.autopilot.control.attitude_control import forward_speed
from sitl.autopilot.control.records import COAST, LOOP_S
from sitl.autopilot.control.servo_outputs import GROUND_STEERING, THROTTLE, THROTTLE_LEFT, THROTTLE_RIGHT
from sitl.autopilot.control.shaping import limited

EVEN_MIX = 0.5
"""MOT_STR_THR_MIX at which throttle and steering are reduced equally when both do not fit."""


@njit(cache=True, nogil=True)
def has_steered_wheels(tuning: Any) -> bool:
    """Whether the rover cannot turn on the spot, because not both skid motors have an output."""
    return bool(tuning.skids == 0.0)


@njit(cache=True, nogil=True)
def thrust(output: float, tuning: Any) -> float:
    """The output of a motor: at least MOT_THR_MIN once it turns, shaped by MOT_THST_EXPO."""
    if output == 0.0:
        return output
    if tuning.throttle_min > 0.0:
        output = math.copysign(tuning.throttle_min, output) + output * (1.0 - tuning.throttle_min)
    expo = tuning.thrust_expo
    if expo == 0.0 or abs(expo) > 1.0:
        return output
    bent = (expo - 1.0 + math.sqrt((1.0 - expo) ** 2 + 4.0 * expo * min(abs(output), 1.0))) / (2.0 * expo)
    return math.copysign(bent, output)


@njit(cache=True, nogil=True)
def mixed(throttle: float, steering: float, mix: float, asymmetry: float) -> tuple[float, float]:
    """Throttle and steering that fit together on two motors that are ``asymmetry`` times weaker in reverse.

    ``mix`` (MOT_STR_THR_MIX): from 0, throttle has priority, to 1, steering has.
    """
    lowest = -1.0 / asymmetry
    middle = 0.5 * (1.0 + lowest)
    room = max(throttle, 0.0) - lowest if throttle < middle else 1.0 - middle
    steering, throttle = limited(steering, room), min(max(throttle, lowest), 1.0)
    excess = max(throttle + abs(steering), (throttle - abs(steering)) / lowest)
    if excess <= 1.0:
        return throttle, steering
    fair = 1.0 / excess
    high = throttle >= middle
    if mix >= EVEN_MIX:
        steering *= fair + (1.0 - fair) * (mix - EVEN_MIX) / EVEN_MIX
        return (1.0 - abs(steering) if high else abs(steering) + lowest), steering
    throttle *= fair + (1.0 - fair) * (EVEN_MIX - mix) / EVEN_MIX
    left = 1.0 - throttle if high else throttle - lowest
    return throttle, math.copysign(left, steering)


@njit(cache=True, nogil=True)
def run_skid(control: Any, tuning: Any, throttle: float, steering: float) -> tuple[float, float]:
    """Outputs of the left and right motor; together they are scaled down to fit."""
    total = abs(throttle) + abs(steering)
    asymmetry, mix = max(tuning.asymmetry, 1.0), min(max(tuning.mix, 0.0), 1.0)
    if asymmetry == 1.0 and mix == EVEN_MIX:
        scale = 1.0 / total if total > 1.0 else 1.0
        less_throttle = less_steering = scale < 1.0
        left, right = scale * (throttle + steering), scale * (throttle - steering)
    else:
        fit_throttle, fit_steering = mixed(throttle, steering, mix, asymmetry)
        less_throttle, less_steering = abs(fit_throttle) < abs(throttle), abs(fit_steering) < abs(steering)
        left, right = fit_throttle + fit_steering, fit_throttle - fit_steering
        left, right = left * asymmetry if left < 0.0 else left, right * asymmetry if right < 0.0 else right
    control.left_limited = 1 if steering < 0.0 and (less_steering or steering <= -1.0) else 0
    control.right_limited = 1 if steering > 0.0 and (less_steering or steering >= 1.0) else 0
    control.throttle_limited = 1 if less_throttle or abs(throttle) >= tuning.throttle_max else 0
    return thrust(left, tuning), thrust(right, tuning)


@njit(cache=True, nogil=True)
def run_wheels(control: Any, tuning: Any, speed: float, throttle: float, steering: float) -> float:
    """Steering output of steered wheels: scaled down with speed, and reversed when the rover rolls backwards.

    Up to MOT_SPD_SCA_BASE it is not scaled and counts as limited, so that the integral does not wind up.
    """
    fast = tuning.steering_base_m_s > 0.0 and abs(speed) > tuning.steering_base_m_s
    control.left_limited = 1 if not fast or steering <= -1.0 else 0
    control.right_limited = 1 if not fast or steering >= 1.0 else 0
    control.throttle_limited = 1 if abs(throttle) >= tuning.throttle_max else 0
    if fast:
        steering *= tuning.steering_base_m_s / abs(speed)
    return -steering if speed < 0.0 else steering


@njit(cache=True, nogil=True)
def routed(function: float, left: float, right: float, throttle: float, steering: float) -> float:
    """The value of an output with this SERVOn_FUNCTION."""
    if function == THROTTLE_LEFT:
        return left
    if function == THROTTLE_RIGHT:
        return right
    if function == THROTTLE:
        return throttle
    return steering if function == GROUND_STEERING else 0.0


@njit(cache=True, nogil=True)
def run_motors(control: Any, tuning: Any, estimate: Any) -> None:
    """Set the outputs 1 and 3 from throttle and steering."""
    throttle = limited(control.throttle, tuning.throttle_max)
    if tuning.slew_rate > 0.0:
        change = tuning.slew_rate * LOOP_S * 0.01
        throttle = control.throttle_before + limited(throttle - control.throttle_before, change)
    steering = limited(control.steering, 1.0)
    if not control.armed:
        control.servo_1 = control.servo_3 = control.throttle_before = 0.0
        control.left_limited = control.right_limited = control.throttle_limited = 1
        return
    control.throttle_before = throttle
    left = right = 0.0
    if has_steered_wheels(tuning):
        # In MANUAL nothing is scaled; the sign of the throttle then gives the direction.
        speed = forward_speed(estimate) if control.task != COAST else 0.0 if throttle >= 0.0 else -1e-9
        steering = run_wheels(control, tuning, speed, throttle, steering)
    else:
        left, right = run_skid(control, tuning, throttle, steering)
    throttle = thrust(throttle, tuning)
    control.servo_1 = tuning.servo_1_sign * routed(tuning.servo_1, left, right, throttle, steering)
    control.servo_3 = tuning.servo_3_sign * routed(tuning.servo_3, left, right, throttle, steering)
