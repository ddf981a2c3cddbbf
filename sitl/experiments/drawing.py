"""How the experiments' pictures look."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from companion.core.grid import OBSTACLE, Cell, Grid
from companion.storage.files import refuse_pipe, whole_file

if TYPE_CHECKING:
    from matplotlib.figure import Figure

BLUE, RED, GREEN, ORANGE, GREY = "#0072b2", "#d1495b", "#009e73", "#e69f00", "#8a8f98"
WALL, UNSEEN, GROUND = (0.20, 0.22, 0.26), (0.78, 0.80, 0.83), (0.985, 0.985, 0.975)


def four_panels(width_in: float, height_in: float) -> tuple[Figure, list[Any]]:
    """A figure of two by two panels."""
    from matplotlib.figure import Figure  # loaded when something is drawn

    figure = Figure(figsize=(width_in, height_in), layout="constrained", dpi=110)
    panels = list(figure.subplots(2, 2).flat)
    for panel in panels:
        panel.tick_params(length=2, colors=GREY, labelsize=8)
        panel.spines[["top", "right"]].set_visible(False)
        panel.spines[["left", "bottom"]].set_edgecolor(GREY)
    return figure, panels


def save(figure: Figure, file: Path) -> Path:
    """Write the picture (the format follows from the suffix), without the date and version that would change it."""
    file.parent.mkdir(parents=True, exist_ok=True)
    refuse_pipe(file)
    with whole_file(file) as new:
        figure.savefig(new, metadata={"Software": None} if file.suffix == ".png" else None)
    return file


def figures(value: float) -> str:
    """A number with two significant figures and no exponent."""
    return f"{float(f'{value:.2g}'):g}" if abs(value) < 1e5 else f"{value:.0f}"


def title(panel: Any, text: str) -> None:
    """A panel's heading."""
    panel.set_title(text, loc="left", fontsize=10, fontweight="bold")


def draw_map(panel: Any, grid: Grid, seen: NDArray[np.bool_] | None = None) -> None:
    """The ground, north up; obstacles dark, those not in ``seen`` (shape (height, width)) light."""
    obstacle = grid.weights >= OBSTACLE
    picture = np.empty((*grid.weights.shape, 3))
    picture[:] = GROUND
    picture[obstacle] = WALL
    if seen is not None:
        picture[obstacle & ~seen] = UNSEEN
    panel.imshow(picture, origin="lower", interpolation="nearest")
    panel.set_xticks(range(0, grid.width, 20))
    panel.set_yticks(range(0, grid.height, 10))
    panel.spines[:].set_visible(True)
    panel.spines[:].set_linewidth(0.6)
    panel.spines[:].set_edgecolor(GREY)


def draw_ends(panel: Any, start: Cell, target: Cell) -> None:
    """Start as a green disc, target as an orange square."""
    panel.plot(*start, marker="o", markersize=7, color=GREEN, markeredgecolor="white", clip_on=False, zorder=5)
    panel.plot(*target, marker="s", markersize=7, color=ORANGE, markeredgecolor="white", clip_on=False, zorder=5)
