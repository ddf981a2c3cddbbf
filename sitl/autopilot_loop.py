"""Compiled: what the motion controllers do in one main loop, by task."""

from __future__ import annotations

from typing import Any

from numba import njit

from sitl.autopilot_circle import run_circle
from sitl.autopilot_guided import run_control
from sitl.autopilot_legs import run_leg
from sitl.autopilot_motors import run_motors
from sitl.control import CIRCLE, LEG


@njit(cache=True, nogil=True)
def run_tasks(control: Any, tuning: Any, estimate: Any) -> None:
    """One main loop: from the task to motor outputs."""
    if control.task == LEG:
        run_leg(control, tuning, estimate)
        run_motors(control, tuning, estimate)
    elif control.task == CIRCLE:
        run_circle(control, tuning, estimate)
        run_motors(control, tuning, estimate)
    else:
        run_control(control, tuning, estimate)
