"""Search spaces in the form of Sedighi et al. 2004: square, from the upper left corner to the lower right one.

The paper shows its own only as small pictures. These eight are ours, drawn to fit what it says of them: 01 can be
crossed row by row only; 02, 05 and 06 defeat a row-wise planner but not a column-wise one; 03 and 04 can be crossed row
by row and column by column; 07 and 08 need both in one path.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from companion.core.grid import BASE_WEIGHT, OBSTACLE, Cell, Weights
from companion.planning.problem import PlanningProblem
from companion.storage.files import read_at_most
from sitl.experiments.experiment import ExperimentError

MOST_BYTES = 10_000_000
DRAWINGS = {
    "SPSet01": """
        ..........
        ..........
        #######...
        ..........
        ..........
        ...#######
        ..........
        #######...
        ..........
        ..........
    """,
    "SPSet02": """
        ..#.......
        ..#...#...
        ..#...#...
        ..#...#...
        ..#...#.#.
        ......#...
        ......#...
        ......#...
        ..#...#...
        ..#...#...
    """,
    "SPSet03": """
        ..........
        .###..##..
        .###..##..
        ......##..
        ..........
        ###..####.
        ###..####.
        ..........
        .##...##..
        ......##..
    """,
    "SPSet04": """
        ....#.....
        .##...##..
        .##.#.....
        ....####..
        .##......#
        .##.##.#..
        ....##.##.
        .#........
        .###.###.#
        ..........
    """,
    "SPSet05": """
        ....#.......
        ....#.......
        ....#...#...
        ....#...#...
        .##.#...#...
        .##.....#.#.
        ........#.#.
        ........#...
        ....#...#...
        ....#...#...
        ....#...#...
        ....#...#...
    """,
    "SPSet06": """
        ..#.........
        ..#.........
        ..#...###...
        ..#...#.....
        ..#...#..#..
        ..#...#..#..
        ..#...#..#..
        ..#...#..#..
        ..#...#..#..
        ......#..#..
        ......#..#..
        ......#..#..
    """,
    "SPSet07": """
        ..........
        ########..
        ..........
        ..########
        ......#...
        ......#.#.
        ......#.#.
        ......#.#.
        ........#.
        ........#.
    """,
    "SPSet08": """
        ..#.........
        ..#.........
        ..#.........
        ..#..#####..
        ..#..#......
        ..#..#......
        .....#..####
        .....#......
        .....#....#.
        .....#....#.
        .....#....#.
        .....#....#.
    """,
}


def weights_of(rows: list[str], obstacle: str) -> Weights:
    """The map of a drawing, top row north."""
    return np.array([[OBSTACLE if letter == obstacle else BASE_WEIGHT for letter in row] for row in reversed(rows)])


def crossing(weights: Weights) -> PlanningProblem:
    """From the upper left corner to the lower right one."""
    height, width = weights.shape
    return PlanningProblem(weights, Cell(0, height - 1), Cell(width - 1, 0))


def own_spaces() -> dict[str, PlanningProblem]:
    """SPSet01 to SPSet08."""
    return {name: crossing(weights_of(drawing.split(), "#")) for name, drawing in DRAWINGS.items()}


def given_spaces(folder: Path) -> dict[str, PlanningProblem]:
    """Every grid of a folder (*.txt: the number of rows, then as many rows of 0 free, 1 obstacle), by the file's name.

    Raises ExperimentError for a folder without grids. Text files of another kind are passed over.
    """
    if not folder.is_dir():
        raise ExperimentError(f"{folder}: no such folder of grids (--maps)")
    spaces = {}
    for file in sorted(folder.glob("*.txt")):
        try:
            first, *rows = read_at_most(file, MOST_BYTES).decode("utf-8").split()
        except (OSError, ValueError):
            continue
        square = first.isdecimal() and int(first) == len(rows) > 0 and all(len(row) == len(rows) for row in rows)
        if square and set("".join(rows)) <= {"0", "1"}:
            spaces[file.stem] = crossing(weights_of(rows, "1"))
    if not spaces:
        raise ExperimentError(f"{folder}: no grids (*.txt: the number of rows, then as many rows of 0 and 1)")
    return spaces


def origin_of(folder: Path) -> str | None:
    """The first web address in the folder's SOURCE.txt: where its grids come from."""
    try:
        text = read_at_most(folder / "SOURCE.txt", MOST_BYTES).decode("utf-8")
    except (OSError, ValueError):
        return None
    return next(iter(re.findall(r"https?://[^\s)]+", text)), None)
