"""``rover-sitl serve``: the simulated rover on the network, like ArduPilot's own SITL."""

from __future__ import annotations

import contextlib
import os
import signal
import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from types import FrameType
from typing import Annotated

import typer
from rich.console import Console

from companion.cli.web import Token, Web, WebError, asked_place, served
from companion.core.clock import WallClock
from companion.core.frames import GeoPoint, LocalFrame, NedPoint
from companion.lidar.spec import LidarError, LidarSpec, parsed
from companion.mapping.map_files import MapError
from companion.mission.load import load_mission
from companion.mission.mission import Mission, MissionError
from companion.mission.resolve import resolve
from companion.viewer.terminal.painter import Painter, ViewError, terminal
from companion.viewer.web_process import WebProcess
from sitl.faults.fault_file import FaultFileError
from sitl.network import FORMS, Endpoint, ListenError, open_endpoint
from sitl.network.event_log import EventLog
from sitl.network.lidar_pty import LidarTerminal
from sitl.network.server import serve as run_server
from sitl.scenario import Scenario, ScenarioError, equipped, simulated, with_lidars
from sitl.simulator import Simulator
from sitl.view.watching import Watching
from sitl.view.web_feed import WebFeed

DEFAULT_LISTEN = ["udpout:127.0.0.1:14550", "tcp:127.0.0.1:5760"]
HOW_TO_CONNECT = "a companion connects with --connect udpin:127.0.0.1:14550 or --connect tcp:127.0.0.1:5760"
BAD_INPUT = 2
BAD_INPUTS = (MissionError, MapError, ScenarioError, ListenError, FaultFileError, ViewError, WebError, LidarError)
NO_PATH = "pty"
"""The port of a lidar for which no path was given."""


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
    lidar_pty: Annotated[
        list[str] | None,
        typer.Option(
            metavar="MODEL[:PATH][:KEY=VALUE,...]",
            help="A lidar on a pseudo-terminal, with a symbolic link at PATH, mounted as for --lidar of `run`; it "
            "takes the place of the mission's sensors. Repeatable.",
        ),
    ] = None,
    params: Annotated[Path | None, typer.Option(help="ArduRover's parameters: NAME,VALUE or NAME VALUE.")] = None,
    faults: Annotated[Path | None, typer.Option(help="TOML file with a fault plan.")] = None,
    view: Annotated[bool, typer.Option("--view", help="Show map, rover and rates on this terminal.")] = False,
    web: Web = None,
    web_token: Token = None,
) -> None:
    """Simulate the rover of MISSION in real time for whoever connects; ends with Ctrl-C.

    One line is printed for each client that connects or disconnects, and for each collision.
    """
    clock = WallClock()
    with contextlib.ExitStack() as ends:
        try:
            console = terminal(sys.stdout) if view else None
            place = asked_place(web, web_token)
            lidars = terminals_of(lidar_pty or ())
            sensors = "none" if lidars and sensors is None else sensors
            mission, scenario = _scenario(mission_file, sensors, params, faults)
            name = mission.name
            scenario = with_lidars(scenario, lidars)
            page = None if place is None else WebProcess(place)
            if page is not None:
                ends.callback(page.close)
            # Compile everything before clients connect and time starts.
            with Console(stderr=True).status("starting ..."):
                scenario.simulator(seed).rehearse()
            simulator = scenario.simulator(seed)
            watching = Watching(name, simulator)
            told = Told([] if quiet else [watching.tell if view else say])
            feed = None if page is None else _fed(simulator, page, name, listen, told, targets_of(mission, scenario))
            log = EventLog(told.tell, clock.now_s, told.warn)
            endpoints: list[Endpoint] = []
            for serial_port, url in enumerate(listen or DEFAULT_LISTEN):
                endpoints.append(open_endpoint(url, simulator, log, serial_port))
                ends.callback(endpoints[-1].close)
            for device, spec in zip(simulator.lidars, lidars, strict=True):
                endpoints.append(LidarTerminal(device, "" if spec.port == NO_PATH else spec.port, told.tell))
                ends.callback(endpoints[-1].close)
        except BAD_INPUTS as error:
            typer.echo(str(error), err=True)
            raise typer.Exit(BAD_INPUT) from error
        for url in listen or DEFAULT_LISTEN:
            told.tell(f"sending to {url}" if url.startswith("udpout") else f"listening on {url}")
        if not listen:
            told.tell(HOW_TO_CONNECT)
        if page is not None:
            typer.echo(served(page.place, to_person=sys.stderr.isatty()), err=True)
        stop = stop_signals()
        with _viewed(console, watching, clock) as draw:

            def observe() -> None:
                draw()
                if feed is not None:
                    feed.show(clock.now_s())

            run_server(simulator, endpoints, clock.now_s, speedup, lambda: not stop, log, observe)
        log.end(simulator)
        if feed is not None:
            feed.end(clock.now_s())
    if not quiet:
        touched = len(simulator.collisions)
        say(f"stopped after {simulator.time_s:.0f} s of the rover's time and {touched} collision{'s' * (touched != 1)}")


