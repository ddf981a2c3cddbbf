"""Compiled: what the motion controllers do in one main loop, by task."""

from __future__ import annotations

from typing import Any

from numba import njit

from sitl.autopilot.circle import run_circle
from sitl.autopilot.control import CIRCLE, LEG
from sitl.autopilot.guided import run_control
from sitl.autopilot.legs import run_leg
from sitl.autopilot.motors import run_motors


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
