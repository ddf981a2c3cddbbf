"""``rover-companion run``: drive a mission on a real rover, or on a simulator that stands in for one."""

from __future__ import annotations

import signal
from pathlib import Path
from types import FrameType
from typing import Annotated

import typer
from rich.console import Console
from rich.status import Status as Spinner

from companion.app import Companion, Status
from companion.clock import WallClock
from companion.itinerary import TargetStatus
from companion.mapfiles import MapError
from companion.mavlink.autopilot_link import AutopilotLink
from companion.mavlink.codec import Codec
from companion.mavlink.transport import LinkError, open_link
from companion.mission.load import load_mission
from companion.mission.mission import MissionError
from companion.recorder import NullRecorder, Recorder, RecordError
from companion.settings import SettingsError, load_settings
from companion.stepping import ThreadRunner
from companion.warmup import warm_up

EXIT_REACHED, EXIT_BAD_INPUT, EXIT_MISSED, EXIT_STOPPED = 0, 2, 3, 130


def run(
    mission_file: Annotated[Path, typer.Argument(metavar="MISSION", help="TOML, .plan or .waypoints file.")],
    connect: Annotated[str, typer.Option(help="udpin:HOST:PORT, udpout:HOST:PORT, tcp:HOST:PORT or serial:DEVICE:BAUD")],
    arm: Annotated[bool, typer.Option("--arm", help="Arm the motors; otherwise wait for a person to do it.")] = False,
    settings_file: Annotated[Path | None, typer.Option("--settings", help="TOML file.")] = None,
    seed: Annotated[int, typer.Option(min=0, help="Of the genetic algorithm.")] = 0,
    record: Annotated[Path | None, typer.Option(help="Directory for the record of this run.")] = None,
) -> None:
    """Drive MISSION. Exit code 0: every target reached; 3: a target missed; 2: bad input; 130: stopped by a signal."""
    console = Console(stderr=True)
    try:
        settings = load_settings(settings_file)
        mission = load_mission(mission_file)
        with console.status("compiling the planner (once a machine) ..."):
            warm_up(settings)
        link = open_link(connect)
        recorder = Recorder(record, mission_file, settings, seed) if record else NullRecorder()
    except (SettingsError, MissionError, MapError, LinkError, RecordError) as error:
        typer.echo(str(error), err=True)
        raise typer.Exit(EXIT_BAD_INPUT) from error
    clock, runner = WallClock(), ThreadRunner()
    autopilot = AutopilotLink(link, Codec(settings.link), settings.link, recorder)
    companion = Companion(autopilot, clock, mission, settings, runner, recorder, seed=seed, arm=arm)
    stopped = _stop_on_signals(companion)
    try:
        with console.status("connecting") as spinner:
            companion.run(lambda status: _show(spinner, status))
    except MissionError as error:
        typer.echo(str(error), err=True)
        raise typer.Exit(EXIT_BAD_INPUT) from error
    finally:
        companion.close()
        runner.close()
        link.close()
        recorder.close()
    for name, status in companion.statuses():
        typer.echo(f"{name}: {status}")
    if stopped:
        raise typer.Exit(EXIT_STOPPED)
    missed = any(status is not TargetStatus.REACHED for _, status in companion.statuses())
    raise typer.Exit(EXIT_MISSED if missed else EXIT_REACHED)


def _show(spinner: Spinner, status: Status) -> None:
    part = f"part {status.decision.part}" if status.decision else ""
    where = f"north {status.pose.north_m:.1f} m, east {status.pose.east_m:.1f} m" if status.pose else ""
    spinner.update(
        f"{status.doing}: {status.target} [{status.targets_reached}/{status.targets}] {where} {part} steps {status.steps}"
    )


def _stop_on_signals(companion: Companion) -> list[int]:
    """SIGINT and SIGTERM end the run: the rover is stopped first. Returns a list that receives the signal's number."""
    received: list[int] = []

    def stop(number: int, frame: FrameType | None) -> None:
        received.append(number)
        companion.stop()

    signal.signal(signal.SIGINT, stop)
    signal.signal(signal.SIGTERM, stop)
    return received
