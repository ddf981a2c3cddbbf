"""``rover-companion run``: drives a mission on a real rover or a simulated one."""

from __future__ import annotations

import contextlib
import os
import signal
import threading
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from types import FrameType
from typing import Annotated

import typer
from rich.console import Console

from companion.app import Companion, Status
from companion.checkpoint.state_directory import StateDirectoryError
from companion.cli.given import RadiusM, ResolutionM, SpeedMS
from companion.cli.inputs import EXIT_BAD_INPUT, Laps, OutputError, SkipUnknown, usable_settings
from companion.cli.lidars import LidarOption, lidars_given
from companion.cli.live import STDERR, Live, Reader, error_console, levelled, reader_of
from companion.cli.live_view import LiveView, View, painter_for
from companion.cli.service import Service
from companion.cli.source import Source, Stoppable, refuse_arming, warning
from companion.cli.state import RunState, StateFiles
from companion.cli.web import Actions, Token, Web, WebError, served, web_viewer
from companion.control.model_estimate import described
from companion.core.clock import WallClock
from companion.core.severity import Severity
from companion.executive.mission_progress import TargetStatus
from companion.executive.warm_up import COMPILING, kernels_warm, settle, warm_up
from companion.lidar.reader import Lidars, lidars_on
from companion.lidar.serial_port import open_ports
from companion.lidar.spec import LidarError, LidarSpec
from companion.lidar.swapped_port import StrangePort
from companion.mapping.map_files import MapError
from companion.mavlink.autopilot_link import AutopilotLink
from companion.mavlink.codec import Codec
from companion.mavlink.serial_port import rivals_of
from companion.mavlink.signing import SigningKeyError
from companion.mavlink.transport import ByteLink, LinkError
from companion.mission.given import Given
from companion.mission.mission import Mission, MissionError, with_laps
from companion.mission.outline_hint import outline_hint
from companion.navigation.step_runner import ThreadRunner
from companion.recording.record_format import STATE, RecordError
from companion.recording.recorder import NullRecorder, Recorder
from companion.safety.reasons import PowerReason, Reason
from companion.settings import Settings, SettingsError
from companion.storage.background_writer import BackgroundWorker, ShutdownBudget
from companion.viewer.live_viewer import LiveViewer

STOPPING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
BAD_INPUT = (
    SettingsError,
    MissionError,
    MapError,
    LinkError,
    RecordError,
    StateDirectoryError,
    OutputError,
    SigningKeyError,
    WebError,
    LidarError,
)
UNHURRIED_S = 10.0
"""A run that ends by itself waits this long for a slow disk, and for who reads its output."""
AGAIN_S = 1.0
"""So long after a signal the program must have ended, or the signal is raised again."""
EXIT_REACHED, EXIT_MISSED, EXIT_STOPPED = 0, 3, 130


