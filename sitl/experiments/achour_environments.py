"""Four environments like those of Achour & Chaalal 2011: walls and polygons, the second with narrow regions.

The paper prints its start (3, 2) and target (18, 19), no sizes, and shows its environments as small pictures; ours are
20 m wide, the least that has room for both, and fields are 0.1 m.
"""

from __future__ import annotations

import numpy as np
import shapely

from companion.core.grid import BASE_WEIGHT, OBSTACLE, Cell
from companion.planning.problem import PlanningProblem

Place = tuple[float, float]

SIZE_M = 20.0
FIELDS_A_METRE = 10
START_M, TARGET_M = (3.0, 2.0), (18.0, 19.0)


def box(left: float, bottom: float, right: float, top: float) -> tuple[Place, ...]:
    """The corners of a wall, in metres."""
    return ((left, bottom), (right, bottom), (right, top), (left, top))


OBSTACLES: dict[str, tuple[tuple[Place, ...], ...]] = {
    "1": (
        box(4.0, 7.5, 9.0, 10.0),
        ((11.0, 3.0), (15.0, 4.0), (14.0, 8.0), (10.5, 6.5)),
        ((10.0, 12.0), (13.0, 11.0), (15.0, 14.0), (12.0, 16.0)),
        ((3.0, 13.5), (6.5, 13.0), (5.0, 17.0)),
    ),
    "2": (
        box(0.0, 6.0, 8.4, 6.8),
        box(9.6, 6.0, 20.0, 6.8),
        box(0.0, 12.6, 12.4, 13.4),
        box(13.6, 12.6, 20.0, 13.4),
        ((3.0, 8.5), (6.0, 8.2), (5.0, 11.0)),
        ((15.0, 8.5), (18.0, 9.5), (16.0, 11.5)),
        ((5.0, 15.5), (9.0, 15.0), (8.0, 18.0)),
    ),
    "3": (
        box(5.0, 0.0, 5.6, 5.0),
        box(0.0, 8.0, 6.5, 8.6),
        box(9.5, 3.0, 10.1, 12.0),
        box(10.1, 3.0, 14.0, 3.6),
        box(13.5, 8.0, 20.0, 8.6),
        box(3.5, 13.0, 4.1, 20.0),
        box(7.5, 15.0, 13.5, 15.6),
        box(16.0, 12.0, 16.6, 17.5),
        ((6.0, 10.0), (8.0, 10.5), (7.0, 12.5)),
        ((12.0, 10.5), (14.0, 11.0), (13.5, 13.0), (12.0, 12.5)),
        ((15.0, 4.5), (17.5, 5.0), (16.5, 6.8)),
    ),
    "4": (
        box(0.0, 4.4, 5.0, 5.0),
        box(6.8, 2.2, 7.4, 8.4),
        box(7.4, 2.2, 12.0, 2.8),
        box(2.4, 7.8, 6.8, 8.4),
        box(13.6, 0.0, 14.2, 5.2),
        box(9.4, 5.0, 10.0, 11.0),
        box(12.0, 6.8, 18.0, 7.4),
        box(0.0, 10.8, 7.2, 11.4),
        box(12.0, 7.4, 12.6, 10.4),
        box(10.0, 12.6, 16.4, 13.2),
        box(16.4, 9.6, 17.0, 13.2),
        box(2.4, 13.4, 3.0, 18.0),
        box(3.0, 13.4, 8.0, 14.0),
        box(5.6, 16.4, 11.0, 17.0),
        box(10.4, 17.0, 11.0, 20.0),
        box(13.4, 15.4, 14.0, 20.0),
        box(14.0, 15.4, 18.0, 16.0),
        ((16.0, 2.0), (18.4, 2.6), (17.2, 4.8)),
        ((14.2, 9.2), (15.6, 9.6), (14.6, 11.2)),
    ),
}


def environments() -> dict[str, PlanningProblem]:
    """The four, by number."""
    return {name: _problem(obstacles) for name, obstacles in OBSTACLES.items()}


def _problem(obstacles: tuple[tuple[Place, ...], ...]) -> PlanningProblem:
    side = round(SIZE_M * FIELDS_A_METRE)
    middles_m = (np.arange(side) + 0.5) / FIELDS_A_METRE
    x_m, y_m = np.meshgrid(middles_m, middles_m)
    weights = np.full((side, side), BASE_WEIGHT)
    for corners in obstacles:
        weights[shapely.intersects_xy(shapely.Polygon(corners), x_m, y_m)] = OBSTACLE
    return PlanningProblem(weights, _cell(START_M), _cell(TARGET_M))


def _cell(place_m: Place) -> Cell:
    return Cell(int(place_m[0] * FIELDS_A_METRE), int(place_m[1] * FIELDS_A_METRE))
