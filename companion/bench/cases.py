"""The problems that planners are compared on."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from companion.bench.movingai import read_scenarios, scenario_file, spread
from companion.core.grid import Cell, Weights
from companion.mapping.map_files import MapError, load_map

PAPER_MAPS = ("one-obstacle", "clutter", "rooms", "complex")
START, TARGET = Cell(0, 24), Cell(98, 24)
"""Section 5 of Kwasniewski & Gosiewski 2018."""


@dataclass(frozen=True, eq=False, slots=True)
class Case:
    """One map with one or more problems on it. ``scale``: how many times the size of the map's file."""

    name: str
    scale: int
    weights: Weights
    ends: tuple[tuple[Cell, Cell], ...]

    @property
    def fields(self) -> int:
        """How many fields the map has."""
        return int(self.weights.size)


def paper_cases(folder: Path, scales: tuple[int, ...]) -> list[Case]:
    """The four maps of 100 x 50 fields, each field a block of ``scale`` x ``scale``. Raises MapError."""
    cases = []
    for name in PAPER_MAPS:
        weights = load_map(folder / f"{name}.png").weights
        for scale in scales:
            grown = np.ascontiguousarray(weights.repeat(scale, axis=0).repeat(scale, axis=1))
            cases.append(Case(name, scale, grown, ((_grown(START, scale), _grown(TARGET, scale)),)))
    return cases


def map_case(file: Path, problems: int) -> Case:
    """A map of the user's with problems from the scenario file beside it. Raises MapError or ScenarioFileError."""
    weights = load_map(file).weights
    scenarios = scenario_file(file)
    if scenarios is None:
        raise MapError(
            f"{file}: nothing says what to search; give --start and --target, or a MovingAI scenario file beside it "
            f"({file.name}.scen)"
        )
    chosen = spread(read_scenarios(scenarios), problems)
    ends = tuple((scenario.start, scenario.target) for scenario in chosen if scenario.start != scenario.target)
    height, width = weights.shape
    for place in (place for pair in ends for place in pair):
        if not (0 <= place.x < width and 0 <= place.y < height):
            raise MapError(f"{scenarios}: a problem lies outside the map, which has {width} x {height} fields")
    return Case(file.stem, 1, weights, ends)


def _grown(cell: Cell, scale: int) -> Cell:
    return Cell(cell.x * scale + scale // 2, cell.y * scale + scale // 2)
