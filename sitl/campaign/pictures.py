"""Pictures of a campaign's report: distributions of driving times, and where the time went.

Nouns: heat map.
"""

from __future__ import annotations

import math
import textwrap
from pathlib import Path
from typing import Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from companion.mission.load import load_mission
from sitl.campaign.campaign_file import CampaignTable
from sitl.campaign.policies import ERROR
from sitl.campaign.run_spec import RunResult, RunSpec
from sitl.campaign.summary import Runs, labels, varied
from sitl.campaign.worded import GroundSpec
from sitl.experiments import drawing
from sitl.scenario import Scenario, scenario_from_mission

COLOURS = (drawing.BLUE, drawing.ORANGE, drawing.GREEN, drawing.RED, drawing.GREY, "#7b5ea7", "#56b4e9", "#444444")
STROKES: tuple[Literal["-", "--", ":", "-."], ...] = ("-", "--", ":", "-.")
MOST_PANELS = 9
"""Of a heat map: more combinations are not drawn."""
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
    names = _combinations(campaign, runs)
    looks = {key: (COLOURS[n % len(COLOURS)], STROKES[n // len(COLOURS) % len(STROKES)]) for n, key in enumerate(names)}
    for panel, world in zip(panels, worlds, strict=False):
        for key in names:
            own = [one for spec, one in runs if spec.world == world and _key(campaign, spec) == key]
            at_s = sorted(one.seconds for one in own if one.complete)
            if at_s:
                shares = np.arange(len(at_s) + 1) / len(own)
                colour, stroke = looks[key]
                panel.step([at_s[0], *at_s], shares, where="post", color=colour, linestyle=stroke)
        drawing.title(panel, _wrapped(labels(campaign, "world")[world], PANEL_IN, TITLE_LETTER_IN))
        panel.set_ylim(0.0, 1.02)
        panel.spines[["top", "right"]].set_visible(False)
        panel.set_xlabel("driving time, s", fontsize=8)
        panel.tick_params(labelsize=8)
    for panel in panels[len(worlds) :]:
        panel.set_visible(False)
    panels[0].set_ylabel("share of all runs", fontsize=8)
    if len(names) > 1:
        wide_in = figure.get_figwidth()
        texts = [_wrapped(name, wide_in - 2.0 * HANDLE_IN, LETTER_IN) for name in names.values()]
        longest = max(len(line) for text in texts for line in text.split("\n"))
        fitting = max(1, int(wide_in / (LETTER_IN * longest + HANDLE_IN)))
        columns = min(3, len(names), fitting)
        tall = -(-sum(text.count("\n") + 1 for text in texts) // columns)
        figure.set_figheight(figure.get_figheight() + LINE_IN * max(0, tall - 2))
        handles = [Line2D([], [], color=colour, linestyle=stroke) for colour, stroke in looks.values()]
        figure.legend(handles, texts, loc="outside lower center", ncols=columns, frameon=False, fontsize=8)
    return figure


def _wrapped(text: str, width_in: float, letter_in: float) -> str:
    """The text in lines of this width: faults in words are long."""
    return textwrap.fill(text, max(10, int(width_in / letter_in)), break_on_hyphens=False)


def _key(campaign: CampaignTable, spec: RunSpec) -> tuple[object, ...]:
    return tuple(getattr(spec, axis) for axis in varied(campaign) if axis != "world")


def _combinations(campaign: CampaignTable, runs: Runs) -> dict[tuple[object, ...], str]:
    """The combinations of all axes but the world, each with its name."""
    axes = [axis for axis in varied(campaign) if axis != "world"]
    words = {axis: labels(campaign, axis) for axis in axes}
    return {
        key: ", ".join(_named(axis, value, words[axis]) for axis, value in zip(axes, key, strict=True)) or "all"
        for key in dict.fromkeys(_key(campaign, spec) for spec, _ in runs)
    }


def _named(axis: str, value: object, words: dict[object, str]) -> str:
    return f"{axis} {words[value]}" if isinstance(value, bool | float) else words[value]


def heat_maps(campaign: CampaignTable, runs: Runs, folder: Path) -> list[tuple[str, Figure]]:
    """Of each world that is the same for every seed: the mission's name and its picture, a panel a combination."""
    names, maps = _combinations(campaign, runs), []
    for world in campaign.worlds:
        own: dict[str, list[RunResult]] = {}
        for spec, result in runs:
            if spec.world == world and GroundSpec.of(world) is None and result.outcome != ERROR:
                own.setdefault(names[_key(campaign, spec)], []).append(result)
        if own:
            maps.append((world, _heat_map(folder / world, own)))
    return maps


def _heat_map(mission_file: Path, results: dict[str, list[RunResult]]) -> Figure:
    """``results``: by the name of the combination. All panels have the same colours for the same time."""
    spent = {name: _mean_s(own) for name, own in list(results.items())[:MOST_PANELS]}
    scenario = scenario_from_mission(load_mission(mission_file))
    places = [place for one in spent.values() for place in one]
    north_m, east_m = _extent(places, scenario.start.north_m, scenario.start.east_m)
    longest_s = max((seconds for one in spent.values() for seconds in one.values()), default=1.0)
    columns = math.ceil(math.sqrt(len(spent)))
    lines, width = -(-len(spent) // columns), 8.0 if len(spent) == 1 else PANEL_IN
    tall = width * 0.9 * min(1.2, (north_m[1] - north_m[0]) / (east_m[1] - east_m[0])) + 0.9
    figure = Figure(figsize=(width * columns + 0.8, tall * lines + 0.3), layout="constrained")
    panels = figure.subplots(lines, columns, squeeze=False).ravel()
    for panel, (name, squares) in zip(panels, spent.items(), strict=False):
        shares = np.full((north_m[1] - north_m[0], east_m[1] - east_m[0]), np.nan)
        for (north, east), mean_s in squares.items():
            shares[north - north_m[0], east - east_m[0]] = mean_s
        _draw_walls(panel, scenario)
        shown_at = (east_m[0], east_m[1], north_m[0], north_m[1])
        image = panel.imshow(
            shares, origin="lower", extent=shown_at, cmap="YlOrRd", vmin=0.0, vmax=longest_s, interpolation="nearest"
        )
        panel.set_anchor("W")  # its title has the room to the right of it
        panel.set_xlim(east_m[0], east_m[1])
        panel.set_ylim(north_m[0], north_m[1])
        panel.plot(scenario.start.east_m, scenario.start.north_m, "^", color=drawing.BLUE, markersize=8)
        panel.set_xlabel("metres east", fontsize=8)
        panel.set_ylabel("metres north", fontsize=8)
        panel.tick_params(labelsize=8)
        drawing.title(
            panel,
            _wrapped(
                f"{mission_file.stem}, {name}: {len(results[name])} run{'s' * (len(results[name]) != 1)}",
                width,
                TITLE_LETTER_IN,
            ),
        )
    for panel in panels[len(spent) :]:
        panel.set_visible(False)
    figure.colorbar(image, ax=panels.tolist(), label="seconds in a square metre", shrink=0.8, panchor=False)
    return figure


def _mean_s(results: list[RunResult]) -> dict[tuple[int, int], float]:
    """Seconds in each square, the mean of the runs."""
    spent: dict[tuple[int, int], float] = {}
    for result in results:
        for north, east, seconds in result.dwelt:
            spent[north, east] = spent.get((north, east), 0.0) + seconds / len(results)
    return spent


def _draw_walls(panel: Axes, scenario: Scenario) -> None:
    solid: NDArray[np.bool_] = scenario.world.obstacles
    if solid.size > 1:
        side_m = scenario.world.resolution_m
        edges = (0.0, solid.shape[1] * side_m, 0.0, solid.shape[0] * side_m)
        walls = np.where(solid, 1.0, np.nan)
        panel.imshow(walls, origin="lower", extent=edges, cmap="gray", vmin=0.0, vmax=4.0, interpolation="nearest")


def _extent(places: list[tuple[int, int]], north_m: float, east_m: float) -> tuple[tuple[int, int], tuple[int, int]]:
    """From where to where, north and east, with two metres round it."""
    norths, easts = [int(north_m), *(place[0] for place in places)], [int(east_m), *(place[1] for place in places)]
    return (min(norths) - 2, max(norths) + 3), (min(easts) - 2, max(easts) + 3)
