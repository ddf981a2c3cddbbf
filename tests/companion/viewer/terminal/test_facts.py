"""Facts make way for each other where there is little room."""

import io

import pytest
from rich.console import Console

from companion.viewer.terminal.facts import Fact, Section, facts_table

ROVER = Section(
    "Rover", (Fact("mode", "GUIDED"), Fact("heading", "90°", minor=True), Fact("GPS", "3D fix", minor=True))
)
LINKS = Section("Links", (Fact("gcs", "10/s", minor=True),))
WHY = Section("Mission", (Fact("why", "the way that was planned is blocked"),))


def shown(sections: tuple[Section, ...], rows: int) -> list[str]:
    console = Console(file=io.StringIO(), width=30)
    console.print(facts_table(sections, 28, rows))
    assert isinstance(console.file, io.StringIO)
    return [line.strip() for line in console.file.getvalue().rstrip().split("\n")]


@pytest.mark.parametrize("rows", range(1, 12))
def test_there_are_never_more_lines_than_rows(rows: int) -> None:
    assert len(shown((ROVER, WHY, LINKS), rows)) <= rows


def test_minor_facts_go_first_and_from_the_end() -> None:
    assert shown((ROVER, LINKS), 6)[-1] == "gcs        10/s"
    assert shown((ROVER, LINKS), 5) == ["Rover", "mode       GUIDED", "heading    90°", "GPS        3D fix"]
    assert shown((ROVER, LINKS), 3) == ["Rover", "mode       GUIDED", "heading    90°"]
    alarm = Section("Rover", (Fact("mode", "GUIDED"), Fact("GPS", "no fix", alarm=True, minor=True)))
    assert "GPS        no fix" in shown((alarm, LINKS), 3)


def test_a_long_fact_is_worth_more_lines_than_minor_ones() -> None:
    lines = shown((ROVER, WHY), 7)
    assert "GPS        3D fix" not in lines and " ".join(" ".join(lines).split()).endswith("planned is blocked")
