"""How difficult BARN worlds are: the five measures of Perille et al. 2020, and how they spread over a set of worlds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import astuple

import numpy as np

from sitl.experiments.barn_worlds import FINE_M, GOAL_M, START_M, BarnWorld
from sitl.experiments.experiment import ExperimentError
from sitl.generators.measures import Difficulty, measured
from sitl.generators.shortest_way import cheapest_way, coarse, shortest_m, weights_with

FIELD_M = 0.1
"""Side of the fields in which the shortest way is looked for."""
ROOM_M = 0.27
"""It keeps so much room: a little more than half a Jackal's width."""
AMONG_POSTS_M = (4.5, 9.6)
"""So far ahead the posts stand. What is measured is the way between."""
SHARES = (10, 25, 50, 75, 90)
"""Of the worlds, in percent."""
SPREAD_HEAD = ("worlds", "closest wall m", "visibility m", "dispersion", "characteristic m", "tortuosity")


def difficulty_of(barn: BarnWorld) -> Difficulty:
    """Along the shortest way among the posts. Raises ExperimentError for a world without a way."""
    world = barn.world()
    weights = weights_with(coarse(world.obstacles, FINE_M, FIELD_M), ROOM_M, FIELD_M)
    start_m, goal_m = ((ahead_m, right_m - world.west_m) for right_m, ahead_m in (START_M, GOAL_M))
    way_m = cheapest_way(weights, start_m, goal_m, FIELD_M)
    if way_m is None:
        raise ExperimentError(f"world {barn.number}: no way from start to goal; leave it out of --worlds")
    first_m, last_m = AMONG_POSTS_M
    way_m = way_m[(way_m[:, 0] > first_m) & (way_m[:, 0] < last_m)]
    length_m = shortest_m(weights, (way_m[0, 0], way_m[0, 1]), (way_m[-1, 0], way_m[-1, 1]), FIELD_M)
    return measured(world.obstacles, FINE_M, way_m, length_m)


def spread_rows(difficulties: Sequence[Difficulty]) -> list[list[str]]:
    """A row for each share of the worlds: which figures it does not exceed."""
    figures = np.percentile([astuple(one) for one in difficulties], SHARES, axis=0)
    names = [f"{share} %" if share != 50 else "median" for share in SHARES]
    return [[name, *(f"{figure:.2f}" for figure in row)] for name, row in zip(names, figures, strict=True)]
