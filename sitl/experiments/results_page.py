"""The page of results: each experiment owns one section of it and replaces that alone."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from rich import box
from rich.table import Table

from companion.storage.files import read_at_most, whole_file

MOST_BYTES = 10_000_000

HEAD = """# Results

Tables and pictures on this page are written by the commands named in each section (`make results` runs them
all); nothing is entered by hand.
"""


def write_section(folder: Path, name: str, text: str, file: str) -> Path:
    """Put a section into ``folder``/``file``, in place of its former self or at the end."""
    page = folder / file
    folder.mkdir(parents=True, exist_ok=True)
    before = read_at_most(page, MOST_BYTES).decode("utf-8") if page.exists() else HEAD
    begin, end = f"<!-- begin {name} -->", f"<!-- end {name} -->"
    section = f"{begin}\n{text.strip()}\n{end}\n"
    if begin in before and end in before:
        head, _, rest = before.partition(begin)
        tail = rest.partition(end)[2].lstrip("\n")
        after = head + section + (f"\n{tail}" if tail else "")
    else:
        after = f"{before.rstrip()}\n\n{section}"
    with whole_file(page) as new:
        new.write_text(after, encoding="utf-8")
    return page


def terminal_table(title: str, head: Sequence[str], rows: Sequence[Sequence[str]], texts: Sequence[str] = ()) -> Table:
    """The same for the terminal, narrow enough for 80 columns.

    ``texts``: columns of words, which may take several lines.
    """
    table = Table(title=title, title_justify="left", box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0), pad_edge=False)
    for column, name in enumerate(head):
        text = name in texts
        table.add_column(name, justify="right" if column and not text else "left", no_wrap=not text)
    for row in rows:
        table.add_row(*row)
    return table


def share_with_interval(count: int, of: int) -> str:
    """A share of runs, and its 95 % interval after Clopper and Pearson (exact): of no contact in 100, 0 to 0.036."""
    from scipy.stats import binomtest

    if of == 0:
        return "-"
    bounds = binomtest(count, of).proportion_ci(0.95, "exact")
    return f"{count / of:.3f} ({bounds.low:.3f} to {bounds.high:.3f})"


def without_intervals(rows: Sequence[Sequence[str]]) -> list[list[str]]:
    """The same figures without what stands in brackets: a terminal is narrow."""
    return [[cell.partition(" (")[0] for cell in row] for row in rows]


def markdown_table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table; the first column is text, the others are figures and stand right."""
    lines = [head, [":--", *["--:"] * (len(head) - 1)], *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)
