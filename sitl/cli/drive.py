"""``rover-sitl drive``: companion and simulator in lock-step on one mission."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import typer
from rich.console import Console

from companion.app import Status
from companion.cli.entry import StoppedError
from companion.cli.given import RadiusM, SpeedMS
from companion.cli.inputs import (
    EXIT_BAD_INPUT,
    EXIT_NOT_WRITTEN,
    Laps,
    OutputError,
    PlannerName,
    SkipUnknown,
    usable_settings,
)
from companion.cli.mission import warn_of_world
from companion.cli.source import warn_of_places, warning
from companion.cli.web import Actions, Token, Web, WebError, served, web_viewer
from companion.core.clock import WallClock
from companion.core.interrupts import is_interrupt, was_terminated
from companion.executive.mission_progress import TargetStatus
from companion.executive.warm_up import COMPILING, kernels_warm
from companion.lidar.spec import LidarError, LidarSpec, parsed
from companion.mapping.map_files import MapError
from companion.mission.given import Given
from companion.mission.mission import Mission, MissionError
from companion.mission.outline_hint import outline_hint
from companion.mission.source_files import source_files
from companion.recording.record_format import RecordError
from companion.recording.recorder import NullRecorder, Recorder
from companion.safety.reasons import EndReason
from companion.settings import Settings, SettingsError
from companion.viewer.live_viewer import LiveViewer
from companion.viewer.terminal.painter import Painter, ViewError, terminal
from sitl.cli import drive_options as options
from sitl.cli.drive_mission import OnWorld, mission_to_drive, refuse_blind, refuse_turning_on_the_spot
from sitl.cli.drive_outputs import Outputs, complete_record, outputs, print_summary
from sitl.cli.drive_progress import Also, Pace, Unattended, run_with_progress
from sitl.cli.drive_view import run_with_view
from sitl.faults.fault_file import FaultFileError
from sitl.lockstep import Drive, Report
from sitl.network.collision_log import CollisionLog
from sitl.scenario import Scenario, ScenarioError, equipped, simulated, with_lidars

BAD_INPUT = (
    SettingsError, MissionError, MapError, RecordError, ScenarioError, OutputError, FaultFileError, ViewError, WebError,
    LidarError,
)  # fmt: skip
WEB_EVERY_S = 0.1
SIMULATED = "simulated"
"""The port of a lidar in the simulator."""
RECORD_START_US = 1_577_836_800_000_000
"""2020-01-01: simulated time has no date, and the same run must give the same record."""


def drive(
    context: typer.Context,
    mission_file: options.MissionFile = None,
    seed: options.Seed = 0,
    settings_file: options.SettingsFile = None,
    planner: PlannerName = None,
    record: options.Record = None,
    report_file: options.ReportFile = None,
    image: options.Image = None,
    map_stem: options.MapStem = None,
    json_file: options.JsonFile = None,
    sensors: options.Sensors = None,
    lidar: options.Lidars = None,
    world: options.World = None,
    start: options.Start = None,
    target: options.Target = None,
    top_left: options.TopLeft = False,
    resolution_m: options.ResolutionM = None,
    radius_m: RadiusM = None,
    speed_m_s: SpeedMS = None,
    prior: options.Prior = False,
    params: options.Params = None,
    faults: options.Faults = None,
    time_limit_s: options.TimeLimitS = 3600.0,
    skip_unknown: SkipUnknown = False,
    laps: Laps = None,
    speedup: options.Speedup = None,
    view: options.View = False,
    web: Web = None,
    web_token: Token = None,
    web_actions: Actions = False,
) -> None:
    """Drive MISSION (or --world with --start and --target), companion and simulator together, faster than real time.

    Exit code 0: all targets reached and no collision; 3: a target unreachable, given up or not reached in time;
    4: collision; 2: bad input; 5: as 0, but a file could not be written; 130: stopped by Ctrl-C or
    SIGTERM. A run that waits for a person ends after a minute, with --web-actions never; one that
    cannot begin ends after five.
    """
    painter: Painter | None = None
    console, wanted = Console(), outputs(image, map_stem, json_file, report_file, record)
    recorder: Recorder | NullRecorder = NullRecorder()
    run: Drive | None = None
    usual = options.VIEWED_SPEEDUP if view else options.WEB_SPEEDUP if web else None
    pace = Pace(usual if speedup is None else speedup, WallClock())
    try:
        painter, page = _painter(view), web_viewer(web, web_token, _warn, actions=web_actions)
        with _telling(page):
            settings = usable_settings(settings_file, planner)
            where = OnWorld(world, start, target, resolution_m, top_left, prior)
            given = Given(resolution_m if world is None else None, radius_m, speed_m_s)
            chosen = mission_to_drive(mission_file, where, given, skip_unknown=skip_unknown, laps=laps)
            lidars = tuple(map(_simulated_lidar, lidar or ()))
            mission = equipped(chosen, "none" if lidars and sensors is None else sensors, params)
            scenario = _simulated(mission, faults, lidars)
            files = {"settings": settings_file, "faults": faults, "sensors": _file(sensors)}
            wanted.check((*files.values(), *source_files(mission)))
            folder = context.with_resource(wanted.record_folder())
            if folder is not None:
                with wanted.asked_for():
                    recorder = Recorder(
                        folder,
                        mission,
                        settings,
                        seed,
                        arm=True,
                        files=files,
                        start_us=RECORD_START_US,
                        lidars=[one.text for one in lidars],
                    )
                context.call_on_close(recorder.close)  # also where a part of one's own fails on the way
            with console.status("loading the planner ..."):
                _say_if_compiling(settings, mission)
                run = Drive(
                    mission, scenario, settings, seed, recorder, time_limit_s, station=page.station if page else None,
                    lidars=lidars,
                )  # fmt: skip
            also = Also() if page is None else _shown(run, page, settings)
            if painter is None:
                report = run_with_progress(run, console, pace, also)
            else:
                report = run_with_view(run, painter, _paced(run, pace, also), also)
            if page is not None:
                page.end(run.ended_by(EndReason.TIME_LIMIT))
    except BAD_INPUT as error:
        raise _refused(error) from error
    except (KeyboardInterrupt, SystemError) as error:
        if not is_interrupt(error):
            raise
        _print_last(painter, rows_below=1)
        kept = _kept(run, recorder, wanted, console, _why(error))
        raise StoppedError(f"{_stopped(run)}; {'; '.join(kept) or 'nothing was written'}") from None
    recorder.close(ended_by=run.ended_by(EndReason.TIME_LIMIT))
    _print_results(report, console, mission, settings)
    _print_last(painter, wanted.lines + isinstance(recorder, Recorder))
    unwritten = _written(wanted, run, recorder, console)
    raise typer.Exit(report.exit_code or unwritten)


def _written(wanted: Outputs, run: Drive, recorder: Recorder | NullRecorder, console: Console) -> int:
    """What was asked for is written; the exit code if something could not be, or the record has ended early."""
    try:
        wanted.write(run, recorder, console)
    except OutputError as error:
        _warn(str(error))
        return EXIT_NOT_WRITTEN
    return EXIT_NOT_WRITTEN if recorder.problem else 0


def _simulated_lidar(text: str) -> LidarSpec:
    """A lidar of ``--lidar``. Raises LidarError."""
    if "/" in text.partition(":")[2]:
        raise LidarError(f"lidar '{text}': names a port; a simulated lidar has none: write MODEL[:KEY=VALUE,...]")
    return parsed(text, SIMULATED)


def _print_results(report: Report, console: Console, mission: Mission, settings: Settings) -> None:
    print_summary(report, console)
    hint = outline_hint(mission.rover, settings.guidance.controller)
    if hint and any(status is TargetStatus.UNREACHABLE for _, status in report.targets):
        _warn(hint)


def _painter(view: bool) -> Painter | None:
    return Painter(terminal(sys.stdout)) if view else None


def _refused(error: Exception) -> typer.Exit:
    _warn(str(error))
    return typer.Exit(EXIT_BAD_INPUT)


def _file(sensors: str | None) -> Path | None:
    return Path(sensors) if sensors is not None and sensors.endswith(".toml") else None


def _why(interrupt: BaseException) -> EndReason:
    return EndReason.TERMINATED if was_terminated(interrupt) else EndReason.STOPPED_BY_USER


def _kept(
    run: Drive | None, recorder: Recorder | NullRecorder, wanted: Outputs, console: Console, stopped: EndReason
) -> list[str]:
    """What was recorded of a drive that was interrupted is kept, and its report written; tells where they are."""
    recorder.close(ended_by=stopped if run is None else run.ended_by(stopped))
    if not isinstance(recorder, Recorder):
        return []
    kept = []
    if run is not None and not recorder.problem:
        with contextlib.suppress(OutputError, MapError):  # the program ends with what it can say
            complete_record(run, recorder)
        try:
            line = wanted.write_report(recorder, console, run)
            kept += [line.replace("report:  ", "report: ", 1)] if line else []
        except (OutputError, MapError, RecordError) as error:
            kept.append(f"no report: {error}")
    if wanted.record is not None:
        told = recorder.problem or f"record so far: {recorder.directory}"
        kept.append(f"{told}; rover-companion report {recorder.directory} shows it")
    return kept


def _stopped(run: Drive | None) -> str:
    """What was interrupted."""
    if run is None:
        return "before the first metre"
    reached = sum(status is TargetStatus.REACHED for _, status in run.companion.statuses())
    targets = f"{reached} of {len(run.mission.targets)} targets reached"
    touched = len(run.simulator.collisions)
    told = f", {touched} collision{'s' * (touched != 1)}" if touched else ""
    return f"{run.mission.name} after {run.simulator.time_s:.0f} s of simulated time, {targets}{told}"


def _warn(text: str) -> None:
    typer.echo(text, err=True)


def _print_last(painter: Painter | None, rows_below: int) -> None:
    if painter is not None:
        painter.print_last(rows_below)


def _simulated(mission: Mission, faults: Path | None, lidars: Sequence[LidarSpec]) -> Scenario:
    """The simulation of a mission that can be driven here; remarks are printed."""
    warn_of_places(mission, lambda line: _warn(warning(line)))
    refuse_blind(mission, lidars)
    scenario = with_lidars(simulated(mission, faults), lidars)
    refuse_turning_on_the_spot(mission, scenario)
    for note in scenario.notes:
        typer.echo(note, err=True)
    warn_of_world(mission, lambda line: _warn(warning(line)))
    return scenario


def _say_if_compiling(settings: Settings, mission: Mission) -> None:
    if not kernels_warm(settings, mission.rover.turning_radius_m):
        typer.echo(COMPILING, err=True)


@contextlib.contextmanager
def _telling(page: LiveViewer | None) -> Iterator[None]:
    """The page is told how a drive ended that was broken off, and is closed."""
    try:
        yield
    except BAD_INPUT:
        raise
    except (KeyboardInterrupt, Exception) as error:
        if page is not None and is_interrupt(error):
            page.end(_why(error))
        elif page is not None and isinstance(error, Exception):
            page.fail(error)
        raise
    finally:
        if page is not None:
            page.close()


def _shown(run: Drive, page: LiveViewer, settings: Settings) -> Also:
    """The page, which begins to show the run."""
    _warn(served(page.web.place, to_person=sys.stderr.isatty()))
    page.follow(run.companion, settings, simulated=True)
    log, start = CollisionLog(page.warn, WallClock().now_s), run.scenario.start

    def show(status: Status) -> None:
        collisions = run.simulator.collisions
        log.look(collisions, start)
        page.show(status, [touched.from_start(start) for touched in collisions])

    return Also(show, WEB_EVERY_S)


def _paced(run: Drive, pace: Pace, also: Also) -> Callable[[float], None]:
    unattended = Unattended(run, lambda _: None)  # the view shows what the companion waits for

    def wait(time_s: float) -> None:
        unattended.look(run.companion.status())
        pace.wait(time_s)

    return wait
