"""``rover-sitl world make``: a world of a kind from a seed, with a mission in it, and a picture."""

from __future__ import annotations

from dataclasses import asdict
from io import BytesIO
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from PIL import Image
from pydantic import ValidationError

from companion.cli.inputs import EXIT_BAD_INPUT, OutputError, apart, picture, replaced, writable, written
from companion.core.own_parts import OwnPartError
from companion.storage.files import open_file
from companion.storage.validation import alike, describe_first
from sitl.generators.canvas import FINE_M
from sitl.generators.kinds import GroundKind, Parameters, is_kind, parameters_of
from sitl.generators.made_ground import ACROSS_M, NEAREST_TARGET_M, MadeGround, NoWayError, made
from sitl.generators.measures import Difficulty

app = typer.Typer(add_completion=False, name="world", help="Worlds from seeds.", no_args_is_help=True)


KNOWN = ", ".join(GroundKind)


class WorldError(Exception):
    """A world that cannot be made; the text is one line."""


@app.callback()
def worlds() -> None:
    """Worlds from seeds."""


@app.command()
def make(
    kind: Annotated[
        str,
        typer.Argument(metavar="KIND", help=f"One of: {KNOWN}; or one of your own by module:name (docs/worlds.md)."),
    ],
    seed: Annotated[int, typer.Option(min=0, help="The same seed gives the same world.")] = 0,
    set_: Annotated[
        list[str] | None, typer.Option("--set", metavar="NAME=VALUE", help="A parameter of the kind; may be repeated.")
    ] = None,
    movers: Annotated[int, typer.Option(min=0, max=50, help="So many things drive to and fro across the way.")] = 0,
    target_east_m: Annotated[
        float, typer.Option(min=NEAREST_TARGET_M, max=ACROSS_M, help="So far east of the start the target lies.")
    ] = ACROSS_M,
    out: Annotated[Path, typer.Option(help="Folder for the mission and its world.")] = Path("out/worlds"),
    image: Annotated[Path | None, typer.Option(help="Draw it, with the shortest way.")] = None,
) -> None:
    """Make a world of KIND with a mission from one side to the other, for rover-sitl drive; there is always a way.

    Exit code 2: bad input, no ground of these parameters has a way, or files with other content are there.
    """
    try:
        picture(image)
        given = _given(kind, set_ or [])
        mission = out / f"{kind.replace(':', '-')}-{seed}.toml"
        apart((image,), (mission, mission.with_suffix(".png")))
        writable(mission)
        ground = made(kind, seed, given, movers, target_east_m)
        measures = ground.difficulty
        files = {
            mission.with_suffix(".png"): _world(ground),
            mission: _mission(ground, seed, given, measures, mission.with_suffix(".png").name).encode(),
        }
        _refuse_others(files)
        for file, content in files.items():
            with replaced(file) as new:
                new.write_bytes(content)
        if image is not None:
            with written(image):
                _draw(ground, seed, image)
    except (WorldError, NoWayError, OwnPartError, OutputError) as error:
        typer.echo(str(error), err=True)
        raise typer.Exit(EXIT_BAD_INPUT) from error
    for line in _lines(measures):
        typer.echo(line)
    typer.echo(f"mission: {mission}; rover-sitl drive {mission} drives it")


def _given(kind: str, listed: list[str]) -> Parameters:
    """The kind's parameters. Raises WorldError."""
    if not is_kind(kind):
        near = alike(kind, tuple(one.value for one in GroundKind))
        raise WorldError(f"KIND {kind!r:.60} is unknown{f', did you mean {near!r}?' if near else ';'} known: {KNOWN}")
    values = {}
    for text in listed:
        name, equals, value = text.partition("=")
        if not equals:
            raise WorldError(f"--set {text:.60}: give a parameter as NAME=VALUE, like {_example(kind)}")
        if name.strip() in values:
            raise WorldError(f"--set {text:.60}: {name.strip()} is given twice")
        values[name.strip()] = value.strip()
    model = parameters_of(kind)
    try:
        return model.model_validate(values)
    except ValidationError as error:
        raise WorldError(f"{kind}: {' '.join(describe_first(error, model).split())}; {_known(kind)}") from error


def _example(kind: str) -> str:
    name, value = next(iter(parameters_of(kind)().model_dump().items()))
    return f"{name}={value:g}"


