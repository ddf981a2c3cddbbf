"""Facts beside the map: sections of names and values, as many as there is room for.

Nouns: fact.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from rich.table import Table
from rich.text import Text

NAME_COLUMNS = 11
MOST_LINES = 3
"""Minor facts make way for so many lines of another."""


@dataclass(frozen=True, slots=True)
class Fact:
    """One line of the panel; ``alarm``: highlighted; ``minor``: left out first where there is no room."""

    name: str
    value: str
    alarm: bool = False
    minor: bool = False


@dataclass(frozen=True, slots=True)
class Section:
    """Facts under a heading."""

    title: str
    facts: tuple[Fact, ...]


def facts_table(sections: tuple[Section, ...], columns: int, rows: int) -> Table:
    """The sections; without minor facts where there is no room. Long facts take several lines where there is some."""
    table = Table.grid()
    table.add_column(width=columns, no_wrap=True, overflow="ellipsis")
    sections = _fitting(sections, columns, rows)
    spare = max(rows - sum(1 + len(section.facts) for section in sections), 0)
    lines: list[Text] = []
    for section in sections:
        lines.append(Text(section.title, "bold"))
        for fact in section.facts:
            lines_of_fact = _fact_lines(fact, columns, spare + 1)
            spare -= len(lines_of_fact) - 1
            lines += lines_of_fact
    for line in lines[:rows]:
        table.add_row(line)
    return table


def _fitting(sections: tuple[Section, ...], columns: int, rows: int) -> tuple[Section, ...]:
    """The sections, less the last minor facts until the rest fits; a section without facts is left out."""
    kept = [list(section.facts) for section in sections]
    too_many = sum(len(_fact_lines(fact, columns, MOST_LINES)) for facts in kept for fact in facts)
    too_many += len(kept) - rows
    for facts in reversed(kept):
        for number in reversed(range(len(facts))):
            if too_many > 0 and facts[number].minor and not facts[number].alarm:
                too_many -= len(_fact_lines(facts.pop(number), columns, MOST_LINES))
        too_many -= not facts
    return tuple(replace(section, facts=tuple(facts)) for section, facts in zip(sections, kept, strict=True) if facts)


def fact_line(fact: Fact, columns: int) -> Text:
    """A fact on one line."""
    return _fact_lines(fact, columns, 1)[0]


def _fact_lines(fact: Fact, columns: int, most: int) -> list[Text]:
    """A fact in at most ``most`` lines; text that does not fit is cut with an ellipsis."""
    style = "bold not dim #ff5f5f" if fact.alarm else "not dim"
    values = broken(fact.value, max(columns - NAME_COLUMNS, 1))
    if len(values) > most:
        values[most - 1 :] = [f"{values[most - 1]} {values[most]}"]  # which is too long, and cut below
    lines = []
    for number, value in enumerate(values):
        line = Text((fact.name if number == 0 else "").ljust(NAME_COLUMNS), "dim", no_wrap=True)
        line.append(value, style)
        line.truncate(columns, overflow="ellipsis")
        lines.append(line)
    return lines


def broken(text: str, columns: int, indent: str = "") -> list[str]:
    """A text in lines of at most ``columns`` characters, at least one; longer words are split."""
    lines = [""]
    for word in text.split():
        if lines[-1].strip() and len(lines[-1]) + 1 + len(word) > columns:
            lines.append(indent)
        lines[-1] += word if not lines[-1].strip() else f" {word}"
        while len(lines[-1]) > columns:
            lines[-1:] = [lines[-1][:columns], indent + lines[-1][columns:]]
    return lines
