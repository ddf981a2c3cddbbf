"""What of the map is told to a viewer, and that a viewer has the map as it is."""

from __future__ import annotations

import math
from random import Random

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from companion.core.frames import NedPoint
from companion.core.grid import empty_grid
from companion.mapping.evidence_map import EvidenceMap, new_map
from companion.mapping.map_edits import forget
from companion.settings import Settings
from companion.viewer.map_tiles import (
    GLANCES_A_SECOND,
    IN_TURN_A_SECOND,
    NEAR_A_SECOND,
    TILE,
    TOLD_A_SECOND,
    TileWatch,
    cell_classes,
    cells_of,
    run_lengths,
)
from companion.viewer.tile_kernels import CLOSED, COSTLY, FREE, SEEN_OBSTACLE, UNKNOWN
from companion.viewer.wire import Place, tile_message, tiles_in

MAPPING = Settings().mapping
LOOK_S = 0.2
"""So long after the one before is each look."""
MOST = math.ceil((NEAR_A_SECOND + TOLD_A_SECOND + IN_TURN_A_SECOND) * LOOK_S) + 3


def new_evidence(fields: int = 40) -> EvidenceMap:
    return new_map(empty_grid(fields, fields), 0.35, MAPPING)


@given(arrays(np.uint8, st.integers(1, 300), elements=st.integers(0, 7)))
def test_runs_hold_any_cells(cells: np.ndarray) -> None:
    assert np.array_equal(cells_of(run_lengths(cells)), cells)


def test_a_tile_of_one_kind_takes_a_byte_for_32_cells() -> None:
    assert len(run_lengths(np.zeros((TILE, TILE), np.uint8))) == TILE * TILE // 32


@given(st.lists(st.tuples(st.tuples(st.integers(0, 65535), st.integers(0, 65535)), st.binary(max_size=50)), max_size=5))
def test_a_message_holds_its_tiles(tiles: list[tuple[tuple[int, int], bytes]]) -> None:
    assert list(tiles_in(tile_message(tiles))) == tiles


def test_what_is_seen_counts_more_than_what_the_mission_says() -> None:
    evidence = new_evidence(4)
    s = evidence.subdivisions
    evidence.base.weights[0, :] = (0.5, 0.8, 1.0, 1.0)
    evidence.log_odds[0, 0] = -1.0
    evidence.log_odds[0, 3 * s] = 3.0
    classes = cell_classes(evidence, 0, 0, 4 * s, s)
    assert classes.shape == (s, 4 * s)
    assert [int(classes[0, x]) for x in (0, 1, s, 2 * s, 3 * s)] == [FREE, UNKNOWN, COSTLY, CLOSED, SEEN_OBSTACLE]


@settings(max_examples=12, deadline=None)
@given(st.lists(st.tuples(st.floats(0.0, 39.9), st.floats(0.0, 39.9), st.sampled_from([-1.0, 3.0])), max_size=30))
def test_whoever_takes_every_message_has_the_map(changes: list[tuple[float, float, float]]) -> None:
    """Things change round the rover, and the map may forget anywhere."""
    evidence, held = new_evidence(), {}
    evidence.base.weights[30:35, 5:9] = 1.0
    watch = TileWatch(evidence)
    for north_m, east_m, value in changes:
        y, x = (int(v / evidence.evidence_m) for v in (north_m, east_m))
        evidence.log_odds[y, x] = value
        held.update(watch.changed(evidence, NedPoint(north_m, east_m), 3.0, LOOK_S))
    if changes:
        forget(evidence)
    for _ in range(30):
        held.update(watch.changed(evidence, NedPoint(0.0, 0.0), 3.0, LOOK_S))
    assert_holds(held, evidence)


