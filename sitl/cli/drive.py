"""``rover-sitl drive``: companion and simulator in lock-step on one mission."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from companion.app import Status
from companion.cli.entry import StoppedError
from companion.cli.inputs import OutputError, usable_settings
from companion.clock import WallClock
from companion.itinerary import TargetStatus
from companion.mapfiles import MapError
from companion.mission.load import load_mission
from companion.mission.mission import Mission, MissionError
from companion.recorder import NullRecorder, Recorder, RecordError
from companion.settings import SettingsError
from sitl.cli.drive_outputs import outputs, print_summary
from sitl.cli.drive_view import run_with_view
from sitl.cli.pace import Pace
from sitl.cli.viewer import Viewer, ViewError, terminal
from sitl.fault_file import FaultFileError, load_faults
from sitl.ground import field_at, mission_in_world, mission_on_map
from sitl.lockstep import Drive, Report
from sitl.scenario import Scenario, ScenarioError, scenario_from_mission, with_faults, with_parameter_file, with_sensors
from sitl.worldfile import ground_grid

EXIT_BAD_INPUT = 2
BAD_INPUT = (
    SettingsError, MissionError, MapError, RecordError, ScenarioError, OutputError, FaultFileError, ViewError,
)  # fmt: skip
LINE_EVERY_S = 60.0
VIEWED_SPEEDUP = 10.0
"""Fast enough not to be waited for, slow enough to be followed."""
RECORD_START_US = 1_577_836_800_000_000
"""2020-01-01: simulated time begins at no date, and the same run shall give the same record."""


def drive(
    mission_file: Annotated[
        Path | None, typer.Argument(metavar="[MISSION]", help="TOML, .plan or .waypoints file.", show_default=False)
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Of planner and simulator: the same seed gives the same run.")] = 0,
    settings_file: Annotated[Path | None, typer.Option("--settings", help="TOML file, see docs/settings.md.")] = None,
    record: Annotated[Path | None, typer.Option(help="Directory for the record of this run.")] = None,
    image: Annotated[Path | None, typer.Option(help="Write a picture (.png, .jpg) of map and track.")] = None,
    map_stem: Annotated[
        Path | None, typer.Option("--map", metavar="STEM", help="Write what was mapped as STEM.yaml and STEM.pgm.")
    ] = None,
    json_file: Annotated[Path | None, typer.Option("--json", help="Write the result as JSON.")] = None,
    sensors: Annotated[
        str | None, typer.Option(help="lidar-90, lidar-360, beams or a TOML file; default: the mission's.")
    ] = None,
    world: Annotated[
        Path | None, typer.Option(help="The ground: image, ROS yaml, MovingAI .map or TOML world.")
    ] = None,
    start: Annotated[str | None, typer.Option(metavar="X,Y", help="With --world: the field to start from.")] = None,
    target: Annotated[str | None, typer.Option(metavar="X,Y", help="With --world: the field to reach.")] = None,
    top_left: Annotated[bool, typer.Option("--top-left", help="With --world: Y counts down from the top row.")] = False,
    resolution_m: Annotated[float | None, typer.Option(help="Field size of --world, where the map has none.")] = None,
    prior: Annotated[
        bool, typer.Option("--prior", help="With --world: the companion knows the map from the start.")
    ] = False,
    params: Annotated[Path | None, typer.Option(help="ArduRover's parameters: NAME,VALUE or NAME VALUE.")] = None,
    faults: Annotated[Path | None, typer.Option(help="TOML plan of what goes wrong when.")] = None,
    time_limit_s: Annotated[float, typer.Option(min=1.0, help="Simulated seconds before giving up.")] = 3600.0,
    speedup: Annotated[
        float | None,
        typer.Option(
            min=0.1,
            max=10_000.0,
            help=f"Times real time, at most; default: as fast as it goes, with --view {VIEWED_SPEEDUP:g}.",
        ),
    ] = None,
    view: Annotated[bool, typer.Option("--view", help="Show map, rover and decisions on this terminal.")] = False,
) -> None:
    """Drive MISSION (or --world with --start and --target), companion and simulator together, faster than real time.

    Exit code 0: all targets reached and no collision; 3: a target unreachable, given up or not reached in time;
    4: collision; 2: bad input; 130: stopped by Ctrl-C.
    """
    console, wanted = Console(), outputs(image, map_stem, json_file)
    recorder: Recorder | NullRecorder = NullRecorder()
    run: Drive | None = None
    viewer: Viewer | None = None
    pace = Pace(VIEWED_SPEEDUP if view and speedup is None else speedup, WallClock())
    try:
        screen = terminal() if view else None
        settings = usable_settings(settings_file)
        mission = _mission(mission_file, world, start, target, resolution_m, top_left=top_left, prior=prior)
        if sensors is not None:
            mission = with_sensors(mission, sensors)
        if params is not None:
            mission = with_parameter_file(mission, params)
        _refuse_blind(mission)
        scenario = with_faults(scenario_from_mission(mission), load_faults(faults) if faults else None)
        _refuse_untold(mission, scenario)
        for note in scenario.notes:
            typer.echo(note, err=True)
        if record is not None:
            files = {"settings": settings_file, "faults": faults, "sensors": _file(sensors)}
            recorder = Recorder(record, mission, settings, seed, arm=True, files=files, start_us=RECORD_START_US)
        wanted.check()
        with console.status("compiling (once a machine) ..."):
            run = Drive(mission, scenario, settings, seed, recorder, time_limit_s)
        if screen is None:
            report = _run_with_progress(run, console, pace)
        else:
            report, viewer = run_with_view(run, screen, pace.wait)
    except BAD_INPUT as error:
        typer.echo(str(error), err=True)
        raise typer.Exit(EXIT_BAD_INPUT) from error
    except KeyboardInterrupt:
        recorder.close()
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
    """What Ctrl-C has ended, and where the record of it lies."""
    if run is None:
        what = "before the first metre"
    else:
        reached = sum(status is TargetStatus.REACHED for _, status in run.companion.statuses())
        targets = f"{reached} of {len(run.mission.targets)} targets reached"
        what = f"{run.mission.name} after {run.simulator.time_s:.0f} s of simulated time, {targets}"
    kept = f"record so far: {recorder.directory}" if isinstance(recorder, Recorder) else "nothing was written"
    return f"stopped by Ctrl-C: {what}; {kept}"


def _refuse_blind(mission: Mission) -> None:
    if mission.sitl is not None and str(mission.sitl.sensors) == "none":
        raise MissionError(
            "sensors none: the companion does not drive without range data; none is for rover-sitl serve"
        )


def _refuse_untold(mission: Mission, scenario: Scenario) -> None:
    """The companion must know that it cannot turn on the spot."""
    if scenario.turning_radius_m > 0.0 and mission.rover.turning_radius_m <= 0.0:
        raise MissionError(
            f"{mission.source or mission.name}: the parameters are of a rover with steered wheels: give the mission "
            f"[rover] turning_radius_m = {scenario.turning_radius_m:g}, or the companion would turn it on the spot"
        )


def _mission(
    mission_file: Path | None,
    world: Path | None,
    start: str | None,
    target: str | None,
    resolution_m: float | None,
    *,
    top_left: bool,
    prior: bool,
) -> Mission:
    """The mission to drive, from a file, from --world with --start and --target, or from both."""
    if world is None:
        if mission_file is None:
            raise MissionError("drive: give a MISSION file, or --world MAP with --start X,Y and --target X,Y")
        if start or target or top_left or prior or resolution_m is not None:
            raise MissionError("drive: --start, --target, --top-left, --prior and --resolution-m go with --world")
        return _driven_here(load_mission(mission_file))
    if prior and world.suffix.lower() == ".toml":
        raise MissionError(f"drive: --prior: {world} is drawn in shapes; the companion can be given a map only")
    ground = ground_grid(world, resolution_m)
    begin = field_at(ground, start, "--start", top_left=top_left) if start else None
    if mission_file is not None:
        if target is not None:
            raise MissionError("drive: --target goes with --world alone; the mission has its own targets")
        return mission_in_world(_driven_here(load_mission(mission_file)), world, ground, begin, prior=prior)
    if begin is None or target is None:
        raise MissionError("drive: --world without a mission needs --start X,Y and --target X,Y")
    end = field_at(ground, target, "--target", top_left=top_left)
    return mission_on_map(world, ground, begin, end, prior=prior)


def _run_with_progress(run: Drive, console: Console, pace: Pace) -> Report:
    """Show one line that changes; where there is no terminal (a log file, CI), a new line now and then instead."""
    if not console.is_terminal:
        return _run_with_lines(run, console, pace)
    columns = (TextColumn("{task.description}"), BarColumn(), TextColumn("{task.fields[state]}"), TimeElapsedColumn())
    with Progress(*columns, console=console) as progress:
        task = progress.add_task(run.mission.name, total=None, state="")

        def observe(status: Status) -> None:
            progress.update(task, state=_state(run, status))
            pace.wait(status.time_s)

        report = run.run(observe)
        progress.update(task, total=1, completed=1, state=report.outcome)
    return report


def _run_with_lines(run: Drive, console: Console, pace: Pace) -> Report:
    next_s = 0.0

    def observe(status: Status) -> None:
        nonlocal next_s
        if status.time_s >= next_s:
            next_s = status.time_s + LINE_EVERY_S
            console.print(f"{run.mission.name}: {_state(run, status)}", soft_wrap=True, markup=False, highlight=False)
        pace.wait(status.time_s)

    return run.run(observe)


def _state(run: Drive, status: Status) -> str:
    part = status.decision.part.value if status.decision else "-"
    state = f"{status.time_s:6.1f} s  {status.doing}  {status.target}  part {part}  step {status.steps}"
    goal = run.companion.itinerary.goal if run.companion.itinerary else None
    if goal is not None and status.pose is not None:
        state += f"  {status.pose.point.distance_m(goal.point):.0f} m to go"
    return state


def _driven_here(mission: Mission) -> Mission:
    """The mission, unless it is the autopilot's to drive."""
    if mission.in_auto:
        raise MissionError(
            f"{mission.source}: the autopilot drives this mission in AUTO (NAV_GUIDED_ENABLE); use rover-sitl serve, upload the mission, "
            "and rover-companion run"
        )
    return mission
