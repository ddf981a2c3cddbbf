"""The compiled loops of the map, against slow readings of what they say they do."""

from __future__ import annotations

import math
from collections.abc import Collection

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from companion.mapping.evidence_kernels import (
    InverseSensorModel,
    ScanInCells,
    cast_scan,
    first_unseen,
    look,
    nearest,
    soften,
    weigh,
    weigh_roomy,
)

SIZE, S = 48, 8
MODEL = InverseSensorModel(
    hit=0.8, miss=0.3, limit=3.0, free_limit=2.0, depth_cells=0.4, kept_cells=0.0, confirm_cells=3.0, occupied_at=0.5
)
NOTHING = np.empty((0, 2), np.int64)
CELLS = st.sets(st.tuples(st.integers(0, SIZE - 1), st.integers(0, SIZE - 1)), max_size=20)
PLACES = st.floats(1.0, SIZE - 1.0)


def raster(occupied: Collection[tuple[int, int]] = (), unseen: Collection[tuple[int, int]] = ()) -> np.ndarray:
    log_odds = np.full((SIZE, SIZE), -1.0, np.float32)
    for x, y in unseen:
        log_odds[y, x] = 0.0
    for x, y in occupied:
        log_odds[y, x] = 2.0
    return log_odds


def cast(range_cells: float, protected: np.ndarray = NOTHING, kept_cells: float = 0.0, times: int = 1) -> np.ndarray:
    """One beam to the north from the middle of a raster that nothing has been seen of."""
    log_odds, stamps = np.zeros((SIZE, SIZE), np.float32), np.zeros((SIZE, SIZE), np.int32)
    scan = ScanInCells(24.5, 24.5, 0.0, np.zeros(1), np.array([range_cells]), 16.0, 0.05)
    for stamp in range(1, times + 1):
        cast_scan(
            log_odds,
            stamps,
            np.int32(stamp),
            scan,
            MODEL._replace(kept_cells=kept_cells),
            NOTHING,
            protected,
            (scan.x, scan.y, 1.0),
        )
    return log_odds


def test_a_hit_hardens_its_cell_and_frees_the_cells_before_it() -> None:
    log_odds = cast(10.0)
    assert log_odds[34, 24] == pytest.approx(MODEL.hit)
    assert log_odds[26:33, 24] == pytest.approx(np.full(7, -MODEL.miss))
    assert (log_odds[36:] == 0.0).all() and (log_odds[30, :20] == 0.0).all()
    assert log_odds[24, 24] == -MODEL.free_limit, "under the rover"


def test_evidence_is_limited_on_both_sides() -> None:
    log_odds = cast(10.0, times=50)
    assert log_odds.max() == MODEL.limit and log_odds[26:33, 24] == pytest.approx(np.full(7, -MODEL.free_limit))


def test_nothing_seen_frees_to_the_reach_and_unknown_says_nothing() -> None:
    assert (cast(math.inf)[26:40, 24] < 0.0).all() and not (cast(math.inf) > 0.0).any()
    assert (cast(math.nan)[26:] == 0.0).all()


def test_protected_cells_and_the_last_ones_before_a_hit_are_not_freed() -> None:
    log_odds = cast(10.0, np.array([[24, 28]]), kept_cells=3.0)
    assert log_odds[28, 24] == 0.0 and log_odds[27, 24] < 0.0
    assert (log_odds[32:34, 24] == 0.0).all() and log_odds[30, 24] < 0.0


@pytest.mark.parametrize(
    ("earlier", "obstacle", "confirm_cells", "confirmed"),
    [
        ([(26, 36)], None, 3.0, True),
        ([(3, 3), (24, 34)], None, 3.0, True),
        ([(27, 35)], None, 3.0, False),
        ([], None, 3.0, False),
        ([(26, 36)], (22, 34), 3.0, False),
        ([(26, 36)], (22, 31), 3.0, True),
        ([(24, 34)], None, 0.0, False),
    ],
    ids=["near", "same", "far", "none", "known", "another", "never"],
)
def test_on_ground_seen_free_a_hit_counts_at_once_where_an_earlier_one_ended_near(
    earlier: list[tuple[int, int]], obstacle: tuple[int, int] | None, confirm_cells: float, confirmed: bool
) -> None:
    """Unless there is an obstacle already: that is what was hit."""
    log_odds, stamps = raster(() if obstacle is None else [obstacle]), np.zeros((SIZE, SIZE), np.int32)
    scan = ScanInCells(24.5, 24.5, 0.0, np.zeros(1), np.array([10.0]), 16.0, 0.05)
    cells = np.array(earlier, np.int64).reshape(-1, 2)
    model = MODEL._replace(confirm_cells=confirm_cells)
    turned = cast_scan(log_odds, stamps, np.int32(1), scan, model, cells, NOTHING, (scan.x, scan.y, 1.0))
    assert log_odds[34, 24] == pytest.approx(MODEL.hit if confirmed else -1.0 + MODEL.hit)
    assert turned.tolist() == ([24, 34, 24, 34] if confirmed else [SIZE, SIZE, -1, -1])


@settings(deadline=None)
@given(CELLS, PLACES, PLACES, st.floats(0.5, 12.0))
def test_the_nearest_obstacle_is_the_nearest(occupied: set[tuple[int, int]], x: float, y: float, reach: float) -> None:
    gaps = [max(math.hypot(cx + 0.5 - x, cy + 0.5 - y) - 0.5, 0.0) for cx, cy in occupied]
    assert nearest(raster(occupied), x, y, reach, 1.0) == pytest.approx(min([reach, *gaps]))


