"""Scenario files of the MovingAI benchmarks: problems on a map, with the cost of the best path."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from companion.core.grid import Cell
from companion.storage.files import read_at_most

MOST_BYTES = 100_000_000


class ScenarioFileError(ValueError):
    """A scenario file that cannot be used; the text is one line with file, line and reason."""


@dataclass(frozen=True, slots=True)
class Scenario:
    """One problem.

    ``start`` and ``target`` are fields with y upward; ``optimum_fields`` is the shortest length as the file gives it.

    Lengths count sqrt 2 for a diagonal step and forbid cutting corners (Sturtevant 2012).
    """

    start: Cell
    target: Cell
    optimum_fields: float


def read_scenarios(file: Path) -> list[Scenario]:
    """All problems of a ``.scen`` file. Raises ScenarioFileError."""
    try:
        lines = read_at_most(file, MOST_BYTES).decode("utf-8").splitlines()
    except OSError as error:
        raise ScenarioFileError(f"{file}: cannot be read: {error.strerror}; name a MovingAI scenario file") from error
    except UnicodeDecodeError as error:
        raise ScenarioFileError(f"{file}: cannot be read as text: {error}") from error
    if not lines or not lines[0].lower().startswith("version"):
        raise ScenarioFileError(f"{file}: line 1: not a MovingAI scenario file, it does not begin with a version")
    return [_scenario(file, number, line) for number, line in enumerate(lines[1:], start=2) if line.strip()]


def _scenario(file: Path, number: int, line: str) -> Scenario:
    parts = line.split()
    try:
        height, start_x, start_y, target_x, target_y = (int(part) for part in parts[3:8])
        optimum_fields = float(parts[8])
    except (ValueError, IndexError):
        raise ScenarioFileError(
            f"{file}: line {number}: nine columns are needed: "
            "bucket, map, width, height, start x and y, target x and y, length"
        ) from None
    return Scenario(Cell(start_x, height - 1 - start_y), Cell(target_x, height - 1 - target_y), optimum_fields)


def spread(scenarios: list[Scenario], count: int) -> list[Scenario]:
    """At most so many, evenly from the easy to the hard (files are sorted by length)."""
    if len(scenarios) <= count:
        return scenarios
    return [scenarios[round(i * (len(scenarios) - 1) / max(count - 1, 1))] for i in range(count)]


def scenario_file(map_file: Path) -> Path | None:
    """The scenario file that lies beside a map, if one does: MAP.scen or any NAME-*.scen."""
    beside = map_file.with_name(f"{map_file.name}.scen")
    if beside.is_file():
        return beside
    return next(iter(sorted(map_file.parent.glob(f"{map_file.stem}-*.scen"))), None)
