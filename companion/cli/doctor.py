"""``rover-companion doctor``: finds what would stop a mission, without moving anything."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

from companion.checkpoint.state_directory import default_directory, last_estimate
from companion.cli.given import RadiusM, ResolutionM, SpeedMS
from companion.cli.inputs import EXIT_BAD_INPUT, OutputError, SkipUnknown, usable_settings
from companion.cli.lidars import LidarOption, lidars_given
from companion.cli.state import StateFiles
from companion.control.model_estimate import ModelEstimate, described
from companion.core.clock import Clock, WallClock
from companion.core.scan import RangeScan
from companion.diagnosis.checks import PARAMETERS, diagnose, kernels
from companion.diagnosis.finding import Finding, Level
from companion.diagnosis.payload import Command, parameters_of, payload
from companion.executive.controller_choice import settings_for
from companion.executive.open_gaps import map_at_start, open_gap_m
from companion.executive.warm_up import kernels_warm
from companion.lidar.examination import LidarHeard, lidar_findings
from companion.lidar.reader import LidarReader, Lidars, lidars_on
from companion.lidar.serial_port import listened, open_ports
from companion.lidar.spec import LidarError, LidarSpec
from companion.lidar.swapped_port import INSTEAD_OF, findings_of_port
from companion.lidar.trouble import LidarTrouble, trouble
from companion.mavlink import port_users
from companion.mavlink.signing import SigningKeyError
from companion.mavlink.surveyor import Surveyor
from companion.mavlink.transport import ByteLink, LinkError, device_of, open_link
from companion.mission.doubtful_places import doubtful_places
from companion.mission.field_size import field_size
from companion.mission.given import Given, with_given
from companion.mission.load import load_mission
from companion.mission.mission import Mission, MissionError
from companion.settings import Settings, SettingsError
from companion.vehicle.motion_limits import LIMITS, THROTTLE_SCALE
from companion.vehicle.survey import RangeSource, Survey

STEP_S = 0.05
LISTEN_S = 4.0
"""So long at least to lidars."""
EXIT_FINE, EXIT_WOULD_STOP, EXIT_NOBODY = 0, 3, 4
MISSION_FINDINGS = ("mission", "mission-items", "far-target", "payload")
COLOURS = {Level.STOP: "red", Level.WARN: "yellow", Level.NOTE: "cyan"}


def doctor(
    connect: Annotated[str, typer.Option(help="The autopilot, as for `run`.")],
    mission_file: Annotated[
        Path | None,
        typer.Argument(metavar="MISSION", help="A mission to be looked at where the rover is.", show_default=False),
    ] = None,
    seconds: Annotated[float, typer.Option(min=1.0, max=600.0, help="Listen no longer than this.")] = 15.0,
    resolution_m: ResolutionM = None,
    radius_m: RadiusM = None,
    speed_m_s: SpeedMS = None,
    skip_unknown: SkipUnknown = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the findings as JSON.")] = False,
    settings_file: Annotated[Path | None, typer.Option("--settings", help="TOML file, see docs/settings.md.")] = None,
    lidar: LidarOption = None,
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
        mission, left_out = None, list[Finding]()
        if mission_file is not None:
            mission, left_out = _looked_at(mission_file, Given(resolution_m, radius_m, speed_m_s), skip=skip_unknown)
        commands, clock, specs = commands_of(mission), WallClock(), lidars_given(lidar, connect)
        link, wired = _opened(connect, specs, clock)
    except (SettingsError, LinkError, MissionError, OutputError, SigningKeyError, LidarError) as error:
        typer.echo(str(error), err=True)
        raise typer.Exit(EXIT_BAD_INPUT) from error
    examination = Surveyor(link, settings.link, (*PARAMETERS, *parameters_of(commands)), signer)
    now_s = began_s = clock.now_s()
    if not as_json:
        typer.echo(f"listening on {connect} for up to {seconds:g} s", err=True)
    try:
        while (not examination.done or wired.wants(now_s - began_s)) and now_s - began_s < seconds:
            examination.step(now_s)
            wired.listen(now_s)
            clock.sleep_until_s(now_s + STEP_S)
            now_s = clock.now_s()
        seen = replace(examination.result(), wired=bool(specs))
    finally:
        link.close()
        wired.lidars.close()
        files.close()
    heard = wired.heard(now_s - began_s)
    findings = [
        *lidar_findings(heard, others_look_ahead=seen.vehicle.scan_ahead is not None),
        *_diagnosed(seen, settings, device_of(connect)),
        *payload(seen, commands),
        *left_out,
        *([] if mission is None else of_mission(mission, seen, settings)),
        *kernels(cold=not kernels_warm(settings)),
    ]
    findings.sort(key=lambda one: list(Level).index(one.level))
    estimate = last_estimate(state or default_directory(os.environ))
    if as_json:
        found = [asdict(one) for one in findings]
        summary = {**_summary(seen), "lidars": [one.described for one in heard]}
        typer.echo(json.dumps({"heard": summary, "followed": _followed(estimate), "findings": found}, indent=2))
    else:
        lines = [one.described for one in heard]
        lines += [] if mission is None else [mission_line(mission, seen, findings)]
        _show(seen, findings, estimate, settings.safety.gps_fix, lines)
    if not seen.rover_heard and seen.unbelieved is None:
        raise typer.Exit(EXIT_NOBODY)
    raise typer.Exit(EXIT_WOULD_STOP if any(one.level is Level.STOP for one in findings) else EXIT_FINE)


def _diagnosed(seen: Survey, settings: Settings, device: str | None) -> list[Finding]:
    """What is found about the autopilot, or about what is on its port instead; call it when the link is closed."""
    findings = diagnose(seen, settings.safety.gps_fix)
    swapped = list(findings_of_port(seen.place, seen.strange, partial(listened, device) if device else None))
    return [*swapped, *(one for one in findings if not (swapped and one.name in INSTEAD_OF))]


def _looked_at(file: Path, given: Given, *, skip: bool) -> tuple[Mission, list[Finding]]:
    """The mission without what no rover can do, and what that is where a run would refuse it. Raises MissionError."""
    mission = with_given(load_mission(file, simulated=False, skip_unknown=True), given)
    try:
        load_mission(file, simulated=False, skip_unknown=skip)
    except MissionError as error:
        return mission, [Finding("mission-items", Level.STOP, f"{error}.", "a mission without them")]
    return mission, []


def commands_of(mission: Mission | None) -> list[Command]:
    """The mission's commands: their numbers and first parameters."""
    if mission is None:
        return []
    given = [*mission.commands, *(command for target in mission.targets for command in target.commands)]
    return [(command.command, command.params[0] or 0.0) for command in given]


