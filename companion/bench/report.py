"""The figures as tables for people and as data."""

from __future__ import annotations

import importlib.metadata
import platform
from dataclasses import asdict
from os import cpu_count

from companion.bench.cases import Case
from companion.bench.contestants import Contestant
from companion.bench.measure import DETERMINISTIC_RUNS, Entry, Limits
from companion.planning.raster import PathFault
from companion.settings import Settings
from companion.settings.versions import made_with

REMARKS = {PathFault.CORNER_CUT: "cuts corners", PathFault.OBSTACLE: "touches obstacles"}
"""Other words for a fault, where there are some."""
PACKAGES = (
    "rover-companion",
    "numpy",
    "numba",
    "scipy",
    "scikit-image",
    "tcod",
    "nano-astar",
    "pyastar2d",
    "pathfinding",
    "pathplanning",
    "networkx",
    "ompl",
)


def where() -> str:
    """The computer and the versions that the times depend on."""
    versions = ", ".join(f"{name} {version}" for name in PACKAGES if (version := _version(name)))
    return f"{platform.machine()}, {cpu_count()} processors, Python {platform.python_version()}; {versions}"


def _version(package: str) -> str:
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return ""


def runs_explained(limits: Limits) -> list[str]:
    """How many searches a row consists of, and what a search without a path means; lines, column names in asterisks."""
    last = limits.first_seed + limits.seeds - 1
    return [
        "*found* counts the searches that gave a path, of all that were made:",
        f"{limits.seeds} with seeds {limits.first_seed} to {last} of planners that draw random numbers, "
        f"{DETERMINISTIC_RUNS} of others, whose path is always the same, and one a problem where a map has more "
        "problems than that;",
        f"fewer where {limits.cell_s:g} s were over. Times are of all searches, costs of those that gave a path.",
        "A random planner but `hybrid` that finds none has spent its budget (`plan` says so), which proves nothing:",
        "`bspline-ga` after its epochs, `prm` when the samples of all its rounds do not join start and target. Our",
        "graph searches and `hybrid` end with a path or with the proof that there is none.",
    ]


def short(value: float) -> str:
    """Two significant figures, no exponent."""
    return f"{float(f'{value:.2g}'):g}" if value < 1e5 else f"{value:.0f}"


def head(scales: list[int]) -> list[str]:
    """Column names of ``rows``."""
    times = [f"{f'x{scale} ' if len(scales) > 1 else ''}ms (p99)" for scale in scales]
    return ["planner", *times, "cost / best", "found", "MB", "remarks"]


def rows(entries: list[Entry], contestants: list[Contestant], case: str, scales: list[int]) -> list[list[str]]:
    """One row for each contestant that was measured on this map, fastest at the smallest size first."""
    table = []
    for contestant in contestants:
        own = {e.scale: e for e in entries if (e.contestant, e.case) == (contestant.name, case)}
        if not own:
            continue
        shown = [own.get(scale) for scale in scales]
        times = [f"{short(e.median_ms)} ({short(e.p99_ms)})" if e else "-" for e in shown]
        ratios = " ".join("-" if e is None else "none" if e.ratio is None else f"{e.ratio:.3f}" for e in shown)
        found = " ".join(f"{e.found}/{e.runs}" if e else "-" for e in shown)
        memory = " ".join("-" if e is None or e.memory_mb is None else f"{e.memory_mb:.0f}" for e in shown)
        faults = sorted({REMARKS.get(fault, fault.value) for e in own.values() for fault in e.faults})
        remarks = "; ".join(([contestant.note] if contestant.note else []) + faults)
        first = next(e for e in shown if e)
        table.append((first.scale, first.median_ms, [contestant.name, *times, ratios, found, memory, remarks]))
    return [row for _, _, row in sorted(table, key=lambda entry: entry[:2])]


def as_json(entries: list[Entry], cases: list[Case], limits: Limits, settings: Settings) -> dict[str, object]:
    """Everything measured, and what it was measured with."""
    maps = [
        {"name": case.name, "scale": case.scale, "fields": case.fields, "problems": len(case.ends)} for case in cases
    ]
    return {
        "where": where(),
        "limits": asdict(limits),
        **made_with(settings),
        "maps": maps,
        "entries": [asdict(entry) for entry in entries],
    }