def run(
    connect: Annotated[
        str,
        typer.Option(
            help="The autopilot: udpin:HOST:PORT, udpout:HOST:PORT, tcp:HOST:PORT, tcpin:HOST:PORT "
            "or serial:DEVICE:BAUD."
        ),
    ],
    mission_file: Annotated[
        Path | None, typer.Argument(metavar="MISSION", help="TOML, .plan or .waypoints file.", show_default=False)
    ] = None,
    from_autopilot: Annotated[
        bool, typer.Option("--from-autopilot", help="Drive the mission that the autopilot has stored.")
    ] = False,
    resolution_m: ResolutionM = None,
    radius_m: RadiusM = None,
    speed_m_s: SpeedMS = None,
    arm: Annotated[bool, typer.Option("--arm", help="Arm the motors; otherwise wait for a person to do it.")] = False,
    settings_file: Annotated[Path | None, typer.Option("--settings", help="TOML file, see docs/settings.md.")] = None,
    seed: Annotated[int, typer.Option(min=0, help="Of planners that draw random numbers.")] = 0,
    record: Annotated[Path | None, typer.Option(help="Directory for the record and the map of this run.")] = None,
    state: Annotated[Path | None, typer.Option(help="Directory where this rover's state is kept.")] = None,
    lidar: LidarOption = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on where the run that kept its state there ended.")
    ] = False,
    signing_key: Annotated[
        Path | None, typer.Option(help="File with the passphrase, or 64 hexadecimal digits.")
    ] = None,
    skip_unknown: SkipUnknown = False,
    laps: Laps = None,
    web: Web = None,
    web_token: Token = None,
    web_actions: Actions = False,
    view: View = False,
) -> None:
    """Drive MISSION.

    Exit code 0: every target reached; 3: a target missed; 2: bad input; 1: error in the program; 130: stopped by a
    signal.
    """
    console = error_console()

    reader = reader_of(STDERR, os.environ)

    def say(text: str) -> None:
        console.print(levelled(text, Severity.INFO, reader), soft_wrap=True, markup=False, highlight=False)

    live: Live | LiveView | None = None

    def warn(text: str) -> None:
        """Of a problem beside the drive, perhaps while the picture is on the terminal."""
        live.tell(text, Severity.WARNING) if live is not None else say(text)

    try:
        with _StopSignals() as stop, contextlib.ExitStack() as ends:
            budget = ShutdownBudget()
            files = StateFiles(state, budget)
            ends.callback(files.close)
            settings, specs = files.settings(usable_settings(settings_file), say), lidars_given(lidar, connect)
            signer = files.signer(signing_key)
            painter = painter_for(view=view, say=say)
            page = web_viewer(web, web_token, warn, actions=web_actions, signer=signer)
            if page is not None:
                ends.callback(page.close)
                say(served(page.web.place, to_person=reader is Reader.PERSON))
            source = Source(
                mission_file,
                connect,
                from_autopilot=from_autopilot,
                skip_unknown=skip_unknown,
                given=Given(resolution_m, radius_m, speed_m_s),
            )
            mission = source.mission(settings, signer, stop, say, partial(_caution, console, reader))
            if mission is None:
                raise SystemExit(EXIT_STOPPED)
            mission = refuse_arming(with_laps(mission, laps), arm=arm)
            # The link first: with a wrong one nothing is written.
            link, keeping = _opened(source, say, ends), RunState(mission, state, resume=resume, say=say)
            ends.callback(keeping.close)
            if keeping.ended:
                raise typer.Exit(_print_statuses(keeping.statuses))
            given = {"settings": settings_file, STATE: keeping.file if keeping.previous else None}
            recorder = (
                Recorder(
                    record,
                    mission,
                    settings,
                    seed,
                    arm=arm,
                    files=given,
                    worker=BackgroundWorker("record", budget),
                    lidars=[one.text for one in specs],
                )
                if record
                else NullRecorder()
            )
            lidars = _lidars(specs, recorder, ends)
            with console.status("loading the planner ..."):
                _load_planner(settings, mission, say)
            _drop(link, lidars)
            place = _told_place(recorder, record, say)
            keeping.start(budget)
            codec, station = Codec(settings.link, signer=signer), None if page is None else page.station
            autopilot = AutopilotLink(link, codec, settings.link, recorder, station)
            lines = Live(console, mission.name, reader)
            live = lines if painter is None else LiveView(painter, lines, mission.name)
            rig = _Rig(
                mission, settings, link, autopilot, recorder, place, keeping, files, live, stop, budget, page, lidars
            )
            code = _drive(rig, seed=seed, arm=arm)
    except BAD_INPUT as error:
        typer.echo(levelled(str(error), Severity.ERROR, reader) if reader is Reader.JOURNAL else str(error), err=True)
        raise typer.Exit(EXIT_BAD_INPUT) from error
    if stop.asked:
        raise SystemExit(EXIT_STOPPED)  # it has reported that itself
    raise typer.Exit(code)


