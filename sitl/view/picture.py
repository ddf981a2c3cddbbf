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
from companion.mapping.map_queries import known_fields
from companion.viewer.map_figure import Extent, MapFigure, Places, corners_of, extent_of, framed

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from companion.core.frames import GeoPoint
    from companion.mapping.evidence_map import EvidenceMap
    from sitl.lockstep import Drive
    from sitl.world.world import World

PART_COLOURS = {"B": "#1f6fd6", "C": "#e07b00", "A": "#c2185b", "-": "#1f6fd6"}
GROUND_COLOURS = {"slippery": "#4fa8d8", "rough": "#c9a800"}
DOOR_COLOUR, GLASS_COLOUR, BLACK_COLOUR = "#e53935", "#00acc1", "#4a148c"
BEHIND = {"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 1.0}
"""Of texts that may lie on something."""
MOVER_COLOUR, MOVER_STEP_S = "#7b1fa2", 0.5
PART_NAMES = {"B": "exploring (B)", "C": "new path (C)", "A": "returning (A)"}


def save_picture(run: Drive, path: Path) -> None:
    """Write a north-up picture: obstacles, map, the track coloured by the navigator's part, start and targets.

    It is framed on what was driven and seen.
    """
    track = run.report.track
    places = np.array([(point.north_m, point.east_m) for point in track])
    figure = MapFigure(framed(places, *_seen(run), _start(run), _targets(run), _collisions(run)))
    axes = figure.axes
    _draw_world(figure, run)
    _draw_map(figure, run)
    _draw_ground(figure, run.simulator.world)
    _draw_special(figure, run.simulator.world, run.report.sim_time_s)
    _draw_movers(axes, run)
    _draw_track(axes, places, [point.part for point in track])
    _draw_rover(axes, run)
    _draw_places(figure, run)
    _draw_collisions(axes, run)
    report = run.report
    title = (
        f"{run.mission.name}: {report.outcome} - {report.distance_m:.0f} m in {report.driving_time_s:.0f} s, "
        f"{report.steps} steps ({report.return_steps} returning), {_counted(report.collisions)}, seed {report.seed}"
    )
    figure.save(path, title)


def _start(run: Drive) -> Places:
    return np.array([(run.scenario.start.north_m, run.scenario.start.east_m)])


def _targets(run: Drive) -> Places:
    """Where the targets are in the world, shape (n, 2); none before the mission has begun."""
    progress, origin = run.companion.progress, run.companion.origin
    if progress is None or origin is None:
        return np.empty((0, 2))
    points = np.array([(target.point.north_m, target.point.east_m) for target in progress.targets])
    return points.reshape(-1, 2) + run.scenario.start.place_of(origin)


def _collisions(run: Drive) -> Places:
    return np.array([(one.north_m, one.east_m) for one in run.simulator.collisions]).reshape(-1, 2)


def _map_extent(run: Drive, evidence: EvidenceMap, origin: GeoPoint) -> Extent:
    """The edges of the companion's map in the world."""
    north_m, east_m = run.scenario.start.place_of(origin)
    edges = extent_of(evidence.base)
    return Extent(edges.west_m + east_m, edges.east_m + east_m, edges.south_m + north_m, edges.north_m + north_m)


def _seen(run: Drive) -> tuple[Places, ...]:
    """Corners of the ground that the companion has seen."""
    evidence, origin = run.companion.evidence, run.companion.origin
    if evidence is None or origin is None:
        return ()
    return (corners_of(known_fields(evidence), _map_extent(run, evidence, origin)),)


def _counted(collisions: int) -> str:
    return "1 collision" if collisions == 1 else f"{collisions} collisions"


def _extent(world: World) -> tuple[float, float, float, float]:
    """West, east, south and north edges of the world."""
    return (world.west_m, world.west_m + world.width_m, world.south_m, world.south_m + world.height_m)


def _in_sight(mask: NDArray[np.bool_], world: World, ground: Extent) -> bool:
    """Whether any of these fields of the world is on the picture."""
    north_m = world.south_m + (np.arange(mask.shape[0]) + 0.5) * world.resolution_m
    east_m = world.west_m + (np.arange(mask.shape[1]) + 0.5) * world.resolution_m
    rows = (north_m > ground.south_m) & (north_m < ground.north_m)
    columns = (east_m > ground.west_m) & (east_m < ground.east_m)
    return bool(mask[np.ix_(rows, columns)].any())


def _draw_world(figure: MapFigure, run: Drive) -> None:
    """Draw the world's obstacles in light grey."""
    world = run.simulator.world
    if not _in_sight(world.obstacles, world, figure.ground):
        return
    picture = np.where(world.obstacles, 0.0, np.nan)
    figure.axes.imshow(
        picture, origin="lower", extent=_extent(world), cmap="gray", vmin=-3.2, vmax=1.0, interpolation="nearest"
    )
    figure.key("#c2c2c2", "obstacle, not seen")


def _tint(
    axes: Axes, world: World, mask: NDArray[np.bool_], colour: str, strength: NDArray[np.float64] | float
) -> None:
    """Colour the fields of a mask with a strength."""
    from matplotlib.colors import to_rgb

    picture: NDArray[np.float64] = np.zeros((*mask.shape, 4))
    picture[..., :3] = to_rgb(colour)
    picture[..., 3] = np.where(mask, strength, 0.0)
    axes.imshow(picture, origin="lower", extent=_extent(world), interpolation="nearest")


def _draw_ground(figure: MapFigure, world: World) -> None:
    """Draw slippery and rough ground; a stronger colour means worse ground."""
    for (name, colour), layer in zip(GROUND_COLOURS.items(), world.ground, strict=True):
        if layer.size and _in_sight(layer < 1.0, world, figure.ground):
            _tint(figure.axes, world, layer < 1.0, colour, 0.15 + 0.45 * (1.0 - layer.astype(np.float64)))
            figure.key(colour, f"{name} ground", 0.5)


def _draw_special(figure: MapFigure, world: World, ended_s: float) -> None:
    """Draw doors as they were at the end, and obstacles that do not reflect rays."""
    labels: set[str] = set()
    for door in (one for one in world.doors if _in_sight(one.fields, world, figure.ground)):
        is_open = door.is_open(ended_s)
        label, alpha = ("door, open at the end", 0.35) if is_open else ("door, closed at the end", 1.0)
        _tint(figure.axes, world, door.fields, DOOR_COLOUR, alpha)
        if label not in labels:
            figure.key(DOOR_COLOUR, label, alpha)
        labels.add(label)
    for mask, colour, name in ((world.glass, GLASS_COLOUR, "glass"), (world.black, BLACK_COLOUR, "black")):
        if mask is not None and _in_sight(mask, world, figure.ground):
            _tint(figure.axes, world, mask, colour, 1.0)
            figure.key(colour, f"{name}, reflects no rays")


def _draw_map(figure: MapFigure, run: Drive) -> None:
    """Draw the companion's map: free ground tinted, obstacles dark."""
    evidence, origin = run.companion.evidence, run.companion.origin
    if evidence is None or origin is None:
        return
    grid, extent = evidence.grid, _map_extent(run, evidence, origin)
    picture: NDArray[np.float64] = np.zeros((grid.height, grid.width, 4))
    picture[known_fields(evidence)] = (0.85, 0.93, 0.82, 0.6)
    picture[grid.weights >= OBSTACLE] = (0.15, 0.15, 0.15, 0.85)
    closed = evidence.base.weights >= OBSTACLE
    if closed.any():
        picture[closed] = (0.80, 0.62, 0.40, 0.75)
        figure.key("#cc9e66", "closed from the start: fence or known map")
    figure.axes.imshow(picture, origin="lower", extent=extent, interpolation="nearest")
    figure.key("#262626", "obstacle in the companion's map")
    figure.key("#dcefd8", "seen free")


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


def _draw_track(axes: Axes, places: Places, parts: list[str]) -> None:
    from matplotlib.collections import LineCollection

    points = places[:, ::-1]
    segments = np.stack((points[:-1], points[1:]), axis=1)
    axes.add_collection(
        LineCollection(list(segments), colors=[PART_COLOURS[part] for part in parts[1:]], linewidths=2.0)
    )
    for part, name in PART_NAMES.items():
        if part in parts:
            axes.plot([], [], color=PART_COLOURS[part], linewidth=2.0, label=name)


def _draw_collisions(axes: Axes, run: Drive) -> None:
    """A red cross where the rover touched something, with time, speed and what it was."""
    for number, collision in enumerate(run.simulator.collisions):
        place = (collision.east_m, collision.north_m)
        label = "collision" if number == 0 else None
        axes.plot(*place, "X", color="#ff0000", markeredgecolor="white", markersize=13, zorder=10, label=label)
        text = f"{collision.time_s:.1f} s, {collision.speed_m_s:.1f} m/s, {collision.what}"
        axes.annotate(
            text,
            place,
            textcoords="offset points",
            xytext=(9, -14),
            color="#d00000",
            fontsize=9,
            zorder=11,
            bbox=BEHIND,
        )


def _draw_rover(axes: Axes, run: Drive) -> None:
    """Draw the rover's outline where it stands at the end."""
    from matplotlib.patches import Circle, Polygon

    truth, outline = run.simulator.truth, run.scenario.outline
    # Over the target's star: a small thing on most pictures.
    name, edge = "the rover at the end", "#202020"
    style: dict[str, Any] = {"facecolor": "white", "edgecolor": edge, "zorder": 5}
    if outline.radius_m > 0.0:
        axes.add_patch(Circle((truth.east_m, truth.north_m), outline.radius_m, **style))
        # The legend would show a rectangle for any patch.
        axes.plot([], [], "o", markerfacecolor="white", markeredgecolor=edge, label=name)
        return
    sine, cosine = math.sin(truth.heading_rad), math.cos(truth.heading_rad)
    front_m, rear_m, half_m = outline.front_m, outline.rear_m, outline.half_width_m
    corners = ((front_m, half_m), (front_m, -half_m), (-rear_m, -half_m), (-rear_m, half_m))
    places = [
        (truth.east_m + ahead_m * sine + aside_m * cosine, truth.north_m + ahead_m * cosine - aside_m * sine)
        for ahead_m, aside_m in corners
    ]
    axes.add_patch(Polygon(places, label=name, **style))


def _draw_places(figure: MapFigure, run: Drive) -> None:
    start, axes, ground = run.scenario.start, figure.axes, figure.ground
    axes.plot(start.east_m, start.north_m, "o", color="#2e7d32", markersize=9, label="start")
    targets = _targets(run).tolist()
    for i, (north_m, east_m) in enumerate(targets):
        axes.plot(east_m, north_m, "*", color="#d32f2f", markersize=14, label="target" if i == 0 else None)
        if len(targets) > 1 and run.companion.progress is not None:
            # Towards the middle, where there is room.
            left = east_m > 0.5 * (ground.west_m + ground.east_m)
            aside, towards = ((-8, 8), "right") if left else ((8, 8), "left")
            name = run.companion.progress.targets[i].name
            axes.annotate(
                name, (east_m, north_m), textcoords="offset points", xytext=aside, ha=towards, fontsize=9, bbox=BEHIND
            )
