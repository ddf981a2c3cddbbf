"""Picture file of a run: the world, the companion's map, and the driven track.

Nouns: picture.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from companion.core.grid import OBSTACLE
from companion.mapping.evidence_map import known_fields

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from sitl.lockstep import Drive
    from sitl.world.world import World

LEGEND_COLUMNS = 5
PART_COLOURS = {"B": "#1f6fd6", "C": "#e07b00", "A": "#c2185b", "-": "#1f6fd6"}
GROUND_COLOURS = {"slippery": "#4fa8d8", "rough": "#c9a800"}
DOOR_COLOUR, GLASS_COLOUR, BLACK_COLOUR = "#e53935", "#00acc1", "#4a148c"
MOVER_COLOUR, MOVER_STEP_S = "#7b1fa2", 0.5
PART_NAMES = {"B": "exploring (B)", "C": "new path (C)", "A": "returning (A)"}


def save_picture(run: Drive, path: Path) -> None:
    """Write a north-up picture: obstacles, map, the track coloured by the navigator's part, start and targets."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    track = run.report.track
    north = np.array([p.north_m for p in track])
    east = np.array([p.east_m for p in track])
    figure = Figure(figsize=(12, 6.6), dpi=110, layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    _draw_world(axes, run)
    _draw_map(axes, run)
    _draw_ground(axes, run.simulator.world)
    _draw_special(axes, run.simulator.world, run.report.sim_time_s)
    _draw_movers(axes, run)
    _draw_track(axes, north, east, [p.part for p in track])
    _draw_rover(axes, run)
    _draw_places(axes, run)
    _draw_collisions(axes, run)
    axes.set_aspect("equal")
    axes.set_xlabel("east, m")
    axes.set_ylabel("north, m")
    report = run.report
    figure.suptitle(
        f"{run.mission.name}: {report.outcome} - {report.distance_m:.0f} m in {report.driving_time_s:.0f} s, "
        f"{report.steps} steps ({report.return_steps} returning), {_counted(report.collisions)}, seed {report.seed}",
        fontsize=12,
    )
    figure.legend(loc="outside lower center", ncols=LEGEND_COLUMNS, frameon=False)
    figure.savefig(path)


def _counted(collisions: int) -> str:
    return "1 collision" if collisions == 1 else f"{collisions} collisions"


def _extent(world: World) -> tuple[float, float, float, float]:
    """West, east, south and north edges of the world."""
    return (world.west_m, world.west_m + world.width_m, world.south_m, world.south_m + world.height_m)


def _draw_world(axes: Axes, run: Drive) -> None:
    """Draw the world's obstacles in light grey."""
    world = run.simulator.world
    if not world.obstacles.any():
        return
    picture = np.where(world.obstacles, 0.0, np.nan)
    axes.imshow(
        picture, origin="lower", extent=_extent(world), cmap="gray", vmin=-3.2, vmax=1.0, interpolation="nearest"
    )
    axes.plot([], [], "s", color="#c2c2c2", label="obstacle, not seen")


def _tint(
    axes: Axes, world: World, mask: NDArray[np.bool_], colour: str, strength: NDArray[np.float64] | float
) -> None:
    """Colour the fields of a mask with a strength."""
    from matplotlib.colors import to_rgb

    picture: NDArray[np.float64] = np.zeros((*mask.shape, 4))
    picture[..., :3] = to_rgb(colour)
    picture[..., 3] = np.where(mask, strength, 0.0)
    axes.imshow(picture, origin="lower", extent=_extent(world), interpolation="nearest")


def _draw_ground(axes: Axes, world: World) -> None:
    """Draw slippery and rough ground; a stronger colour means worse ground."""
    for (name, colour), layer in zip(GROUND_COLOURS.items(), world.ground, strict=True):
        if layer.size and (layer < 1.0).any():
            _tint(axes, world, layer < 1.0, colour, 0.15 + 0.45 * (1.0 - layer.astype(np.float64)))
            axes.plot([], [], "s", color=colour, alpha=0.5, label=f"{name} ground")


def _draw_special(axes: Axes, world: World, ended_s: float) -> None:
    """Draw doors as they were at the end, and obstacles that do not reflect rays."""
    labels: set[str] = set()
    for door in world.doors:
        is_open = door.is_open(ended_s)
        label = "door, open at the end" if is_open else "door, closed at the end"
        _tint(axes, world, door.fields, DOOR_COLOUR, 0.35 if is_open else 1.0)
        axes.plot(
            [], [], "s", color=DOOR_COLOUR, alpha=0.35 if is_open else 1.0, label=None if label in labels else label
        )
        labels.add(label)
    for mask, colour, name in ((world.glass, GLASS_COLOUR, "glass"), (world.black, BLACK_COLOUR, "black")):
        if mask is not None:
            _tint(axes, world, mask, colour, 1.0)
            axes.plot([], [], "s", color=colour, label=f"{name}, reflects no rays")


def _draw_map(axes: Axes, run: Drive) -> None:
    """Draw the companion's map: free ground tinted, obstacles dark."""
    evidence, origin = run.companion.evidence, run.companion.origin
    if evidence is None or origin is None:
        return
    grid = evidence.grid
    north_m, east_m = run.scenario.start.place_of(origin)
    left, low = grid.south_west.east_m + east_m, grid.south_west.north_m + north_m
    extent = (left, left + grid.width * grid.resolution_m, low, low + grid.height * grid.resolution_m)
    picture: NDArray[np.float64] = np.zeros((grid.height, grid.width, 4))
    picture[known_fields(evidence)] = (0.85, 0.93, 0.82, 0.6)
    picture[grid.weights >= OBSTACLE] = (0.15, 0.15, 0.15, 0.85)
    closed = evidence.base.weights >= OBSTACLE
    if closed.any():
        picture[closed] = (0.80, 0.62, 0.40, 0.75)
        axes.plot([], [], "s", color="#cc9e66", label="closed from the start: fence or known map")
    axes.imshow(picture, origin="lower", extent=extent, interpolation="nearest")
    axes.plot([], [], "s", color="#262626", label="obstacle in the companion's map")
    axes.plot([], [], "s", color="#dcefd8", label="seen free")


def _draw_movers(axes: Axes, run: Drive) -> None:
    """Draw the tracks of moving obstacles, and their positions at the end."""
    from matplotlib.patches import Circle

    world, ended_s = run.simulator.world, run.report.sim_time_s
    for number, mover in enumerate(world.movers):
        times_s = np.arange(0.0, ended_s, MOVER_STEP_S)
        places = np.array([world.mover_at(number, float(time_s))[:2] for time_s in (*times_s, ended_s)])
        label = "moving obstacle" if number == 0 else None
        axes.plot(places[:, 1], places[:, 0], ":", color=MOVER_COLOUR, linewidth=1.2, label=label)
        axes.add_patch(Circle((places[-1, 1], places[-1, 0]), mover.radius_m, color=MOVER_COLOUR))


def _draw_track(axes: Axes, north: NDArray[np.float64], east: NDArray[np.float64], parts: list[str]) -> None:
    from matplotlib.collections import LineCollection

    points = np.column_stack((east, north))
    segments = np.stack((points[:-1], points[1:]), axis=1)
    axes.add_collection(
        LineCollection(list(segments), colors=[PART_COLOURS[part] for part in parts[1:]], linewidths=2.0)
    )
    for part, name in PART_NAMES.items():
        if part in parts:
            axes.plot([], [], color=PART_COLOURS[part], linewidth=2.0, label=name)
    margin_m = 3.0
    axes.set_xlim(min(axes.get_xlim()[0], east.min() - margin_m), max(axes.get_xlim()[1], east.max() + margin_m))
    axes.set_ylim(min(axes.get_ylim()[0], north.min() - margin_m), max(axes.get_ylim()[1], north.max() + margin_m))


def _draw_collisions(axes: Axes, run: Drive) -> None:
    """A red cross where the rover touched something, with time, speed and what it was."""
    for number, collision in enumerate(run.simulator.collisions):
        place = (collision.east_m, collision.north_m)
        label = "collision" if number == 0 else None
        axes.plot(*place, "X", color="#ff0000", markeredgecolor="white", markersize=13, zorder=10, label=label)
        text = f"{collision.time_s:.1f} s, {collision.speed_m_s:.1f} m/s, {collision.what}"
        behind = {"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 1.0}
        axes.annotate(
            text,
            place,
            textcoords="offset points",
            xytext=(9, -14),
            color="#d00000",
            fontsize=9,
            zorder=11,
            bbox=behind,
        )


def _draw_rover(axes: Axes, run: Drive) -> None:
    """Draw the rover's outline where it stands at the end."""
    from matplotlib.patches import Circle, Polygon

    truth, outline = run.simulator.truth, run.scenario.outline
    # Over the target's star: a small thing on most pictures.
    style: dict[str, Any] = {"facecolor": "white", "edgecolor": "#202020", "zorder": 5, "label": "the rover at the end"}
    if outline.radius_m > 0.0:
        axes.add_patch(Circle((truth.east_m, truth.north_m), outline.radius_m, **style))
        return
    sine, cosine = math.sin(truth.heading_rad), math.cos(truth.heading_rad)
    front_m, rear_m, half_m = outline.front_m, outline.rear_m, outline.half_width_m
    corners = ((front_m, half_m), (front_m, -half_m), (-rear_m, -half_m), (-rear_m, half_m))
    places = [
        (truth.east_m + ahead_m * sine + aside_m * cosine, truth.north_m + ahead_m * cosine - aside_m * sine)
        for ahead_m, aside_m in corners
    ]
    axes.add_patch(Polygon(places, **style))


def _draw_places(axes: Axes, run: Drive) -> None:
    start = run.scenario.start
    axes.plot(start.east_m, start.north_m, "o", color="#2e7d32", markersize=9, label="start")
    progress, origin = run.companion.progress, run.companion.origin
    if progress is None or origin is None:
        return
    north_m, east_m = start.place_of(origin)
    for i, target in enumerate(progress.targets):
        place = (target.point.east_m + east_m, target.point.north_m + north_m)
        axes.plot(*place, "*", color="#d32f2f", markersize=14, label="target" if i == 0 else None)
        if len(progress.targets) > 1:
            # Towards the middle, where there is room.
            left = place[0] > sum(axes.get_xlim()) / 2.0
            aside, towards = ((-8, 8), "right") if left else ((8, 8), "left")
            axes.annotate(target.name, place, textcoords="offset points", xytext=aside, ha=towards, fontsize=9)
