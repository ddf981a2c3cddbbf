"""``rover-sitl serve``: the simulated rover on the network, like ArduPilot's own SITL."""

from __future__ import annotations

import contextlib
import signal
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from types import FrameType
from typing import Annotated

import typer
from rich.console import Console

from companion.core.clock import WallClock
from companion.mapping.map_files import MapError
from companion.mission.load import load_mission
from companion.mission.mission import MissionError
from companion.viewer.terminal.painter import Painter, ViewError, terminal
from sitl.faults.fault_file import FaultFileError
from sitl.network import FORMS, Endpoint, ListenError, open_endpoint
from sitl.network.event_log import EventLog
from sitl.network.server import serve as run_server
from sitl.scenario import Scenario, ScenarioError, equipped, simulated
from sitl.view.watching import Watching

DEFAULT_LISTEN = ["udpout:127.0.0.1:14550", "tcp:127.0.0.1:5760"]
BAD_INPUT = 2


def serve(
    mission_file: Annotated[Path, typer.Argument(metavar="MISSION", help="TOML, .plan or .waypoints file.")],
    listen: Annotated[
        list[str] | None,
        typer.Option(
            help=f"{FORMS}; several times for several. The first is the vehicle's SERIAL0, and so on. "
            f"Default: {', '.join(DEFAULT_LISTEN)}."
        ),
    ] = None,
    speedup: Annotated[float, typer.Option(min=0.01, max=200.0, help="Times real time.")] = 1.0,
    seed: Annotated[int, typer.Option(min=0, help="For all noise.")] = 0,
    quiet: Annotated[bool, typer.Option("--quiet", help="Say nothing but errors.")] = False,
    sensors: Annotated[str | None, typer.Option(help="A suite's name or a TOML file; default: the mission's.")] = None,
    params: Annotated[Path | None, typer.Option(help="ArduRover's parameters: NAME,VALUE or NAME VALUE.")] = None,
    faults: Annotated[Path | None, typer.Option(help="TOML file with a fault plan.")] = None,
    view: Annotated[bool, typer.Option("--view", help="Show map, rover and rates on this terminal.")] = False,
) -> None:
    """Simulate the rover of MISSION in real time for whoever connects; ends with Ctrl-C.

    One line is printed for each client that connects or disconnects, and for each collision.
    """
    clock = WallClock()
    endpoints: list[Endpoint] = []
    try:
        console = terminal(sys.stdout) if view else None
        name, scenario = _scenario(mission_file, sensors, params, faults)
        # Compile everything before clients connect and time starts.
        with Console(stderr=True).status("starting ..."):
            scenario.simulator(seed).rehearse()
        simulator = scenario.simulator(seed)
        watching = Watching(name, simulator)
        tell = watching.tell if view else say
        log = EventLog() if quiet else EventLog(tell, clock.now_s)
        for serial_port, url in enumerate(listen or DEFAULT_LISTEN):
            endpoints.append(open_endpoint(url, simulator, log, serial_port))
    except (MissionError, MapError, ScenarioError, ListenError, FaultFileError, ViewError) as error:
        for endpoint in endpoints:
            endpoint.close()
        typer.echo(str(error), err=True)
        raise typer.Exit(BAD_INPUT) from error
    if not quiet:
        for url in listen or DEFAULT_LISTEN:
            tell(f"sending to {url}" if url.startswith("udpout") else f"listening on {url}")
        if not listen:
            tell("a companion connects with --connect udpin:127.0.0.1:14550 or --connect tcp:127.0.0.1:5760")
    stop = stop_signals()
    try:
        with _viewed(console, watching, clock) as observe:
            run_server(simulator, endpoints, clock.now_s, speedup, lambda: not stop, log, observe)
    finally:
        for endpoint in endpoints:
            endpoint.close()
    log.end(simulator)
    if not quiet:
        touched = len(simulator.collisions)
        say(f"stopped after {simulator.time_s:.0f} s of the rover's time and {touched} collision{'s' * (touched != 1)}")


def _scenario(
    mission_file: Path, sensors: str | None, params: Path | None, faults: Path | None
) -> tuple[str, Scenario]:
    """The mission's name and its simulation with the options; remarks are printed."""
    mission = equipped(load_mission(mission_file), sensors, params)
    scenario = simulated(mission, faults)
    for note in scenario.notes:
        typer.echo(note, err=True)
    return mission.name, scenario


def stop_signals() -> list[int]:
    """A list that stays empty until the process receives a signal to end."""
    stop: list[int] = []

    def on_signal(number: int, frame: FrameType | None) -> None:
        stop.append(number)

    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, on_signal)
    return stop


@contextlib.contextmanager
def _viewed(console: Console | None, watching: Watching, clock: WallClock) -> Iterator[Callable[[], None]]:
    """The function that the server calls in each round: it draws the view when that is due."""
    if console is None:
        yield lambda: None
        return
    with Painter(console) as painter:

        def observe() -> None:
            now_s = clock.now_s()
            watching.note()
            if painter.is_due(now_s):
                view = watching.view(now_s)
                painter.show(lambda: view)

        yield observe


def say(line: str) -> None:
    """Print a line; a closed standard output does not stop the simulator."""
    with contextlib.suppress(OSError):
        typer.echo(line)
