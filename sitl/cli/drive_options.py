"""The options of ``rover-sitl drive`` and their help texts."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

VIEWED_SPEEDUP = 10.0
"""Default speed with --view: slow enough to follow."""
WEB_SPEEDUP = 1.0
"""Default speed with --web: as a real rover drives."""

MissionFile = Annotated[
    Path | None, typer.Argument(metavar="MISSION", help="TOML, .plan or .waypoints file.", show_default=False)
]
Seed = Annotated[int, typer.Option(min=0, help="For planner and simulator: the same seed gives the same run.")]
SettingsFile = Annotated[Path | None, typer.Option("--settings", help="TOML file, see docs/settings.md.")]
Record = Annotated[Path | None, typer.Option(help="Directory for the record of this run.")]
ReportFile = Annotated[
    Path | None,
    typer.Option("--report", metavar="FILE", help="Write the drive as one HTML file, to look at afterwards."),
]
Image = Annotated[Path | None, typer.Option(help="Write a picture (.png, .jpg) of map and track.")]
MapStem = Annotated[
    Path | None, typer.Option("--map", metavar="STEM", help="Write the companion's map as STEM.yaml and STEM.pgm.")
]
JsonFile = Annotated[Path | None, typer.Option("--json", help="Write the result as JSON.")]
Sensors = Annotated[
    str | None,
    typer.Option(help="lidar-90, lidar-360, beams or a TOML file (none: only for serve); default: the mission's."),
]
Lidars = Annotated[
    list[str] | None,
    typer.Option(
        "--lidar",
        metavar="MODEL[:KEY=VALUE,...]",
        help="A lidar that the companion reads itself, see docs/lidars.md; takes the place of the mission's sensors.",
    ),
]
World = Annotated[Path | None, typer.Option(help="The ground: image, ROS yaml, MovingAI .map or TOML world.")]
Start = Annotated[str | None, typer.Option(metavar="X,Y", help="With --world: the field to start from.")]
Target = Annotated[str | None, typer.Option(metavar="X,Y", help="With --world: the field to reach.")]
TopLeft = Annotated[bool, typer.Option("--top-left", help="With --world: Y counts down from the top row.")]
ResolutionM = Annotated[
    float | None,
    typer.Option(min=0.01, max=1000.0, help="Field size of --world, if the map has none; without, as for `run`."),
]
Prior = Annotated[bool, typer.Option("--prior", help="With --world: the companion knows the map from the start.")]
Params = Annotated[Path | None, typer.Option(help="ArduRover's parameters: NAME,VALUE or NAME VALUE.")]
Faults = Annotated[Path | None, typer.Option(help="TOML file with a fault plan.")]
TimeLimitS = Annotated[float, typer.Option(min=1.0, help="Simulated seconds before giving up.")]
Speedup = Annotated[
    float | None,
    typer.Option(
        min=0.1,
        max=10_000.0,
        help=f"Times real time, at most; default: as fast as possible, with --view {VIEWED_SPEEDUP:g}, "
        f"with --web {WEB_SPEEDUP:g}.",
    ),
]
View = Annotated[bool, typer.Option("--view", help="Show map, rover and decisions on this terminal.")]
