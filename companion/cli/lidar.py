"""``rover-companion lidar``: publishes a lidar on a serial port as OBSTACLE_DISTANCE."""

from __future__ import annotations

import contextlib
import os
import signal
from dataclasses import dataclass
from pathlib import Path
from types import FrameType
from typing import Annotated

import typer

from companion.cli.inputs import EXIT_BAD_INPUT, OutputError
from companion.cli.lidars import lidars_given
from companion.cli.state import StateFiles
from companion.core.clock import Clock, WallClock
from companion.lidar.reader import LidarReader, Lidars, lidars_on
from companion.lidar.serial_port import open_ports
from companion.lidar.spec import FORM, LidarError
from companion.lidar.trouble import trouble
from companion.mavlink.obstacle_publisher import COMPONENT, ObstaclePublisher
from companion.mavlink.signing import SigningKeyError
from companion.mavlink.transport import ByteLink, LinkError, open_link

STEP_S = 0.02
TURN_SILENT_S, LINK_SILENT_S = 1.0, 3.0


def lidar(
    spec_text: Annotated[str, typer.Argument(metavar="SPEC", help=FORM)],
    connect: Annotated[
        str, typer.Option(help="Where to publish: an autopilot, router or ground station, as for `run`.")
    ],
    component: Annotated[int, typer.Option(min=1, max=255, help="MAVLink component id of the lidar.")] = COMPONENT,
    system: Annotated[int, typer.Option(min=1, max=255, help="System id until the rover is heard.")] = 1,
    signing_key: Annotated[
        Path | None, typer.Option(help="File with the passphrase, or 64 hexadecimal digits.")
    ] = None,
) -> None:
    """Publish a lidar as OBSTACLE_DISTANCE, for ArduRover or ground stations, until Ctrl-C.

    Exit code 2: bad input; else 0.
    """
    clock = WallClock()
    with contextlib.ExitStack() as ends:
        try:
            (spec,) = lidars_given([spec_text], connect)
            files = StateFiles(None)
            ends.callback(files.close)
            publisher = ObstaclePublisher(component, system, files.signer(signing_key))
            link = open_link(connect)
            ends.callback(link.close)
            lidars = lidars_on([spec], open_ports([spec], clock))
            ends.callback(lidars.close)
        except (LidarError, LinkError, OutputError, SigningKeyError) as error:
            typer.echo(str(error), err=True)
            raise typer.Exit(EXIT_BAD_INPUT) from error
        typer.echo(f"publishing {lidars.names[0]} on {link.description} as component {component}")
        _publish(lidars, publisher, link, clock)


def _publish(lidars: Lidars, publisher: ObstaclePublisher, link: ByteLink, clock: Clock) -> None:
    """Until a signal; tells when scans come and when they stay away, and the same of who listens."""
    stop: list[int] = []

    def on_signal(number: int, frame: FrameType | None) -> None:
        stop.append(number)

    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, on_signal)
    now_s = clock.now_s()
    turns, answers = _Signs(now_s, TURN_SILENT_S, None), _Signs(now_s, LINK_SILENT_S, talks=False)
    while not stop:
        if data := link.read():
            publisher.hear(data)
            if answers.come(now_s):
                typer.echo(f"{link.description}: heard")
        link.write(publisher.heartbeat(now_s))
        for seen in lidars.poll(now_s):
            link.write(publisher.scan(seen.scan))
            if turns.come(now_s):
                typer.echo(f"{len(seen.scan.bearing_rad)} readings a turn")
        if turns.stay_away(now_s):
            typer.echo(f"no whole turn for {TURN_SILENT_S:g} s: {_why_not(lidars.readers[0])}")
        if answers.stay_away(now_s):
            typer.echo(f"{link.description}: nothing heard for {LINK_SILENT_S:g} s")
        clock.sleep_until_s(now_s + STEP_S)
        now_s = clock.now_s()


@dataclass
class _Signs:
    """Of something that comes again and again. ``talks``: whether it comes; None while that is not known."""

    heard_s: float
    silent_s: float
    talks: bool | None

    def come(self, now_s: float) -> bool:
        """It has come; whether that is news."""
        self.heard_s, before, self.talks = now_s, self.talks, True
        return not before

    def stay_away(self, now_s: float) -> bool:
        """Whether it is news that it has not come for so long."""
        if self.talks is False or now_s - self.heard_s <= self.silent_s:
            return False
        self.talks = False
        return True


def _why_not(reader: LidarReader) -> str:
    port = reader.spec.port
    if not os.path.exists(port):
        return f"{reader.name}: {port} is gone; look at its cable"
    return str(trouble(reader) or f"{reader.name} on {port}: look at its power and cable")
