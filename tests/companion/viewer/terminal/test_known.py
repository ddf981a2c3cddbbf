"""The companion's map as layers."""

import numpy as np
import pytest

from companion.core.frames import NedPoint
from companion.core.grid import Cell, empty_grid
from companion.mapping.evidence_map import new_map
from companion.mission.mission import OnBlocked
from companion.settings import Settings
from companion.viewer.terminal.known import REACH_M, known_layers, target_places
from companion.viewer.terminal.sketch import PlaceState
from tests.companion.executive.test_mission_progress import blocked, progress


@pytest.mark.parametrize("corner", [NedPoint(0.0, 0.0), NedPoint(-40.0, 17.5)])
def test_of_a_large_map_the_part_round_a_place_is_the_same_as_in_the_whole(corner: NedPoint) -> None:
    evidence = new_map(empty_grid(900, 700, 1.0, corner), 0.3, Settings().mapping)
    place = evidence.base.centre_of(Cell(880, 20))
    s = evidence.subdivisions
    evidence.log_odds[20 * s : 25 * s, 870 * s : 873 * s] = 4.0
    evidence.base.weights[100, 700] = 1.0
    for whole, part in zip(known_layers(evidence), known_layers(evidence, around=place), strict=True):
        assert part.where.any() and part.where.size < 0.5 * whole.where.size
        assert part.kind is whole.kind and part.resolution_m == whole.resolution_m
        rows, columns = (np.flatnonzero(part.where.any(axis=axis)) * part.resolution_m for axis in (1, 0))
        all_rows, all_columns = (np.flatnonzero(whole.where.any(axis=axis)) * whole.resolution_m for axis in (1, 0))
        assert part.south_m + rows == pytest.approx(whole.south_m + all_rows)
        assert part.west_m + columns == pytest.approx(whole.west_m + all_columns)
        assert part.where.shape[1] * part.resolution_m == pytest.approx(REACH_M + 20.0, abs=1.5)


def test_off_the_map_there_is_nothing() -> None:
    evidence = new_map(empty_grid(10, 10), 0.3, Settings().mapping)
    assert all(layer.where.size == 0 for layer in known_layers(evidence, around=NedPoint(5000.0, 0.0)))


def test_a_target_that_is_tried_again_is_not_drawn_as_lost_until_the_run_has_ended() -> None:
    waits, skips = blocked(progress(OnBlocked.WAIT)), blocked(progress(OnBlocked.SKIP))
    assert target_places(waits)[0].state is PlaceState.PENDING
    assert target_places(waits, ended=True)[0].state is target_places(skips)[0].state is PlaceState.LOST