def _opened(connect: str, specs: Sequence[LidarSpec], clock: Clock) -> tuple[ByteLink, _Wired]:
    """Link and lidars. Raises LinkError or LidarError."""
    wired = _Wired(lidars_on(specs, open_ports(specs, clock)), specs)
    try:
        return open_link(connect), wired
    except LinkError:
        wired.lidars.close()
        raise


def of_mission(mission: Mission, seen: Survey, settings: Settings) -> list[Finding]:
    """What would stop this mission where the rover's home is, and which targets are doubtful from there."""
    home = seen.vehicle.home
    if home is None:
        return []
    rover, sees = mission.rover, seen.vehicle.scan_ahead
    narrow = sees is not None and sees.scan.is_narrow
    settings = settings_for(settings, narrow_sight=narrow, turning_radius_m=rover.turning_radius_m)
    try:
        evidence = map_at_start(mission, settings, home.point, narrow_sight=narrow)
    except MissionError as error:
        return [Finding("mission", Level.STOP, f"{error}.", "change the mission as it says")]
    doubtful = doubtful_places(mission, home.point)
    found = [Finding("far-target", Level.WARN, line, "look at the mission's places") for line in doubtful]
    if mission.grid.by_footprint:
        side_m, gap_m = evidence.base.resolution_m, open_gap_m(rover, evidence)
        finer = field_size(rover, settings.mapping, narrow_sight=narrow).may_be_finer(side_m)
        remedy = "for narrower ones: resolution_m" if finer else "smaller fields would open no more"
        says = f"The mission's fields are {side_m:.3g} m wide: the rover drives through gaps of {gap_m:.1f} m or more."
        found.append(Finding("fields", Level.NOTE, says, f"{remedy}, docs/missions.md"))
    return found


def mission_line(mission: Mission, seen: Survey, findings: Sequence[Finding]) -> str:
    """What was looked at of a mission, and whether anything is wrong with it."""
    count = len(mission.targets)
    name = f"mission {mission.name}: {count} target{'s' * (count != 1)}"
    if seen.vehicle.home is None:
        return f"{name}; not laid out, because the autopilot tells no home yet"
    if any(one.name in MISSION_FINDINGS for one in findings):
        return f"{name}; see below"
    commands = ", and the autopilot has what its commands need" if commands_of(mission) else ""
    return f"{name}; it can be laid out round the rover's home{commands}"


def _summary(seen: Survey) -> dict[str, object]:
    """The survey as JSON values."""
    return {
        "place": seen.place,
        "rover": seen.rover_heard,
        "unbelieved": seen.unbelieved,
        "system": seen.system if seen.rover_heard else None,
        "version": None if seen.version is None else ".".join(map(str, seen.version)),
        "gps_fix": None if seen.vehicle.gps is None else seen.vehicle.gps.fix.text,
        "guard_waits_s": None if seen.vehicle.guard is None else seen.vehicle.guard.waits_s,
        "parameters": dict(seen.parameters),
        "sensors": [asdict(one) for one in seen.sources],
    }