def _known(kind: str) -> str:
    """The parameters of a kind with their values, for people."""
    values = parameters_of(kind)().model_dump()
    return "parameters: " + ", ".join(f"{name} ({value:g})" for name, value in values.items())


def _lines(measures: Difficulty) -> list[str]:
    return [
        f"closest wall {measures.closest_wall_m:.2f} m, visibility {measures.visibility_m:.1f} m, dispersion "
        f"{measures.dispersion:.1f} of 16,",
        f"characteristic dimension {measures.characteristic_m:.1f} m, tortuosity {measures.tortuosity:.2f}",
    ]


def _refuse_others(files: dict[Path, bytes]) -> None:
    """Nothing that somebody has changed, or made with other options, is lost. Raises WorldError or OutputError."""
    for file, content in files.items():
        with written(file):
            try:
                with open_file(file) as there:
                    same = there.read(len(content) + 1) == content
            except FileNotFoundError:
                continue
        if not same:
            raise WorldError(f"{file}: is there with other content, and would be lost; choose another --out")


def _world(ground: MadeGround) -> bytes:
    """The image that is the world."""
    image = BytesIO()
    Image.fromarray(np.where(ground.world.obstacles[::-1], 0, 255).astype(np.uint8)).save(image, "png")
    return image.getvalue()


def _mission(ground: MadeGround, seed: int, given: Parameters, measures: Difficulty, world: str) -> str:
    """The text of the mission in a world with this file's name."""
    start, goal = ground.start_m, ground.goal_m
    values = {**given.model_dump(), "movers": len(ground.movers), "target_east_m": goal[1] - start[1]}
    told = ", ".join(f"{name} {value:g}" for name, value in values.items())
    measured = ", ".join(f"{name} {value:.3g}" for name, value in asdict(measures).items())
    lines = [
        f"# rover-sitl world make {ground.kind} --seed {seed}: {told}",
        f"# along the shortest way: {measured}",
        f'name = "{ground.kind} {seed}"',
        "",
        "[[target]]",
        'name = "goal"',
        f"north_m = {goal[0] - start[0]:.2f}",
        f"east_m = {goal[1] - start[1]:.2f}",
        "",
        "[sitl]",
        f'world = "{world}"',
        f"resolution_m = {FINE_M:g}",
        f"start = [{int(start[1] / FINE_M)}, {int(start[0] / FINE_M)}]",
        "heading_deg = 90.0",
        'sensors = "lidar-360"',
    ]
    for mover in ground.movers:
        route = ", ".join(f"[{place.north_m:g}, {place.east_m:g}]" for place in mover.route)
        lines += [
            "",
            "[[sitl.movers]]",
            f'name = "{mover.name}"',
            f"radius_m = {mover.radius_m:g}",
            f"speed_m_s = {mover.speed_m_s:g}",
            f"route_m = [{route}]",
            "repeat = true",
        ]
    return "\n".join(lines) + "\n"


def _draw(ground: MadeGround, seed: int, file: Path) -> None:
    from matplotlib.figure import Figure

    from sitl.experiments import drawing

    figure = Figure(figsize=(9.0, 7.6), layout="constrained")
    panel = figure.subplots()
    world = ground.world
    edges = (0.0, world.width_m, 0.0, world.height_m)
    panel.imshow(world.obstacles, origin="lower", extent=edges, cmap="gray_r", vmin=0.0, vmax=1.3)
    panel.plot(ground.way_m[:, 1], ground.way_m[:, 0], color=drawing.BLUE, linewidth=1.5, label="shortest way")
    panel.plot(*ground.start_m[::-1], "^", color=drawing.GREEN, markersize=10, label="start")
    panel.plot(*ground.goal_m[::-1], "*", color=drawing.RED, markersize=13, label="goal")
    for number, mover in enumerate(ground.movers):
        norths_m = [ground.start_m[0] + place.north_m for place in mover.route]
        easts_m = [ground.start_m[1] + place.east_m for place in mover.route]
        panel.plot(easts_m, norths_m, "o--", color=drawing.ORANGE, label=None if number else "moves to and fro")
    drawing.title(panel, f"{ground.kind}, seed {seed}")
    panel.set_xlabel("metres east")
    panel.set_ylabel("metres north")
    figure.legend(loc="outside lower center", ncols=4, frameon=False)
    drawing.save(figure, file)
