"""Fields of posts of a wanted difficulty: as many posts as make the way so tight, and the way cut through them.

A field that chance makes has no way any more long before it is as hard as those of BARN. So a way is cut: the one that
needs the fewest posts taken away. How much of the lattice is filled is then found by bisection.

Nouns: graded posts.
"""

from __future__ import annotations

import math

import numpy as np

from companion.core.grid import OBSTACLE
from sitl.generators.canvas import FINE_M, empty, with_ends
from sitl.generators.measures import Difficulty, measured
from sitl.generators.posts import Lattice, lattice_shape, places_of, radius_of, smooth, stand
from sitl.generators.shortest_way import (
    BODY_M,
    WAY_RESOLUTION_M,
    Place,
    Way,
    cheapest_way,
    coarse,
    shortest_m,
    weights_with,
)
from sitl.world.world import Obstacles

EASY_M, HARD_M = (2.1, 7.0), (0.8, 3.2)
"""Distance to the closest wall and visibility that are wanted at difficulties 0 and 1."""
TIGHT_M = 0.4
"""Room on both sides of the way at difficulty 1; the usual rover has a radius of 0.35 m."""
STRIP_M = 4.5
"""No post stands within this of the west and the east edge."""
MOST_FILLED = 0.5
TRIES = 7
NEAR = 0.02
"""So near, in logarithms, is near enough."""
DEAR, THROUGH = 0.95, 0.1
"""Weights of a field at which posts must be taken away, and of one at which none must."""
MORE_M = (0.1, WAY_RESOLUTION_M * math.sqrt(2.0))
"""So much more room is cut: coarse fields reach farther than a post in them, at most by the second figure."""


def room_at(difficulty: float) -> float:
    """Room on both sides of the way, metres."""
    return BODY_M + difficulty * (TIGHT_M - BODY_M)


def wanted_m(difficulty: float) -> tuple[float, float]:
    """The wanted distance to the closest wall and visibility, metres: in equal ratios from ``EASY_M`` to ``HARD_M``."""
    wall_m, visibility_m = (easy * (hard / easy) ** difficulty for easy, hard in zip(EASY_M, HARD_M, strict=True))
    return wall_m, visibility_m


def graded(
    difficulty: float, step_m: float, smoothed: int, ends_m: tuple[Place, Place], rng: np.random.Generator
) -> Obstacles:
    """The field whose closest wall and visibility are nearest to the wanted ones, together."""
    chance, room_m = rng.random(lattice_shape(step_m, STRIP_M)), room_at(difficulty)
    wanted = math.log(math.prod(wanted_m(difficulty)))
    few, many, best = 0.0, MOST_FILLED, (math.inf, empty())
    for _ in range(TRIES):
        filled = 0.5 * (few + many)
        solid, found = _opened(smooth(chance < filled, smoothed), step_m, room_m, ends_m)
        off = math.inf if found is None else math.log(found.closest_wall_m * found.visibility_m) - wanted
        if abs(off) < best[0]:
            best = abs(off), solid
        if abs(off) < NEAR:
            break
        few, many = (filled, many) if off > 0.0 else (few, filled)
    return best[1]


def _opened(
    lattice: Lattice, step_m: float, room_m: float, ends_m: tuple[Place, Place]
) -> tuple[Obstacles, Difficulty | None]:
    """The field without the posts that stand in the way, and how hard it is; None: there is no way all the same."""
    places_m = places_of(lattice, step_m, STRIP_M)
    cut_m = _cut(places_m, room_m + radius_of(step_m), room_m, ends_m)
    apart_m = np.full(len(places_m), math.inf)
    for field_m in cut_m:
        np.minimum(apart_m, np.hypot(*(places_m - field_m).T), out=apart_m)
    for more_m in MORE_M:
        left = np.zeros_like(lattice)
        left[tuple(np.argwhere(lattice)[apart_m >= room_m + radius_of(step_m) + more_m].T)] = True
        solid = with_ends(stand(left, step_m, STRIP_M), *ends_m)
        weights = weights_with(coarse(solid), room_m)
        way_m = cheapest_way(weights, *ends_m)
        if way_m is not None:
            return solid, measured(solid, FINE_M, way_m, shortest_m(weights, *ends_m))
    return solid, None


def _cut(places_m: Way, reach_m: float, room_m: float, ends_m: tuple[Place, Place]) -> Way:
    """The fields of the way that needs the fewest posts taken away, and those beside its diagonal steps."""
    edges = coarse(with_ends(empty(), *ends_m))
    posts = np.zeros_like(edges)
    posts[tuple((places_m / WAY_RESOLUTION_M).astype(np.int64).T)] = True
    dear = np.where(weights_with(posts, reach_m) >= OBSTACLE, DEAR, THROUGH)
    way_m = cheapest_way(np.where(weights_with(edges, room_m) >= OBSTACLE, OBSTACLE, dear), *ends_m)
    if way_m is None:
        return np.empty((0, 2))
    sides_m = np.column_stack((way_m[:-1, 0], way_m[1:, 1])), np.column_stack((way_m[1:, 0], way_m[:-1, 1]))
    return np.unique(np.vstack((way_m, *sides_m)), axis=0)
