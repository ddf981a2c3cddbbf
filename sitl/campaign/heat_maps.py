"""Where the time went, of each world of a campaign: seconds in each square of one metre, a panel for each combination.

Nouns: heat map.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.image import AxesImage

from companion.mission.load import load_mission
from sitl.campaign.campaign_file import CampaignTable
from sitl.campaign.drive_run import NO_GROUND
from sitl.campaign.pictures import LINE_IN, PANEL_IN, TITLE_LETTER_IN, combination_of, combinations, wrapped
from sitl.campaign.policies import ERROR
from sitl.campaign.run_spec import RunResult
from sitl.campaign.summary import Runs, labels
from sitl.campaign.worded import GroundSpec
from sitl.experiments import drawing
from sitl.scenario import scenario_from_mission
from sitl.world.world import World

MOST_PANELS = 9
"""More combinations are not drawn."""


class _Stage(NamedTuple):
    """Where runs are drawn; ``start_m``: north and east."""

    world: World
    start_m: tuple[float, float]


Squares = Mapping[tuple[int, int], float]
"""Seconds by metres north and east of the world's corner, rounded down."""


def heat_maps(campaign: CampaignTable, runs: Runs, folder: Path) -> list[tuple[str, Figure]]:
    """Each picture with what it shows. ``folder``: of the campaign's file.

    A mission's ground is the same for every seed: means over its runs. Generated ground is another one for each seed:
    two of its grounds (``shown_seeds``).
    """
    maps = []
    for world in campaign.worlds:
        own = [one for one in runs if one[0].world == world and one[1].outcome not in (ERROR, NO_GROUND)]
        if not any(result.dwelt for _, result in own):
            continue
        name, ground = labels(campaign, "world")[world], GroundSpec.of(world)
        if ground is None:
            scenario = scenario_from_mission(load_mission(folder / world))
            stage = _Stage(scenario.world, (scenario.start.north_m, scenario.start.east_m))
            maps.append((f"{name}: mean over the runs", _heat_map(stage, name, _panels(campaign, own))))
            continue
        for seed, what in shown_seeds(own).items():
            there = ground.made(seed)
            of_seed = [one for one in own if one[0].seed == seed]
            figure = _heat_map(_Stage(there.world, there.start_m), f"{name}, seed {seed}", _panels(campaign, of_seed))
            maps.append((f"{name}, seed {seed}: {what}", figure))
    return maps


