"""BARN worlds: cylinders on a lattice before a rover that is to get to the other side (Perille et al. 2020).

A file of worlds is a NumPy archive: ``number`` (n,), ``lattice`` (n, rows, columns), True where a cylinder stands, and
for each number N ``path_N`` (m, 2), the reference path in steps of the lattice. Our own worlds are made from seeds, of
the same kind: a cellular automaton fills the lattice and smooths it.

Frame of the benchmark: x to the right, y ahead, metres. World frame: north = y, east = x.
"""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np
from numpy.lib.npyio import NpzFile
from numpy.typing import NDArray

from companion.core.grid import Cell
from companion.planning.problem import Budget, PlanningProblem
from companion.planning.registry import make_planner
from companion.settings import PlannerSettings
from sitl.experiments.experiment import ExperimentError
from sitl.world.world import World

Lattice = NDArray[np.bool_]

STEP_M = 0.15
"""Side of a lattice cell."""
CYLINDER_M = 0.075
"""Radius of a cylinder."""
FINE_M = 0.025
"""Side of a field of the simulated world."""
START_M, GOAL_M = (-2.25, 3.0), (-2.25, 13.0)
"""Where a run begins, heading ahead, and ends: x, y."""
SCORED_X_M = -2.0
"""The challenge's scorer lets the path begin and end there."""
FAR_M = 15.6
"""The sides go on to here, and then the way is shut."""
PATH_X_M, PATH_Y_M = -4.575, 5.075
"""Where step (0, 0) of a reference path lies."""
ROWS, COLUMNS = 64, 30
FIRST_ROW = 34
"""The obstacles begin at this row of the lattice."""
BODY_M = 0.36
"""Our own worlds have a way for a disc of this radius, as all of the challenge's have."""
SHARES, ROUNDS = (0.15, 0.2, 0.25, 0.3), (2, 3, 4)
"""How much of the lattice of our own worlds is filled at first, and how often it is smoothed."""


@dataclass(frozen=True, eq=False, slots=True)
class BarnWorld:
    """One world: its number, where cylinders stand, and its reference path, shape (n, 2), x and y in metres."""

    number: int
    lattice: Lattice
    path_m: NDArray[np.float64]

    @property
    def optimal_s(self) -> float:
        """The time of the reference path at 2 m/s, as the challenge counts it."""
        ends = np.array([[SCORED_X_M, START_M[1]]]), np.array([[SCORED_X_M, GOAL_M[1]]])
        steps = np.diff(np.vstack((ends[0], self.path_m, ends[1])), axis=0)
        return float(np.hypot(steps[:, 0], steps[:, 1]).sum()) / 2.0

    def world(self) -> World:
        """The simulated world; the sides go on beyond the lattice, and it is shut at the far end."""
        rows = math.ceil(FAR_M / STEP_M)
        standing = np.zeros((rows, self.lattice.shape[1]), dtype=np.bool_)
        standing[: len(self.lattice)] = self.lattice
        standing[:, [0, -1]] = True
        standing[-1] = True
        pieces = round(STEP_M / FINE_M)
        middle = (np.arange(pieces) + 0.5) * FINE_M - 0.5 * STEP_M
        disc = np.hypot(middle[:, None], middle[None, :]) <= CYLINDER_M
        # Columns count to the left, from x = 0.
        solid = np.kron(standing[:, ::-1], disc.astype(np.int8)).astype(np.bool_)
        return World(solid, FINE_M, 0.0, -STEP_M * standing.shape[1])


def read_worlds(file: Path) -> list[BarnWorld]:
    """The worlds of a file, in its order. Raises ExperimentError."""
    try:
        loaded = np.load(file)
        if not isinstance(loaded, NpzFile):
            raise ValueError("a single array")
        with loaded as archive:
            read = [
                (int(number), np.asarray(lattice), np.asarray(archive[f"path_{number}"]))
                for number, lattice in zip(archive["number"], archive["lattice"], strict=True)
            ]
    except OSError as error:
        raise ExperimentError(f"{file}: cannot be read ({error.strerror or error})") from error
    except (ValueError, KeyError, IndexError, EOFError, BadZipFile) as error:  # whose texts are of numpy's inner life
        raise ExperimentError(
            f"{file}: no archive of BARN worlds; give a .npz with the arrays number, lattice and path_NUMBER"
        ) from error
    if not read:
        raise ExperimentError(f"{file}: has no world")
    twice = [number for number, count in Counter(number for number, _, _ in read).items() if count > 1]
    if twice:
        raise ExperimentError(f"{file}: has world {twice[0]} more than once")
    for number, lattice, path in read:
        if fault := _lattice_fault(lattice) or _path_fault(path):
            raise ExperimentError(f"{file}: world {number}: {fault}")
    return [BarnWorld(number, lattice.astype(np.bool_), _path_m(path)) for number, lattice, path in read]


