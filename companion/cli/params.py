"""``rover-companion params``: the parameters that the autopilot should have: a file, or compared with the rover's."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

from companion.cli.inputs import EXIT_BAD_INPUT, OutputError, in_folder, replaced, usable_settings
from companion.cli.state import StateFiles
from companion.core.clock import WallClock
from companion.mavlink.parameter_reader import ParameterReader
from companion.mavlink.signing import SigningKeyError
from companion.mavlink.transport import LinkError, open_link
from companion.mission.load import load_mission
from companion.mission.mission import MissionError, RoverSpec
from companion.settings import SettingsError
from companion.vehicle.wanted_parameters import WantedParameter, for_rover, wanted_parameters

EXIT_FINE, EXIT_DIFFERS, EXIT_NOBODY = 0, 3, 4
STEP_S, HEARD_S, LIMIT_S = 0.02, 10.0, 60.0
SUFFIXES = {".param": "{name},{value:g}", ".parm": "{name},{value:g}", ".params": "1\t1\t{name}\t{value:g}\t{kind}"}
"""Mission Planner and MAVProxy; QGroundControl (vehicle, component, name, value, type)."""


def params(
    write: Annotated[
        Path | None, typer.Option(help="Write them to this file: .param (Mission Planner, MAVProxy) or .params (QGC).")
    ] = None,
    check: Annotated[bool, typer.Option("--check", help="Compare them with the rover's; needs --connect.")] = False,
    connect: Annotated[str | None, typer.Option(help="The autopilot, as for `run`.")] = None,
    mission_file: Annotated[Path | None, typer.Option("--mission", help="WP_SPEED for this mission.")] = None,
    guard: Annotated[bool, typer.Option("--guard", help="With those of the guard on the autopilot.")] = False,
    station: Annotated[bool, typer.Option("--station", help="With those for a ground station.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="With --check: print JSON.")] = False,
    settings_file: Annotated[Path | None, typer.Option("--settings", help="TOML file, see docs/settings.md.")] = None,
    state: Annotated[Path | None, typer.Option(help="Directory where this rover's state is kept.")] = None,
    signing_key: Annotated[
        Path | None, typer.Option(help="File with the passphrase, or 64 hexadecimal digits.")
    ] = None,
) -> None:
    """Print the parameters that the autopilot should have, write them to a file, or compare them with the rover's.

    Sets nothing. Exit code 0: they are as wanted; 3: some differ, or were not answered; 4: no rover heard; 2: bad
    input.
    """
    try:
        if not check and (connect is not None or as_json):
            raise OutputError("params: --connect and --json go with --check, which compares with the rover's")
        rover = RoverSpec() if mission_file is None else load_mission(mission_file, simulated=False).rover
        table = wanted_parameters(rover.cruise_speed_m_s)
        wanted = for_rover(table, guard=guard, station=station)
        if write is not None:
            _write(write, wanted, table)
        if check:
            files = StateFiles(state)
            reader, place = _read(connect, wanted, files, settings_file, signing_key, quiet=as_json)
    except (MissionError, SettingsError, OutputError, LinkError, SigningKeyError) as error:
        typer.echo(str(error), err=True)
        raise typer.Exit(EXIT_BAD_INPUT) from error
    if check:
        raise typer.Exit(_compare(reader, wanted, place, as_json=as_json))
    if write is None:
        Console().print(_shown(wanted))


def text_of(wanted: Sequence[WantedParameter], table: Sequence[WantedParameter], form: str) -> str:
    """A parameter file, with the reason above each line; those of other rovers as comments."""
    lines = ["# ArduRover's parameters for rover-companion. Restart the autopilot when they are set."]
    for one in table:
        line = form.format(name=one.name, value=one.value, kind=one.kind)
        lines += ["#", f"# {one.why}"]
        lines.append(line if one in wanted else f"# only {one.use}: {one.name} {one.value:g}")
    return "\n".join([*lines, ""])


def _write(place: Path, wanted: Sequence[WantedParameter], table: Sequence[WantedParameter]) -> None:
    form = SUFFIXES.get(place.suffix.lower())
    if form is None:
        raise OutputError(f"{place}: end its name in .param (Mission Planner, MAVProxy) or .params (QGroundControl)")
    in_folder(place)
    with replaced(place) as new:
        new.write_text(text_of(wanted, table, form), encoding="utf-8")
    typer.echo(f"wrote {place}: {len(wanted)} parameters; load it with a ground station, and restart the autopilot")


def _read(
    connect: str | None,
    wanted: Sequence[WantedParameter],
    files: StateFiles,
    settings_file: Path | None,
    signing_key: Path | None,
    *,
    quiet: bool,
) -> tuple[ParameterReader, str]:
    """The rover's own values, and where they were asked for. Raises LinkError, SettingsError, SigningKeyError."""
    if connect is None:
        raise LinkError("params --check: name the rover with --connect")
    try:
        settings, signer = usable_settings(settings_file).link, files.signer(signing_key)
        link, clock = open_link(connect), WallClock()
        if not quiet:
            typer.echo(f"reading parameters on {connect}", err=True)
        reader = ParameterReader(link, settings, [one.name for one in wanted], signer)
        began_s = now_s = clock.now_s()
        try:
            while not reader.done(now_s) and now_s - began_s < (LIMIT_S if reader.rover_heard else HEARD_S):
                reader.step(now_s)
                clock.sleep_until_s(now_s + STEP_S)
                now_s = clock.now_s()
            place = link.description
        finally:
            link.close()
    finally:
        files.close()
    return reader, place


def _compare(reader: ParameterReader, wanted: Sequence[WantedParameter], place: str, *, as_json: bool) -> int:
    """Print the comparison; returns the exit code."""
    values = reader.values
    if not reader.rover_heard:
        trouble = reader.signing_trouble
        typer.echo(f"{place}: no rover is heard; {trouble or 'rover-companion doctor says more'}", err=True)
        return EXIT_NOBODY
    unheard = [one.name for one in wanted if one.name not in values]
    wrong = [one.name for one in wanted if one.name in values and not one.accepts(values[one.name])]
    if as_json:
        rows = [
            {"name": one.name, "wanted": one.wish, "is": values.get(one.name), "fine": _is_fine(one, values)}
            for one in wanted
        ]
        typer.echo(json.dumps({"place": place, "parameters": rows}, indent=2))
    else:
        Console().print(_shown(wanted, values))
        told = [f"{len(wrong)} of {len(wanted)} differ: {', '.join(wrong)}"] if wrong else []
        told += [f"not answered: {', '.join(unheard)}"] if unheard else []
        typer.echo("; ".join(told) or f"all {len(wanted)} are as wanted")
    return EXIT_DIFFERS if wrong or unheard else EXIT_FINE


def _is_fine(one: WantedParameter, values: Mapping[str, float]) -> bool:
    return one.name in values and one.accepts(values[one.name])


def _shown(wanted: Sequence[WantedParameter], values: Mapping[str, float] | None = None) -> Table:
    """The table for people; with the rover's values if they are given."""
    table = Table("parameter", "wanted", *(["is"] if values is not None else []), "why")
    for one in wanted:
        row = [one.name, one.wish]
        if values is not None:
            value = "not answered" if one.name not in values else f"{values[one.name]:g}"
            row.append(value if _is_fine(one, values) else f"[red]{value}[/]")
        table.add_row(*row, one.why)
    return table
