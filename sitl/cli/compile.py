"""Compiles the kernels before their first use, in a process for each processor: ``python -m sitl.cli.compile [--all]``.

Without ``--all`` only those for a drive with the default settings. Kernels in the cache are loaded, not compiled.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context

from companion.cli import kernel_cache
from companion.core.clock import stopwatch_s

Job = Callable[[], None]


def genetic_planner() -> None:
    """The B-spline planner: half of the time."""
    _planners("bspline-ga")


def graph_searches() -> None:
    """The planners that the default planner falls back to."""
    _planners("astar", "theta-star")


def other_planners() -> None:
    """Those of the papers, and the other graph searches."""
    _planners("sedighi", "geisler", "hermanu", "vertex", "vertex++", "achour", "prm", "dstar-lite", "dijkstra")


def simulator() -> None:
    """Autopilot, rover and sensors."""
    from companion.mission.mission import Mission
    from sitl.scenario import scenario_from_mission

    scenario_from_mission(Mission("", ())).simulator(0).rehearse()


def drive() -> None:
    """Maps and guidance, and what combines the planners."""
    from companion.executive.warm_up import warm_up
    from companion.settings import Settings

    warm_up(Settings())


def manoeuvres() -> None:
    """Guidance of rovers that cannot turn on the spot."""
    from companion.executive.warm_up import warm_up
    from companion.settings import Settings

    warm_up(Settings(), turning_radius_m=1.0)


def physics() -> None:
    """The world behind the real firmware."""
    from companion.mission.mission import Mission
    from sitl.scenario import scenario_from_mission

    scenario_from_mission(Mission("", ())).physics(0, scans=False).rehearse()


FOR_A_DRIVE: tuple[Sequence[Job], ...] = ((genetic_planner, simulator, graph_searches), (drive,))
FOR_ALL: tuple[Sequence[Job], ...] = (
    (genetic_planner, simulator, other_planners, graph_searches),
    (drive, physics),
    (manoeuvres,),
)
"""Jobs of a group share few kernels and run side by side; a group uses the kernels of those before it."""


def main() -> None:
    """Run all jobs, with a line for each."""
    groups = FOR_ALL if "--all" in sys.argv[1:] else FOR_A_DRIVE
    kernel_cache.use_cache(os.environ)
    count, done, since_s = sum(map(len, groups)), 0, stopwatch_s()
    with ProcessPoolExecutor(os.cpu_count(), get_context("spawn")) as pool:
        for group in groups:
            running = {pool.submit(job): job.__name__ for job in group}
            for future in as_completed(running):
                future.result()
                done += 1
                name = running[future].replace("_", " ")
                print(f"  compiled {done} of {count}: {name} ({stopwatch_s() - since_s:.0f} s)", flush=True)


def _planners(*names: str) -> None:
    from companion.planning import registry

    registry.warm_up(names)


if __name__ == "__main__":
    main()
