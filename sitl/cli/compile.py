"""Compiles the kernels of both programs before their first use: ``python -m sitl.cli.compile [--all]``.

Without ``--all`` only those for a drive with the default settings. Kernels in the cache are loaded, not compiled.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping, Sequence

from companion.cli import compile as companions
from companion.cli import kernel_cache
from companion.cli.compile import Job, drive, genetic_planner, graph_searches, lines_of, manoeuvres, motions


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


def physics() -> None:
    """The world behind the real firmware."""
    from companion.mission.mission import Mission
    from sitl.scenario import scenario_from_mission

    scenario_from_mission(Mission("", ())).physics(0, linked=False).rehearse()


FOR_A_DRIVE: Sequence[Job] = (genetic_planner, graph_searches, simulator, drive)
FOR_ALL: Sequence[Job] = (
    genetic_planner,
    graph_searches,
    simulator,
    drive,
    motions,
    vertex_planners,
    other_planners,
    manoeuvres,
    physics,
)
"""Those that others wait for and that take longest come first."""

AFTER: Mapping[Job, Sequence[Job]] = {
    **companions.AFTER,
    other_planners: (graph_searches,),
    physics: (simulator,),
}
"""Jobs that use the kernels of others. Side by side, both would compile them."""


def main() -> None:
    """Run all jobs, with a line for each."""
    kernel_cache.use_cache(os.environ)
    for line in lines_of(FOR_ALL if "--all" in sys.argv[1:] else FOR_A_DRIVE, AFTER):
        print(line, flush=True)


def _planners(*names: str) -> None:
    from companion.planning import registry

    registry.warm_up(names)


if __name__ == "__main__":
    main()
