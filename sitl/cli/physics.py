"""``rover-sitl physics``: world and rover for the real ArduRover firmware."""

from __future__ import annotations

import math
from collections.abc import Iterable
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from companion.cli.inputs import OutputError, apart, replaced, writable
from companion.core.clock import WallClock
from companion.mapping.map_files import MapError
from companion.mission.load import load_mission
from companion.mission.mission import MissionError
from companion.mission.source_files import source_files
from companion.vehicle.recommended_parameters import RECOMMENDED_PARAMETERS
from sitl.cli.serve import BAD_INPUT, say, stop_signals
from sitl.firmware.firmware_parameters import firmware_parameters, parameter_file
from sitl.firmware.parameter_files import ParameterFileError
from sitl.firmware.physics import Physics
from sitl.firmware.physics_log import PhysicsLog, summary
from sitl.firmware.physics_server import open_port, run
from sitl.network import ListenError
from sitl.network.client_log import LoggedLink
from sitl.network.mavlink_client import FORMS, ClientLink, open_link
from sitl.scenario import Scenario, ScenarioError, equipped, scenario_from_mission
from sitl.world.geodesy import ALTITUDE_M

FIRMWARE_PORT = 9002
"""Where ArduPilot asks if nothing else is said."""


def physics(
    mission_file: Annotated[Path, typer.Argument(metavar="MISSION", help="TOML, .plan or .waypoints file.")],
    port: Annotated[int, typer.Option(min=1, max=65535, help="UDP port at which the firmware asks.")] = FIRMWARE_PORT,
    host: Annotated[str, typer.Option(help="Address to listen on; 0.0.0.0 for other computers.")] = "127.0.0.1",
    mavlink: Annotated[
        str | None,
        typer.Option(metavar="URL", help=f"Where the lidar's scans and what moving things announce go: {FORMS}."),
    ] = None,
    params: Annotated[Path | None, typer.Option(help="ArduRover's parameters: NAME,VALUE or NAME VALUE.")] = None,
    write_params: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Write the parameters that the firmware needs for this rover.")
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="For all noise.")] = 0,
    quiet: Annotated[bool, typer.Option("--quiet", help="Say nothing but errors.")] = False,
    sensors: Annotated[str | None, typer.Option(help="A suite's name or a TOML file; default: the mission's.")] = None,
) -> None:
    """Simulate rover and world of MISSION for the ArduRover firmware (--model JSON:127.0.0.1); ends with Ctrl-C."""
    clock = WallClock()
    link: ClientLink | None = None
    try:
        mission = equipped(load_mission(mission_file, skip_unknown=True), sensors, params)
        scenario = scenario_from_mission(mission)
        behind = scenario.physics(seed, linked=mavlink is not None)
        _write_parameters(scenario, behind, write_params, (params, *source_files(mission)))
        link = open_link(mavlink) if mavlink else None
        # Compile everything before the firmware waits for answers.
        with Console(stderr=True).status("starting ..."):
            behind.rehearse()
        listening = open_port(host, port)
    except (MissionError, MapError, ScenarioError, ListenError, OutputError, ParameterFileError) as error:
        if link is not None:
            link.close()
        typer.echo(str(error), err=True)
        raise typer.Exit(BAD_INPUT) from error
    tell = (lambda line: None) if quiet else say
    if link is not None and mavlink is not None:
        link = LoggedLink(link, mavlink, tell, lambda: behind.system)
    for line in _greeting(behind, host, port, mavlink, write_params):
        tell(line)
    stop, log = stop_signals(), PhysicsLog(behind, tell, clock.now_s)
    try:
        run(behind, listening, link, clock.now_s, lambda: not stop, log.look)
    finally:
        listening.close()
        if link is not None:
            link.close()
    log.end()
    tell(summary(behind))


def _write_parameters(scenario: Scenario, behind: Physics, file: Path | None, inputs: Iterable[Path | None]) -> None:
    """Write the parameters for the firmware, if requested; print remarks about the user's own parameters."""
    parameters: dict[str, float] | None = None
    if file is not None:
        apart((file,), inputs)
        writable(file)
        parameters = firmware_parameters(scenario.parameters, behind.suite, steered=scenario.turning_radius_m > 0.0)
        with replaced(file) as new:
            new.write_text(parameter_file(parameters), encoding="ascii")
    if scenario.parameter_file is not None:
        for note in scenario.parameter_file.firmware_notes(parameters, RECOMMENDED_PARAMETERS):
            typer.echo(note, err=True)


def _greeting(behind: Physics, host: str, port: int, mavlink: str | None, parameters: Path | None) -> list[str]:
    """How to start the firmware, and which sensors it does not get."""
    start = behind.start
    heading_deg = math.degrees(start.heading_rad) % 360.0
    home = f"{start.home.lat_deg:.7f},{start.home.lon_deg:.7f},{ALTITUDE_M:g},{heading_deg:.0f}"
    defaults = f" --defaults {parameters}" if parameters else ""
    out = "" if port == FIRMWARE_PORT else f" --sim-port-out {port}"
    lines = [
        f"listening on udp {host}:{port}",
        f"start the firmware with --model JSON:127.0.0.1{out} --home {home}{defaults}",
    ]
    if behind.suite.lidar and mavlink is None:
        lines.append("the lidar is not published: give --mavlink URL, for instance tcp:127.0.0.1:5762")
    if behind.announces and mavlink is None:
        lines.append("moving things announce nothing: give --mavlink URL, for instance tcp:127.0.0.1:5762")
    if behind.suite.proximity:
        lines.append("the proximity sectors are left out: the firmware computes its own from rangefinders or scans")
    return lines
