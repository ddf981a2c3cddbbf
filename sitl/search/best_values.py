"""The picture of a search: how near each run came to what is looked for, and the nearest of each start so far."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from sitl.experiments import drawing
from sitl.search.goals import FOUND, MEASURES, Goal
from sitl.search.search import IMPOSSIBLE, Generation

WIDE_IN, TALL_IN = 10.0, 4.0


def best_values(goal: Goal, generations: Sequence[Generation]) -> Figure:
    """Over the number of the run; runs that show the goal stand at the lower edge, those not driven nowhere."""
    values = np.array([one.distance for generation in generations for one in generation.evaluations])
    starts = np.array([generation.start for generation in generations for _ in generation.evaluations])
    numbers = np.arange(1, len(values) + 1)
    found, measured = values == FOUND, (values != FOUND) & (values != IMPOSSIBLE)
    figure = Figure(figsize=(WIDE_IN, TALL_IN), layout="constrained")
    panel = figure.subplots()
    panel.scatter(numbers[measured], values[measured], s=6, color=drawing.GREY, linewidths=0, label="a run")
    for number, start in enumerate(np.unique(starts)):
        own = measured & (starts == start)
        label = "the nearest of its start so far" if number == 0 else None
        panel.step(
            numbers[own],
            np.minimum.accumulate(values[own]),
            where="post",
            color=drawing.BLUE,
            linewidth=1.4,
            label=label,
        )
    edge = np.full(int(found.sum()), 0.02)
    panel.scatter(
        numbers[found],
        edge,
        s=30,
        marker="x",
        color=drawing.RED,
        transform=panel.get_xaxis_transform(),
        label=goal.value,
    )
    panel.set_xlabel("runs of the search", fontsize=8)
    panel.set_ylabel(MEASURES[goal], fontsize=8)
    panel.tick_params(labelsize=8)
    panel.xaxis.set_major_locator(MaxNLocator(integer=True))
    panel.spines[["top", "right"]].set_visible(False)
    figure.legend(loc="outside lower center", ncols=3, frameon=False, fontsize=8)
    return figure