def terminals_of(texts: Sequence[str]) -> list[LidarSpec]:
    """The lidars of ``--lidar-pty``. Raises LidarError, also if two have one path."""
    lidars = [terminal_of(text) for text in texts]
    for number, spec in enumerate(lidars):
        same = [text for text, one in zip(texts, lidars[:number], strict=False) if _one_path(one.port, spec.port)]
        if same:
            raise LidarError(f"--lidar-pty '{texts[number]}': '{same[0]}' has the same path; give each its own")
    return lidars


def _one_path(one: str, other: str) -> bool:
    return NO_PATH not in (one, other) and os.path.abspath(one) == os.path.abspath(other)


def terminal_of(text: str) -> LidarSpec:
    """A lidar of ``--lidar-pty``, whose port is the path of the link. Raises LidarError."""
    name, _, rest = text.partition(":")
    path, colon, options = rest.rpartition(":")
    if not colon and ("=" in rest or rest in ("", "flip")):
        path, options = "", rest
    elif not colon:
        path, options = rest, ""
    return parsed(f"{name}:{options}".rstrip(":"), path or NO_PATH)


class Told:
    """Who is told of events: the terminal or a log file, and the page."""

    def __init__(self, hearers: list[Callable[[str], None]]) -> None:
        self.hearers = hearers
        self.feed: WebFeed | None = None

    def tell(self, line: str) -> None:
        """Something has happened."""
        self._pass_on(line, "info")

    def warn(self, line: str) -> None:
        """A collision."""
        self._pass_on(line, "error")

    def _pass_on(self, line: str, level: str) -> None:
        for hear in self.hearers:
            hear(line)
        if self.feed is not None:
            self.feed.tell(line, level)


def targets_of(mission: Mission, scenario: Scenario) -> list[dict[str, object]]:
    """Name and place of each target, north and east of the start; none where they cannot be placed."""
    home = scenario.start.home
    with contextlib.suppress(MissionError):
        targets = resolve(mission, LocalFrame(GeoPoint(home.lat_deg, home.lon_deg)), NedPoint(0.0, 0.0)).targets
        places = [[round(one.point.north_m, 3), round(one.point.east_m, 3)] for one in targets]
        return [{"name": one.name, "place": place} for one, place in zip(targets, places, strict=True)]
    return []


def _fed(
    simulator: Simulator,
    page: WebProcess,
    name: str,
    listen: list[str] | None,
    told: Told,
    targets: list[dict[str, object]],
) -> WebFeed:
    """The feed of the page, which is told of events from now on."""
    how = f"its links: {', '.join(listen)}" if listen else HOW_TO_CONNECT
    told.feed = WebFeed(simulator, page, name, how, lambda line: typer.echo(line, err=True), targets)
    return told.feed


def _scenario(
    mission_file: Path, sensors: str | None, params: Path | None, faults: Path | None
) -> tuple[Mission, Scenario]:
    """The mission and its simulation with the options; remarks are printed."""
    mission = equipped(load_mission(mission_file, skip_unknown=True), sensors, params)
    scenario = simulated(mission, faults)
    for note in scenario.notes:
        typer.echo(note, err=True)
    return mission, scenario


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
