"""Runs the simulator in real time, or a multiple of it, for the clients at its endpoints."""

from __future__ import annotations

import select
from collections.abc import Callable

from sitl.network import Endpoint
from sitl.network.event_log import EventLog
from sitl.simulator import Simulator

STEP_S = 0.02
LATE_S = 1.0
"""A delay beyond this is dropped when the machine cannot keep up."""


def serve(
    simulator: Simulator,
    endpoints: list[Endpoint],
    now_s: Callable[[], float],
    speedup: float,
    running: Callable[[], bool],
    log: EventLog | None = None,
    observe: Callable[[], None] = lambda: None,
) -> None:
    """Run the simulator ``speedup`` times as fast as ``now_s`` (real seconds) until ``running`` returns False.

    ``log`` reports events; ``observe`` is called in every round, and must not take long.
    """
    log = log or EventLog()
    began_s = now_s() - simulator.time_s / speedup
    while running():
        _exchange(simulator, endpoints, now_s())
        goal_s = (now_s() - began_s) * speedup
        late_s = goal_s - simulator.time_s
        if late_s > LATE_S * max(speedup, 1.0):
            began_s += late_s / speedup
            goal_s = simulator.time_s + STEP_S
            for lidar in simulator.lidars:
                lidar.clock_ahead_s += late_s
        simulator.advance_to_s(goal_s)
        _exchange(simulator, endpoints, now_s())
        log.look(simulator)
        observe()
        wait_s = (simulator.time_s + STEP_S) / speedup + began_s - now_s()
        if wait_s > 0.0:
            select.select([one for endpoint in endpoints for one in endpoint.descriptors()], [], [], wait_s)


def _exchange(simulator: Simulator, endpoints: list[Endpoint], now_s: float) -> None:
    for endpoint in endpoints:
        endpoint.exchange(simulator, now_s)
