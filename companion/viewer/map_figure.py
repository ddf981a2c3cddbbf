"""Figures of ground for picture files: north up, equal scale, framed on what matters, legend below.

Places are rows of north and east in metres. Importing it is cheap: matplotlib is loaded when a figure is made.

Nouns: map figure, extent.
"""

from __future__ import annotations

import math
import textwrap
import warnings
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from companion.core.grid import Grid

LEAST_M = 8.0
"""No side of a figure shows less ground than this."""
MARGIN, LEAST_MARGIN_M = 0.04, 1.0
"""Ground round what matters, as a share of the longer side."""
NARROWEST, WIDEST = 0.75, 3.0
"""Width by height of the ground; if it is longer or taller, more ground is shown beside it."""
AREA_IN2, WIDTHS_IN, DPI = 66.0, (8.2, 12.0), 110
LINE_IN, TEXT_IN = 0.24, 0.075
"""About the height of a line of the legend, and the width of a character."""
SCALE_SHARE = 5.0
"""The scale is the longest round length that is at most one of so many parts of the width."""

Places = NDArray[np.float64]


class Extent(NamedTuple):
    """Edges of ground in metres, in the order of matplotlib's ``extent``."""

    west_m: float
    east_m: float
    south_m: float
    north_m: float

    @property
    def width_m(self) -> float:
        """From west to east."""
        return self.east_m - self.west_m

    @property
    def height_m(self) -> float:
        """From south to north."""
        return self.north_m - self.south_m


def extent_of(grid: Grid) -> Extent:
    """The edges of a grid."""
    south_m, west_m = grid.south_west.north_m, grid.south_west.east_m
    return Extent(west_m, west_m + grid.width * grid.resolution_m, south_m, south_m + grid.height * grid.resolution_m)


def corners_of(fields: NDArray[np.bool_], grid: Extent) -> Places:
    """Two corners of the fields that are set, shape (2, 2); shape (0, 2) if none is. ``grid``: where the fields lie."""
    rows, columns = np.flatnonzero(fields.any(axis=1)), np.flatnonzero(fields.any(axis=0))
    if len(rows) == 0:
        return np.empty((0, 2))
    side_m = grid.height_m / fields.shape[0], grid.width_m / fields.shape[1]
    low, high = (rows[0], columns[0]), (rows[-1] + 1, columns[-1] + 1)
    corners: Places = np.array((low, high)) * side_m + (grid.south_m, grid.west_m)
    return corners


def framed(*places: Places) -> Extent:
    """The ground to show: all places with a margin, not less than ``LEAST_M``, not too long and not too tall."""
    together = np.concatenate([each.reshape(-1, 2) for each in places])
    low, high = together.min(axis=0), together.max(axis=0)
    margin_m = max(LEAST_MARGIN_M, MARGIN * float((high - low).max()))
    height_m, width_m = np.maximum(high - low + 2.0 * margin_m, LEAST_M)
    width_m, height_m = max(width_m, NARROWEST * height_m), max(height_m, width_m / WIDEST)
    north_m, east_m = 0.5 * (low + high)
    return Extent(east_m - width_m / 2.0, east_m + width_m / 2.0, north_m - height_m / 2.0, north_m + height_m / 2.0)


class MapFigure:
    """A figure of this ground; draw on ``axes``, in metres east and north, then ``save``.

    Whatever has a label is in the legend.
    """

    def __init__(self, ground: Extent) -> None:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        self.ground = ground
        self._figure = Figure(dpi=DPI, layout="constrained")
        FigureCanvasAgg(self._figure)
        self.axes = self._figure.add_subplot()

    def key(self, colour: object, label: str, alpha: float = 1.0) -> None:
        """A coloured square in the legend."""
        self.axes.plot([], [], "s", color=colour, alpha=alpha, label=label)

    def save(self, file: Path, title: str) -> None:
        """Write the picture; the suffix decides the format. Raises OSError."""
        ground, axes = self.ground, self.axes
        ratio = ground.width_m / ground.height_m
        width_in = min(max(math.sqrt(AREA_IN2 * ratio), WIDTHS_IN[0]), WIDTHS_IN[1])
        handles, labels = axes.get_legend_handles_labels()
        labels = [textwrap.fill(label, int(width_in / TEXT_IN) - 6) for label in labels]
        columns = _columns(labels, width_in)
        lines = sum(1 + label.count("\n") for label in labels) if columns == 1 else math.ceil(len(labels) / columns)
        title = textwrap.fill(title, int(width_in / TEXT_IN) - 6)
        beside_in = 0.75 + LINE_IN * (lines + 1 + title.count("\n"))
        self._figure.set_size_inches(width_in, (width_in - 0.7) / ratio + beside_in)
        axes.set_xlim(ground.west_m, ground.east_m)
        axes.set_ylim(ground.south_m, ground.north_m)
        axes.set_aspect("equal")
        axes.set_xlabel("east, m")
        axes.set_ylabel("north, m")
        _add_scale(self)
        self._figure.suptitle(title, fontsize=12)
        self._figure.legend(handles, labels, loc="outside lower center", ncols=columns, frameon=False)
        with warnings.catch_warnings():
            # The font has no letters of Chinese, for example: they are boxes in the picture, and not worth a line.
            warnings.filterwarnings("ignore", "Glyph .* missing from", UserWarning)
            self._figure.savefig(file)


def _columns(labels: list[str], width_in: float) -> int:
    """Of the legend: so many that the longest label fits."""
    longest = max((len(label) for label in labels), default=1)
    return max(1, min(int(width_in / (TEXT_IN * longest + 0.6)), len(labels)))


def _add_scale(figure: MapFigure) -> None:
    """A bar of a round length in the corner, on white."""
    from mpl_toolkits.axes_grid1.anchored_artists import AnchoredSizeBar

    longest_m = figure.ground.width_m / SCALE_SHARE
    power_m = 10.0 ** math.floor(math.log10(longest_m))
    length_m = max(times * power_m for times in (1.0, 2.0, 5.0) if times * power_m <= longest_m)
    bar = AnchoredSizeBar(
        figure.axes.transData, length_m, f"{length_m:g} m", "lower right",
        size_vertical=0.0025 * figure.ground.width_m, sep=3.0, borderpad=0.6,
    )  # fmt: skip
    bar.patch.set(edgecolor="none", alpha=0.8)
    figure.axes.add_artist(bar)