@settings(deadline=None)
@given(CELLS, CELLS, PLACES, PLACES, PLACES, PLACES, st.floats(0.5, 4.0))
def test_a_look_never_says_more_than_small_steps_find(
    occupied: set[tuple[int, int]],
    unseen: set[tuple[int, int]],
    x0: float,
    y0: float,
    x1: float,
    y1: float,
    half: float,
) -> None:
    log_odds, base = raster(occupied, unseen - occupied), np.full((SIZE // S, SIZE // S), 0.5)
    start, end, radius = (x0, y0), (x1, y1), 0.5 * half
    clear, seen = look(log_odds, base, np.zeros_like(base, np.float32), start, end, half, radius, 1.0)
    length = math.hypot(x1 - x0, y1 - y0)
    assert 0.0 <= clear <= length + 1e-9 and 0.0 <= seen <= length + 1e-9
    middles = [(cx + 0.5, cy + 0.5) for cx, cy in occupied]
    if all(math.hypot(mx - x0, my - y0) > half + 0.7 for mx, my in middles):
        for d in np.arange(0.0, clear - 1e-6, 0.25):
            px, py = x0 + d * (x1 - x0) / length, y0 + d * (y1 - y0) / length
            assert all(math.hypot(mx - px, my - py) > half + 0.5 - 1e-6 for mx, my in middles)


def test_a_look_ends_at_closed_fields_and_at_the_edge() -> None:
    base, penalty = np.full((6, 6), 0.5), np.zeros((6, 6), np.float32)
    base[4, 2] = 1.0
    clear, _ = look(raster(), base, penalty, (20.5, 4.5), (20.5, 44.5), 1.0, 1.0, 1.0)
    assert clear == pytest.approx(32.0 - 4.5, abs=0.51)
    assert look(raster(), base, penalty, (4.5, 4.5), (4.5, 99.0), 1.0, 1.0, 1.0)[0] == pytest.approx(43.5, abs=0.51)
    assert look(raster(), base, penalty, (4.5, 4.5), (4.5, 4.5), 1.0, 1.0, 1.0) == (0.0, 0.0)


def test_the_first_unseen_place_beside_a_line_is_the_nearest_one() -> None:
    log_odds = raster(unseen={(27, 30), (21, 20)})
    along, x, y = first_unseen(log_odds, (24.5, 5.5), (24.5, 40.5), 3.0, 4.0)
    assert (int(x), int(y)) == (21, 20) and along == pytest.approx(14.5, abs=0.51)
    assert first_unseen(log_odds, (24.5, 5.5), (24.5, 40.5), 1.0, 4.0) == (35.0, 24.5, 40.5)
    assert first_unseen(log_odds, (24.5, 5.5), (24.5, 5.5), 1.0, 4.0)[0] == 0.0


@settings(deadline=None)
@given(CELLS, st.floats(0.5, 9.0))
def test_a_field_is_closed_by_evidence_in_it_or_within_the_radius_of_its_middle(
    occupied: set[tuple[int, int]], radius: float
) -> None:
    base, weights = np.full((6, 6), 0.5), np.zeros((6, 6))
    weigh(raster(occupied), base, np.zeros((6, 6), np.float32), weights, (0, 0, 6, 6), 1.0, radius)
    for fy in range(6):
        for fx in range(6):
            closed = any(
                (x // S == fx and y // S == fy)
                or math.hypot(x + 0.5 - (fx + 0.5) * S, y + 0.5 - (fy + 0.5) * S) < radius
                for x, y in occupied
            )
            assert weights[fy, fx] == (1.0 if closed else 0.5)


@settings(deadline=None)
@given(CELLS, st.floats(0.5, 9.0))
def test_a_roomy_field_is_open_if_any_of_its_cells_is_as_far_from_all_evidence(
    occupied: set[tuple[int, int]], radius: float
) -> None:
    base, weights = np.full((6, 6), 0.5), np.zeros((6, 6))
    weigh_roomy(raster(occupied), base, np.zeros((6, 6), np.float32), weights, (1, 0, 6, 5), 1.0, radius)
    for fy in range(6):
        for fx in range(6):
            cells = [(x, y) for y in range(fy * S, (fy + 1) * S) for x in range(fx * S, (fx + 1) * S)]
            edge = math.ceil(radius)
            cells = [(x, y) for x, y in cells if edge <= min(x, y) and max(x, y) < 6 * S - edge]
            is_open = any(all(math.hypot(x - ox, y - oy) >= radius for ox, oy in occupied) for x, y in cells)
            outside = fx < 1 or fy >= 5
            assert weights[fy, fx] == (0.0 if outside else 0.5 if is_open else 1.0)


def test_only_the_window_is_weighed_and_softened() -> None:
    base, weights = np.full((6, 6), 0.5), np.full((6, 6), 0.25)
    weigh(raster({(20, 20)}), base, np.zeros((6, 6), np.float32), weights, (1, 1, 4, 4), 1.0, 1.0)
    assert weights[2, 2] == 1.0 and (weights[1:4, 1:4] >= 0.5).all()
    assert (weights[0] == 0.25).all() and (weights[:, 4:] == 0.25).all()
    soften(weights, (1, 1, 4, 4), 2.0, 0.4, 0.9)
    assert weights[2, 3] == pytest.approx(0.9) and weights[2, 2] == 1.0
    assert 0.5 < weights[1, 1] < 0.9 and (weights[0] == 0.25).all()
