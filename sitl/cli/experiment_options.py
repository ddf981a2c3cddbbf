"""The options of ``rover-sitl experiment``, which experiment takes which, and their help texts."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated

import typer

from sitl.campaign.campaign_file import MOST_RUNS
from sitl.cli.named import names_in
from sitl.experiments.experiment import OFF_MODEL, TIMEOUT_S, ExperimentError, Options

EXPERIMENTS = (
    "adaptive-control-points",
    "kwasniewski-maps",
    "kwasniewski-table1",
    "navigation",
    "driving",
    "dead-companion",
    "killed-companion",
    "missions",
    "barn",
    "controllers",
    "traffic",
    "gates",
    "wang-table4",
    "sedighi-table1",
    "achour-table1",
    "soak",
)
"""Each is a module of ``sitl.experiments``, loaded when it is asked for: they load the plotting library."""
MISMATCHED = ("barn", "controllers", "dead-companion", "gates", "killed-companion", "missions")
GUARDED = ("dead-companion", "killed-companion", "missions")
TAKERS = {
    "--planners": ("navigation", "driving"),
    "--world": ("navigation", "driving"),
    "--worlds": ("barn",),
    "--controllers": MISMATCHED,
    "--setups": ("barn", "gates"),
    "--lidar": ("barn",),
    "--missions": ("dead-companion", "missions"),
    "--sensors": ("missions",),
    "--guard": GUARDED,
    "--off": MISMATCHED,
    "--late": ("barn", "controllers", "gates", "killed-companion", "missions"),
    "--guid-timeout": ("barn", "dead-companion", "gates", "missions"),
    "--outline": ("gates",),
    "--turning-radius": ("driving",),
    "--maps": (
        "adaptive-control-points", "kwasniewski-maps", "kwasniewski-table1", "navigation", "driving", "dead-companion",
        "killed-companion", "missions", "traffic", "sedighi-table1",
    ),
    "--keep": (
        "barn", "controllers", "dead-companion", "driving", "gates", "killed-companion", "missions", "traffic",
    ),
}  # fmt: skip
"""The experiments that each option is for; those that are not here are for all of them."""
RUNS, RUNS_OF_BARN = 100, 10
"""Unless it is said; the second as the BARN challenge has it."""


def _of(option: str) -> str:
    """Which experiments take it, as its help begins."""
    return ", ".join(TAKERS[option])


Name = Annotated[str, typer.Argument(metavar="NAME", help=f"One of: {', '.join(EXPERIMENTS)}.")]
Runs = Annotated[
    int | None,
    typer.Option(
        min=1,
        max=MOST_RUNS,
        help="Runs, with consecutive seeds, on each map, mission or world; default: "
        f"{RUNS}, for barn {RUNS_OF_BARN}. kwasniewski-table1 makes at least 3.",
    ),
]
Seed = Annotated[int, typer.Option(min=0, help="Of the first run; the next ones are consecutive.")]
Jobs = Annotated[
    int, typer.Option(min=1, help="Processes (needs joblib). Results stay the same, but measured times get longer.")
]
Maps = Annotated[
    Path | None,
    typer.Option(
        help=f"{_of('--maps')}: folder with the maps, and with the shipped missions beside it; default: missions/maps. "
        "sedighi-table1: more grids."
    ),
]
World = Annotated[
    list[Path] | None,
    typer.Option(help=f"{_of('--world')}: another map, with its MovingAI scenario file beside it; may be repeated."),
]
Planners = Annotated[
    str | None,
    typer.Option(help=f"{_of('--planners')}: names, separated by commas; default: all that apply."),
]
Worlds = Annotated[
    Path | None,
    typer.Option(
        help="barn: a file of BARN worlds (.npz; docs/worlds.md says how it is made). Driven is the challenge's "
        "standard set of 50 worlds, or every world of a file that lacks some of them. Default: 50 worlds of our "
        "own making."
    ),
]
Controllers = Annotated[
    str | None,
    typer.Option(
        help=f"{_of('--controllers')}: what leads the rover, names separated by commas; default: all, for "
        "gates motion-ga, for dead-companion, killed-companion and missions points."
    ),
]
Setups = Annotated[
    str | None,
    typer.Option(
        help="barn: guarded, strict (without the guard), jackal (a Jackal's limits), separated by commas; gates: "
        "one of the first two; default: guarded."
    ),
]
Lidar = Annotated[
    str | None,
    typer.Option(
        metavar="MODEL",
        help="barn: the companion reads a lidar of this model itself (docs/lidars.md), of which 270 degrees and 10 m "
        "count; without it 72 distances come over MAVLink.",
    ),
]
Missions = Annotated[
    str | None,
    typer.Option(help=f"{_of('--missions')}: names of shipped missions, separated by commas; default: all."),
]
Sensors = Annotated[
    str | None,
    typer.Option(help=f"{_of('--sensors')}: suites, separated by commas; default: lidar-90,lidar-360,beams."),
]
Guard = Annotated[bool, typer.Option("--guard", help=f"{_of('--guard')}: with the guard on the autopilot.")]
Off = Annotated[
    float,
    typer.Option(min=0.0, max=0.9, help=f"{_of('--off')}: so far the rover is off its model, at most: a share."),
]
Late = Annotated[
    float,
    typer.Option(min=0.0, max=2.0, help=f"{_of('--late')}: seconds that a message takes over the link, each way."),
]
GuidTimeout = Annotated[
    float,
    typer.Option(
        min=0.1,
        max=30.0,
        help=f"{_of('--guid-timeout')}: seconds for which the autopilot goes on with the last velocity (GUID_TIMEOUT).",
    ),
]
Outline = Annotated[
    str | None,
    typer.Option(
        metavar="LENGTHxWIDTH",
        help="gates: the rover's outline in metres, 2.0x0.5 for example; default: 0.9x0.7.",
    ),
]
TurningRadius = Annotated[
    float,
    typer.Option(
        min=0.0,
        max=10.0,
        help="driving: the random grounds alone, with steered wheels whose tightest arc has this radius in metres.",
    ),
]
Keep = Annotated[
    Path | None,
    typer.Option(
        help=f"{_of('--keep')}: a folder that keeps each result (needs joblib). After an end before the time, "
        "the same command goes on. Results of other code are not used."
    ),
]
JsonFile = Annotated[Path | None, typer.Option("--json", help="Write all figures as JSON.")]
Docs = Annotated[Path | None, typer.Option(help="Folder whose results.md and images/ are updated; created if missing.")]


def names_given(option: str, listed: str | None) -> tuple[str, ...]:
    """The names of an option; none if it is not there. Raises ExperimentError for one that names nothing."""
    if listed is None:
        return ()
    names = names_in(listed)
    if not names:
        raise ExperimentError(f"{option} {listed!r:.40}: names nothing; separate names by commas")
    return names


def outline_m(given: str | None) -> tuple[float, float] | None:
    """Length and width in metres. Raises ExperimentError."""
    if given is None:
        return None
    try:
        length_m, width_m = (float(one) for one in given.split("x"))
    except ValueError:
        length_m = width_m = math.nan
    if not 0.1 <= width_m <= length_m <= 5.0:
        raise ExperimentError(
            f"--outline {given!r:.40}: give length and width in metres, 0.1 to 5, the length first: 2.0x0.5"
        )
    return length_m, width_m


def refuse_unused(name: str, options: Options) -> None:
    """Refuse options without effect. Raises ExperimentError."""
    given = {
        "--planners": options.planners,
        "--world": options.worlds,
        "--worlds": options.archive,
        "--controllers": options.controllers,
        "--setups": options.setups,
        "--lidar": options.lidar is not None,
        "--missions": options.missions,
        "--sensors": options.sensors,
        "--guard": options.guard,
        "--off": options.off != OFF_MODEL,
        "--late": options.late_s,
        "--guid-timeout": options.timeout_s != TIMEOUT_S,
        "--outline": options.outline_m,
        "--turning-radius": options.turning_radius_m,
        "--maps": options.maps,
        "--keep": options.keep,
    }
    for option, takers in TAKERS.items():
        if given[option] and name not in takers:
            listed = " and ".join(filter(None, (", ".join(takers[:-1]), takers[-1])))
            raise ExperimentError(f"{option}: {name} does not take it; the option is for {listed}")
    if options.turning_radius_m and options.maps is not None:
        raise ExperimentError("--turning-radius: with it the random grounds alone are driven; leave out --maps")
    if options.turning_radius_m and options.worlds:
        raise ExperimentError("--turning-radius: with it the random grounds alone are driven; leave out --world")
