"""One main loop of motion control: from the present task to motor outputs (compiled)."""

from __future__ import annotations

from typing import Any

from numba import njit

from sitl.autopilot.control.attitude_control import run_stop
from sitl.autopilot.control.circle import begin_circle, run_circle
from sitl.autopilot.control.guided import begin_guided, begin_target, run_heading_or_rate, run_waypoint
from sitl.autopilot.control.motors import run_motors
from sitl.autopilot.control.records import CIRCLE, COAST, HEADING, LEG, TURN_RATE, WAYPOINT, MotionRecords
from sitl.autopilot.control.wp_nav import begin_leg, run_leg


@njit(cache=True, nogil=True)
def run_task(control: Any, tuning: Any, estimate: Any) -> None:
    """Run the present task for one main loop and set the motor outputs."""
    if control.task == LEG:
        run_leg(control, tuning, estimate)
    elif control.task == CIRCLE:
        run_circle(control, tuning, estimate)
    elif control.task == WAYPOINT and not control.reached:
        run_waypoint(control, tuning, estimate)
    elif control.task in (HEADING, TURN_RATE):
        run_heading_or_rate(control, tuning, estimate)
    elif control.task == COAST:
        control.throttle, control.steering = control.stick_throttle, control.stick_steering
    else:
        if control.task == WAYPOINT and control.fresh_target:
            control.fresh_target = 0
            control.arrived = 1
        run_stop(control, tuning, estimate)
        control.steering = 0.0
    run_motors(control, tuning, estimate)


def compile_begins(records: MotionRecords) -> None:
    """Begin each kind of task once, on copies of the records, so that no client waits for a compiler later."""
    estimate, control, tuning = (record.copy()[0] for record in records)
    begin_guided(control, tuning)
    begin_target(control, tuning, estimate, 1.0, 0.0)
    begin_leg(control, tuning, estimate, (1.0, 0.0), (0.0, 0.0), False)
    begin_circle(control, estimate, 1.0, 0.0, 1.0)