def assert_holds(held: dict[Place, bytes], evidence: EvidenceMap) -> None:
    """These tiles are the map."""
    height, width = evidence.log_odds.shape
    seen = np.zeros((-(-height // TILE) * TILE, -(-width // TILE) * TILE), np.uint8)
    for (column, row), runs in held.items():
        seen[row * TILE : (row + 1) * TILE, column * TILE : (column + 1) * TILE] = cells_of(runs).reshape(TILE, TILE)
    assert np.array_equal(seen[:height, :width], cell_classes(evidence, 0, 0, width, height))


def test_only_what_changed_is_told_and_what_could_not_be_told_is_told_again() -> None:
    evidence, here = new_evidence(), NedPoint(5.0, 5.0)
    watch = TileWatch(evidence)
    while watch.is_behind:
        assert watch.changed(evidence, here, 5.0, LOOK_S) == []
    evidence.log_odds[10:20, 10:20] = -1.0
    first = watch.changed(evidence, here, 5.0, LOOK_S)
    assert [place for place, _ in first] == [(0, 0)] and watch.changed(evidence, here, 5.0, LOOK_S) == []
    watch.tell_again([(0, 0)])
    assert watch.changed(evidence, here, 5.0, LOOK_S) == first


@pytest.mark.parametrize("place", [(-50.0, -50.0), (500.0, 20.0)])
def test_a_rover_off_the_map_is_no_fault(place: tuple[float, float]) -> None:
    evidence = new_evidence()
    assert TileWatch(evidence).changed(evidence, NedPoint(*place), 10.0, LOOK_S) == []


def test_a_look_at_a_large_map_takes_some_tiles_and_comes_to_all_of_them() -> None:
    evidence = new_evidence(400)
    evidence.base.weights[:] = 1.0
    watch, counts = TileWatch(evidence), []
    while watch.is_behind:
        counts.append(len(watch.changed(evidence, NedPoint(5.0, 5.0), 5.0, LOOK_S)))
    height, width = evidence.log_odds.shape
    assert sum(counts) == -(-height // TILE) * -(-width // TILE) and max(counts) <= MOST
    watch.tell_again()
    assert watch.is_behind and len(watch.changed(evidence, NedPoint(5.0, 5.0), 5.0, LOOK_S)) >= TOLD_A_SECOND * LOOK_S


def test_a_large_map_of_which_little_is_known_is_told_soon_and_what_is_near_first() -> None:
    evidence = new_evidence(800)
    s = evidence.subdivisions
    for north, east in ((10, 10), (400, 400), (790, 790)):
        evidence.base.weights[north, east] = 1.0
    watch, told, looks = TileWatch(evidence), [], 0
    while watch.is_behind:
        told += [place for place, _ in watch.changed(evidence, NedPoint(410.0, 410.0), 1.0, LOOK_S)]
        looks += 1
    tiles = (-(-evidence.log_odds.shape[0] // TILE)) ** 2
    assert told == [(at * s // TILE, at * s // TILE) for at in (400, 790, 10)]
    assert looks == -(-tiles // math.ceil(GLANCES_A_SECOND * LOOK_S)) > 3


def test_a_tile_that_could_not_be_told_and_is_empty_since_is_told_as_empty() -> None:
    evidence, here = new_evidence(), NedPoint(5.0, 5.0)
    watch = TileWatch(evidence)
    evidence.log_odds[0, 0] = -1.0
    assert [place for place, _ in watch.changed(evidence, here, 5.0, LOOK_S)] == [(0, 0)]
    evidence.log_odds[0, 1] = -1.0
    watch.tell_again(place for place, _ in watch.changed(evidence, here, 5.0, LOOK_S))
    evidence.log_odds[0, :2] = 0.0
    assert [(place, int(cells_of(runs).max())) for place, runs in watch.changed(evidence, here, 5.0, LOOK_S)] == [
        ((0, 0), 0)
    ]


def test_a_sensor_that_sees_far_costs_no_more_and_what_it_finds_there_is_told_in_a_while() -> None:
    evidence, here = new_evidence(400), NedPoint(200.0, 200.0)
    watch, places, looks = TileWatch(evidence), [], 0
    while watch.is_behind:
        watch.changed(evidence, here, 120.0, LOOK_S)
    evidence.log_odds[:] = 3.0
    told: set[tuple[int, int]] = set()
    tiles = math.ceil(evidence.log_odds.shape[0] / TILE) ** 2
    while len(told) < 200:
        places = [place for place, _ in watch.changed(evidence, here, 120.0, LOOK_S)]
        told.update(places)
        looks += 1
        assert len(places) <= MOST
    assert tiles > 200 and looks <= 3 * 200 / (NEAR_A_SECOND * LOOK_S)
    assert len(told | {place for place, _ in watch.changed(evidence, here, 120.0, math.inf)}) > 300


@settings(max_examples=25, deadline=None)
@given(
    st.lists(
        st.tuples(st.floats(-3.0, 3.0), st.floats(-3.0, 3.0), st.sampled_from(["look", "lost", "stall"])), max_size=60
    ),
    st.randoms(use_true_random=False),
)
def test_nothing_that_was_in_reach_is_forgotten(steps: list[tuple[float, float, str]], random: Random) -> None:
    """The rover comes along, things change within reach, looks are seldom, and what they bring is lost at times."""
    evidence, held, north_m, east_m, reach_m = new_evidence(120), {}, 60.0, 60.0, 9.0
    watch = TileWatch(evidence)
    while watch.is_behind:
        watch.changed(evidence, NedPoint(north_m, east_m), reach_m, 10.0)
    for to_north_m, to_east_m, then in steps:
        north_m, east_m = (min(max(v, 10.0), 110.0) for v in (north_m + to_north_m, east_m + to_east_m))
        at_m = (north_m + random.uniform(-6.0, 6.0), east_m + random.uniform(-6.0, 6.0))
        y, x = (int(v / evidence.evidence_m) for v in at_m)
        evidence.log_odds[y, x] = random.choice([-1.0, 3.0])
        watch.note(evidence, NedPoint(north_m, east_m), reach_m)
        if then == "stall":
            continue
        news = dict(watch.changed(evidence, NedPoint(north_m, east_m), reach_m, 0.02))
        if then == "lost":
            watch.tell_again(news)
        else:
            held.update(news)
    later = dict(held)
    for _ in range(60):
        held.update(watch.changed(evidence, NedPoint(north_m, east_m), reach_m, LOOK_S))
    assert_holds(held, evidence)
    again = TileWatch(evidence)
    later.update(again.changed(evidence, NedPoint(north_m, east_m), 0.0, math.inf))
    assert_holds(later, evidence)
