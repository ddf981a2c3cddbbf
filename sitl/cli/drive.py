"""``rover-sitl drive``: companion and simulator in lock-step on one mission."""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from pathlib import Path

import typer
from rich.console import Console

from companion.cli.entry import StoppedError
from companion.cli.inputs import EXIT_BAD_INPUT, OutputError, usable_settings
from companion.core.clock import WallClock
from companion.executive.mission_progress import TargetStatus
from companion.executive.warm_up import COMPILING, kernels_warm
from companion.mapping.map_files import MapError
from companion.mission.mission import MissionError
from companion.recording.record_format import RecordError
from companion.recording.recorder import NullRecorder, Recorder
from companion.settings import SettingsError
from sitl.cli import drive_options as options
from sitl.cli.drive_mission import OnWorld, mission_to_drive, refuse_blind, refuse_turning_on_the_spot
from sitl.cli.drive_outputs import outputs, print_summary, write_collisions
from sitl.cli.drive_progress import Pace, Unattended, run_with_progress
from sitl.cli.drive_view import run_with_view
from sitl.cli.viewer import Viewer, ViewError, terminal
from sitl.faults.fault_file import FaultFileError
from sitl.lockstep import Drive
from sitl.scenario import ScenarioError, equipped, simulated

BAD_INPUT = (
    SettingsError, MissionError, MapError, RecordError, ScenarioError, OutputError, FaultFileError, ViewError,
)  # fmt: skip
RECORD_START_US = 1_577_836_800_000_000
"""2020-01-01: simulated time has no date, and the same run must give the same record."""


def drive(
    mission_file: options.MissionFile = None,
    seed: options.Seed = 0,
    settings_file: options.SettingsFile = None,
    record: options.Record = None,
    image: options.Image = None,
    map_stem: options.MapStem = None,
    json_file: options.JsonFile = None,
    sensors: options.Sensors = None,
    world: options.World = None,
    start: options.Start = None,
    target: options.Target = None,
    top_left: options.TopLeft = False,
    resolution_m: options.ResolutionM = None,
    prior: options.Prior = False,
    params: options.Params = None,
    faults: options.Faults = None,
    time_limit_s: options.TimeLimitS = 3600.0,
    speedup: options.Speedup = None,
    view: options.View = False,
) -> None:
    """Drive MISSION (or --world with --start and --target), companion and simulator together, faster than real time.

    Exit code 0: all targets reached and no collision; 3: a target unreachable, given up or not reached in time;
    4: collision; 2: bad input; 130: stopped by Ctrl-C or SIGTERM. A run that waits for a person ends after a minute.
    """
    console, wanted = Console(), outputs(image, map_stem, json_file)
    recorder: Recorder | NullRecorder = NullRecorder()
    run: Drive | None = None
    viewer: Viewer | None = None
    pace = Pace(options.VIEWED_SPEEDUP if view and speedup is None else speedup, WallClock())
    try:
        screen = terminal() if view else None
        settings = usable_settings(settings_file)
        mission = mission_to_drive(mission_file, OnWorld(world, start, target, resolution_m, top_left, prior))
        mission = equipped(mission, sensors, params)
        refuse_blind(mission)
        scenario = simulated(mission, faults)
        refuse_turning_on_the_spot(mission, scenario)
        for note in scenario.notes:
            typer.echo(note, err=True)
        if record is not None:
            files = {"settings": settings_file, "faults": faults, "sensors": _file(sensors)}
            recorder = Recorder(record, mission, settings, seed, arm=True, files=files, start_us=RECORD_START_US)
        wanted.check((settings_file, faults, _file(sensors), *mission.files))
        with console.status("loading the planner ..."):
            if not kernels_warm(settings, mission.rover.turning_radius_m):
                typer.echo(COMPILING, err=True)
            run = Drive(mission, scenario, settings, seed, recorder, time_limit_s)
        if screen is None:
            report = run_with_progress(run, console, pace)
        else:
            report, viewer = run_with_view(run, screen, _paced(run, pace))
    except BAD_INPUT as error:
        typer.echo(str(error), err=True)
        raise typer.Exit(EXIT_BAD_INPUT) from error
    except KeyboardInterrupt:
        recorder.close()
        if run is not None and isinstance(recorder, Recorder):
            with contextlib.suppress(OutputError):  # the program ends with what it can say
                write_collisions(run, recorder)
        raise StoppedError(_stopped(run, recorder)) from None
    recorder.close()
    print_summary(report, console)
    if viewer is not None:
        viewer.print_last()
    try:
        wanted.write(run, recorder, console)
    except OutputError as error:
        typer.echo(str(error), err=True)
        raise typer.Exit(EXIT_BAD_INPUT) from error
    raise typer.Exit(report.exit_code)


def _file(sensors: str | None) -> Path | None:
    return Path(sensors) if sensors is not None and sensors.endswith(".toml") else None


def _stopped(run: Drive | None, recorder: Recorder | NullRecorder) -> str:
    """What was interrupted, and where its record is."""
    if run is None:
        what = "before the first metre"
    else:
        reached = sum(status is TargetStatus.REACHED for _, status in run.companion.statuses())
        targets = f"{reached} of {len(run.mission.targets)} targets reached"
        touched = len(run.simulator.collisions)
        told = f", {touched} collision{'s' * (touched != 1)}" if touched else ""
        what = f"{run.mission.name} after {run.simulator.time_s:.0f} s of simulated time, {targets}{told}"
    kept = f"record so far: {recorder.directory}" if isinstance(recorder, Recorder) else "nothing was written"
    return f"{what}; {kept}"


def _paced(run: Drive, pace: Pace) -> Callable[[float], None]:
    unattended = Unattended(run, lambda _: None)  # the view shows what the companion waits for

    def wait(time_s: float) -> None:
        unattended.look(run.companion.status())
        pace.wait(time_s)

    return wait