def _lidars(specs: list[LidarSpec], recorder: Recorder | NullRecorder, ends: contextlib.ExitStack) -> Lidars:
    """The lidars, closed in the end. Raises LidarError."""
    lidars = lidars_on(specs, open_ports(specs, WallClock()), recorder)
    ends.callback(lidars.close)
    return lidars


def _drop(link: ByteLink, lidars: Lidars) -> None:
    """Forget what has piled up meanwhile."""
    link.read()
    lidars.drop()


def _caution(console: Console, reader: Reader, line: str) -> None:
    text = warning(line) if reader is Reader.PERSON else levelled(line, Severity.WARNING, reader)
    console.print(text, soft_wrap=True, markup=False, highlight=False)


def _told_place(recorder: Recorder | NullRecorder, asked: Path | None, say: Callable[[str], None]) -> Path | None:
    """The folder of the record, which is told if it is another one than was asked for."""
    place = recorder.directory if isinstance(recorder, Recorder) else None
    if place != asked:
        say(f"{asked} has a record already; this one goes to {place}")
    return place


def _opened(source: Source, say: Callable[[str], None], ends: contextlib.ExitStack) -> ByteLink:
    """The link, closed in the end; names the other programs that have the same serial port open. Raises LinkError."""
    link = source.link()
    ends.callback(link.close)
    for user in rivals_of(link):
        say(f"{link.description}: {user} has this port open too, and takes bytes away; see docs/ports.md")
    return link


def _load_planner(settings: Settings, mission: Mission, say: Callable[[str], None]) -> None:
    if not kernels_warm(settings, mission.rover.turning_radius_m):
        say(COMPILING)
        warm_up(settings, mission.rover.turning_radius_m)
    settle()


@dataclass(frozen=True, slots=True)
class _Rig:
    """The objects of a run. ``place``: the folder of its record; None without one."""

    mission: Mission
    settings: Settings
    link: ByteLink
    autopilot: AutopilotLink
    recorder: Recorder | NullRecorder
    place: Path | None
    keeping: RunState
    files: StateFiles
    live: Live | LiveView
    stop: _StopSignals
    budget: ShutdownBudget
    page: LiveViewer | None
    lidars: Lidars


def _drive(rig: _Rig, *, seed: int, arm: bool) -> int:
    """Drive to the end, close everything and print the result. Returns the exit code."""
    runner = ThreadRunner()
    companion = Companion(
        rig.autopilot,
        WallClock(),
        rig.mission,
        rig.settings,
        runner,
        rig.recorder,
        seed=seed,
        arm=arm,
        checkpointer=rig.keeping.checkpointer,
        keep_settings=rig.files.keep,
        lidars=rig.lidars,
    )
    rig.stop.listener = companion
    service = Service(os.environ)

    if rig.page is not None:
        rig.page.follow(companion, rig.settings, simulated=False)
    if isinstance(rig.live, LiveView):
        rig.live.follow(companion)

    strange = StrangePort(rig.link.description, lambda text: rig.live.tell(text, Severity.WARNING))

    def show(status: Status) -> None:
        strange.look(status.time_s, rig.autopilot.codec.strange)
        rig.live.show(status)
        service.show(status)
        if rig.page is not None:
            rig.page.show(status)

    service.ready()
    with rig.live:  # which may wait for the terminal at its end: the rover is stopped first
        try:
            companion.run(show)
            if not rig.stop.asked:
                rig.budget.extend(UNHURRIED_S)
                rig.live.unhurried(UNHURRIED_S)
        except Exception as error:
            companion.close()  # the rover first
            if rig.page is not None:
                rig.page.fail(error)
            raise
        finally:
            service.stopping()
            companion.close()
            rig.keeping.close()
            runner.close()
            rig.link.close()
            rig.lidars.close()
            rig.recorder.close()
    return _ended(companion, rig)


