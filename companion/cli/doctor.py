"""``rover-companion doctor``: finds what would stop a mission, without moving anything."""

from __future__ import annotations

import json
import os
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

from companion.checkpoint.state_directory import default_directory, last_estimate
from companion.cli.inputs import EXIT_BAD_INPUT, OutputError, usable_settings
from companion.cli.state import StateFiles
from companion.control.model_estimate import ModelEstimate, described
from companion.core.clock import WallClock
from companion.core.frames import LocalFrame, NedPoint
from companion.diagnosis.checks import PARAMETERS, diagnose, kernels
from companion.diagnosis.finding import Finding, Level
from companion.executive.warm_up import kernels_warm
from companion.mapping.map_files import MapError
from companion.mavlink.signing import SigningKeyError
from companion.mavlink.surveyor import Surveyor
from companion.mavlink.transport import LinkError, open_link
from companion.mission.doubtful_places import doubtful_places
from companion.mission.field_size import field_size, finer_evidence, sure_gap_m
from companion.mission.load import load_mission
from companion.mission.mission import Mission, MissionError
from companion.mission.resolve import resolve
from companion.settings import Settings, SettingsError
from companion.vehicle.motion_limits import LIMITS, THROTTLE_SCALE
from companion.vehicle.survey import Survey

STEP_S = 0.05
EXIT_FINE, EXIT_WOULD_STOP, EXIT_NOBODY = 0, 3, 4
COLOURS = {Level.STOP: "red", Level.WARN: "yellow", Level.NOTE: "cyan"}


def doctor(
    connect: Annotated[str, typer.Option(help="The autopilot, as for `run`.")],
    mission_file: Annotated[
        Path | None,
        typer.Argument(metavar="MISSION", help="A mission to be looked at where the rover is.", show_default=False),
    ] = None,
    seconds: Annotated[float, typer.Option(min=1.0, max=600.0, help="Listen no longer than this.")] = 15.0,
    as_json: Annotated[bool, typer.Option("--json", help="Print the findings as JSON.")] = False,
    settings_file: Annotated[Path | None, typer.Option("--settings", help="TOML file, see docs/settings.md.")] = None,
    state: Annotated[Path | None, typer.Option(help="Directory where this rover's state is kept.")] = None,
    signing_key: Annotated[
        Path | None, typer.Option(help="File with the passphrase, or 64 hexadecimal digits.")
    ] = None,
) -> None:
    """Say what would stop a mission. Exit code 0: nothing; 3: something would; 4: no rover heard; 2: bad input."""
    try:
        files = StateFiles(state)
        settings = usable_settings(settings_file)
        signer = files.signer(signing_key)
        mission = None if mission_file is None else load_mission(mission_file, simulated=False)
        link = open_link(connect)
    except (SettingsError, LinkError, OutputError, SigningKeyError, MissionError) as error:
        typer.echo(str(error), err=True)
        raise typer.Exit(EXIT_BAD_INPUT) from error
    clock = WallClock()
    examination = Surveyor(link, settings.link, PARAMETERS, signer)
    now_s = began_s = clock.now_s()
    try:
        while not examination.done and now_s - began_s < seconds:
            examination.step(now_s)
            clock.sleep_until_s(now_s + STEP_S)
            now_s = clock.now_s()
        seen = examination.result()
    finally:
        link.close()
        files.close()
    findings = [
        *diagnose(seen, settings.safety.gps_fix),
        *([] if mission is None else of_mission(mission, seen, settings)),
        *kernels(cold=not kernels_warm(settings)),
    ]
    estimate = last_estimate(state or default_directory(os.environ))
    if as_json:
        found = [asdict(one) for one in findings]
        typer.echo(json.dumps({"heard": _summary(seen), "followed": _followed(estimate), "findings": found}, indent=2))
    else:
        _show(seen, findings, estimate, settings.safety.gps_fix)
    if not seen.rover_heard and seen.unbelieved is None:
        raise typer.Exit(EXIT_NOBODY)
    raise typer.Exit(EXIT_WOULD_STOP if any(one.level is Level.STOP for one in findings) else EXIT_FINE)


