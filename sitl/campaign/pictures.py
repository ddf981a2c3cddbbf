"""The picture of a campaign's driving times: how many runs were complete after how long."""

from __future__ import annotations

import textwrap
from typing import Literal

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from sitl.campaign.campaign_file import CampaignTable
from sitl.campaign.run_spec import RunSpec
from sitl.campaign.summary import Runs, labels, varied
from sitl.experiments import drawing

COLOURS = (drawing.BLUE, drawing.ORANGE, drawing.GREEN, drawing.RED, drawing.GREY, "#7b5ea7", "#56b4e9", "#444444")
STROKES: tuple[Literal["-", "--", ":", "-."], ...] = ("-", "--", ":", "-.")
PANEL_IN, LETTER_IN, TITLE_LETTER_IN = 4.2, 0.064, 0.098
"""The width of a panel, and about that of a letter of the legend and of a title."""
HANDLE_IN, LINE_IN = 0.55, 0.18
"""Of the legend: a handle with room, and the height of a line."""


def times(campaign: CampaignTable, runs: Runs) -> Figure:
    """For each world the share of all runs that were complete within so many seconds, a line for each combination."""
    worlds = [world for world in campaign.worlds if any(spec.world == world and one.complete for spec, one in runs)]
    columns = min(3, len(worlds))
    lines = -(-len(worlds) // columns)
    figure = Figure(figsize=(PANEL_IN * columns + 0.6, 3.0 * lines + 0.6), layout="constrained")
    panels = figure.subplots(lines, columns, squeeze=False).ravel()
    names = combinations(campaign, runs)
    looks = {key: (COLOURS[n % len(COLOURS)], STROKES[n // len(COLOURS) % len(STROKES)]) for n, key in enumerate(names)}
    for panel, world in zip(panels, worlds, strict=False):
        for key in names:
            own = [one for spec, one in runs if spec.world == world and combination_of(campaign, spec) == key]
            at_s = sorted(one.seconds for one in own if one.complete)
            if at_s:
                shares = np.arange(len(at_s) + 1) / len(own)
                colour, stroke = looks[key]
                panel.step([at_s[0], *at_s], shares, where="post", color=colour, linestyle=stroke)
        drawing.title(panel, wrapped(labels(campaign, "world")[world], PANEL_IN, TITLE_LETTER_IN))
        panel.set_ylim(0.0, 1.02)
        panel.spines[["top", "right"]].set_visible(False)
        panel.set_xlabel("driving time, s", fontsize=8)
        panel.tick_params(labelsize=8)
    for panel in panels[len(worlds) :]:
        panel.set_visible(False)
    panels[0].set_ylabel("share of all runs", fontsize=8)
    if len(names) > 1:
        wide_in = figure.get_figwidth()
        texts = [wrapped(name, wide_in - 2.0 * HANDLE_IN, LETTER_IN) for name in names.values()]
        longest = max(len(line) for text in texts for line in text.split("\n"))
        fitting = max(1, int(wide_in / (LETTER_IN * longest + HANDLE_IN)))
        columns = min(3, len(names), fitting)
        tall = -(-sum(text.count("\n") + 1 for text in texts) // columns)
        figure.set_figheight(figure.get_figheight() + LINE_IN * max(0, tall - 2))
        handles = [Line2D([], [], color=colour, linestyle=stroke) for colour, stroke in looks.values()]
        figure.legend(handles, texts, loc="outside lower center", ncols=columns, frameon=False, fontsize=8)
    return figure


def wrapped(text: str, width_in: float, letter_in: float) -> str:
    """The text in lines of this width: faults in words are long."""
    return textwrap.fill(text, max(10, int(width_in / letter_in)), break_on_hyphens=False)


def combination_of(campaign: CampaignTable, spec: RunSpec) -> tuple[object, ...]:
    """The values of all axes that vary, but the world."""
    return tuple(getattr(spec, axis) for axis in varied(campaign) if axis != "world")


def combinations(campaign: CampaignTable, runs: Runs) -> dict[tuple[object, ...], str]:
    """The combinations of all axes but the world, each with its name."""
    axes = [axis for axis in varied(campaign) if axis != "world"]
    words = {axis: labels(campaign, axis) for axis in axes}
    return {
        key: ", ".join(_named(axis, value, words[axis]) for axis, value in zip(axes, key, strict=True)) or "all"
        for key in dict.fromkeys(combination_of(campaign, spec) for spec, _ in runs)
    }


def _named(axis: str, value: object, words: dict[object, str]) -> str:
    return f"{axis} {words[value]}" if isinstance(value, bool | float) else words[value]
