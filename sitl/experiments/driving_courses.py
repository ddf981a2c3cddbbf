"""What the experiment ``driving`` drives, with the map unknown or known.

Nouns: course.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from companion.app import Status
from companion.executive.mission_progress import TargetStatus
from companion.mapping.evidence_map import EvidenceMap
from companion.mapping.map_edits import restore
from companion.mission.mission import Mission
from companion.recording.recorder import NullRecorder
from sitl.experiments.controllers import mission_on, scenario_on
from sitl.experiments.experiment import POINTS
from sitl.experiments.navigation import settings_with
from sitl.experiments.time_bound import UNKNOWN_S, time_bound_s
from sitl.generators.made_ground import made
from sitl.lockstep import Drive, DriveOutcome, Report
from sitl.scenario import scenario_from_mission, steered
from sitl.world.truth import SimStart
from sitl.world.world import World

TIME_LIMIT_S = 1800.0
TELL_S = 0.1
"""So soon after its beginning a map is told."""
ON_EDGE = 1e-6
"""Fields that touch a cell by less than this share do not lie in it."""


@dataclass(frozen=True, slots=True)
class CourseDrive:
    """One drive. ``bound_s``: see ``time_bound_s``; None: not asked for, or there is none."""

    report: Report
    bound_s: float | None = None

    @property
    def reached(self) -> bool:
        """Whether all targets were."""
        ended = self.report.outcome in (DriveOutcome.REACHED, DriveOutcome.COLLISION)
        return ended and all(status is TargetStatus.REACHED for _, status in self.report.targets)


def drive(
    course: Mission | str, planner: str, seed: int, known: bool = False, turning_radius_m: float = 0.0
) -> CourseDrive:
    """One drive in lock-step. ``course``: a mission, or a kind of ground, of which each seed draws another one.

    ``known``: the companion has the true map from the start; ``bound_s`` is worked out. ``turning_radius_m``: on
    generated ground, of a rover with steered wheels; 0: it turns on the spot.
    """
    if isinstance(course, Mission):
        mission, scenario = course, scenario_from_mission(course)
    else:
        ground = made(course, seed)
        mission = mission_on(ground, POINTS, seed)
        mission = replace(mission, rover=replace(mission.rover, turning_radius_m=turning_radius_m))
        scenario = steered(scenario_on(ground, mission.rover, POINTS), turning_radius_m)
    run = Drive(mission, scenario, settings_with(planner), seed, NullRecorder(), TIME_LIMIT_S)
    told = _ToldMap(run) if known else None
    report = run.run() if told is None else run.run(told.observe, TELL_S)
    report.track.clear()
    executor = run.companion.executor
    bound_s = time_bound_s(mission, scenario, executor) if known and executor is not None else UNKNOWN_S
    return CourseDrive(report, None if bound_s == UNKNOWN_S else bound_s)


class _ToldMap:
    """Tells the companion the true world once its map begins, as if it had seen all of it many times."""

    def __init__(self, run: Drive) -> None:
        self._run = run
        self._evidence: EvidenceMap | None = None

    def observe(self, status: Status) -> None:
        """To be called now and then. Tells each new map once."""
        executor = self._run.companion.mission_run.executor
        if executor is not None and executor.evidence is not self._evidence:
            self._evidence = executor.evidence
            tell(self._evidence, self._run.scenario.world, self._run.scenario.start)


def tell(evidence: EvidenceMap, world: World, start: SimStart) -> None:
    """Tell a map the true world; beyond it nothing is known. The map's frame has its zero where the rover starts."""
    corner, size_m = evidence.base.south_west, evidence.evidence_m
    rows, columns = evidence.log_odds.shape
    solid = world.layers().solid.fields
    on_south = _fields_in(start.north_m + corner.north_m - world.south_m, size_m, rows, world.resolution_m)
    on_west = _fields_in(start.east_m + corner.east_m - world.west_m, size_m, columns, world.resolution_m)
    known, found = _any_in(np.ones_like(solid), on_south, on_west), _any_in(solid, on_south, on_west)
    settings = evidence.settings
    log_odds = np.where(found, settings.limit, np.where(known, -settings.free_limit, 0.0)).astype(np.float32)
    restore(evidence, log_odds, np.zeros_like(evidence.penalty))


def _fields_in(edge_m: float, size_m: float, count: int, field_m: float) -> NDArray[np.int64]:
    """For each of ``count`` cells in a row the first field that lies in it, and the first behind it; shape (2, n)."""
    edges = (edge_m + np.arange(count + 1) * size_m) / field_m
    return np.array((np.floor(edges[:-1] + ON_EDGE), np.ceil(edges[1:] - ON_EDGE))).astype(np.int64)


def _any_in(fields: NDArray[np.bool_], rows: NDArray[np.int64], columns: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Whether any field in each cell is set; ``rows``, ``columns``: as ``_fields_in`` gives them."""
    sums = np.zeros((fields.shape[0] + 1, fields.shape[1] + 1), np.int64)
    sums[1:, 1:] = fields.cumsum(axis=0).cumsum(axis=1)
    low, high = np.clip(rows, 0, fields.shape[0])
    left, right = np.clip(columns, 0, fields.shape[1])
    counts = sums[np.ix_(high, right)] - sums[np.ix_(low, right)] - sums[np.ix_(high, left)] + sums[np.ix_(low, left)]
    found: NDArray[np.bool_] = counts > 0
    return found
