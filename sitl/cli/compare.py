"""``rover-sitl compare``: planners side by side on missions, one table, one plot, one CSV file."""

from __future__ import annotations

import json
import os
import re
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated

import typer

from companion.cli.inputs import EXIT_BAD_INPUT, writable, written
from companion.storage.files import whole_file
from sitl.campaign.campaign_file import CampaignError, load_campaign
from sitl.campaign.pictures import times
from sitl.cli.campaign import BAD_INPUT, drive_campaign
from sitl.cli.named import names_in
from sitl.cli.runs import alone_in
from sitl.experiments import drawing
from sitl.generators.kinds import is_kind

FILE, PLOT = "campaign.toml", "times.png"


def compare(
    missions: Annotated[
        list[Path], typer.Argument(metavar="MISSION...", help="Mission files; kinds of worlds from seeds, like maze.")
    ],
    planners: Annotated[str, typer.Option(help="Names, separated by commas; the others are compared with the first.")],
    seeds: Annotated[int, typer.Option(min=1, help="Runs of each planner on each mission, with paired seeds.")] = 30,
    controllers: Annotated[str, typer.Option(help="What leads the rover, names separated by commas.")] = "points",
    jobs: Annotated[int, typer.Option(min=1, help="Processes (needs joblib).")] = 1,
    out: Annotated[Path, typer.Option(help="Folder of the results; what is done there is not done again.")] = Path(
        "out/compare"
    ),
) -> None:
    """Drive each MISSION with each planner, and show driving times, paired ratios with intervals, and a plot.

    It is a campaign: a copy of OUT/campaign.toml can be changed and driven with rover-sitl campaign. Exit code 2: bad
    input; 3: a run ended with an error of the programs; 130: stopped, what is done is kept.
    """
    try:
        file = out / FILE
        writable(file)
        _check(missions, planners, controllers)
        with alone_in(out), written(file), TemporaryDirectory(dir=out) as folder:
            tried = Path(folder) / FILE
            tried.write_text(_campaign(missions, tried.parent, planners, controllers, seeds), encoding="utf-8")
            _load(tried)
            with whole_file(file) as new:
                new.write_text(_campaign(missions, out, planners, controllers, seeds), encoding="utf-8")
        runs = drive_campaign(file, out, jobs)
        if any(result.complete for _, result in runs):
            with written(out / PLOT):
                drawing.save(times(load_campaign(file), runs), out / PLOT)
            typer.echo(f"plot: {out / PLOT}")
        typer.echo(f"table: {out / 'runs.csv'}")
    except BAD_INPUT as error:
        typer.echo(str(error), err=True)
        raise typer.Exit(EXIT_BAD_INPUT) from error


def _check(missions: list[Path], planners: str, controllers: str) -> None:
    """Raises CampaignError for what the campaign's file would be blamed for."""
    for mission in missions:
        if _is_file(mission) and not mission.is_file():
            raise CampaignError(f"{mission}: no such mission file")
    for option, listed in (("--planners", planners), ("--controllers", controllers)):
        if not names_in(listed):
            raise CampaignError(f"{option} {listed!r:.40}: names nothing; separate names by commas")


def _is_file(mission: Path) -> bool:
    """Not a kind of ground: its words may end like a file's name, as ``rooms least_door_m=1.6`` does."""
    return bool(mission.suffix) and not is_kind(str(mission).partition(" ")[0])


def _load(file: Path) -> None:
    """Raises CampaignError that names options: nobody has written the file and its lists."""
    try:
        load_campaign(file)
    except CampaignError as error:
        text = str(error).replace(f"{file}: ", "").partition("; docs/campaigns.md")[0]
        text = re.sub(r"^(planners|controllers)( \d+)?:", r"--\1:", text)
        raise CampaignError(re.sub(r"^worlds( \d+)?:", "MISSION:", text)) from error


def _campaign(missions: list[Path], folder: Path, planners: str, controllers: str, seeds: int) -> str:
    """The campaign's file in a folder; a list of strings is written alike in JSON and TOML."""
    there = folder.resolve()  # the way back from a folder behind a link begins where that leads
    worlds = [
        os.path.relpath(one.parent.resolve() / one.name, there) if _is_file(one) else str(one) for one in missions
    ]
    lists = {"worlds": worlds, "planners": names_in(planners), "controllers": names_in(controllers)}
    lines = [f"{key} = {json.dumps(values, ensure_ascii=False)}" for key, values in lists.items()]
    return "\n".join(['name = "compare"', *lines, f"runs = {seeds}"]) + "\n"
