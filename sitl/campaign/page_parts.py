"""Parts of the HTML pages of campaigns and searches: document, table, figure. A page loads nothing."""

from __future__ import annotations

import base64
import html
import io
from collections.abc import Container, Iterable, Sequence
from itertools import repeat

from matplotlib.figure import Figure

IN_FILES, SERVED = ("<html ", 'data-run="'), ('<html class="served" ', 'target="_blank" href="/replay/')
"""What makes links of the runs of a page, where somebody answers them; in a file they are plain text."""
WIDE_LETTERS = 30
"""Longer words of a column are wrapped."""
STYLE = """
:root { color-scheme: light dark; --line: #8886; --soft: #8882; }
body { font: 15px/1.5 system-ui, sans-serif; max-width: 75rem; margin: 2rem auto; padding: 0 1rem; }
h1 { font-size: 1.6rem; } h2 { font-size: 1.2rem; margin-top: 2.2rem; }
/* A shadow at an edge behind which the table goes on: what covers it scrolls along with the table. */
.scroll { overflow-x: auto; background:
  linear-gradient(to right, Canvas 50%, transparent) 0 / 3rem 100% no-repeat local,
  linear-gradient(to left, Canvas 50%, transparent) 100% / 3rem 100% no-repeat local,
  linear-gradient(to right, #888a, transparent) 0 / 1rem 100% no-repeat scroll,
  linear-gradient(to left, #888a, transparent) 100% / 1rem 100% no-repeat scroll; }
/* A long table scrolls in a window of its own, and its head stays. */
.long .scroll { max-height: 80vh; overflow: auto; }
.long th { position: sticky; top: 0; background: linear-gradient(var(--soft), var(--soft)), Canvas; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; }
th, td { padding: .25rem .7rem; text-align: right; border-bottom: 1px solid var(--line); white-space: nowrap; }
th { background: var(--soft); vertical-align: bottom; } th.text, td.text { text-align: left; }
td.wide { white-space: normal; min-width: 14rem; text-align: left; }
th[aria-sort] { cursor: pointer; } th[aria-sort=ascending]::after { content: " ▲"; }
th[aria-sort=descending]::after { content: " ▼"; }
.filter { display: flex; flex-wrap: wrap; gap: .3rem .9rem; align-items: baseline; }
.filter select { max-width: 14rem; } .filter[hidden] { display: none; }
figure { margin: 1rem 0; background: #fff; padding: .5rem; display: inline-block; max-width: 100%; }
img { max-width: 100%; height: auto; } figcaption { color: #444; font-size: .9em; }
code { font-size: .85em; background: var(--soft); padding: .1rem .3rem; user-select: all; }
html:not(.served) .replays { display: none; }
"""


REPLAYS = '<span class="replays">A click on a seed drives the run again and shows it. </span>'
"""Told where the page is served."""


def number_of(count: int, what: str) -> str:
    """The number with its word, like ``1 run`` or ``2 runs``."""
    return f"{count} {what}{'' if count == 1 else 's'}"


def long_columns(lines: Iterable[Sequence[str]], among: Iterable[int]) -> set[int]:
    """The numbers of the columns, of those given, that are to be wrapped."""
    found = list(among)
    return {number for line in lines for number in found if len(line[number]) > WIDE_LETTERS}


def table(
    head: Sequence[str],
    lines: Iterable[Sequence[str]],
    text: Container[int],
    wide: Container[int] = (),
    code: Container[int] = (),
    runs: Sequence[str] = (),
    linked: int = 0,
) -> str:
    """``text``: the numbers of the columns that are words; ``wide``: of those that are wrapped; ``code``: of commands.

    The others are figures. ``runs``: the run of each line; its cell ``linked`` is a link that drives it again, where
    the page is served.
    """

    def kind(number: int) -> str:
        return "wide" if number in wide else "text" if number in text or number in code else ""

    def cell(number: int, content: str, run: str) -> str:
        inside = html.escape(content)
        if number in code:
            inside = f"<code>{inside}</code>"
        if run and number == linked:
            inside = f'<a class="replay" data-run="{run}">{inside}</a>'
        return f'<td class="{kind(number)}">{inside}</td>'

    top = "".join(
        f'<th class="{"text" if kind(number) else ""}">{html.escape(name)}</th>' for number, name in enumerate(head)
    )
    body = "".join(
        f"<tr>{''.join(cell(n, content, run) for n, content in enumerate(line))}</tr>"
        for line, run in zip(lines, runs or repeat(""), strict=False)
    )
    return f'<div class="scroll"><table><thead><tr>{top}</tr></thead><tbody>{body}</tbody></table></div>'


def served(page: str) -> str:
    """The same page with links at its runs."""
    for here, there in zip(IN_FILES, SERVED, strict=True):
        page = page.replace(here, there)
    return page


def picture(figure: Figure, what: str) -> str:
    """``what``: in words, below it."""
    out = io.BytesIO()
    figure.savefig(out, format="png", dpi=110, metadata={"Software": None})
    data = base64.b64encode(out.getvalue()).decode()
    return (
        f'<figure><img alt="" src="data:image/png;base64,{data}"><figcaption>{html.escape(what)}</figcaption></figure>'
    )


def document(title: str, parts: Iterable[str]) -> str:
    """The whole page."""
    return (
        f'<!doctype html><html lang="en"><head><meta charset="utf-8"><title>{html.escape(title)}</title>'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<style>{STYLE}</style></head><body>{''.join(parts)}</body></html>\n"
    )