def _ended(companion: Companion, rig: _Rig) -> int:
    """Print the result, and what could not be saved; returns the exit code."""
    code = _print_statuses(companion.statuses(), companion.outcome.broken_off)
    code = code if companion.complete else EXIT_MISSED
    with contextlib.suppress(OSError):  # no reader: the exit code remains
        if companion.parting is not None:
            typer.echo(companion.parting, err=True)
        for line in (*companion.command_lines(), *map(str, companion.laps)):
            typer.echo(line)
        if any(status is TargetStatus.UNREACHABLE for _, status in companion.statuses()):
            hint = outline_hint(rig.mission.rover, rig.settings.guidance.controller)
            typer.echo(hint, nl=bool(hint))
        if companion.estimate is not None:
            typer.echo(f"the rover follows velocities {described(companion.estimate)}")
        for line in (rig.files.close(), rig.keeping.problem, str(rig.autopilot.codec.counters.refused)):
            if line:
                typer.echo(line, err=True)
        if rig.place is not None:
            _save_map(companion, rig.place, rig.budget)
            if rig.recorder.problem:
                typer.echo(rig.recorder.problem, err=True)
            typer.echo(f"record: {rig.place}; rover-companion report {rig.place} shows it")
        if rig.stop.asked and code != EXIT_REACHED and rig.keeping.way_on:
            typer.echo(rig.keeping.way_on)
    return code


def _print_statuses(statuses: list[tuple[str, TargetStatus]], broken_off: Reason[PowerReason] | None = None) -> int:
    """Print the status of each target, with the reason if the mission was broken off; returns the exit code."""
    with contextlib.suppress(OSError):
        for name, status in statuses:
            untried = status in (TargetStatus.SKIPPED, TargetStatus.PENDING)
            typer.echo(f"{name}: {status}{f' ({broken_off})' if broken_off is not None and untried else ''}")
    return EXIT_REACHED if all(status is TargetStatus.REACHED for _, status in statuses) else EXIT_MISSED


def _save_map(companion: Companion, directory: Path, budget: ShutdownBudget) -> None:
    """Write the map as ``map.yaml`` and ``map.pgm``; a disk that is full or hangs does not change the run's result."""
    place = directory / "map.yaml"
    told: list[tuple[str, bool]] = []

    def save() -> None:
        try:
            if companion.save_map(directory / "map"):
                told.append((f"map: {place}", False))
        except MapError as error:
            told.append((str(error), True))

    worker = BackgroundWorker("map", budget)
    worker.put(save)
    if not worker.close():
        told.append((f"{place}: not written: the disk does not answer", True))
    for line, err in told:
        typer.echo(line, err=err)


class _StopSignals:
    """SIGINT, SIGTERM and a closed terminal stop the rover, then end the run.

    Before the drive they end the program at once. An exception that is raised within a compiler's callback is lost, so
    it is raised again until the program ends, and a drive does not begin.
    """

    def __init__(self) -> None:
        self.asked = False
        self._listener: Stoppable | None = None
        self._again: threading.Timer | None = None

    @property
    def listener(self) -> Stoppable | None:
        """Who is told; None before the drive."""
        return self._listener

    @listener.setter
    def listener(self, listener: Stoppable | None) -> None:
        if self.asked and self._listener is None:
            raise SystemExit(EXIT_STOPPED)
        self._listener = listener

    def __enter__(self) -> _StopSignals:
        """Install the handlers."""
        self._before = {number: signal.signal(number, self._stop) for number in STOPPING}
        return self

    def __exit__(self, *_: object) -> None:
        """Restore the former handlers."""
        if self._again is not None:
            self._again.cancel()
        for number, handler in self._before.items():
            signal.signal(number, handler)

    def _stop(self, number: int, frame: FrameType | None) -> None:
        if self._listener is not None:
            self.asked = True
            self._listener.stop()
            return
        if not self.asked:
            typer.echo("stopped before anything was sent to the rover", err=True)
        self.asked = True
        self._again = threading.Timer(AGAIN_S, signal.raise_signal, (number,))
        self._again.daemon = True
        self._again.start()
        raise SystemExit(EXIT_STOPPED)
