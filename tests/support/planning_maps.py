"""Maps and shorthands that several planning tests share."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from companion.core.grid import BASE_WEIGHT, OBSTACLE, Cell, Weights
from companion.planning.problem import PlanningProblem


def drawn(*rows: str) -> Weights:
    """Weights from a drawing, top row = north: # obstacle, digit d = weight d / 10, anything else the base weight."""
    shades = {"#": OBSTACLE} | {str(d): d / 10.0 for d in range(10)}
    return np.array([[shades.get(letter, BASE_WEIGHT) for letter in row] for row in reversed(rows)])


def one_obstacle(factor: int = 1) -> PlanningProblem:
    """100 x 50 fields (times the factor) with one block across the straight way."""
    weights = np.full((50 * factor, 100 * factor), BASE_WEIGHT)
    weights[15 * factor : 36 * factor, 48 * factor : 53 * factor] = OBSTACLE
    return PlanningProblem(weights, Cell(0, 24 * factor), Cell(98 * factor, 24 * factor))


def movingai_map(file: Path) -> Weights:
    """A MovingAI map by the format's own rules, read independently of ``companion.mapping.map_files``."""
    rows = file.read_text(encoding="ascii").splitlines()[4:]
    return np.array([[BASE_WEIGHT if letter in ".GS" else OBSTACLE for letter in row] for row in reversed(rows)])
