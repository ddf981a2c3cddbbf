"""``rover-companion lidar``: publishes a lidar on a serial port as OBSTACLE_DISTANCE."""

from __future__ import annotations

import contextlib
import signal
from pathlib import Path
from types import FrameType
from typing import Annotated

import typer

from companion.cli.inputs import EXIT_BAD_INPUT, OutputError
from companion.cli.lidars import lidars_given
from companion.cli.state import StateFiles
from companion.core.clock import Clock, WallClock
from companion.lidar.reader import Lidars, lidars_on
from companion.lidar.serial_port import open_ports
from companion.lidar.spec import FORM, LidarError
from companion.lidar.trouble import trouble
from companion.mavlink.obstacle_publisher import COMPONENT, ObstaclePublisher
from companion.mavlink.signing import SigningKeyError
from companion.mavlink.transport import ByteLink, LinkError, open_link

STEP_S = 0.02
SILENT_S = 1.0


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
    """Until a signal; tells when scans come and when they stay away."""
    stop: list[int] = []

    def on_signal(number: int, frame: FrameType | None) -> None:
        stop.append(number)

    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, on_signal)
    now_s = heard_s = clock.now_s()
    talks: bool | None = None
    while not stop:
        publisher.hear(link.read())
        link.write(publisher.heartbeat(now_s))
        for seen in lidars.poll(now_s):
            heard_s = now_s
            link.write(publisher.scan(seen.scan))
            if not talks:
                talks = True
                typer.echo(f"{len(seen.scan.bearing_rad)} readings a turn")
        if talks is not False and now_s - heard_s > SILENT_S:
            talks = False
            why = trouble(lidars.readers[0]) or "look at its power and cable"
            typer.echo(f"no whole turn for {SILENT_S:g} s: {why}")
        clock.sleep_until_s(now_s + STEP_S)
        now_s = clock.now_s()
