"""Several populations, islands, that live on several threads and now and then send their best to the next one (our extension).

Between two migrations no island knows of another, and each has random numbers of its own, so what comes out depends on the
seed and the number of islands, never on the number of threads.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from companion.core.grid import Weights
from companion.planning.bspline_ga.fitness import Task, Tuning, is_correct
from companion.planning.bspline_ga.population import (
    Population,
    Span,
    advance,
    begin,
    best_of,
    copy_genes,
    empty_population,
    rank_of,
    vln_of,
)
from companion.planning.bspline_ga.tuples import Lives, Places, TuningValues
from companion.planning.random_numbers import seeded
from companion.planning.raster import CellArray

Job = Callable[[int], Population]
Run = Callable[[Job, int], list[Population]]


@dataclass(frozen=True, slots=True)
class Archipelago:
    """How many islands, after how many epochs they send their best round, and how many threads share the work."""

    islands: int
    migrate_every: int
    threads: int


@njit(cache=True, nogil=True)
def settle(
    weights: Weights, places: Places, settings: TuningValues, control_points: int, lives: Lives, until: int, seed: int
) -> Population:
    """A new island's population, alive until an epoch."""
    task, tuning, span = Task(*places), Tuning(*settings), Span(*lives)
    vln = vln_of(weights, control_points, tuning)
    people = empty_population(control_points, span.population, tuning, seeded(seed))
    begin(weights, people, task, tuning, control_points, span, vln)
    advance(weights, people, task, tuning, span, vln, until)
    return people


@njit(cache=True, nogil=True)
def live_on(
    weights: Weights,
    places: Places,
    settings: TuningValues,
    control_points: int,
    lives: Lives,
    until: int,
    people: Population,
) -> Population:
    """The same population, alive until a later epoch."""
    task, tuning = Task(*places), Tuning(*settings)
    advance(weights, people, task, tuning, Span(*lives), vln_of(weights, control_points, tuning), until)
    return people


@njit(cache=True, nogil=True)
def welcome(people: Population, genes: CellArray, value: float) -> None:
    """A migrant takes its rank among the selected; one that is no better than the last of them goes under."""
    if value < people.values[-1]:
        place = rank_of(people.ranks, people.values, value)
        copy_genes(genes, people.selected[place], len(genes))
        people.counts[place] = len(genes)


def migrate(peoples: list[Population]) -> None:
    """The best of each island goes to the next one, round in a ring, all at once."""
    leaving = [(best_of(people), float(people.values[0])) for people in peoples]
    for i, (genes, value) in enumerate(leaving):
        welcome(peoples[(i + 1) % len(peoples)], genes, value)


def evolve_islands(
    weights: Weights,
    places: Places,
    settings: TuningValues,
    control_points: int,
    lives: Lives,
    archipelago: Archipelago,
    seeds: NDArray[np.int64],
) -> tuple[bool, CellArray, int, int]:
    """As ``ga_population.evolve``: (found, best chromosome, epochs of the longest lived, evaluations of all)."""
    _, min_epochs, max_epochs = lives
    common = (weights, places, settings, control_points, lives)
    vln = vln_of(weights, control_points, Tuning(*settings))
    until = min(archipelago.migrate_every, max_epochs)
    with _workers(archipelago.threads) as run:
        peoples = run(lambda i: settle(*common, until, int(seeds[i])), archipelago.islands)
        while until < max_epochs and not any(_is_done(people, vln, min_epochs) for people in peoples):
            migrate(peoples)
            until = min(until + archipelago.migrate_every, max_epochs)
            now, living = until, peoples
            peoples = run(lambda i: live_on(*common, now, living[i]), archipelago.islands)  # noqa: B023 - run at once
    best = min(peoples, key=lambda people: float(people.values[0]))
    epochs = max(int(people.spent[0]) for people in peoples)
    return is_correct(best.values[0], vln), best_of(best), epochs, sum(int(people.spent[1]) for people in peoples)


def _is_done(people: Population, vln: float, min_epochs: int) -> bool:
    return bool(people.spent[0] >= min_epochs and is_correct(people.values[0], vln))


@contextmanager
def _workers(threads: int) -> Iterator[Run]:
    """Runs a job for every island, on so many threads, and waits for all; the kernels hold no interpreter lock."""
    if threads == 1:
        yield lambda job, islands: [job(i) for i in range(islands)]
        return
    with ThreadPoolExecutor(threads) as pool:
        yield lambda job, islands: list(pool.map(job, range(islands)))
