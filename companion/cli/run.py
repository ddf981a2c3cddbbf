"""``rover-companion run``: drives a mission on a real rover or a simulated one."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import typer
from rich.console import Console

from companion.app import Companion, Status
from companion.checkpoint.state_directory import StateDirectoryError
from companion.cli import run_options as options
from companion.cli.arming_advice import ArmingAdvice
from companion.cli.ending import ended, print_statuses
from companion.cli.entry import EXIT_STOPPED
from companion.cli.given import RadiusM, ResolutionM, SpeedMS
from companion.cli.inputs import EXIT_BAD_INPUT, Laps, OutputError, PlannerName, SkipUnknown, usable_settings
from companion.cli.lidars import LidarOption, lidars_given
from companion.cli.live import STDERR, Live, Reader, error_console, levelled, reader_of
from companion.cli.live_view import LiveView, View, painter_for
from companion.cli.rig import Rig
from companion.cli.service import Service
from companion.cli.source import Source, refuse_arming, warning
from companion.cli.state import RunState, StateFiles
from companion.cli.stop_signals import StopSignals
from companion.cli.web import Actions, Token, Web, WebError, served, web_viewer
from companion.core.clock import WallClock
from companion.core.heap import return_large_blocks
from companion.core.severity import Severity
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
from companion.navigation.step_runner import ThreadRunner
from companion.recording.record_format import STATE, RecordError
from companion.recording.recorder import NullRecorder, Recorder
from companion.safety.reasons import EndReason
from companion.settings import Settings, SettingsError
from companion.storage.background_writer import BackgroundWorker, ShutdownBudget

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


def run(
    connect: options.Connect,
    mission_file: options.MissionFile = None,
    from_autopilot: options.FromAutopilot = False,
    resolution_m: ResolutionM = None,
    radius_m: RadiusM = None,
    speed_m_s: SpeedMS = None,
    arm: options.Arm = False,
    settings_file: options.SettingsFile = None,
    planner: PlannerName = None,
    seed: options.Seed = 0,
    record: options.Record = None,
    state: options.State = None,
    lidar: LidarOption = None,
    resume: options.Resume = False,
    signing_key: options.SigningKey = None,
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
        with StopSignals() as stop, contextlib.ExitStack() as ends:
            budget = ShutdownBudget()
            files = StateFiles(state, budget)
            ends.callback(files.close)
            settings, specs = files.settings(usable_settings(settings_file, planner), say), lidars_given(lidar, connect)
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
                raise typer.Exit(print_statuses(keeping.statuses))
            given = {"settings": settings_file, STATE: keeping.file if keeping.previous else None}
            recorder = NullRecorder() if record is None else Recorder(
                record, mission, settings, seed, arm=arm, files=given, worker=BackgroundWorker("record", budget),
                lidars=[one.text for one in specs],
            )  # fmt: skip
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
            rig = Rig(
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
    return_large_blocks()  # its maps may be large, and the computer small
    if not kernels_warm(settings, mission.rover.turning_radius_m):
        say(COMPILING)
        warm_up(settings, mission.rover.turning_radius_m)
    settle()


@dataclass(frozen=True, slots=True)
class _Ender:
    """Ends the run as the signal says that came."""

    companion: Companion
    signals: StopSignals

    def stop(self) -> None:
        """Safe in a signal handler."""
        self.companion.stop(self.signals.why or EndReason.STOPPED_BY_USER)


def _drive(rig: Rig, *, seed: int, arm: bool) -> int:
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
    rig.stop.listener = _Ender(companion, rig.stop)
    service = Service(os.environ)

    if rig.page is not None:
        rig.page.follow(companion, rig.settings, simulated=False)
    if isinstance(rig.live, LiveView):
        rig.live.follow(companion)

    strange = StrangePort(rig.link.description, lambda text: rig.live.tell(text, Severity.WARNING))
    advice = ArmingAdvice(lambda text: rig.live.tell(text, Severity.NOTICE))

    def show(status: Status) -> None:
        strange.look(status.time_s, rig.autopilot.codec.strange)
        rig.live.show(status)
        advice.look(status.activity)
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
            rig.recorder.close(ended_by=rig.stop.why)
    return ended(companion, rig)