def of_mission(mission: Mission, seen: Survey, settings: Settings) -> list[Finding]:
    """What would stop this mission where the rover's home is, and which targets are doubtful from there."""
    home = seen.vehicle.home
    if home is None:
        return []
    rover, mapping = mission.rover, settings.mapping
    size = field_size(rover, mapping)
    try:
        side_m = resolve(mission, LocalFrame(home.point), NedPoint(0.0, 0.0), size=size).ground.resolution_m
    except (MissionError, MapError) as error:
        return [Finding("mission", Level.STOP, f"{error}.", "change the mission as it says")]
    doubtful = doubtful_places(mission, home.point)
    found = [Finding("far-target", Level.WARN, line, "look at the mission's places") for line in doubtful]
    if size is not None and mission.grid.by_footprint:
        gap_m = sure_gap_m(rover, finer_evidence(mapping, side_m), side_m)
        says = f"The mission's fields are {side_m:.2g} m wide: the rover drives through gaps of {gap_m:.1f} m or more."
        found.append(Finding("fields", Level.NOTE, says, "for narrower ones: resolution_m, docs/missions.md"))
    return found


def _summary(seen: Survey) -> dict[str, object]:
    """The survey as JSON values."""
    return {
        "place": seen.place,
        "rover": seen.rover_heard,
        "unbelieved": seen.unbelieved,
        "system": seen.system if seen.rover_heard else None,
        "version": None if seen.version is None else ".".join(map(str, seen.version)),
        "gps_fix": None if seen.vehicle.gps is None else seen.vehicle.gps.fix.text,
        "parameters": dict(seen.parameters),
        "sensors": [asdict(one) for one in seen.sources],
    }


def _followed(estimate: ModelEstimate | None) -> dict[str, float] | None:
    """How the rover followed velocities in the last run; None if that is not known."""
    if estimate is None or estimate.known <= 0.0:
        return None
    figures = {name: round(value, 4) for name, value in estimate.figures._asdict().items()}
    return {"known": round(estimate.known, 3), **figures}


def _show(seen: Survey, findings: list[Finding], estimate: ModelEstimate | None, gps_fix: str) -> None:
    console = Console()
    if seen.rover_heard:
        version = "" if seen.version is None else f", ArduRover {'.'.join(map(str, seen.version))}"
        console.print(f"rover: system {seen.system}{version}, on {seen.place}", soft_wrap=True, markup=False)
        names = dict.fromkeys((*LIMITS, *THROTTLE_SCALE))
        if known := {name: seen.parameters[name] for name in names if name in seen.parameters}:
            limits = ", ".join(f"{name} {value:g}" for name, value in known.items())
            console.print(f"limits: {limits}", soft_wrap=True, markup=False)
        fix = "not told" if seen.vehicle.gps is None else seen.vehicle.gps.fix.text
        console.print(f"GPS fix: {fix}; safety.gps_fix asks for {gps_fix}", soft_wrap=True, highlight=False)
        if estimate is not None and estimate.known > 0.0:
            line = f"last run: the rover followed velocities {described(estimate)}"
            console.print(line, soft_wrap=True, markup=False, highlight=False)
    elif seen.unbelieved is not None:
        line = f"rover: system {seen.unbelieved}, on {seen.place}, heard but not believed"
        console.print(line, soft_wrap=True, markup=False)
    table = Table("", "finding", "what to do", show_lines=True)
    for one in findings:
        value = "" if one.value is None or not one.parameter else f" ({one.parameter} is {one.value:g})"
        table.add_row(f"[{COLOURS[one.level]}]{one.level}[/]", _plain(f"{one.says}{value}"), _plain(one.remedy))
    if findings:
        console.print(table)
    stopping = sum(one.level is Level.STOP for one in findings)
    console.print(f"{stopping} would stop a mission" if stopping else "nothing found that would stop a mission")


def _plain(text: str) -> str:
    """Escape markup of rich in texts of others."""
    return text.replace("[", "\\[")
