"""``docs/benchmarks.md`` and its plot, written from what was measured."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from companion.bench.aims import genetic_ratios, genetic_verdict, peer_ratios, peers_verdict
from companion.bench.cases import PAPER_MAPS, Case
from companion.bench.contestants import Contestant
from companion.bench.measure import Entry, Limits
from companion.bench.report import head, rows, runs_explained, where
from companion.storage.files import refuse_pipe, whole_file

PICTURE = "benchmarks.png"


def write_page(
    folder: Path, command: str, entries: list[Entry], contestants: list[Contestant], cases: list[Case], limits: Limits
) -> list[Path]:
    """Write page and picture; gives the files written."""
    page, picture = folder / "benchmarks.md", folder / "images" / PICTURE
    picture.parent.mkdir(parents=True, exist_ok=True)
    for file in (page, picture):
        refuse_pipe(file)
    with whole_file(page) as new:
        new.write_text(_page(command, entries, contestants, cases, limits), encoding="utf-8")
    plot(picture, entries, contestants)
    return [page, picture]


def _page(command: str, entries: list[Entry], contestants: list[Contestant], cases: list[Case], limits: Limits) -> str:
    parts = [
        f"""# Benchmarks of the planners

Written by `{command}`. All rows were measured in one process, one after the other, so they can be compared with each
other; on another machine all are faster or slower.

{where()}. At most {limits.cell_s:g} s for one planner on one map, and a planner whose next larger map would take longer
than that for a single search is not sent there (`-`). Times are medians of whole searches as a user calls them, in
milliseconds, with the 99th percentile in brackets: a new map each time, so building a graph or a queue counts. *cost /
best* is the median cost of the paths over the least possible (Dijkstra's); *MB* is by how much the process grew during
one search. Where several figures stand in one cell they belong to the sizes in order. Remarks on faults are by our own
rules: no path may touch an obstacle or cut its corner; paths of any-angle planners are rounded to fields for this, and
may touch a corner by the rounding.

{chr(10).join(runs_explained(limits))}

![Time against size](images/{PICTURE})
"""
    ]
    for name in dict.fromkeys(case.name for case in cases):
        own = [case for case in cases if case.name == name]
        scales = [case.scale for case in own]
        height, width = own[0].weights.shape
        size = f"{width} x {height} fields" + (
            f" and {', '.join(f'{s} x' for s in scales[1:])} as large" if own[1:] else ""
        )
        problems = len(own[0].ends)
        title = f"{name} ({size}{f', {problems} problems' if problems > 1 else ''})"
        parts.append(f"## {title}\n\n{_markdown(head(scales), rows(entries, contestants, name, scales))}\n")
    parts += [part for part in (_ratios(entries), _peers(entries, contestants)) if part]
    return "\n".join(parts).rstrip() + "\n"


def _markdown(names: list[str], table: list[list[str]]) -> str:
    marks = [":--", *["--:"] * (len(names) - 2), ":--"]
    return "\n".join(f"| {' | '.join(row)} |" for row in (names, marks, *table))


def _ratios(entries: list[Entry]) -> str:
    """The genetic algorithm against graph search, where both were measured."""
    ratios = genetic_ratios(entries)
    if not ratios:
        return ""
    lines = [[name, f"x{scale}", f"{ratio:.2f}", f"{100.0 * share:.0f} %"] for name, scale, ratio, share in ratios]
    table = _markdown(["map", "size", "astar's time over bspline-ga's", "bspline-ga finds a path in"], lines)
    return f"## Where the genetic algorithm wins, and where it stops\n\n{genetic_verdict(ratios)}\n\n{table}\n"


def _peers(entries: list[Entry], contestants: list[Contestant]) -> str:
    """Our fastest complete planner against the fastest of others, where both were measured."""
    ratios = peer_ratios(entries, contestants)
    if not ratios:
        return ""
    lines = [[name, f"x{scale}", f"{ratio:.2f}", peer] for name, scale, peer, ratio in ratios]
    table = _markdown(["map", "size", "the peer's time over astar's", "fastest complete peer"], lines)
    return f"## astar against the fastest peer\n\n{peers_verdict(ratios)}\n\n{table}\n"


def plot(file: Path, entries: list[Entry], contestants: list[Contestant]) -> None:
    """Median time against the size of the four maps, both logarithmic; ours in colour, peers grey."""
    from matplotlib import colormaps
    from matplotlib.figure import Figure

    maps = [name for name in PAPER_MAPS if any(entry.case == name for entry in entries)] or sorted(
        {e.case for e in entries}
    )
    figure = Figure(figsize=(13.0, 4.2 * ((len(maps) + 1) // 2)), layout="constrained", dpi=100)
    panels: Any = np.atleast_1d(figure.subplots((len(maps) + 1) // 2, 2, sharey=True)).ravel()
    colours = colormaps["tab20"].colors  # type: ignore[attr-defined]
    ours = [contestant.name for contestant in contestants if contestant.ours]
    for panel, name in zip(panels, maps, strict=False):
        for contestant in contestants:
            own = sorted((e.scale, e.median_ms) for e in entries if (e.contestant, e.case) == (contestant.name, name))
            if own:
                colour = colours[ours.index(contestant.name) % 20] if contestant.ours else (0.6, 0.6, 0.6)
                style = "-o" if contestant.ours else ":."
                panel.plot(*zip(*own, strict=True), style, color=colour, label=contestant.name, markersize=4)
                if not contestant.ours:
                    panel.annotate(
                        contestant.name, own[-1], fontsize=6, color="0.4", xytext=(3, 0), textcoords="offset points"
                    )
        panel.set_xscale("log")
        panel.set_yscale("log")
        panel.set_title(name, loc="left", fontsize=10, fontweight="bold")
        panel.set_xlabel("times 100 x 50 fields, each side")
        panel.set_ylabel("median search, ms")
        panel.grid(alpha=0.25)
    for panel in panels[len(maps) :]:
        panel.set_visible(False)
    handles, labels = panels[0].get_legend_handles_labels()
    own_handles = [(h, label) for h, label in zip(handles, labels, strict=True) if label in ours]
    if own_handles:
        figure.legend(*zip(*own_handles, strict=True), loc="outside right upper", frameon=False, fontsize=8)
    with whole_file(file) as new:
        figure.savefig(new, metadata={"Software": None})
