"""Time, cost, faults and memory of every contestant on every case, measured in one process, one after the other."""

from __future__ import annotations

import gc
import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from companion.bench.cases import Case
from companion.bench.contestants import Contestant, Found
from companion.core.clock import stopwatch_s
from companion.core.grid import OBSTACLE
from companion.planning.problem import Budget, PlanningProblem
from companion.planning.raster import FAULTS, CellArray, PathFault, cells_cost, first_fault, plain
from companion.planning.registry import make_planner
from companion.settings import PlannerSettings

DETERMINISTIC_RUNS = 20
"""Searches whose result never varies are repeated only to measure their time."""


@dataclass(frozen=True, slots=True)
class Limits:
    """How much to measure. ``seeds``: of random planners.

    ``cell_s``: time for one contestant on one case, after which no new
    search is begun; a contestant whose next larger map would take longer than this for one search is not sent there.
    """

    seeds: int = 100
    first_seed: int = 0
    cell_s: float = 10.0


@dataclass(frozen=True, slots=True)
class Entry:
    """One contestant on one case.

    ``ratios``: cost of each path over the best possible; ``faults``: what is wrong with its paths.
    """

    contestant: str
    case: str
    scale: int
    runs: int
    found: int
    times_ms: tuple[float, ...]
    ratios: tuple[float, ...]
    faults: tuple[PathFault, ...]
    memory_mb: float | None

    @property
    def median_ms(self) -> float:
        """Median time of a search, found or not."""
        return float(np.median(self.times_ms))

    @property
    def p99_ms(self) -> float:
        """99 % of the searches took no longer."""
        return float(np.percentile(self.times_ms, 99))

    @property
    def ratio(self) -> float | None:
        """Median cost of the paths found over the best possible."""
        return float(np.median(self.ratios)) if self.ratios else None


Advance = Callable[[str, int, int], None]
"""Called with what is measured now, how much is done and how much there is."""


def measure(contestants: list[Contestant], cases: list[Case], limits: Limits, advance: Advance) -> list[Entry]:
    """All entries, without those that would take too long or too much memory."""
    entries: list[Entry] = []
    for number, case in enumerate(cases):
        optima = [_optimum(case, at) for at in range(len(case.ends))]
        for at, contestant in enumerate(contestants):
            advance(
                f"{case.name} x{case.scale} {contestant.name}",
                number * len(contestants) + at,
                len(cases) * len(contestants),
            )
            if case.fields <= contestant.most_fields and _expected_s(entries, contestant, case) <= limits.cell_s:
                entries.append(_entry(contestant, case, optima, limits))
    advance("done", 1, 1)
    return entries


def _expected_s(entries: list[Entry], contestant: Contestant, case: Case) -> float:
    """An estimate from the next smaller size of the same map: most times grow at least with the number of fields."""
    before = [e for e in entries if (e.contestant, e.case) == (contestant.name, case.name) and e.scale < case.scale]
    return before[-1].median_ms / 1e3 * (case.scale / before[-1].scale) ** 2 if before else 0.0


def _optimum(case: Case, at: int) -> float:
    """The least cost of a problem; inf if it has no path."""
    start, target = case.ends[at]
    dijkstra = make_planner("dijkstra", PlannerSettings())
    path = dijkstra.plan(PlanningProblem(case.weights, start, target), Budget(), np.random.default_rng(0)).path
    return np.inf if path is None else path.cost


def _entry(contestant: Contestant, case: Case, optima: list[float], limits: Limits) -> Entry:
    runs = max(limits.seeds if contestant.random else DETERMINISTIC_RUNS, len(case.ends))
    order = spread_order(len(case.ends))
    times_ms: list[float] = []
    ratios: list[float] = []
    faults: set[PathFault] = set()
    memory_mb, found = _with_memory(
        contestant, case, limits.first_seed
    )  # and what it loads the first time is loaded now
    gc.collect()
    gc.disable()
    began_s = stopwatch_s()
    try:
        while len(times_ms) < runs and (not times_ms or stopwatch_s() - began_s < limits.cell_s):
            at = order[len(times_ms) % len(order)]
            rng = np.random.default_rng(limits.first_seed + len(times_ms))
            before_s = stopwatch_s()
            found = contestant.solve(case.weights, *case.ends[at], rng)
            times_ms.append(1e3 * (stopwatch_s() - before_s))
            if found is not None:
                cells = np.ascontiguousarray(found(), np.int64)
                faults |= _faults(case, cells, case.ends[at])
                ratios.append(cells_cost(case.weights, cells) / optima[at] if optima[at] else 1.0)
    finally:
        gc.enable()
    return Entry(
        contestant.name,
        case.name,
        case.scale,
        len(times_ms),
        len(ratios),
        tuple(times_ms),
        tuple(ratios),
        tuple(sorted(faults)),
        memory_mb,
    )


def spread_order(count: int) -> list[int]:
    """An order of the problems that mixes easy and hard ones, so that a run that is stopped early has met both."""
    step = next(n for n in range(max(round(0.618 * count), 1), count + 2) if math.gcd(n, count) == 1)
    return [at * step % count for at in range(count)]


def _faults(case: Case, cells: CellArray, ends: tuple[tuple[int, int], tuple[int, int]]) -> set[PathFault]:
    """What is wrong with a path by our own rules."""
    number, _ = first_fault(plain(case.weights), cells, corner_cutting=False)
    if tuple(cells[0]) != tuple(ends[0]) or tuple(cells[-1]) != tuple(ends[1]):
        return {PathFault.WRONG_ENDS}
    if FAULTS[number] is PathFault.CORNER_CUT and (case.weights[cells[:, 1], cells[:, 0]] >= OBSTACLE).any():
        return {PathFault.CORNER_CUT, PathFault.OBSTACLE}
    return {FAULTS[number]} - {PathFault.NONE}


# --- memory ----------------------------------------------------------------------------------------------------------


def _with_memory(contestant: Contestant, case: Case, seed: int) -> tuple[float | None, Found]:
    """One search, and by how much the process grew at its peak, MB; None where the system does not say."""
    before = _peak_kb(reset=True)
    found = contestant.solve(case.weights, *case.ends[0], np.random.default_rng(seed))
    after = _peak_kb(reset=False)
    return (None if before is None or after is None else max(after - before, 0) / 1024.0), found


def _peak_kb(*, reset: bool) -> int | None:
    """The largest size of this process since the last reset (Linux counts it)."""
    try:
        if reset:
            Path("/proc/self/clear_refs").write_text("5", encoding="ascii")
        lines = Path("/proc/self/status").read_text(encoding="ascii").splitlines()
    except OSError:
        return None
    return next((int(line.split()[1]) for line in lines if line.startswith("VmHWM")), None)