def shown_seeds(runs: Runs) -> dict[int, str]:
    """Seeds of generated ground with what they stand for: the one in the middle by time lost, and the one with most.

    Time lost: driving time beyond the bound, the mean of a seed's runs. Targets that were not reached come before it:
    a run that gives up is a short one. Only seeds on which all is driven that was driven on any.
    """
    of_seed = dict[int, list[RunResult]]()
    for spec, result in runs:
        of_seed.setdefault(spec.seed, []).append(result)
    most = max(map(len, of_seed.values()))
    all_driven = {seed: one for seed, one in of_seed.items() if len(one) == most}
    losses = {seed: (_missed(one), _lost_s(one)) for seed, one in all_driven.items()}
    ordered = sorted(losses, key=lambda seed: (*losses[seed], seed))
    shown = {ordered[(len(ordered) - 1) // 2]: "the middle", ordered[-1]: "the most"}
    of = f"of {len(ordered)} grounds"
    return {seed: f"{_loss_told(*losses[seed])}, {rank} {of}" for seed, rank in shown.items()}


def _missed(results: Sequence[RunResult]) -> int:
    return sum(one.targets - one.reached for one in results)


def _lost_s(results: Sequence[RunResult]) -> float:
    return sum(one.seconds - one.bound_s for one in results) / len(results)


def _loss_told(missed: int, lost_s: float) -> str:
    targets = f"{missed} target{'s' if missed > 1 else ''} not reached, " if missed else ""
    return f"{targets}{lost_s:.1f} s beyond the bound"


def _panels(campaign: CampaignTable, runs: Runs) -> dict[str, Sequence[RunResult]]:
    """Results by the name of their combination."""
    names, panels = combinations(campaign, runs), dict[str, list[RunResult]]()
    for spec, result in runs:
        panels.setdefault(names[combination_of(campaign, spec)], []).append(result)
    return dict(list(panels.items())[:MOST_PANELS])


def _heat_map(stage: _Stage, title: str, results: Mapping[str, Sequence[RunResult]]) -> Figure:
    """All panels have the same colours for the same time."""
    spent = {name: _mean_s(own) for name, own in results.items()}
    north_m, east_m = _extent([place for one in spent.values() for place in one], stage.start_m)
    longest_s = max((seconds for one in spent.values() for seconds in one.values()), default=1.0)
    columns = math.ceil(math.sqrt(len(spent)))
    lines, width = -(-len(spent) // columns), 8.0 if len(spent) == 1 else PANEL_IN
    first = title if len(spent) == 1 else ""  # what stands below the picture says of all where they are
    titles = [
        wrapped(": ".join(filter(None, (first, name, _told(results[name])))), width, TITLE_LETTER_IN) for name in spent
    ]
    highest = max(text.count("\n") + 1 for text in titles)
    tall = width * 0.9 * min(1.2, (north_m[1] - north_m[0]) / (east_m[1] - east_m[0])) + 0.7 + LINE_IN * highest
    figure = Figure(figsize=(width * columns + 0.8, tall * lines + 0.3), layout="constrained")
    panels = figure.subplots(lines, columns, squeeze=False).ravel()
    for panel, text, squares in zip(panels, titles, spent.values(), strict=False):
        image = _draw(panel, stage, squares, (north_m, east_m), longest_s)
        drawing.title(panel, text)
    for panel in panels[len(spent) :]:
        panel.set_visible(False)
    figure.colorbar(image, ax=panels.tolist(), label="seconds in a square metre", shrink=0.8, panchor=False)
    return figure


def _told(results: Sequence[RunResult]) -> str:
    if len(results) > 1:
        return f"{len(results)} runs"
    return f"{results[0].outcome}, {results[0].seconds:.0f}\u00a0s"


def _draw(
    panel: Axes,
    stage: _Stage,
    squares: Squares,
    extent_m: tuple[tuple[int, int], tuple[int, int]],
    longest_s: float,
) -> AxesImage:
    north_m, east_m = extent_m
    shares = np.full((north_m[1] - north_m[0], east_m[1] - east_m[0]), np.nan)
    for (north, east), mean_s in squares.items():
        shares[north - north_m[0], east - east_m[0]] = mean_s
    _draw_walls(panel, stage.world)
    image = panel.imshow(
        shares, origin="lower", extent=(*east_m, *north_m), cmap="YlOrRd", vmin=0.0, vmax=longest_s,
        interpolation="nearest",
    )  # fmt: skip
    panel.set_anchor("W")  # its title has the room to the right of it
    panel.set_xlim(*east_m)
    panel.set_ylim(*north_m)
    panel.plot(stage.start_m[1], stage.start_m[0], "^", color=drawing.BLUE, markersize=8)
    panel.set_xlabel("metres east", fontsize=8)
    panel.set_ylabel("metres north", fontsize=8)
    panel.tick_params(labelsize=8)
    return image


def _mean_s(results: Sequence[RunResult]) -> dict[tuple[int, int], float]:
    """Seconds in each square, the mean of the runs."""
    spent: dict[tuple[int, int], float] = {}
    for result in results:
        for north, east, seconds in result.dwelt:
            spent[north, east] = spent.get((north, east), 0.0) + seconds / len(results)
    return spent


def _draw_walls(panel: Axes, world: World) -> None:
    if world.obstacles.size > 1:
        walls = np.where(world.obstacles, 1.0, np.nan)
        edges = (0.0, world.width_m, 0.0, world.height_m)
        panel.imshow(walls, origin="lower", extent=edges, cmap="gray", vmin=0.0, vmax=4.0, interpolation="nearest")


def _extent(places: list[tuple[int, int]], start_m: tuple[float, float]) -> tuple[tuple[int, int], tuple[int, int]]:
    """From where to where, north and east, with two metres round it."""
    norths, easts = ([int(start), *(place[n] for place in places)] for n, start in enumerate(start_m))
    return (min(norths) - 2, max(norths) + 3), (min(easts) - 2, max(easts) + 3)