def _followed(estimate: ModelEstimate | None) -> dict[str, float] | None:
    """How the rover followed velocities in the last run; None if that is not known."""
    if estimate is None or estimate.known <= 0.0:
        return None
    figures = {name: round(value, 4) for name, value in estimate.figures._asdict().items()}
    return {"known": round(estimate.known, 3), **figures}


class _Wired:
    """The lidars on serial ports of this computer, and what was heard of them."""

    def __init__(self, lidars: Lidars, specs: Sequence[LidarSpec]) -> None:
        self.lidars = lidars
        self._specs = specs
        self._newest: dict[str, RangeScan] = {}

    def wants(self, elapsed_s: float) -> bool:
        """Whether to go on listening: a motor takes a while to get up to speed."""
        return bool(self._specs) and elapsed_s < LISTEN_S

    def listen(self, now_s: float) -> None:
        """Take in what has come."""
        self._newest |= {seen.scan.source: seen.scan for seen in self.lidars.poll(now_s)}

    def heard(self, seconds: float) -> list[LidarHeard]:
        """What was heard of each."""
        return [
            LidarHeard(one.name, one.spec.port, seconds, one.counters, self._newest.get(one.name), _with_rivals(one))
            for one in self.lidars.readers
        ]


def _with_rivals(lidar: LidarReader) -> LidarTrouble | None:
    """What is wrong with a lidar, with the other programs that have its port open and take bytes away."""
    found = trouble(lidar)
    users = port_users.of_device(lidar.spec.port)
    if found is None or not users:
        return found
    says = f"{found.says}; {port_users.in_words(users)} has the same port open and takes bytes away"
    return replace(found, says=says, remedy="stop that program")


def _show(
    seen: Survey, findings: list[Finding], estimate: ModelEstimate | None, gps_fix: str, lines: list[str]
) -> None:
    console = Console()
    for line in lines:
        console.print(line, soft_wrap=True, markup=False, highlight=False)
    if seen.rover_heard:
        version = "" if seen.version is None else f", ArduRover {'.'.join(map(str, seen.version))}"
        console.print(f"rover: system {seen.system}{version}, on {seen.place}", soft_wrap=True, markup=False)
        names = dict.fromkeys((*LIMITS, *THROTTLE_SCALE))
        if known := {name: seen.parameters[name] for name in names if name in seen.parameters}:
            limits = ", ".join(f"{name} {value:g}" for name, value in known.items())
            console.print(f"limits: {limits}", soft_wrap=True, markup=False)
        if (guard := seen.vehicle.guard) is not None:
            line = f"guard: on the autopilot, sets HOLD {guard.waits_s:g} s after the companion's last packet"
            console.print(line, soft_wrap=True, markup=False, highlight=False)
        fix = "not told" if seen.vehicle.gps is None else seen.vehicle.gps.fix.text
        console.print(f"GPS fix: {fix}; safety.gps_fix asks for {gps_fix}", soft_wrap=True, highlight=False)
        if estimate is not None and estimate.known > 0.0:
            line = f"last run: the rover followed velocities {described(estimate)}"
            console.print(line, soft_wrap=True, markup=False, highlight=False)
        for source in seen.sources:
            console.print(f"sensor: {_described(source)}", soft_wrap=True, markup=False, highlight=False)
    elif seen.unbelieved is not None:
        line = f"rover: system {seen.unbelieved}, on {seen.place}, heard but not believed"
        console.print(line, soft_wrap=True, markup=False)
    table = Table("", "finding", "what to do", show_lines=True)
    for one in findings:
        value = "" if one.value is None or not one.parameter else f" ({one.parameter} is {one.value:g})"
        table.add_row(f"[{COLOURS[one.level]}]{one.level}[/]", _plain(f"{one.says}{value}"), _plain(one.remedy))
    if findings:
        console.print(table)
    if any(one.wanted is not None and one.level is not Level.NOTE for one in findings):
        console.print("`rover-companion params --write FILE` writes a file with all parameters that should be set")
    stopping = sum(one.level is Level.STOP for one in findings)
    console.print(f"{stopping} would stop a mission" if stopping else "nothing found that would stop a mission")


def _described(one: RangeSource) -> str:
    """A range sensor in words."""
    where = "" if one.orientation is None else f" facing {one.orientation}"
    limits = f"{one.min_m:g} to {one.max_m:g} m, {one.rate_hz:.1f} Hz"
    return f"{one.message} {one.sensor} of component {one.component}{where}, {limits}"


def _plain(text: str) -> str:
    """Escape markup of rich in texts of others."""
    return text.replace("[", "\\[")
