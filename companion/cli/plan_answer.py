"""What ``rover-companion plan`` answers: as a table for people, and as JSON."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from rich.table import Table

from companion.core.grid import Cell, Grid
from companion.planning.problem import Path, PlanResult, PlanStatus, VehicleMotion
from companion.settings import Settings
from companion.settings.versions import made_with

EFFORT = {
    "sedighi": ("generations", "chromosomes"),
    "hermanu": ("generations", "chromosomes"),
    "geisler": ("generations", "chromosomes"),
    "vertex": ("generations", "chromosomes"),
    "vertex++": ("generations", "chromosomes"),
    "achour": ("iterations", "segments weighed"),
    "prm": ("queries of the roadmap", "lines looked at"),
}
"""What a result's epochs and evaluations are, where they are not the genetic algorithm's of the paper."""

AHEAD_DEG = 10.0
"""A line that sets out so near to the rover's heading can be driven from there: its first step is a chord of an arc."""

STATUS_WORDS = {
    PlanStatus.FOUND: "found",
    PlanStatus.NO_PATH: "no path: proved that there is none",
    PlanStatus.BUDGET_SPENT: "budget spent: none found, which proves nothing",
}


@dataclass(frozen=True, slots=True)
class Answer:
    """What a search came to, and what was asked. ``motion`` has how the rover turns."""

    result: PlanResult
    seconds: float
    seed: int
    top_left: bool
    grid: Grid
    motion: VehicleMotion
    settings: Settings

    def place(self, cell: Cell) -> tuple[int, int]:
        """A field in the coordinates that the user chose."""
        return flipped(cell, self.grid.height, self.top_left)


def flipped(cell: Cell, height: int, top_left: bool) -> tuple[int, int]:
    """From a field's place in the grid to the user's coordinates, and the same way back."""
    return (cell.x, height - 1 - cell.y) if top_left else (cell.x, cell.y)


def line_of(path: Path) -> NDArray[np.float64]:
    """What is driven: the path's curve; without one the line through the middles of its fields. Shape (n, 2), in fields."""
    return path.cell_array.astype(np.float64) if path.curve is None else path.curve


def length_of(line: NDArray[np.float64]) -> float:
    """How long a line is, in its own unit."""
    return float(np.hypot(*np.diff(line, axis=0).T).sum())


def tightest_radius(line: NDArray[np.float64]) -> float:
    """The radius of a line's sharpest bend: half the two steps there, over the change of direction; inf if it is straight."""
    steps = np.diff(line, axis=0)
    lengths = np.hypot(*steps.T)
    steps, lengths = steps[lengths > 0.0], lengths[lengths > 0.0]
    turns = np.abs(np.diff(np.unwrap(np.arctan2(steps[:, 1], steps[:, 0]))))
    bends = turns > 1e-9
    return float((0.5 * (lengths[1:] + lengths[:-1])[bends] / turns[bends]).min()) if bends.any() else np.inf


def bearing_of(line: NDArray[np.float64]) -> float:
    """Where a line sets out to: 0 along +x, growing towards +y."""
    x, y = next(step for step in line - line[0] if step.any())
    return math.atan2(y, x)


def as_text(answer: Answer) -> str:
    """The answer as one JSON object; the path is a list of [x, y] in the user's coordinates."""
    result, path = answer.result, answer.result.path
    curve = path.curve if path else None
    return json.dumps(
        {
            "status": result.status.value,
            "planner": result.planner,
            "cost": path.cost if path else None,
            "length_fields": path.length_fields if path else None,
            "length_m": path.length_fields * answer.grid.resolution_m if path else None,
            "curve_length_fields": None if curve is None else length_of(curve),
            "curve_length_m": None if curve is None else length_of(curve) * answer.grid.resolution_m,
            "sharpest_bend_m": _bend_m(answer, path) if path else None,
            "time_s": answer.seconds,
            "epochs": result.epochs,
            "evaluations": result.evaluations,
            "control_points": result.control_points,
            "seed": answer.seed,
            "path": [answer.place(cell) for cell in path.cells] if path else None,
            **made_with(answer.settings),
        }
    )


def as_table(answer: Answer) -> Table:
    """The answer for people."""
    result, path = answer.result, answer.result.path
    table = Table(show_header=False)
    table.add_row("status", STATUS_WORDS[result.status])
    table.add_row("planner", result.planner)
    if path is not None:
        for name, text in _lengths(answer, path).items():
            table.add_row(name, text)
    table.add_row("time", f"{answer.seconds * 1000.0:.3f} ms")
    if result.epochs:
        rounds, tries = EFFORT.get(result.planner, ("epochs", "chromosomes"))
        table.add_row("search", f"{result.epochs} {rounds}, {result.evaluations} {tries}")
    return table


def _lengths(answer: Answer, path: Path) -> dict[str, str]:
    """What the path costs and how long it is, field by field and along the line that is driven."""
    resolution_m = answer.grid.resolution_m

    def both(fields: float) -> str:
        return f"{fields:.2f} fields, {fields * resolution_m:.2f} m"

    line = line_of(path)
    rows = {"cost": f"{path.cost:.3f}", "from field to field": both(path.length_fields)}
    rows["line to drive"] = both(length_of(line)) if path.curve is not None else "the same: through the fields' middles"
    bend_m = _bend_m(answer, path)
    radius_m = answer.motion.turning_radius_fields * resolution_m
    if radius_m > 0.0:
        # The line is sampled, which says the radius to some per cent.
        fits = bend_m is None or bend_m >= 0.95 * radius_m
        bend = "none" if bend_m is None else f"{bend_m:.2f} m radius"
        rows["sharpest bend"] = bend if fits else f"{bend}: too tight, the rover would manoeuvre there"
    heading_rad = answer.motion.heading_rad
    if heading_rad is not None and len(line) > 1:
        off_deg = math.degrees(abs(math.remainder(bearing_of(line) - heading_rad, 2.0 * math.pi)))
        ahead = off_deg <= AHEAD_DEG
        rows["sets out"] = "ahead" if ahead else f"{off_deg:.0f} deg off its heading: the rover would manoeuvre first"
    return rows


def _bend_m(answer: Answer, path: Path) -> float | None:
    """The radius of the sharpest bend of what is driven; None for a straight line."""
    radius = tightest_radius(line_of(path))
    return radius * answer.grid.resolution_m if math.isfinite(radius) else None