def _lattice_fault(lattice: NDArray[Any]) -> str:
    """What is wrong with it; empty for nothing."""
    if lattice.shape != (ROWS, COLUMNS):
        return f"its lattice has the shape {lattice.shape}; one of {ROWS} x {COLUMNS} cells is needed"
    if not np.all((lattice == 0) | (lattice == 1)):
        return "its lattice has values other than 0 (free) and 1 (a cylinder)"
    return ""


def _path_fault(path: NDArray[Any]) -> str:
    """What is wrong with it; empty for nothing."""
    if path.ndim != 2 or path.shape[1] != 2 or len(path) < 2:
        return f"its path has the shape {path.shape}; two or more steps, column and row, are needed"
    return "" if np.issubdtype(path.dtype, np.number) and np.all(np.isfinite(path)) else "its path has no numbers"


def made_world(seed: int) -> BarnWorld:
    """A world of our own making: share and rounds are drawn from the seed, then fillings until one has a way."""
    rng = np.random.default_rng([seed, 250])
    planner = make_planner("astar", PlannerSettings())
    share, rounds = float(rng.choice(SHARES)), int(rng.choice(ROUNDS))
    while True:
        lattice = _filled(rng, share, rounds)
        weights = _swollen(lattice)
        start, target = Cell(COLUMNS // 2, 20), Cell(COLUMNS // 2, ROWS + 15)
        found = planner.plan(PlanningProblem(weights, start, target), Budget(), np.random.default_rng(0)).path
        if found is not None:
            cells = np.array([(cell.x, cell.y) for cell in found.cells if FIRST_ROW <= cell.y < ROWS])
            middle_m = (cells + 0.5) * STEP_M - (COLUMNS * STEP_M, 0.0)
            return BarnWorld(seed, lattice, middle_m.astype(np.float64))


def _filled(rng: np.random.Generator, share: float, rounds: int) -> Lattice:
    """The lattice with its walls: the cells between them are filled by chance with this share, then smoothed.

    In each round an empty cell with five filled neighbours of eight is filled, and a filled cell with fewer than two is
    emptied. The walls at the sides count as filled neighbours, what lies before the first and behind the last row as
    empty ones.
    """
    middle = rng.random((ROWS - FIRST_ROW, COLUMNS - 2)) < share
    rows, columns = middle.shape
    for _ in range(rounds):
        padded = np.pad(np.pad(middle, ((1, 1), (0, 0))), ((0, 0), (1, 1)), constant_values=True).astype(np.int8)
        with_own = sum(padded[y : y + rows, x : x + columns] for y in range(3) for x in range(3))
        middle = with_own >= np.where(middle, 3, 5)
    # The frame counts columns to the left; a made world is stored as a file's would be.
    lattice = np.zeros((ROWS, COLUMNS), dtype=np.bool_)
    lattice[FIRST_ROW:, 1:-1] = middle
    lattice[:, [0, -1]] = True
    lattice[0] = True
    return lattice


def _swollen(lattice: Lattice) -> NDArray[np.float64]:
    """Weights of a grid of the lattice's cells (x from the left), obstacles grown by the disc that must get through."""
    standing = np.zeros((ROWS + 20, COLUMNS), dtype=np.bool_)
    standing[:ROWS] = lattice[:, ::-1]
    standing[:, [0, -1]] = True
    grown = standing.copy()
    reach = math.ceil((BODY_M + CYLINDER_M) / STEP_M)
    for dy in range(-reach, reach + 1):
        for dx in range(-reach, reach + 1):
            if math.hypot(dx, dy) * STEP_M < BODY_M + CYLINDER_M:
                grown |= np.roll(standing, (dy, dx), axis=(0, 1))
    return np.where(grown, 1.0, 0.5)


def _path_m(steps: NDArray[np.integer]) -> NDArray[np.float64]:
    return np.column_stack((PATH_X_M + STEP_M * steps[:, 0], PATH_Y_M + STEP_M * steps[:, 1])).astype(np.float64)
