"""Islands: several populations that evolve on several threads and send their best to the next one (our extension).

Between two migrations no island depends on another, and each has its own random numbers. So the result depends on the
seed and the number of islands, never on the number of threads.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from companion.core.grid import Weights
from companion.planning.bspline_ga.fitness import is_correct
from companion.planning.bspline_ga.parameters import Lifetime, Task, Tuning
from companion.planning.bspline_ga.population import (
    Evolution,
    Population,
    advance,
    begin,
    best_of,
    copy_genes,
    empty_population,
    rank_of,
    vln_of,
)
from companion.planning.random_numbers import seeded
from companion.planning.raster import CellArray

Job = Callable[[int], Population]
Run = Callable[[Job, int], list[Population]]


class Archipelago(NamedTuple):
    """How many islands, after how many epochs each sends its best on, and how many threads share the work."""

    islands: int
    migrate_every: int
    threads: int


@njit(cache=True, nogil=True)
def settle(evolution: Evolution, control_points: int, until: int, seed: int) -> Population:
    """A new island's population, evolved until an epoch."""
    people = empty_population(control_points, evolution.lifetime.population, evolution.tuning, seeded(seed))
    begin(evolution, people, control_points)
    advance(evolution, people, until)
    return people


@njit(cache=True, nogil=True)
def welcome(people: Population, genes: CellArray, value: float) -> None:
    """A migrant takes its rank among the selected; one that is no better than the last of them is dropped."""
    if value < people.values[-1]:
        place = rank_of(people.ranks, people.values, value)
        copy_genes(genes, people.selected[place], len(genes))
        people.counts[place] = len(genes)


def migrate(peoples: list[Population]) -> None:
    """The best of each island goes to the next one in a ring, all at the same time."""
    leaving = [(best_of(people), float(people.values[0])) for people in peoples]
    for i, (genes, value) in enumerate(leaving):
        welcome(peoples[(i + 1) % len(peoples)], genes, value)


def evolve_islands(
    weights: Weights,
    task: Task,
    tuning: Tuning,
    lifetime: Lifetime,
    control_points: int,
    archipelago: Archipelago,
    seeds: NDArray[np.int64],
) -> tuple[bool, CellArray, int, int]:
    """As ``population.evolve``: (found, best chromosome, epochs of the longest-lived island, evaluations of all)."""
    islands, migrate_every, threads = archipelago
    _, min_epochs, max_epochs = lifetime
    vln = vln_of(weights, control_points, tuning)
    evolution = Evolution(weights, task, tuning, lifetime, vln)

    def go_on(people: Population, until: int) -> Population:
        advance(evolution, people, until)
        return people

    until = min(migrate_every, max_epochs)
    with _workers(threads) as run:
        peoples = run(lambda i: settle(evolution, control_points, until, int(seeds[i])), islands)
        while until < max_epochs and not any(_is_done(people, vln, min_epochs) for people in peoples):
            migrate(peoples)
            until = min(until + migrate_every, max_epochs)
            now, living = until, peoples
            peoples = run(lambda i: go_on(living[i], now), islands)  # noqa: B023 - run at once
    best = min(peoples, key=lambda people: float(people.values[0]))
    epochs = max(int(people.spent[0]) for people in peoples)
    return is_correct(best.values[0], vln), best_of(best), epochs, sum(int(people.spent[1]) for people in peoples)


def _is_done(people: Population, vln: float, min_epochs: int) -> bool:
    return bool(people.spent[0] >= min_epochs and is_correct(people.values[0], vln))


@contextmanager
def _workers(threads: int) -> Iterator[Run]:
    """Runs a job for every island on so many threads and waits for all. The kernels release the interpreter lock."""
    if threads == 1:
        yield lambda job, islands: [job(i) for i in range(islands)]
        return
    with ThreadPoolExecutor(threads) as pool:
        yield lambda job, islands: list(pool.map(job, range(islands)))
