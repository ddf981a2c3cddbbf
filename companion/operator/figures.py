"""A few figures for ground stations to plot (NAMED_VALUE_FLOAT).

Nouns: telemetry.
"""

from __future__ import annotations

import math

from companion.executive.mission_executor import MissionExecutor
from companion.navigation.field_step import Decision, Part
from companion.planning.problem import path_cost
from companion.vehicle.commands import Command, NamedValue

PARTS = {Part.RETURN: 1.0, Part.EXPLORE: 2.0, Part.SEARCH: 3.0}
"""The parts A, B and C of the step function."""


class Telemetry:
    """Says them ``rate_hz`` times a second, all at once; 0: never."""

    def __init__(self, rate_hz: float) -> None:
        self._period_s = 1.0 / rate_hz if rate_hz > 0.0 else math.inf
        self._told_s = -math.inf

    def due(self, executor: MissionExecutor | None, now_s: float) -> list[Command]:
        """The figures to send now; none before the mission has begun."""
        if executor is None or self._period_s == math.inf or now_s - self._told_s < self._period_s - 1e-6:
            return []
        self._told_s = now_s
        return [NamedValue(name, value) for name, value in figures(executor).items()]


def figures(executor: MissionExecutor) -> dict[str, float]:
    """NAV_PART: 1 A (return), 2 B, 3 C, 0 none yet. PATH_COST: of the path decided on, -1 for none.

    SEARCH_MS: the last step with its searches, in whole ticks.

    PROGRESS: targets reached, of all, in percent.
    """
    decision: Decision | None = executor.driver.decision
    weights = executor.evidence.grid.weights
    return {
        "NAV_PART": 0.0 if decision is None else PARTS[decision.part],
        "PATH_COST": path_cost(weights, decision.path) if decision is not None and decision.path else -1.0,
        "SEARCH_MS": 1e3 * executor.driver.step_s,
        "PROGRESS": 100.0 * executor.reached / len(executor.progress.targets),
    }
