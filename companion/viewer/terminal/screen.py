"""The screen of ``--view``: map and facts, below them in one line what the rover does, and the news.

A pure function of the state, as a rich renderable.

Nouns: screen.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from enum import Enum

from rich.console import Group, RenderableType
from rich.layout import Layout
from rich.panel import Panel
from rich.text import Text

from companion.viewer.terminal.facts import Section, broken, fact_line, facts_table
from companion.viewer.terminal.map_panel import map_panel
from companion.viewer.terminal.sketch import Sketch

PANEL_COLUMNS = (32, 44)
"""Smallest and largest width; between them a third of the terminal."""
SMALLEST = (60, 16)
"""Smallest number of columns and rows for a picture."""
NEWS_ROWS, NEWS_SHARE = 3, 6
"""The news have at least so many rows, or one of so many."""
HEADLINE_ROWS = 3


class Mood(Enum):
    """How a headline is to be taken; the values are rich styles."""

    GOOD = "bold #000000 on #5fd75f"
    WAITING = "bold #000000 on #ffd75f"
    BAD = "bold #ffffff on #d70000"
    PLAIN = "bold"


@dataclass(frozen=True, slots=True)
class Headline:
    """What is done now, or why nothing is."""

    text: str
    mood: Mood = Mood.PLAIN


@dataclass(frozen=True, eq=False, slots=True)
class View:
    """The state that is shown. ``events``: texts, the newest last."""

    title: str
    sketch: Sketch
    sections: tuple[Section, ...]
    events: tuple[str, ...] = ()
    headline: Headline | None = None


def render(view: View, columns: int, rows: int, *, colour: bool, least_rows: int = SMALLEST[1]) -> RenderableType:
    """The whole screen, with this many columns and rows of characters. ``least_rows``: fewer give no picture."""
    head = _headline(view.headline, columns)
    if columns < SMALLEST[0] or rows < least_rows:
        return _without_picture(view, head, columns, rows)
    news_rows = max(NEWS_ROWS, rows // NEWS_SHARE)
    main_rows = rows - len(head) - news_rows
    beside = min(max(PANEL_COLUMNS[0], columns // 3), PANEL_COLUMNS[1])
    main = Layout(size=main_rows)
    main.split_row(Layout(name="map"), Layout(name="panel", size=beside))
    main["map"].update(map_panel(view.title, view.sketch, columns - beside - 2, main_rows - 3, colour=colour))
    facts = facts_table(view.sections, beside - 4, main_rows - 2)
    main["panel"].update(Panel(facts, border_style="dim"))
    below = [Layout(Group(*head), size=len(head))] if head else []
    below.append(Layout(Group(*_newest(view.events, columns, news_rows)), size=news_rows))
    layout = Layout()
    layout.split_column(main, *below)
    return layout


def _without_picture(view: View, head: list[Text], columns: int, rows: int) -> Group:
    """Facts only, the headline below them."""
    small = f"{columns} x {rows} characters are too few for a picture (at least {SMALLEST[0]} x {SMALLEST[1]})"
    facts = [fact_line(fact, columns) for section in view.sections for fact in section.facts]
    lines = [*(Text(line, no_wrap=True) for line in broken(small, columns)), *facts]
    return Group(*lines[: max(rows - len(head), 0)], *head[:rows])


def _headline(headline: Headline | None, columns: int) -> list[Text]:
    """Its lines, as wide as the screen; what does not fit into ``HEADLINE_ROWS`` is cut with an ellipsis."""
    if headline is None:
        return []
    lines = broken(headline.text, max(columns - 2, 1))
    if len(lines) > HEADLINE_ROWS:
        lines[HEADLINE_ROWS - 1 :] = [f"{lines[HEADLINE_ROWS - 1][: columns - 3]}…"]
    return [Text(f" {line}".ljust(columns)[:columns], headline.mood.value, no_wrap=True) for line in lines]


def _newest(events: Iterable[str], columns: int, rows: int) -> list[Text]:
    """The newest texts that fit, wrapped; what does not fit is left out, the newest is cut."""
    lines: list[Text] = []
    for text in reversed(tuple(events)):
        wrapped = _wrapped(text, columns)
        if len(lines) + len(wrapped) > rows:
            return lines or wrapped[:rows]
        lines = [*wrapped, *lines]
    return lines


def _wrapped(text: str, columns: int) -> list[Text]:
    """Lines of a text; all but the first are indented by a space."""
    return [Text(line, no_wrap=True) for line in broken(text, columns, " ")]
