"""Compiles the kernels before their first use, in a process for each processor: ``python -m sitl.cli.compile [--all]``.

Without ``--all`` only those for a drive with the default settings. Kernels in the cache are loaded, not compiled.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
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


def vertex_planners() -> None:
    """The genetic planners that move vertices."""
    _planners("vertex", "vertex++")


def other_planners() -> None:
    """The other planners of the papers, and the graph searches that no drive uses by default."""
    _planners("sedighi", "geisler", "hermanu", "achour", "prm", "dstar-lite", "dijkstra")


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


def motions() -> None:
    """Guidance that plans motions."""
    from companion.executive.warm_up import warm_up
    from companion.settings import Settings

    for kind in ("motion-ga", "dwa", "mppi"):
        warm_up(Settings.model_validate({"guidance": {"controller": kind}}))


def physics() -> None:
    """The world behind the real firmware."""
    from companion.mission.mission import Mission
    from sitl.scenario import scenario_from_mission

    scenario_from_mission(Mission("", ())).physics(0, linked=False).rehearse()


FOR_A_DRIVE: Sequence[Job] = (genetic_planner, simulator, graph_searches, drive)
FOR_ALL: Sequence[Job] = (
    genetic_planner,
    vertex_planners,
    simulator,
    graph_searches,
    other_planners,
    drive,
    physics,
    manoeuvres,
    motions,
)
"""Those that take longest and that others wait for come first."""

AFTER: Mapping[Job, Sequence[Job]] = {
    other_planners: (graph_searches,),
    drive: (genetic_planner, graph_searches),
    physics: (simulator,),
    manoeuvres: (drive,),
    motions: (drive,),
}
"""Jobs that use the kernels of others. Side by side, both would compile them."""


def main() -> None:
    """Run all jobs, with a line for each."""
    waiting = list(FOR_ALL if "--all" in sys.argv[1:] else FOR_A_DRIVE)
    kernel_cache.use_cache(os.environ)
    count, since_s = len(waiting), stopwatch_s()
    done: set[Job] = set()
    running: dict[Future[None], Job] = {}
    with ProcessPoolExecutor(os.cpu_count(), get_context("spawn")) as pool:
        while len(done) < count:
            for job in [job for job in waiting if done.issuperset(AFTER.get(job, ()))]:
                waiting.remove(job)
                running[pool.submit(job)] = job
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                future.result()
                job = running.pop(future)
                done.add(job)
                name = job.__name__.replace("_", " ")
                print(f"  compiled {len(done)} of {count}: {name} ({stopwatch_s() - since_s:.0f} s)", flush=True)


def _planners(*names: str) -> None:
    from companion.planning import registry

    registry.warm_up(names)


if __name__ == "__main__":
    main()
